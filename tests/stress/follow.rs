//! Guards one scene: the states at and inside its steps, the totals and the energy; and the energy balance with damping and a moving base.

use crate::figures::{ANY, Figures};
use crate::scenes::{Scene, scene};
use lovines::plant::{MOST_IMPACTS, MOST_RELEASES};
use lovines::{Cavity, Drive, Event, Plant, State};
use proptest::prelude::*;
use std::f64::consts::TAU;

/// Steps for which each scene is followed, and number of impacts after which it is followed no further.
const STEPS: usize = 30;
const IMPACTS_FOLLOWED: u64 = 100_000;
/// Instants inside a step at which the particle must be between its walls, as parts of the step.
const LOOKS: [f64; 3] = [0.181_818, 0.618_034, 0.927_051];
/// Steps with more impacts are not followed once more for looking inside, and scenes with more are followed once only.
const MOST_LOOKED_AT: u64 = 10_000;
const MOST_FOLLOWED_TWICE: u64 = 1_000_000;
/// Longest step of a particle without loss, 1/omega0: it hops on a wall that presses on it for ever, and each hop is followed.
const LONGEST_ELASTIC_STEP: f64 = 1.0;

/// Follows a scene twice, unless it has very many impacts: the second time the plant loses its workspace before every step.
pub fn follow(scene: &Scene, figures: &mut Figures) {
    let mut scene = scene.clone();
    let shortened = scene.parameters.restitution == 1.0 && scene.step > LONGEST_ELASTIC_STEP;
    if shortened {
        scene.step = LONGEST_ELASTIC_STEP;
    }
    record! { figures:
        "scenes without loss whose steps are shortened to 1/omega0" count shortened, ANY;
    }
    let plant = once(&scene, false, figures);
    let twice = plant.totals().impacts <= MOST_FOLLOWED_TWICE;
    record! { figures:
        "scenes followed once only, because of more than 10^6 impacts" count !twice, ANY;
    }
    if twice {
        let other = once(&scene, true, &mut Figures::default());
        let differs = plant.state() != other.state() || plant.totals() != other.totals();
        figures.count("runs with other bits without the workspace", differs, 0.0);
    }
}

/// Displacement and velocity of the primary mass and of the particle.
pub fn states(plant: &Plant) -> [f64; 4] {
    plant.state().into()
}

/// How far the particle is outside the cavity, in half-widths, when its relative displacement is `w`.
fn outside_by(plant: &Plant, w: f64, rounding: f64) -> f64 {
    let [plus, minus] = plant.parameters().gaps();
    ((w - plus).max(-w - minus) - rounding) / (0.5 * (plus + minus))
}

/// The same by the two displacements, whose difference carries their rounding.
fn outside_by_displacements(plant: &Plant) -> f64 {
    let State { q1, q2, .. } = plant.state();
    outside_by(plant, q1 - q2, 4.0 * f64::EPSILON * q1.abs().max(q2.abs()))
}

fn once(s: &Scene, forgetful: bool, figures: &mut Figures) -> Plant {
    let mut plant = Plant::new(s.parameters, s.start).expect("a valid scene");
    let free = s.drive.amplitude == 0.0 && s.drive.signal == [0.0; 4];
    let ideal = s.parameters.cavity == Cavity::IDEAL;
    let at_start = plant.energy(0.0);
    // The energy of a weight on a tilted axis has no natural zero.
    let (mut before, mut largest) = (at_start, at_start.abs());
    let mut drive = s.drive;
    for n in 0..STEPS {
        if forgetful {
            plant = Plant::from(plant.save());
        }
        if !ideal {
            drive.amplitude = s.drive.amplitude * (1.0 + 0.3 * (n % 5) as f64);
            drive.omega = s.drive.omega * (1.0 + 0.1 * (n % 3) as f64);
        }
        let (mut impacts, mut backwards) = (0u64, 0);
        let mut looked = plant;
        let see = |event| {
            if let Event::Impact { wall, velocity, .. } = event {
                backwards += u64::from(wall.sign() * velocity <= 0.0);
                impacts += 1;
            }
        };
        let outcome = plant.advance_with(drive, s.step, see).expect("a valid step");
        if impacts <= MOST_LOOKED_AT {
            let mut gone = 0.0;
            for (n, part) in LOOKS.iter().enumerate() {
                let drive = if n == 0 { drive } else { looked.base().drive };
                looked.advance(drive, part * s.step - gone).expect("a valid step");
                gone = part * s.step;
                let outside = outside_by_displacements(&looked);
                figures.largest("outside its cavity inside steps by, in half-widths", outside, 1e-12);
            }
        }
        // The same signal seen from now.
        drive = plant.base().drive;
        let finite = states(&plant).iter().all(|x| x.is_finite());
        let outside = outside_by(&plant, plant.relative_displacement(), 0.0);
        let fastest = s.parameters.fastest_rate().max(s.drive.omega.abs());
        let events = impacts + outcome.stuck + outcome.released;
        let work = outcome.evaluations as f64 / (events as f64 + 1.0 + fastest * s.step);
        let early = outcome.cut_short && impacts < MOST_IMPACTS && outcome.released < MOST_RELEASES;
        record! { figures:
            "outside its cavity by, in half-widths" largest outside, 1e-12;
            "states that are not numbers" count !finite, 0.0;
            "impacts" count impacts, ANY;
            "impacts from behind a wall or not counted" count backwards + outcome.impacts.abs_diff(impacts), 0.0;
            "advances cut short before their 10^7 impacts or 2 10^6 releases" count early, 0.0;
            "advances that end there, and say so" count outcome.cut_short, ANY;
            "impacts in a period, at most" largest impacts as f64 / (s.step * fastest / TAU).max(1.0), ANY;
            "evaluations per event and radian of the fastest rate, at most" largest work, 50.0;
        }
        if free && largest > 0.0 {
            let (now, lost) = (plant.energy(0.0), plant.totals().dissipated + plant.totals().friction);
            largest = largest.max(now.abs()).max(lost);
            let growth = (now - before) / largest;
            figures.largest("energy grows without excitation by, relative", growth, 1e-12);
            if s.parameters.damping == 0.0 {
                let missing = (now + lost - at_start).abs() / largest;
                figures.largest("energy and dissipated energy miss, undamped, relative", missing, 1e-12);
            }
            before = now;
        }
        if plant.totals().impacts + outcome.released >= IMPACTS_FOLLOWED {
            break;
        }
    }
    figures.count("sticks", plant.totals().sticks, ANY);
    if free && ideal && at_start == 0.0 {
        let moves = plant.state() != s.start;
        figures.count("rigs at rest, particle at a wall, that move", moves, 0.0);
    }
    plant
}

/// A scene, the length of its steps, the decade of the changes of its drive at every sample, and which of its numbers change.
pub type Changing = (Scene, f64, f64, u8);

/// Any selection of offset, slope, amplitude and frequency changes, or none.
pub fn changing() -> BoxedStrategy<Changing> {
    let steady = scene(true).prop_map(|s| (s.clone(), s.step.min(1.0), 0.0, 0));
    prop_oneof![steady, (scene(true), 0.005..0.12f64, -6.0..0.5f64, 1..16u8)].boxed()
}

/// The fast path against the plain solver. Impacts drive neighbours apart: only while there are few does a small distance mean agreement.
pub fn agree((s, step, change, which): &Changing, figures: &mut Figures) {
    let mut fast = Plant::new(s.parameters, s.start).expect("a valid scene");
    let mut searched = fast;
    searched.set_fast_path(false);
    for n in 0..60 {
        let changed = |number: u32| {
            let part = (f64::from(n * 4 + number) * 0.618_033_988_749_895).fract() - 0.5;
            f64::from(which >> number & 1) * 10f64.powf(*change) * part
        };
        let drive = Drive {
            signal: [s.drive.signal[0] + 0.1 * changed(0), 0.1 * changed(1), 0.0, 0.0],
            amplitude: s.drive.amplitude * (1.0 + changed(2)),
            omega: s.drive.omega * (1.0 + changed(3)),
        };
        for plant in [&mut fast, &mut searched] {
            plant.advance(drive, *step).expect("a valid step");
        }
        let impacts = [&fast, &searched].map(|plant| plant.totals().impacts);
        if impacts[0].max(impacts[1]) > 3 {
            break;
        }
        let [a, b] = [&fast, &searched].map(states);
        let size = 1.0 + b.iter().fold(0.0f64, |size, x| size.max(x.abs()));
        let off = a.iter().zip(b).fold(0.0f64, |off, (a, b)| off.max((a - b).abs()));
        figures.count("impacts of one solver only", impacts[0].abs_diff(impacts[1]), 0.0);
        figures.largest("fast path and plain solver differ by, relative", off / size, 1e-10);
    }
}

/// Nodes and weights of the Gauss-Legendre formula with 8 points on [-1, 1] (positive half).
const NODES: [(f64, f64); 4] = [
    (0.183_434_642_495_649_8, 0.362_683_783_378_362),
    (0.525_532_409_916_329, 0.313_706_645_877_887_3),
    (0.796_666_477_413_626_7, 0.222_381_034_453_374_48),
    (0.960_289_856_497_536_2, 0.101_228_536_290_376_26),
];
/// Panels of the energy balance, and the length of one in units of the reciprocal of the fastest rate: the formula's error is below 1e-17 of
/// the integrand there.
const PANELS: usize = 500;
const PANEL: f64 = 0.5;

/// Base displacement and velocity, the signal as seen from now.
fn base(plant: &Plant) -> (f64, f64) {
    let base = plant.base();
    let Drive { signal: [u0, u1, ..], amplitude, omega } = base.drive;
    let (sin, cos) = base.phase.radians().sin_cos();
    if amplitude == 0.0 {
        return (u0, u1);
    }
    (u0 + amplitude * sin, u1 + amplitude * omega * cos)
}

/// The energy balance with damping and a moving base.
///
/// With `E` the kinetic energies and the energy of the spring `k (q1 - e)²/2`:
/// `dE/dt = -c (q1' - e')² + e' [k (e - q1) + c (e' - q1')]` between impacts. Both powers are integrated by Gauss-Legendre quadrature
/// along the motion, with panels that end at events, and panels far shorter than the fastest rate.
pub fn balance(scene: &Scene, figures: &mut Figures) {
    let mut plant = Plant::new(scene.parameters, scene.start).expect("a valid scene");
    plant.begin(scene.drive).expect("a valid drive");
    let p = scene.parameters;
    let fastest = p.fastest_rate().max(scene.drive.omega.abs());
    let at_start = plant.energy(base(&plant).0);
    // What damper and base have done, and the sum of what they have exchanged.
    let (mut lost, mut done, mut exchanged) = (0.0, 0.0, 0.0);
    let mut largest = at_start.abs();
    let advance = |plant: &mut Plant, duration: f64| {
        let advanced = plant.advance(plant.base().drive, duration.max(0.0));
        advanced.expect("a valid step");
    };
    for _ in 0..PANELS {
        let mut first = None;
        let mut ahead = plant;
        let see = |event: Event| _ = first.get_or_insert(event.time());
        let advanced = ahead.advance_with(plant.base().drive, PANEL / fastest, see);
        advanced.expect("a valid step");
        let length = first.unwrap_or(PANEL / fastest);
        let mut integrate = |plant: &Plant, weight: f64| {
            let (s, (e, de)) = (plant.state(), base(plant));
            let slip = s.dq1 - de;
            let damper = p.damping * slip * slip;
            let work = de * (p.stiffness * (e - s.q1) - p.damping * slip);
            lost += weight * damper;
            done += weight * work;
            exchanged += weight * (damper + work.abs());
        };
        let below = NODES.iter().rev().map(|(x, weight)| (-x, *weight));
        let mut gone = 0.0;
        for (x, weight) in below.chain(NODES) {
            let t = 0.5 * length * (1.0 + x);
            advance(&mut plant, t - gone);
            gone = t;
            integrate(&plant, 0.5 * length * weight);
            record! { figures:
                "outside the cavity at the nodes of the quadrature, in half-widths" largest outside_by_displacements(&plant), 1e-12;
            }
        }
        advance(&mut plant, length - gone);
        if first.is_some() {
            // To just behind the event, where the next panel begins. The power hardly changes on the way.
            let behind = 1e-12 / fastest;
            advance(&mut plant, behind);
            integrate(&plant, behind);
            figures.count("events", true, ANY);
        }
        largest = largest.max(plant.energy(base(&plant).0).abs());
    }
    let dissipated = plant.totals().dissipated + plant.totals().friction;
    let error = plant.energy(base(&plant).0) + dissipated + lost - done - at_start;
    let scale = largest + exchanged + dissipated;
    let imbalance = if scale > 0.0 { error.abs() / scale } else { 0.0 };
    figures.largest("energy balance with damper and base misses, relative", imbalance, 1e-12);
}
