//! The impact map: from the state just after an impact to that just after the next, with its derivatives (docs/theory.md, eqs. 24 and 25).
//!
//! Between impacts the motion has a closed form ([`Flight`]). The derivative covers flight and impact: a disturbed motion reaches the wall a
//! little earlier or later (saltation).

use lovines::Section;
use nalgebra::{RowSVector, SMatrix, Vector2, Vector4};
use serde::Serialize;

use super::flight::Flight;
use super::oscillator::ForcedOscillator;
use crate::Dimensionless;

/// Longest flight, periods.
const LONGEST: f64 = 64.0;

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
        Self { phase, q1, dq1, dq2, wall }
    }

    /// How far `later` is from repeating this state after the base has turned by `turn`, rad; with the sign -1, from its mirror image.
    pub(super) fn apart(&self, later: &Bounce, turn: f64, sign: f64) -> Vector4<f64> {
        let mut apart = later.vector() * sign - self.vector();
        apart[0] = later.phase - self.phase - turn;
        apart
    }

    /// Displacement of the particle over b.
    pub fn q2(&self) -> f64 {
        self.q1 - self.wall
    }
}

/// Derivative of four state variables by (phase, q1, q1', q2', Omega, G) where it began.
pub(super) type ByAll = SMatrix<f64, 4, 6>;
/// Derivative of one number by the same.
pub(super) type RowByAll = RowSVector<f64, 6>;

/// The derivative of unknown `n` by all.
pub(super) fn unit_row(n: usize) -> RowByAll {
    RowByAll::from_fn(|_, column| f64::from(u8::from(column == n)))
}

/// One application of the map.
#[derive(Debug, Clone, Copy)]
pub(super) struct Step {
    pub next: Bounce,
    /// Time of flight over 1/omega0.
    pub duration: f64,
    /// Jump of q1' at the impact.
    pub impulse: f64,
    pub by: ByAll,
}

/// The map at one frequency and excitation.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ImpactMap {
    epsilon: f64,
    r: f64,
    pub(super) oscillator: ForcedOscillator,
}

impl ImpactMap {
    /// The map of `scene` (except its G) at the frequency `omega` over omega0 and the excitation `g`.
    pub fn new(scene: &Dimensionless, omega: f64, g: f64) -> Self {
        Self {
            epsilon: scene.epsilon,
            r: scene.r,
            oscillator: ForcedOscillator::new(scene, omega, g),
        }
    }

    /// The state just after the next impact; None if there is none within many periods, if it grazes, or if
    /// impacts accumulate.
    pub fn next(&self, from: &Bounce) -> Option<Bounce> {
        Some(self.landed(from.phase, self.after(from), from.wall)?.0)
    }

    /// The state just after the first impact that follows from (q1, q1', q2, q2') at phase 0 of the base, with the
    /// particle inside its cavity; `None` where [`Self::next`] has none.
    pub fn first(&self, [q1, dq1, q2, dq2]: [f64; 4]) -> Option<Bounce> {
        Some(self.landed(0.0, [q1, dq1, q2, dq2], q1 - q2)?.0)
    }

    /// (q1, q1', q2, q2') after a bounce.
    fn after(&self, from: &Bounce) -> [f64; 4] {
        [from.q1, from.dq1, from.q2(), from.dq2]
    }

    /// The flight from a state at a phase of the base.
    fn flight(&self, phase: f64, [q1, dq1, q2, dq2]: [f64; 4]) -> Flight<[(Section, Vector2<f64>); 1]> {
        let ForcedOscillator { free, omega, .. } = self.oscillator;
        let state = Vector2::new(q1, dq1) - self.oscillator.harmonic(phase);
        Flight {
            sections: [(free, state)],
            harmonic: self.oscillator.response(phase),
            omega,
            particle: [q2, dq2],
        }
    }

    /// The state after the impact that ends the flight from a state with the relative displacement `w`, the duration of the flight, and the
    /// velocity of the primary mass just before the impact.
    fn landed(&self, phase: f64, state: [f64; 4], w: f64) -> Option<(Bounce, f64, f64)> {
        let (flight, [_, start, _, dq2]) = (self.flight(phase, state), state);
        let (duration, wall) = flight.contact([w, start - dq2], 1.0, LONGEST)?;
        let [q1, dq1] = flight.cavity(duration).into();
        let dw = dq1 - dq2;
        let particle = self.particle();
        let next = Bounce {
            phase: phase + self.oscillator.omega * duration,
            q1,
            dq1: dq1 - self.epsilon * particle * dw,
            dq2: dq2 + particle * dw,
            wall,
        };
        Some((next, duration, dq1))
    }

    /// Jump of the particle's velocity over the relative velocity before the impact.
    fn particle(&self) -> f64 {
        (1.0 + self.r) / (1.0 + self.epsilon)
    }

    /// The next impact with its derivatives by state, frequency and excitation.
    pub(super) fn step(&self, from: &Bounce) -> Option<Step> {
        let (next, t, dq1) = self.landed(from.phase, self.after(from), from.wall)?;
        let dw = dq1 - from.dq2;

        // (q1, q1') just before the impact, at a fixed time of flight.
        let end = next.phase;
        let propagator = self.oscillator.free.propagator(t);
        let mut fixed = SMatrix::<f64, 2, 6>::zeros();
        let [[by_phase, by_omega, by_g], before] = [end, from.phase].map(|phase| self.oscillator.derivatives(phase));
        fixed.set_column(0, &(by_phase - propagator * before[0]));
        fixed.fixed_view_mut::<2, 2>(0, 1).copy_from(&propagator);
        fixed.set_column(4, &(by_omega + by_phase * t - propagator * before[1]));
        fixed.set_column(5, &(by_g - propagator * before[2]));

        let (by_q1, by_dq2) = (unit_row(1), unit_row(3));
        // The condition w = wall at the end gives the change of the flight time.
        let by_w = fixed.row(0) - by_q1 - by_dq2 * t;
        let t_by = by_w / -dw;
        let acceleration = self.oscillator.free.rate(Vector2::new(next.q1, dq1))[1] + self.oscillator.force(end);
        let q1_by = fixed.row(0) + t_by * dq1;
        let dq1_by = fixed.row(1) + t_by * acceleration;
        let phase_by = unit_row(0) + unit_row(4) * t + t_by * self.oscillator.omega;
        let dw_by = dq1_by - by_dq2;

        let particle = self.particle();
        let impulse = -self.epsilon * particle;
        let by = ByAll::from_rows(&[phase_by, q1_by, dq1_by + dw_by * impulse, by_dq2 + dw_by * particle]);
        Some(Step { next, duration: t, impulse: impulse * dw, by })
    }

    /// (q1, q1', q2, q2') at the time `t` after a bounce, before the next.
    pub(super) fn state(&self, from: &Bounce, t: f64) -> [f64; 4] {
        let [q1, dq1] = self.flight(from.phase, self.after(from)).cavity(t).into();
        [q1, dq1, from.q2() + from.dq2 * t, from.dq2]
    }
}
