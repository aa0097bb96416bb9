//! Guards the digits of the flow between events: every regime, scanned across each degeneracy, against an integrator of its own in 32 digits.
//! Impacts in all regimes, near-critical damping among them, are compared with an independent simulation in tests/stress.
//!
//! ```text
//! cargo test --test regimes -- --nocapture
//! ```

use lovines::base_motion::BaseMotion;
use lovines::oscillator::Oscillator;
use lovines::segment::{Motion, Segment};
use lovines::{Drive, Parameters, Plant, State};
use std::f64::consts::TAU;
use twofloat::TwoFloat;

/// Largest error after up to a thousand periods, relative to the motion and to what drives it.
const LIMIT: f64 = 1e-13;

#[test]
fn no_regime_loses_digits() {
    println!("| family | cases | up to 1 period | 10 | 100 | 1000 | hardest |\n|---|---|---|---|---|---|---|");
    let mut failed = Vec::new();
    for (name, cases) in families() {
        let mut worst = Worst::default();
        cases.iter().for_each(|case| worst.add(case));
        let Worst { errors, hardest } = worst;
        let short = errors[..5].iter().fold(0.0f64, |a, b| a.max(*b));
        let [.., ten, hundred, thousand] = errors;
        let row = format!(
            "{name} | {} | {short:.1e} | {ten:.1e} | {hundred:.1e} | {thousand:.1e}",
            cases.len()
        );
        println!("| {row} | {hardest:?} |");
        if !errors.iter().all(|error| *error <= LIMIT) {
            failed.push(name);
        }
    }
    assert!(failed.is_empty(), "{failed:?}");
}

/// Lengths of the single step, in natural periods.
const SPANS: [f64; 8] = [1e-9, 1e-4, 0.03, 0.2, 1.0, 10.0, 100.0, 1000.0];
/// Samples that tell the size of a motion.
const SAMPLES: i32 = 8;
/// Longest span of the general search, radians of the fastest rate: its work grows with the span.
const LONGEST_SEARCH: f64 = 70.0;

/// A mass on its spring, its start and its base.
#[derive(Clone, Copy, Debug)]
struct Case {
    mass: f64,
    stiffness: f64,
    damping: f64,
    /// Displacement, m, and velocity, m/s.
    start: (f64, f64),
    drive: Drive,
}

/// The worst errors of a family by length of the step, and the case, the way and the time of the largest.
#[derive(Debug, Default)]
struct Worst {
    errors: [f64; SPANS.len()],
    hardest: Option<(Case, &'static str, f64)>,
}

impl Worst {
    /// Follows a case in one step of each length.
    fn add(&mut self, case: &Case) {
        let drive = &case.drive;
        let system = System::new(case.mass, case.stiffness, case.damping, drive);
        let oscillator = Oscillator::new(case.mass, case.stiffness, case.damping);
        let fast = oscillator.omega0.max(case.damping / case.mass);
        let slow = oscillator.omega0_squared / fast;
        for (n, span) in SPANS.iter().enumerate() {
            let t = span * TAU / oscillator.omega0;
            // How large the motion and its base have been, as displacement and as velocity: the envelope, which has no zeros.
            let amplitude = drive.amplitude.abs();
            let mut size = [amplitude, amplitude * slow];
            let mut see = |z: &Vector| {
                let [q, dq, sin, cos, u, du, ..] = z.map(number);
                let base = (u + drive.amplitude * sin).abs();
                let dbase = (du + drive.amplitude * drive.omega * cos).abs();
                size[0] = size[0].max(base).max(q.hypot(dq / fast));
                size[1] = size[1].max(dbase).max(dq.hypot(q * slow)).max(base * slow);
            };
            let mut z = start(case.start, drive);
            see(&z);
            // Divided by a power of two, the parts are exact.
            let flow = system.flow(t / f64::from(SAMPLES));
            for _ in 0..SAMPLES {
                z = after(&flow, &z);
                see(&z);
            }
            for (way, (q, dq)) in ways(case, &oscillator, t) {
                let part = |error: f64, of: f64| if error == 0.0 { 0.0 } else { error.abs() / of };
                let error = part(number(z[0] - q), size[0]).max(part(number(z[1] - dq), size[1]));
                let largest = self.errors.iter().fold(0.0, |a, b| f64::max(a, *b));
                // Not a number is the worst of all.
                if error > largest || error.is_nan() {
                    self.hardest = Some((*case, way, t));
                }
                if error > self.errors[n] || error.is_nan() {
                    self.errors[n] = error;
                }
            }
        }
    }
}

/// Displacement and velocity after a step of `t` seconds, by each way there is.
fn ways(case: &Case, oscillator: &Oscillator, t: f64) -> Vec<(&'static str, (f64, f64))> {
    let parameters = Parameters {
        primary_mass: case.mass,
        stiffness: case.stiffness,
        damping: case.damping,
        particle_mass: 0.01 * case.mass,
        // No wall in reach.
        half_width: 1e13,
        restitution: 0.65,
        cavity: lovines::Cavity::IDEAL,
    };
    let start = State { q1: case.start.0, dq1: case.start.1, ..State::default() };
    let advanced = |fast: bool| {
        let mut plant = Plant::new(parameters, start).expect("a case that makes sense");
        plant.set_fast_path(fast);
        plant.begin(case.drive).unwrap();
        plant.advance(case.drive, t).unwrap();
        assert_eq!(plant.totals().impacts, 0);
        (plant.state().q1, plant.state().dq1)
    };
    let base = BaseMotion { drive: case.drive, ..BaseMotion::default() };
    let motion = Segment::new(oscillator, base, case.start);
    let [x, v, ..] = motion.at(&motion.series(), t).derivatives;
    let mut ways = vec![("closed form", (x, v))];
    if t * motion.fastest() <= LONGEST_SEARCH {
        ways.push(("search", advanced(false)));
    }
    ways.push(("plant", advanced(true)));
    ways
}

/// The name of a scan, and its cases.
type Family = (String, Vec<Case>);

const AT_REST: (f64, f64) = (0.0, 0.0);
const MOVING: (f64, f64) = (0.7, -0.4);

/// Damping ratios: none, hardly any, light, across critical damping, far above it.
fn damping_ratios() -> Vec<f64> {
    let near = [1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-14, 2.3e-16];
    let below = near.iter().map(|d| 1.0 - d);
    let above = near.iter().rev().map(|d| 1.0 + d);
    let light = [0.0, 1e-300, 1e-30, 1e-16, 1e-12, 1e-8, 1e-6, 1e-4, 5e-4, 1e-2, 0.1];
    let around_half = [0.4999, 0.5, 0.5001, 0.8];
    let heavy = [1.005, 1.0051, 1.1, 2.0, 30.0, 1e3];
    let near = below.chain([1.0]).chain(above);
    light.into_iter().chain(around_half).chain(near).chain(heavy).collect()
}

fn near_zero() -> impl Iterator<Item = f64> {
    [
        1e-16, 2.3e-16, 1e-15, 1e-14, 1e-13, 1e-12, 1e-11, 1e-10, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1,
    ]
    .into_iter()
    .flat_map(|d| [-d, d])
    .chain([0.0])
}

/// The oscillator of unit mass and stiffness.
fn unit(zeta: f64, drive: Drive, start: (f64, f64)) -> Case {
    Case { mass: 1.0, stiffness: 1.0, damping: 2.0 * zeta, start, drive }
}

/// The rig of the default scene with another damping ratio, and as much of the natural frequency as driving frequency.
fn rig(zeta: f64, amplitude: f64, ratio: f64, mass: f64, start: (f64, f64)) -> Case {
    let stiffness: f64 = 11.68e3;
    let omega0 = (stiffness / mass).sqrt();
    Case {
        mass,
        stiffness,
        damping: 2.0 * zeta * mass * omega0,
        start: (0.01 * start.0, 0.01 * omega0 * start.1),
        drive: Drive::harmonic(amplitude, ratio * omega0),
    }
}

fn families() -> Vec<Family> {
    let ratios = damping_ratios();
    let every = |step: usize| ratios.iter().copied().step_by(step);
    let tiny = || [0.0, 1e-300, 1e-16, 1e-14, 1e-12, 1e-10, 1e-8, 1e-6, 1e-4].into_iter();
    let harmonic = |z: f64, omega: f64, start| unit(z, Drive::harmonic(0.3, omega), start);
    let slow = [0.0, 1e-300, -1e-300, 1e-100, -1e-30, 1e-16, -1e-12, 1e-8, -1e-4, 1e-2];
    let beside = || tiny().flat_map(|z| near_zero().map(move |d| (z, 1.0 + d)));
    let mut families: Vec<Family> = Vec::new();
    let mut add = |name: &str, cases: &mut dyn Iterator<Item = Case>| families.push((name.to_owned(), cases.collect()));
    let free = |z| [MOVING, (1.0, 0.0), (0.0, 1.0)].map(|s| unit(z, Drive::default(), s));
    add("free, damping ratio 0 to 1000", &mut every(1).flat_map(free));
    let driven = |z| [0.3, 1.7, 40.0].map(|omega| harmonic(z, omega, MOVING));
    add("harmonic, damping ratio 0 to 1000", &mut every(1).flat_map(driven));
    let resonant = |(z, omega)| {
        [
            harmonic(z, omega, MOVING),
            unit(z, Drive::harmonic(1e-9, omega), AT_REST),
        ]
    };
    add(
        "omega across the resonance, 1e-16 to 0.1 off, damping ratio 0 to 1e-4",
        &mut beside().flat_map(resonant),
    );
    let default = |mass: f64, start| move |(z, omega)| rig(z, 1e-4, omega, mass, start);
    add("the same, default rig", &mut beside().map(default(3.807, AT_REST)));
    add(
        "the same, particle stuck",
        &mut beside().map(default(3.807 + 0.032, MOVING)),
    );
    let slowly = |z| slow.map(|omega| harmonic(z, omega, AT_REST));
    add("omega 0 to 1e-2, both signs", &mut every(4).flat_map(slowly));
    let backwards = |z| [-1.0, -0.7, -1.0 - 1e-12].map(|omega| harmonic(z, omega, MOVING));
    add("omega negative", &mut every(2).flat_map(backwards));
    let off = |z| [1.0, 0.0, 0.7].map(|omega| unit(z, Drive::harmonic(0.0, omega), MOVING));
    add(
        "E = 0 with omega at the resonance, 0, and not",
        &mut every(4).flat_map(off),
    );
    for order in 0..4 {
        let coefficients = [0.4, -0.3, 0.2, 0.1];
        let (mut alone, mut full) = (Drive::default(), Drive::harmonic(0.3, 0.7));
        alone.signal[order] = coefficients[order];
        full.signal[..=order].copy_from_slice(&coefficients[..=order]);
        let resonant = Drive { omega: 1.0 + 1e-12, ..full };
        let cases = |z: f64| {
            let last = if z < 0.2 { resonant } else { full };
            [unit(z, alone, AT_REST), unit(z, full, AT_REST), unit(z, last, MOVING)]
        };
        let name = format!("signal of order {order}, alone and with the oscillator");
        add(&name, &mut every(1).flat_map(cases));
    }
    families
}

// The truth: the bare equation of motion, `M q'' + c (q' - e') + k (q - e) = 0`, integrated in double-double.
//
// Base and mass are one linear system with constant coefficients: `s' = omega c`, `c' = -omega s` for the built-in
// oscillator, one state for each derivative of the signal. Its Taylor series over a short step is summed, and the step
// doubled again and again by squaring. Nothing here knows a damping ratio, a resonance or a particular solution.

/// `q, q', sin, cos, u, u', u'', u'''`.
const SIZE: usize = 8;
/// Terms of the series over a step of at most 1/8 of the fastest rate's time: the first left out is below 1e-36.
const TERMS: usize = 22;

type Vector = [TwoFloat; SIZE];
type Matrix = [Vector; SIZE];

/// The nearest double.
fn number(x: TwoFloat) -> f64 {
    x.hi() + x.lo()
}

fn zero() -> TwoFloat {
    TwoFloat::from(0.0)
}

/// One oscillator and its base.
struct System {
    rates: Matrix,
    fastest: f64,
}

impl System {
    /// The equation for this mass (kg), stiffness (N/m) and damping (N·s/m).
    fn new(mass: f64, stiffness: f64, damping: f64, drive: &Drive) -> Self {
        let mut rates = [[zero(); SIZE]; SIZE];
        let (spring, damper) = (TwoFloat::new_div(stiffness, mass), TwoFloat::new_div(damping, mass));
        let (amplitude, omega) = (drive.amplitude, drive.omega);
        rates[0][1] = TwoFloat::from(1.0);
        let base_velocity = damper * TwoFloat::new_mul(amplitude, omega);
        rates[1] = [
            -spring,
            -damper,
            spring * amplitude,
            base_velocity,
            spring,
            damper,
            zero(),
            zero(),
        ];
        rates[2][3] = TwoFloat::from(omega);
        rates[3][2] = TwoFloat::from(-omega);
        for n in 4..7 {
            rates[n][n + 1] = TwoFloat::from(1.0);
        }
        let fastest = [(stiffness / mass).sqrt(), damping / mass, omega.abs()];
        Self { rates, fastest: fastest.into_iter().fold(0.0, f64::max) }
    }

    /// What `t` seconds do to the state.
    fn flow(&self, t: f64) -> Matrix {
        let doublings = (8.0 * self.fastest * t).log2().ceil().max(0.0) as i32;
        let h = TwoFloat::from(t * 0.5f64.powi(doublings));
        let mut term = [[zero(); SIZE]; SIZE];
        for (n, row) in term.iter_mut().enumerate() {
            row[n] = TwoFloat::from(1.0);
        }
        let mut flow = term;
        for n in 1..=TERMS {
            let scale = h / n as f64;
            term = product(&self.rates, &term).map(|row| row.map(|x| x * scale));
            for (row, more) in flow.iter_mut().zip(&term) {
                for (x, more) in row.iter_mut().zip(more) {
                    *x += *more;
                }
            }
        }
        for _ in 0..doublings {
            flow = product(&flow, &flow);
        }
        flow
    }
}

fn product(a: &Matrix, b: &Matrix) -> Matrix {
    let mut product = [[zero(); SIZE]; SIZE];
    for (row, out) in a.iter().zip(&mut product) {
        for (x, line) in row.iter().zip(b) {
            if *x == 0.0 {
                continue;
            }
            for (sum, y) in out.iter_mut().zip(line) {
                *sum += *x * *y;
            }
        }
    }
    product
}

/// The state that a flow leads to.
fn after(flow: &Matrix, state: &Vector) -> Vector {
    flow.map(|row| (row.iter().zip(state)).fold(zero(), |sum, (a, x)| sum + *a * *x))
}

/// A start at `q`, `q'`, with the built-in oscillator at phase 0.
fn start((q, dq): (f64, f64), drive: &Drive) -> Vector {
    let [u0, u1, u2, u3] = drive.signal;
    [q, dq, 0.0, 1.0, u0, u1, 2.0 * u2, 6.0 * u3].map(TwoFloat::from)
}
