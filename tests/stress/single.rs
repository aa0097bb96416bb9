//! Guards single impacts, grazes, motions without loss, extreme values, and extreme lengths of a step.

use crate::figures::Figures;
use crate::follow::states;
use crate::scenes::{Scene, decades, scene};
use lovines::base_motion::BaseMotion;
use lovines::oscillator::Oscillator;
use lovines::plant::{MOST_EVALUATIONS, MOST_IMPACTS};
use lovines::segment::Segment;
use lovines::{Drive, Parameters, Plant, State};
use proptest::prelude::*;
use std::f64::consts::TAU;

/// A rig and the velocities with which primary mass and particle meet.
pub fn impacts() -> BoxedStrategy<(Scene, f64, f64)> {
    (scene(false), -2.0..2.0f64, -2.0..2.0f64).boxed()
}

/// An impact at the very start: momentum, Newton's law, energy.
pub fn impact((scene, v1, v2): &(Scene, f64, f64), figures: &mut Figures) {
    let (p, approach) = (scene.parameters, v1 - v2);
    let q2 = -p.half_width.copysign(approach);
    let mut plant = Plant::new(p, State { dq1: *v1, q2, dq2: *v2, ..State::default() }).expect("a valid scene");
    let before = plant.energy(0.0);
    plant.advance(Drive::default(), 0.0).expect("a valid step");
    assert_eq!(plant.totals().impacts, 1);
    let after = plant.state();
    let (m1, m2) = (p.primary_mass, p.particle_mass);
    let momentum = m1 * (after.dq1 - v1) + m2 * (after.dq2 - v2);
    let law = (after.dq1 - after.dq2) + p.restitution * approach;
    let energy = plant.energy(0.0) + plant.totals().dissipated - before;
    record! { figures:
        "momentum missed, relative" largest (momentum / (m1 * v1.abs() + m2 * v2.abs())).abs(), 2e-15;
        "Newton's law missed by, relative" largest (law / (v1.abs() + v2.abs())).abs(), 2e-15;
        "energy and dissipated energy missed, relative" largest (energy / before).abs(), 2e-15;
    }
}

/// How long a motion is followed, in units of `1/omega0`, and in how many looks its farthest point is searched for.
const DURATION: f64 = 15.0;
const LOOKS: u32 = 3000;

/// Motions of a primary mass that starts at the centre of its cavity, driven or free.
pub fn grazes() -> BoxedStrategy<Scene> {
    let strategy = (scene(true), any::<bool>(), 0.1..2.0f64).prop_map(|(mut s, driven, speed)| {
        s.start = State { dq1: speed, ..State::default() };
        if !driven {
            s.drive = Drive::default();
        }
        s
    });
    strategy.boxed()
}

/// Where the primary mass goes farthest within the duration; `None` if it goes as far at its end.
fn farthest(s: &Scene) -> Option<f64> {
    let p = s.parameters;
    let oscillator = Oscillator::new(p.primary_mass, p.stiffness, p.damping);
    let base = BaseMotion { drive: s.drive, ..BaseMotion::default() };
    let motion = Segment::new(&oscillator, base, (0.0, s.start.dq1));
    let step = DURATION / f64::from(LOOKS);
    let at = |t: f64| motion.derivatives(t)[0].abs();
    let looks: Vec<f64> = (0..=LOOKS).map(|n| at(f64::from(n) * step)).collect();
    let mut farthest = 0.0f64;
    for (n, near) in looks.windows(3).enumerate() {
        if near[1] >= near[0] && near[1] >= near[2] {
            // With hardly any damping one extreme is as far as the other but for the last digits: each is computed.
            let mut t = (n as f64 + 1.0) * step;
            for _ in 0..20 {
                let d = motion.derivatives(t);
                t -= d[1] / d[2];
            }
            farthest = farthest.max(at(t));
        }
    }
    (farthest > looks[looks.len() - 1] * 1.02).then_some(farthest)
}

/// Walls just before the farthest point of a motion, and just beyond it: in one step, in many, and by the general search alone.
pub fn graze(s: &Scene, figures: &mut Figures) {
    let Some(farthest) = farthest(s) else { return };
    // How many of the three ways report an impact, or none.
    let ways = |half_width: f64, hit: bool| {
        let hits = [(true, 1), (true, 150), (false, 1)].map(|(fast, steps)| {
            let parameters = Parameters { half_width, ..s.parameters };
            let mut plant = Plant::new(parameters, s.start).expect("a valid scene");
            plant.set_fast_path(fast);
            (0..steps).any(|_| {
                let outcome = plant.advance(s.drive, DURATION / f64::from(steps));
                outcome.expect("a valid step").impacts > 0
            })
        });
        hits.iter().filter(|one| **one == hit).count() as u64
    };
    for exponent in 2..=13 {
        let delta = 10f64.powi(-exponent);
        record! { figures:
            "overshoots of 1e-2 to 1e-13 of the half-width missed" count ways(farthest * (1.0 - delta), false), 0.0;
            "undershoots of 1e-2 to 1e-13 of the half-width reported" count ways(farthest * (1.0 + delta), true), 0.0;
        }
    }
}

/// Mass ratios.
pub fn lossless() -> BoxedStrategy<f64> {
    decades(-6.0, 0.0).boxed()
}

/// A million elastic impacts without damping and drive: the energy stays.
pub fn conserves(epsilon: &f64, figures: &mut Figures) {
    let parameters = Parameters::dimensionless(*epsilon, 0.0, 1.0);
    let start = State { q1: 0.4, dq1: 0.1, q2: 0.2, dq2: -1.1 };
    let mut plant = Plant::new(parameters, start).expect("a valid scene");
    let at_start = plant.energy(0.0);
    while plant.totals().impacts < 1_000_000 {
        plant.advance(Drive::default(), 100.0).expect("a valid step");
        let drift = (plant.energy(0.0) + plant.totals().dissipated - at_start).abs() / at_start;
        figures.largest("energy drifts in 10^6 impacts by, relative", drift, 1e-12);
    }
}

/// Damping ratio; amplitude of the base, in half-widths; its frequency, in natural frequencies.
pub fn extremes() -> BoxedStrategy<(f64, f64, f64)> {
    let damping = vec![
        0.0, 1e-12, 1e-6, 1e-3, 1e-2, 0.1, 0.5, 1.0, 2.0, 10.0, 1e2, 1e3, 1e4, 1e5, 1e6,
    ];
    let amplitude = vec![0.0, 1e-3, 0.1, 1.0, 30.0, 1e3];
    let frequency = vec![1e-3, 0.03, 0.3, 1.0, 1.7, 10.0, 30.0, 300.0, 1e3];
    [damping, amplitude, frequency]
        .map(prop::sample::select)
        .prop_map(<(f64, f64, f64)>::from)
        .boxed()
}

/// Steps that an extreme scene is followed for; fewer after this number of impacts.
const STEPS: usize = 20;
const ENOUGH_IMPACTS: u64 = 100_000;

/// The work of a step: a natural period, or ten cycles of the drive where these are shorter.
pub fn work((zeta, amplitude, ratio): &(f64, f64, f64), figures: &mut Figures) {
    let parameters = Parameters {
        damping: 2.0 * zeta,
        ..Parameters::dimensionless(0.0084, 1.0, 0.65)
    };
    let start = State { q1: 0.1, q2: -0.2, dq2: 0.9, ..State::default() };
    let mut plant = Plant::new(parameters, start).expect("a valid scene");
    let drive = Drive::harmonic(*amplitude, *ratio);
    plant.begin(drive).expect("a valid drive");
    let step = (10.0 / ratio).min(1.0);
    for _ in 0..STEPS {
        let outcome = plant.advance(drive, step * TAU).expect("a valid step");
        let units = (outcome.impacts as f64).max(ratio * step).max(step);
        record! { figures:
            "evaluations per impact, drive cycle or natural period, whichever are the most"
                largest outcome.evaluations as f64 / units, 100.0;
        }
        if plant.totals().impacts > ENOUGH_IMPACTS {
            break;
        }
    }
}

const OMEGA: f64 = 0.990_417;

/// The default rig near its steady 1:1 motion.
fn steady() -> (Plant, Drive) {
    let start = State { q1: -0.42, dq1: 0.01, q2: -0.99, dq2: -0.86 };
    let plant = Plant::new(Parameters::dimensionless(0.0084, 1.43, 0.65), start).expect("a valid scene");
    (plant, Drive::harmonic(0.0084 * 1.1, OMEGA))
}

/// One step of a million periods; in the long form also with chatter, and one without end.
pub fn long_steps(all: bool) {
    let (mut plant, drive) = steady();
    let outcome = plant.advance(drive, 1e6 * TAU / OMEGA).expect("a valid step");
    assert!(
        !outcome.cut_short && outcome.impacts.abs_diff(2_000_000) <= 2,
        "{outcome:?}"
    );
    if !all {
        return;
    }
    let start = State { q1: 0.1, q2: 0.1, dq2: 0.3, ..State::default() };
    let mut plant = Plant::new(Parameters::dimensionless(0.05, 1.0, 0.4), start).expect("a valid scene");
    let advanced = plant.advance(Drive::harmonic(1.5, 0.6), 1e6 * TAU / 0.6);
    let outcome = advanced.expect("a valid step");
    assert!(outcome.impacts <= MOST_IMPACTS, "{outcome:?}");
    // A primary mass that never quite reaches the particle: it would be searched for contacts without end.
    let (g, sigma) = (1.64, 0.715);
    let mut plant = Plant::new(Parameters::dimensionless(0.0084, 1.43, 0.65), State::default()).expect("a valid scene");
    let drive = Drive::harmonic(0.0084 * g, 1.0 + 0.0084 * sigma);
    let outcome = plant.advance(drive, 1e100).expect("a valid step");
    assert!(outcome.cut_short && outcome.elapsed > 1e6 && outcome.elapsed == plant.time());
    assert!(outcome.evaluations <= MOST_EVALUATIONS + 1000, "{outcome:?}");
}

/// Short steps against one long one: rounding errors do not add up.
pub fn short_steps(figures: &mut Figures) {
    // Powers of two: both runs mean the same instants. The last is 78 periods in steps of 5e-4 rad.
    for (exponent, n) in [(-30, 100_000), (-20, 1_000_000), (-11, 1_000_000)] {
        let step = 2f64.powi(exponent);
        let (mut tiny, drive) = steady();
        let mut one = tiny;
        for _ in 0..n {
            tiny.advance(drive, step).expect("a valid step");
        }
        one.advance(drive, step * f64::from(n)).expect("a valid step");
        assert_eq!(tiny.totals().impacts, one.totals().impacts);
        let (a, b) = (states(&tiny), states(&one));
        let off = (0..4).map(|n| (a[n] - b[n]).abs()).fold(0.0, f64::max);
        figures.largest("states differ from those after one step by, at most", off, 1e-12);
    }
    figures.print("steps of 1.5e-10 periods, 1e-6 and 5e-4 rad", 3);
}
