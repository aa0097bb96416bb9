//! Random scenes with friction, tilt, unequal gaps and all laws of restitution.

use crate::balance::{Walk, walk};
use crate::common::{Scene, scene};
use crate::follow::{Hardest, Name};
use crate::random::draw;
use crate::table::Table;
use lovines::{Cavity, Drive, Outcome, Plant, Restitution};
use proptest::prelude::*;
use rayon::prelude::*;
use std::panic::catch_unwind;

/// Steps that each scene is followed for.
const STEPS: usize = 30;
/// A scene with so many events has shown what it is.
const ENOUGH: u64 = 100_000;
/// Panels that the energy balance of a scene is followed for.
const PANELS: u32 = 300;

/// What scenes show.
#[derive(Clone, Copy, Debug, Default)]
struct Worst {
    panics: u64,
    impacts: u64,
    sticks: u64,
    released: u64,
    cut_short: u64,
    other_bits: u64,
    outside: Hardest,
    imbalance: Hardest,
    growth: Hardest,
    work: Hardest,
}

impl Worst {
    fn and(self, one: Self) -> Self {
        Self {
            panics: self.panics + one.panics,
            impacts: self.impacts + one.impacts,
            sticks: self.sticks + one.sticks,
            released: self.released + one.released,
            cut_short: self.cut_short + one.cut_short,
            other_bits: self.other_bits + one.other_bits,
            outside: self.outside.or(one.outside),
            imbalance: self.imbalance.or(one.imbalance),
            growth: self.growth.or(one.growth),
            work: self.work.or(one.work),
        }
    }
}

/// A scene with any of the effects. Gravity is from negligible to overwhelming against the accelerations of the rig.
fn strategy() -> BoxedStrategy<Scene> {
    let decades = |from: f64, to: f64| (from..to).prop_map(|x| 10f64.powf(x));
    let law = || {
        prop_oneof![
            2 => Just(None),
            1 => (0.05..=1.0f64).prop_map(|r| Some(Restitution::Constant(r))),
            1 => decades(-3.0, 0.0).prop_map(|k| Some(Restitution::Viscoelastic(k))),
            1 => decades(-1.5, 0.5).prop_map(|v| Some(Restitution::Plastic(v))),
        ]
    };
    let friction = prop_oneof![
        2 => Just((0.0, None)),
        3 => decades(-4.0, 0.5).prop_map(|mu| (mu, None)),
        2 => (decades(-4.0, 0.5), 1.0..2.0f64).prop_map(|(mu, more)| (mu, Some(mu * more))),
    ];
    let tilt = prop_oneof![
        2 => Just(0.0),
        1 => Just(core::f64::consts::FRAC_PI_2),
        2 => -1.5..1.5f64,
        1 => decades(-9.0, 0.0),
    ];
    let gap = || prop_oneof![1 => Just(None), 1 => (0.2..3.0f64).prop_map(Some)];
    let scatter = prop_oneof![2 => Just(0.0), 1 => decades(-3.0, 0.0)];
    let least = prop_oneof![2 => Just(0.0), 1 => 0.0..1.0f64];
    let cavity = (
        friction,
        tilt,
        (gap(), gap()),
        (law(), law()),
        scatter,
        least,
        any::<u64>(),
    );
    (
        any::<bool>().prop_flat_map(scene),
        cavity,
        decades(-1.0, 5.0),
        -1.0..1.0f64,
    )
        .prop_map(
            |(mut s, ((mu, held), tilt, (plus, minus), (law, other), scatter, least, seed), stiffness, place)| {
                // The same motion in another time.
                let rate = f64::sqrt(stiffness);
                s.parameters.cavity = Cavity {
                    b_plus: plus,
                    b_minus: minus,
                    tilt,
                    kinetic_friction: mu,
                    static_friction: held,
                    restitution: [law, other].map(|law| match law {
                        // Below its yield speed a wall takes no energy: slow particles would hop on it for ever.
                        Some(Restitution::Plastic(v)) => Some(Restitution::Plastic(v * rate)),
                        law => law,
                    }),
                    least_restitution: least,
                    scatter,
                    seed,
                };
                // The same motion in another time.
                let rate = f64::sqrt(stiffness);
                s.parameters.stiffness = stiffness;
                s.parameters.damping *= rate;
                (s.start.dq1, s.start.dq2) = (s.start.dq1 * rate, s.start.dq2 * rate);
                s.drive.omega *= rate;
                s.step = s.step.min(10.0) / rate;
                let [plus, minus] = s.parameters.gaps();
                let w = if place > 0.95 {
                    plus
                } else if place < -0.95 {
                    -minus
                } else {
                    0.5 * (plus - minus)
                };
                s.start.q2 = s.start.q1 - w;
                s
            },
        )
        .boxed()
}

/// Follows one scene: undamped and undriven with its energy, or with a new drive at every step.
fn follow(s: &Scene, number: usize) -> Worst {
    let (mut s, mut worst) = (s.clone(), Worst::default());
    let name = Name { kind: "cavity", number };
    let conservative = s.drive.amplitude == 0.0;
    if conservative {
        s.drive = Drive::default();
        s.parameters.damping = 0.0;
    }
    let mut plant = Plant::new(s.parameters, s.start).expect("a valid scene");
    let mut other = plant;
    let p = s.parameters;
    let [plus, minus] = p.gaps();
    let mut largest = 0.0f64;
    let energy = |plant: &Plant| plant.energy(0.0) + plant.totals().dissipated + plant.totals().friction;
    let at_start = energy(&plant);
    for n in 0..STEPS {
        let mut drive = s.drive;
        drive.amplitude *= 1.0 + 0.3 * f64::from(n as u32 % 5);
        drive.omega *= 1.0 + 0.1 * f64::from(n as u32 % 3);
        let before = plant.energy(0.0);
        let outcome: Outcome = plant.advance(drive, s.step).expect("a valid step");
        // The same from what is saved.
        other = Plant::from(other.save());
        let again = other.advance(drive, s.step).expect("a valid step");
        let same = again == outcome && other.state() == plant.state() && other.totals() == plant.totals();
        worst.other_bits += u64::from(!same);
        let state = plant.state();
        let w = state.q1 - state.q2;
        let rounding = 4.0 * f64::EPSILON * state.q1.abs().max(state.q2.abs());
        let outside = ((w - plus).max(-w - minus) - rounding) / (plus + minus);
        worst.outside.see(outside, name);
        let events = outcome.impacts + outcome.stuck + outcome.released;
        worst.impacts += outcome.impacts;
        worst.released += outcome.released;
        let rate = p.fastest_rate().max(drive.omega.abs());
        let turns = rate * s.step;
        let work = outcome.evaluations as f64 / (events as f64 + 1.0 + turns);
        worst.work.see(work, name);
        if conservative {
            let after = plant.energy(0.0);
            largest = largest.max(after.abs()).max(before.abs()).max(energy(&plant).abs());
            let growth = (energy(&plant) - at_start) / largest.max(f64::MIN_POSITIVE);
            worst.growth.see(growth, name);
            worst.imbalance.see(growth.abs(), name);
        }
        if outcome.cut_short {
            worst.cut_short += 1;
            break;
        }
        if worst.impacts + worst.released > ENOUGH {
            break;
        }
    }
    worst.sticks = plant.totals().sticks;
    worst
}

/// Follows so many scenes, and the energy balance of a tenth as many with damper and base.
pub fn scenes(n: usize, table: &mut Table) {
    let worst = (0..n)
        .into_par_iter()
        .map_init(strategy, |strategy, number| {
            let scene = draw(strategy, number);
            catch_unwind(|| follow(&scene, number)).unwrap_or_else(|_| {
                eprintln!("cavity {number} panics: {scene:?}");
                Worst { panics: 1, ..Worst::default() }
            })
        })
        .reduce(Worst::default, Worst::and);
    let Worst { impacts, sticks, released, .. } = worst;
    let among = format!("{n} cavities, {impacts} impacts, {sticks} sticks, {released} releases and reversals");
    table.row("cavities: panics", &among, worst.panics as f64, 0.0);
    table.row(
        "cavities: other bits from what is saved",
        &among,
        worst.other_bits as f64,
        0.0,
    );
    table.row("cavities: steps that do not end", &among, worst.cut_short as f64, 0.0);
    for (what, hardest, allowed) in [
        ("cavities: outside the cavity, in its widths", worst.outside, 1e-12),
        (
            "cavities: energy gained without damper and base, relative",
            worst.growth,
            1e-12,
        ),
        (
            "cavities: energy missed without damper and base, relative",
            worst.imbalance,
            1e-12,
        ),
        (
            "cavities: evaluations per event and radian of the fastest rate",
            worst.work,
            50.0,
        ),
    ] {
        table.row(what, &hardest.among(&among), hardest.figure, allowed);
    }
    let walks: Vec<Walk> = (0..n / 10)
        .into_par_iter()
        .map_init(strategy, |strategy, number| walk(&draw(strategy, number), PANELS))
        .collect();
    let (mut imbalance, mut outside, mut events) = (Hardest::default(), Hardest::default(), 0);
    for (number, one) in walks.iter().enumerate() {
        imbalance.see(one.imbalance, Name { kind: "cavity", number });
        outside.see(one.outside, Name { kind: "cavity", number });
        events += one.events;
    }
    let among = format!("{} cavities with damper and base, {events} events", n / 10);
    let what = "cavities: energy balance with damper and base misses, relative";
    table.row(what, &imbalance.among(&among), imbalance.figure, 1e-12);
    let what = "cavities: outside the cavity at the nodes of the quadrature, in half-widths";
    table.row(what, &outside.among(&among), outside.figure, 1e-12);
}

/// Shows one scene and what it does.
pub fn one(number: usize) {
    let scene = draw(&strategy(), number);
    println!("{scene:#?}\n{:#?}", follow(&scene, number));
    println!("{:#?}", walk(&scene, PANELS));
}
