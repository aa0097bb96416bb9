//! The impact map: from the state just after an impact to that just after the next, with its derivatives (docs/theory.md, eqs. 24 and 25).
//!
//! Between impacts the motion has a closed form. The derivative covers flight and impact: a disturbed motion reaches the wall a
//! little earlier or later (saltation).

use nalgebra::{Complex, RowSVector, SMatrix, Vector2, Vector4};
use serde::Serialize;

use super::oscillator::Oscillator;
use super::particle_flight::Flight;
use crate::Dimensionless;

/// State just after an impact. The base displacement is `epsilon G sin(phase)` there, and the particle is at `q1 - wall`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Bounce {
    /// Phase of the base, rad; it grows from impact to impact.
    pub phase: f64,
    /// Displacement of the primary mass over b.
    pub q1: f64,
    /// Velocity of the primary mass over `b omega0`.
    pub dq1: f64,
    /// Velocity of the particle over `b omega0`.
    pub dq2: f64,
    /// The wall that was hit: +1 for w = +1, -1 for w = -1.
    pub wall: f64,
}

impl Bounce {
    pub(super) fn vector(&self) -> Vector4<f64> {
        Vector4::new(self.phase, self.q1, self.dq1, self.dq2)
    }

    pub(super) fn from_vector(x: &Vector4<f64>, wall: f64) -> Self {
        let [phase, q1, dq1, dq2] = (*x).into();
        Self {
            phase,
            q1,
            dq1,
            dq2,
            wall,
        }
    }

    /// Displacement of the particle over b.
    #[must_use]
    pub fn q2(&self) -> f64 {
        self.q1 - self.wall
    }
}

/// Derivative of four state variables by (phase, q1, q1', q2', Omega, G) where it began.
pub(super) type ByAll = SMatrix<f64, 4, 6>;
/// Derivative of one number by the same.
pub(super) type RowByAll = RowSVector<f64, 6>;

/// One application of the map.
#[derive(Debug, Clone, Copy)]
pub(super) struct Step {
    pub next: Bounce,
    /// Time of flight over 1/omega0.
    pub duration: f64,
    /// Jump of q1' at the impact.
    pub impulse: f64,
    pub by: ByAll,
    pub impulse_by: RowByAll,
}

/// Dimensionless positions and velocities (q1, q1', q2, q2').
pub(super) type State = [f64; 4];

/// The map at one frequency and excitation.
#[derive(Debug, Clone, Copy)]
pub struct ImpactMap {
    epsilon: f64,
    r: f64,
    pub(super) oscillator: Oscillator,
    pub(super) zeta: f64,
    pub(super) omega: f64,
    pub(super) g: f64,
    /// Harmonic response of q1 to the base, per G, and its derivative by Omega.
    pub(super) unit: [Complex<f64>; 2],
}

impl ImpactMap {
    /// The map of `scene` (except its G) at the frequency `omega` over omega0 and the excitation `g`.
    #[must_use]
    pub fn new(scene: &Dimensionless, omega: f64, g: f64) -> Self {
        let zeta = scene.epsilon * scene.lambda / 2.0;
        let oscillator = Oscillator::new(zeta);
        let (force, compliance) = (oscillator.base_force(omega), oscillator.compliance(omega));
        let unit = force * compliance * scene.epsilon;
        let stiffness_by = Complex::new(-2.0 * omega, 2.0 * zeta);
        let unit_by =
            (Complex::new(0.0, 2.0 * zeta) * scene.epsilon - unit * stiffness_by) * compliance;
        Self {
            epsilon: scene.epsilon,
            r: scene.r,
            oscillator,
            zeta,
            omega,
            g,
            unit: [unit, unit_by],
        }
    }

    /// The state just after the next impact; None if there is none within many periods, if it grazes, or if
    /// impacts accumulate.
    #[must_use]
    pub fn next(&self, from: &Bounce) -> Option<Bounce> {
        self.landed(&Flight::new(self, from))
    }

    /// The state just after the first impact that follows from (q1, q1', q2, q2') at a phase of the base, rad, with the
    /// particle inside its cavity; None as for [`Self::next`].
    #[must_use]
    pub fn first(&self, phase: f64, [q1, dq1, q2, dq2]: [f64; 4]) -> Option<Bounce> {
        self.landed(&Flight::between(self, phase, [q1, dq1, q2, dq2], q1 - q2))
    }

    fn landed(&self, flight: &Flight) -> Option<Bounce> {
        let (duration, wall) = flight.contact()?;
        let [q1, dq1] = flight.primary(duration).into();
        let dw = dq1 - flight.dq2;
        let particle = (1.0 + self.r) / (1.0 + self.epsilon);
        Some(Bounce {
            phase: flight.phase + self.omega * duration,
            q1,
            dq1: dq1 - self.epsilon * particle * dw,
            dq2: flight.dq2 + particle * dw,
            wall,
        })
    }

    /// The same with its derivatives.
    pub(super) fn step(&self, from: &Bounce) -> Option<Step> {
        let flight = Flight::new(self, from);
        let (t, wall) = flight.contact()?;
        let [q1, dq1] = flight.primary(t).into();
        let dw = dq1 - from.dq2;
        let particle = (1.0 + self.r) / (1.0 + self.epsilon);

        // (q1, q1') just before the impact, at a fixed time of flight.
        let end = from.phase + self.omega * t;
        let propagator = self.oscillator.propagator(t);
        let mut fixed = SMatrix::<f64, 2, 6>::zeros();
        let by_phase = self.by_phase(end) - propagator * self.by_phase(from.phase);
        let by_omega =
            self.by_omega(end) + self.by_phase(end) * t - propagator * self.by_omega(from.phase);
        let by_g = self.by_g(end) - propagator * self.by_g(from.phase);
        fixed.set_column(0, &by_phase);
        fixed.fixed_view_mut::<2, 2>(0, 1).copy_from(&propagator);
        fixed.set_column(4, &by_omega);
        fixed.set_column(5, &by_g);

        let unit_row = |n: usize| RowByAll::from_fn(|_, column| f64::from(u8::from(column == n)));
        let (by_q1, by_dq2) = (unit_row(1), unit_row(3));
        // The condition w = wall at the end gives the change of the flight time.
        let by_w = fixed.row(0) - by_q1 - by_dq2 * t;
        let t_by = by_w / -dw;
        let acceleration = self.oscillator.free_acceleration(q1, dq1) + self.force(end);
        let q1_by = fixed.row(0) + t_by * dq1;
        let dq1_by = fixed.row(1) + t_by * acceleration;
        let phase_by = unit_row(0) + unit_row(4) * t + t_by * self.omega;
        let dw_by = dq1_by - by_dq2;

        let impulse = -self.epsilon * particle;
        let by = ByAll::from_rows(&[
            phase_by,
            q1_by,
            dq1_by + dw_by * impulse,
            by_dq2 + dw_by * particle,
        ]);
        Some(Step {
            next: Bounce {
                phase: end,
                q1,
                dq1: dq1 + impulse * dw,
                dq2: from.dq2 + particle * dw,
                wall,
            },
            duration: t,
            impulse: impulse * dw,
            by,
            impulse_by: dw_by * impulse,
        })
    }

    /// State at the time `t` after a bounce, before the next.
    pub(super) fn state(&self, from: &Bounce, t: f64) -> State {
        let [q1, dq1] = Flight::new(self, from).primary(t).into();
        [q1, dq1, from.q2() + from.dq2 * t, from.dq2]
    }

    /// Force of the base on the primary mass.
    fn force(&self, phase: f64) -> f64 {
        let amplitude = self.oscillator.base_force(self.omega) * (self.epsilon * self.g);
        (amplitude * Complex::from_polar(1.0, phase)).im
    }

    /// Harmonic response (q, q') at a phase of the base.
    pub(super) fn harmonic(&self, phase: f64) -> Vector2<f64> {
        let z = self.turned(self.unit[0] * self.g, phase);
        Vector2::new(z.im, self.omega * z.re)
    }

    fn by_phase(&self, phase: f64) -> Vector2<f64> {
        let z = self.turned(self.unit[0] * self.g, phase);
        Vector2::new(z.re, -self.omega * z.im)
    }

    fn by_omega(&self, phase: f64) -> Vector2<f64> {
        let z = self.turned(self.unit[0] * self.g, phase);
        let slope = self.turned(self.unit[1] * self.g, phase);
        Vector2::new(slope.im, z.re + self.omega * slope.re)
    }

    fn by_g(&self, phase: f64) -> Vector2<f64> {
        let z = self.turned(self.unit[0], phase);
        Vector2::new(z.im, self.omega * z.re)
    }

    /// Without excitation the response is zero, even at an undamped resonance.
    fn turned(&self, z: Complex<f64>, phase: f64) -> Complex<f64> {
        if z.is_nan() && self.g == 0.0 {
            return Complex::new(0.0, 0.0);
        }
        z * Complex::from_polar(1.0, phase)
    }
}
