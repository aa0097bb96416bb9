//! Random scenes, on all cores. Each has a number, which is printed for the hardest ones.

use crate::balance::{Walk, walk};
use crate::common::{Scene, scene};
use crate::follow::{Hardest, Name, Worst, follow};
use crate::table::Table;
use lovines::Drive;
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};
use rayon::prelude::*;
use std::panic::catch_unwind;

/// Kinds of scenes, and how many of a thousand are drawn.
const KINDS: &[(&str, usize)] = &[
    ("free", 300),
    ("driven", 300),
    ("at rest on the wall", 150),
    ("gap of 1e-6 to 1e3 amplitudes", 150),
    ("signal of order 3", 100),
];

/// Scenes followed between two lines that tell how far the run has come.
const PORTION: usize = 10_000;

fn strategy(kind: &str) -> BoxedStrategy<Scene> {
    let decades = |from: f64, to: f64| (from..to).prop_map(|x| 10f64.powf(x));
    let lively = prop_oneof![
        8 => Just(None),
        1 => decades(-6.0, -2.0).prop_map(|x| Some(1.0 - x)),
        1 => Just(Some(1.0)),
        1 => decades(-3.0, 0.0).prop_map(Some),
    ];
    let with_any_loss = |driven| {
        (scene(driven), lively.clone()).prop_map(|(mut s, r)| {
            s.parameters.restitution = r.unwrap_or(s.parameters.restitution);
            s
        })
    };
    match kind {
        "cavity" => crate::cavity::strategy(),
        "free" => with_any_loss(false).boxed(),
        "driven" => with_any_loss(true).boxed(),
        "at rest on the wall" => (with_any_loss(true), any::<bool>(), any::<bool>())
            .prop_map(|(mut s, plus, still)| {
                let b = s.parameters.half_width;
                if still {
                    s.drive = Drive::default();
                    (s.start.q1, s.start.dq1) = (0.0, 0.0);
                }
                s.start.q2 = s.start.q1 - if plus { b } else { -b };
                s.start.dq2 = s.start.dq1;
                s
            })
            .boxed(),
        "gap of 1e-6 to 1e3 amplitudes" => (with_any_loss(true), decades(-6.0, 3.0))
            .prop_map(|(mut s, gap)| {
                let w = s.start.q1 - s.start.q2;
                let amplitude = s.start.q1.abs().max(s.drive.amplitude);
                s.parameters.half_width = gap * amplitude;
                // A narrow gap is crossed a million times a period.
                s.step = s.step.min(1.0);
                s.start.q2 = s.start.q1 - w.clamp(-1.0, 1.0) * s.parameters.half_width;
                // The difference of two displacements carries their rounding.
                let outside = (s.start.q1 - s.start.q2).abs() > s.parameters.half_width;
                if outside {
                    s.start.q2 = s.start.q1;
                }
                s
            })
            .boxed(),
        _ => (with_any_loss(true), -1.0..1.0f64, -1.0..1.0f64, -1.0..1.0f64)
            .prop_map(|(mut s, u1, u2, u3)| {
                // Of the order of the half-width at the end of a step, or of the scene where that is long.
                let t = s.step.max(1.0);
                s.drive.signal[1..].copy_from_slice(&[u1 / t, u2 / (t * t), u3 / (t * t * t)]);
                s
            })
            .boxed(),
    }
}

/// Number `number` of what is drawn.
pub fn draw<T: std::fmt::Debug>(strategy: &BoxedStrategy<T>, number: usize) -> T {
    let mut seed = [7; 32];
    seed[..8].copy_from_slice(&(number as u64).to_le_bytes());
    let rng = TestRng::from_seed(RngAlgorithm::ChaCha, &seed);
    let mut runner = TestRunner::new_with_rng(Config::default(), rng);
    strategy.new_tree(&mut runner).expect("a scene").current()
}

/// Panels that the energy balance of a scene is followed for.
const PANELS: u32 = 500;

/// The energy balance of damped rigs, driven or not, impacts and rests included; and whether the particle stays between its walls
/// at the nodes of the quadrature.
pub fn balance(n: usize, table: &mut Table) {
    fn damped() -> impl Strategy<Value = Scene> {
        let heavy = (-3.0..1.0f64).prop_map(|x| 2.0 * 10f64.powf(x));
        (any::<bool>().prop_flat_map(scene), heavy).prop_map(|(mut s, damping)| {
            s.parameters.damping = damping;
            s
        })
    }
    balances("damped", n, || damped().boxed(), table);
}

/// The energy balance of scenes of any kind.
pub fn balances(kind: &'static str, n: usize, strategy: fn() -> BoxedStrategy<Scene>, table: &mut Table) {
    let all: Vec<Walk> = (0..n)
        .into_par_iter()
        .map_init(strategy, |strategy, number| walk(&draw(strategy, number), PANELS))
        .collect();
    let (mut imbalance, mut outside) = (Hardest::default(), Hardest::default());
    for (number, one) in all.iter().enumerate() {
        imbalance.see(one.imbalance, Name { kind, number });
        outside.see(one.outside, Name { kind, number });
    }
    let events: u64 = all.iter().map(|one| u64::from(one.events)).sum();
    let among = format!("{n} scenes, {events} events");
    for (what, hardest) in [
        ("energy balance with damper and base misses, relative", imbalance),
        (
            "outside the cavity at the nodes of the quadrature, in half-widths",
            outside,
        ),
    ] {
        table.row(
            &format!("{kind}: {what}"),
            &hardest.among(&among),
            hardest.figure,
            1e-12,
        );
    }
}

/// Follows one scene (`free:17`), and shows it and all that it did.
pub fn one(name: &str) {
    let (kind, number) = name.split_once(':').expect("a kind of scenes, a colon and a number");
    let number = number.parse().expect("a number");
    if kind == "new drives" {
        return crate::drives::one(number);
    }
    let kinds = KINDS.iter().map(|(kind, _)| *kind).chain(["cavity"]);
    let kind = kinds.into_iter().find(|k| *k == kind).expect("a kind of scenes");
    let scene = draw(&strategy(kind), number);
    println!("{scene:#?}\n{:#?}", follow(&scene, Name { kind, number }));
}

/// Follows this number of scenes, each twice, and tells the worst of all.
pub fn scenes(n: usize, table: &mut Table) {
    let mut all = Worst::default();
    for (kind, share) in KINDS {
        all = all.and(of_kind(kind, n * share / 1000, table));
    }
    all.rows(table);
}

/// Follows this number of scenes of one kind.
pub fn of_kind(kind: &'static str, count: usize, table: &mut Table) -> Worst {
    let mut worst = Worst::default();
    for begin in (0..count).step_by(PORTION) {
        let portion: Vec<Worst> = (begin..count.min(begin + PORTION))
            .into_par_iter()
            .map_init(
                || strategy(kind),
                |strategy, number| {
                    let scene = draw(strategy, number);
                    catch_unwind(|| follow(&scene, Name { kind, number })).unwrap_or_else(|_| {
                        eprintln!("{kind} scene {number} panics: {scene:?}");
                        Worst::panicked()
                    })
                },
            )
            .collect();
        worst = portion.into_iter().fold(worst, Worst::and);
        if count > PORTION {
            table.progress(&format!("{} of {count} scenes, {kind}", count.min(begin + PORTION)));
        }
    }
    table.progress(&format!("{kind}: {worst:?}"));
    let among = format!("{count} scenes, {} impacts, {} sticks", worst.impacts, worst.sticks);
    table.row(
        &format!("{kind}: outside its cavity by, in half-widths"),
        &worst.outside.among(&among),
        worst.outside.figure,
        1e-12,
    );
    worst
}
