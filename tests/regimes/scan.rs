//! One case by every way the plant has, against the truth.

use crate::truth::{System, Vector, after, number, start};
use core::fmt;
use lovines::base_motion::BaseMotion;
use lovines::oscillator::Oscillator;
use lovines::segment::Segment;
use lovines::{Drive, Parameters, Plant, State};
use std::f64::consts::TAU;

/// Lengths of the single step, in natural periods.
const SPANS: [f64; 8] = [1e-9, 1e-4, 0.03, 0.2, 1.0, 10.0, 100.0, 1000.0];
/// Samples that tell the size of a motion.
const SAMPLES: i32 = 8;
/// The general search looks at the motion again and again: for so many radians of its fastest rate at most.
const LONGEST_SEARCH: f64 = 70.0;

/// A mass on its spring, its start and its base.
#[derive(Clone, Copy, Debug)]
pub struct Case {
    pub mass: f64,
    pub stiffness: f64,
    pub damping: f64,
    /// Displacement, m, and velocity, m/s.
    pub start: (f64, f64),
    pub drive: Drive,
}

impl Case {
    pub fn damping_ratio(&self) -> f64 {
        0.5 * self.damping / (self.mass * self.stiffness).sqrt()
    }
}

/// How large a motion and what drives it have been, as displacement and as velocity: the envelope of the free motion, which
/// knows no zeros, and the base.
#[derive(Clone, Copy, Debug)]
struct Size {
    slow: f64,
    fast: f64,
    displacement: f64,
    velocity: f64,
}

impl Size {
    fn of(case: &Case, oscillator: &Oscillator) -> Self {
        let fast = oscillator.omega0.max(case.damping / case.mass);
        let slow = oscillator.omega0_squared / fast;
        let amplitude = case.drive.amplitude.abs();
        Self {
            slow,
            fast,
            displacement: amplitude,
            velocity: amplitude * slow,
        }
    }

    fn see(&mut self, z: &Vector, drive: &Drive) {
        let [q, dq, sin, cos, u, du, ..] = z.map(number);
        let base = u + drive.amplitude * sin;
        let dbase = du + drive.amplitude * drive.omega * cos;
        let most = |a: f64, b: f64, c: f64| a.max(b.abs()).max(c);
        self.displacement = most(self.displacement, base, q.hypot(dq / self.fast));
        self.velocity = most(self.velocity, dbase, dq.hypot(q * self.slow)).max(base.abs() * self.slow);
    }

    /// The larger of the errors of displacement and velocity.
    fn error(&self, z: &Vector, (q, dq): (f64, f64)) -> f64 {
        let part = |error: f64, of: f64| if error == 0.0 { 0.0 } else { error.abs() / of };
        let (x, v) = (number(z[0] - q), number(z[1] - dq));
        part(x, self.displacement).max(part(v, self.velocity))
    }
}

/// The worst errors of a family, by length of the step.
#[derive(Debug, Default)]
pub struct Worst {
    errors: [f64; SPANS.len()],
    hardest: Option<(Case, &'static str, f64)>,
}

impl Worst {
    /// Follows a case in one step of each length.
    pub fn add(&mut self, case: &Case) {
        let drive = &case.drive;
        let system = System::new(case.mass, case.stiffness, case.damping, drive);
        let oscillator = Oscillator::new(case.mass, case.stiffness, case.damping);
        for (n, span) in SPANS.iter().enumerate() {
            let t = span * TAU / oscillator.omega0;
            let mut size = Size::of(case, &oscillator);
            let mut z = start(case.start, drive);
            size.see(&z, drive);
            // Divided by a power of two, the parts are exact.
            let flow = system.flow(t / f64::from(SAMPLES));
            for _ in 0..SAMPLES {
                z = after(&flow, &z);
                size.see(&z, drive);
            }
            for (way, got) in ways(case, &oscillator, t) {
                let error = size.error(&z, got);
                // Not a number is the worst of all.
                if error > self.most() || error.is_nan() {
                    self.hardest = Some((*case, way, t));
                }
                if error > self.errors[n] || error.is_nan() {
                    self.errors[n] = error;
                }
            }
        }
    }

    fn most(&self) -> f64 {
        self.errors.iter().fold(0.0, |a, b| a.max(*b))
    }

    pub fn below(&self, limit: f64) -> bool {
        self.errors.iter().all(|error| *error <= limit)
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

impl fmt::Display for Worst {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let short = self.errors[..5].iter().fold(0.0f64, |a, b| a.max(*b));
        write!(f, "{short:.1e}")?;
        for error in &self.errors[5..] {
            write!(f, " | {error:.1e}")?;
        }
        let Some((case, way, t)) = &self.hardest else {
            return write!(f, " | none");
        };
        let Drive { signal, amplitude, omega } = case.drive;
        write!(
            f,
            " | {way}, damping ratio {:e}, omega {omega:e}, E {amplitude}, signal {signal:?}, start {:?}, t {t:e}",
            case.damping_ratio(),
            case.start
        )
    }
}
