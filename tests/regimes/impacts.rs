//! The same regimes with impacts: the truth looks for each in steps far shorter than any flight, and closes in by Newton's
//! method.

use crate::families::{damping_ratios, unit};
use crate::scan::Case;
use crate::truth::{Matrix, System, Vector, after, number, start};
use lovines::{Drive, Parameters, Plant, State};
use twofloat::TwoFloat;

/// Steps in which the truth looks for an impact, s: exact in binary.
const LOOK: f64 = 1.0 / 128.0;
/// Looks between two comparisons: a communication step.
const LOOKS: usize = 48;
const STEPS: usize = 40;
/// Impacts drive neighbours apart: after more than these a last digit has become many.
const FOLLOWED: u64 = 4;

/// Mass, base and particle in 32 digits.
struct Truth<'a> {
    system: &'a System,
    look: Matrix,
    parameters: Parameters,
    z: Vector,
    /// The particle: displacement and velocity.
    particle: (TwoFloat, TwoFloat),
    impacts: u64,
    /// Slowest approach at an impact, m/s.
    slowest: f64,
}

impl Truth<'_> {
    fn moved(&self, flow: &Matrix, t: TwoFloat) -> (Vector, (TwoFloat, TwoFloat)) {
        let (q, v) = self.particle;
        (after(flow, &self.z), (q + v * t, v))
    }

    fn look(&mut self) {
        let mut left = TwoFloat::from(LOOK);
        let mut flow = self.look;
        loop {
            let (z, particle) = self.moved(&flow, left);
            let w = number(z[0] - particle.0);
            let b = self.parameters.half_width;
            if w.abs() <= b {
                (self.z, self.particle) = (z, particle);
                return;
            }
            let wall = TwoFloat::from(b.copysign(w));
            // From the start of the look: the approach hardly changes within it.
            let (mut t, mut at) = (TwoFloat::from(0.0), (self.z, self.particle));
            for _ in 0..7 {
                let gap = wall - (at.0[0] - at.1.0);
                t += gap / (at.0[1] - at.1.1);
                at = self.moved(&self.system.flow_precise(t), t);
            }
            (self.z, self.particle) = at;
            self.impact();
            left -= t;
            flow = self.system.flow_precise(left);
        }
    }

    fn impact(&mut self) {
        let p = &self.parameters;
        let (v1, v2) = (self.z[1], self.particle.1);
        let approach = v1 - v2;
        let total = TwoFloat::new_add(p.primary_mass, p.particle_mass);
        let centre = (v1 * p.primary_mass + v2 * p.particle_mass) / total;
        let apart = -approach * p.restitution;
        self.z[1] = centre + apart * p.particle_mass / total;
        self.particle.1 = centre - apart * p.primary_mass / total;
        self.impacts += 1;
        self.slowest = self.slowest.min(number(approach).abs());
    }
}

/// Largest error of any state, and how many impacts there were.
fn follow(case: &Case) -> (f64, u64) {
    let parameters = Parameters {
        primary_mass: case.mass,
        stiffness: case.stiffness,
        damping: case.damping,
        particle_mass: 0.1 * case.mass,
        half_width: 1.0,
        restitution: 0.8,
        cavity: lovines::Cavity::IDEAL,
    };
    let at_start = State { q1: case.start.0, dq1: case.start.1, q2: 0.2, dq2: -0.9 };
    let system = System::new(case.mass, case.stiffness, case.damping, &case.drive);
    let mut truth = Truth {
        system: &system,
        look: system.flow(LOOK),
        parameters,
        z: start(case.start, &case.drive),
        particle: (at_start.q2.into(), at_start.dq2.into()),
        impacts: 0,
        slowest: f64::INFINITY,
    };
    let mut plant = Plant::new(parameters, at_start).expect("a case that makes sense");
    plant.begin(case.drive).unwrap();
    let mut worst = 0.0f64;
    for _ in 0..STEPS {
        let before = truth.impacts;
        (0..LOOKS).for_each(|_| truth.look());
        // Slow approaches are grazes, which nothing follows for long.
        if truth.impacts > FOLLOWED || truth.slowest < 0.05 {
            return (worst, before);
        }
        let drive = plant.base().drive;
        plant.advance(drive, LOOK * LOOKS as f64).unwrap();
        assert_eq!(plant.totals().impacts, truth.impacts, "{case:?}");
        let s = plant.state();
        let (q2, dq2) = truth.particle;
        let pairs = [(s.q1, truth.z[0]), (s.dq1, truth.z[1]), (s.q2, q2), (s.dq2, dq2)];
        for (got, want) in pairs {
            let error = number(want - got).abs() / number(want).abs().max(1.0);
            worst = worst.max(error);
        }
    }
    (worst, truth.impacts)
}

/// Every damping ratio under every kind of drive: largest error, cases and impacts.
pub fn worst() -> (f64, usize, u64) {
    let signal = |order: usize| {
        let mut drive = Drive::harmonic(0.2, 0.7);
        drive.signal[..=order].copy_from_slice(&[0.1, 0.1, -0.03, 0.003][..=order]);
        drive
    };
    let drives = [
        Drive::default(),
        Drive::harmonic(0.3, 0.7),
        Drive::harmonic(0.3, -1.7),
        Drive::harmonic(0.1, 1.0),
        Drive::harmonic(0.1, 1.0 + 1e-12),
        Drive::harmonic(0.3, 1e-8),
        signal(0),
        signal(1),
        signal(2),
        signal(3),
    ];
    let cases = damping_ratios()
        .into_iter()
        .flat_map(|z| drives.map(|drive| unit(z, drive, (0.5, -0.6))));
    cases.fold((0.0, 0, 0), |(worst, count, impacts), case| {
        let (error, n) = follow(&case);
        (error.max(worst), count + 1, impacts + n)
    })
}
