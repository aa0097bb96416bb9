//! The propagator of a step that is short against every rate and repeated many times.
//!
//! The base moves as a polynomial or a sine. Either is its Taylor series, so that the response from rest is
//! `sum b_n G_n(t)`: `b_n` the n-th derivative of the base displacement at the start, `G_n` the response to `t^n/n!`. The `G_n`
//! belong to the step, not to the drive: a drive that changes at every sample costs two polynomials in `omega²`, and needs
//! neither a sine nor a division. That holds for every damping ratio, at resonance and away from it.

use super::propagator::{Increment, Point, ROTATION, forced, polynomials, rotate};
use crate::arithmetic::{Sum, halves, product_with};
use crate::base_motion::Drive;
use crate::oscillator::{Oscillator, Transition};
use num_complex::Complex64;

/// Longest step, in units of the fastest rate's time: the first term left out is below 1e-17.
pub(super) const LONGEST: f64 = 1.0 / 8.0;
/// Steps whose lengths differ by less, relative, are the same but for a correction of first order; the second order is below 1e-20.
pub(super) const SAME: f64 = 1e-9;
/// Half the number of the `G_n` beside `G_0`.
const MOMENTS: usize = 5;

/// The propagator of one step length; what follows from that is computed when it is needed.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(16))]
pub(super) struct ShortStep {
    /// What the free motion adds: the sum of both.
    free: (Transition, Transition),
    /// `G_n`, in the unit of `t^n`, two at a time with alternating sign: `[G_2, G_1]`, `[-G_4, -G_3]` and so on.
    moments: [[f64; 2]; MOMENTS],
    /// `G_0`, and velocity per base displacement: `omega0² xv`.
    held: [f64; 2],
    /// Velocity per base velocity over the frequency: `2 delta xv`.
    moving: f64,
    halves: (f64, f64),
    /// The key: length of the step, s; NaN where there is none.
    pub t: f64,
    response: Response,
}

/// What a harmonic base adds in one step.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Response {
    /// The key, rad/s.
    omega: f64,
    /// `omega t`.
    pub angle: Sum,
    /// Cosine of the angle, and sine over angle.
    rotation: [f64; 2],
    /// Displacement and velocity that a base displacement adds, and a base velocity.
    displacement: (f64, f64),
    slope: (f64, f64),
}

impl From<f64> for ShortStep {
    fn from(t: f64) -> Self {
        Self {
            t,
            halves: halves(t),
            free: Default::default(),
            moments: Default::default(),
            held: Default::default(),
            moving: 0.0,
            response: Response { omega: f64::NAN, ..Response::default() },
        }
    }
}

impl Default for ShortStep {
    fn default() -> Self {
        Self::from(f64::NAN)
    }
}

impl ShortStep {
    #[inline(never)]
    fn complete(&mut self, oscillator: &Oscillator) {
        self.free = oscillator.split(&oscillator.increment(self.t));
        let per_velocity = self.free.0.xv + self.free.1.xv;
        self.held = [moment(oscillator, 0, self.t), oscillator.omega0_squared * per_velocity];
        self.moving = 2.0 * oscillator.delta * per_velocity;
        self.moments = core::array::from_fn(|n| {
            [2 * n + 2, 2 * n + 1].map(|m| [1.0, -1.0][n % 2] * moment(oscillator, m, self.t))
        });
    }

    /// Whether a step of `t` seconds can have such a propagator.
    pub fn is_short(oscillator: &Oscillator, omega: f64, t: f64) -> bool {
        t * oscillator.fastest.max(omega.abs()) <= LONGEST && t > 0.0
    }

    /// Whether it serves for a step that is longer by `late` seconds: masters compute equal steps with rounding errors.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn serves(&self, drive: &Drive, late: f64) -> bool {
        late == 0.0 || (late.abs() <= SAME * self.t && drive.is_straight())
    }

    /// Forgets the step if it is not short against the drive.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn drive_changed(&mut self, drive: &Drive) {
        if drive.omega.abs() * self.t > LONGEST {
            *self = Self::default();
        }
    }

    /// The response at a frequency, kept for the next step.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn response(&mut self, oscillator: &Oscillator, omega: f64) -> Response {
        if self.response.omega == omega {
            return self.response;
        }
        if self.response.omega.is_nan() {
            self.complete(oscillator);
        }
        let square = omega * omega;
        // `K = even + i omega odd` and `K' = i omega K + F xv`, with `even = G_0 - omega² rest`.
        let [rest, odd] = polynomials(&self.moments, square);
        let displacement = (self.held[0] - square * rest, self.held[1] - square * odd);
        let (value, error) = product_with(omega, (self.t, self.halves));
        // A copy is returned: what was just stored is slow to load.
        let response = Response {
            omega,
            angle: Sum { value, error },
            rotation: polynomials(&ROTATION, value * value),
            displacement,
            slope: (odd, self.moving + displacement.0),
        };
        self.response = response;
        response
    }

    /// What one step adds to `start` while the signal is a straight line.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn increment(&self, response: &Response, amplitude: f64, start: &Point) -> Increment {
        let (head, tail) = &self.free;
        let (y, dy) = head.of(start.y, start.dy);
        let (more_y, more_dy) = tail.of(start.y, start.dy);
        let (cos, sin) = start.phasor;
        let slope = response.omega * cos;
        let forced = |per_displacement, per_slope| amplitude * (per_displacement * sin + per_slope * slope);
        let [turned, sine] = response.rotation;
        Increment {
            y: y + (more_y + forced(response.displacement.0, response.slope.0)),
            dy: dy + (more_dy + forced(response.displacement.1, response.slope.1)),
            phasor: rotate(start.phasor, (turned, response.angle.value * sine)),
        }
    }
}

impl Increment {
    /// Adds what the curvature and jerk of the signal add in one step.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn bend(&mut self, [.., u2, u3]: [f64; 4], step: &ShortStep) {
        let [[g2, g1], [_, g3], ..] = step.moments;
        self.y += 2.0 * u2 * g2 - 6.0 * u3 * g3;
        self.dy += 2.0 * u2 * g1 + 6.0 * u3 * g2;
    }

    /// The same for a step that is longer by `late` seconds, to first order; the signal is a straight line.
    #[inline(never)]
    pub fn later(self, oscillator: &Oscillator, drive: &Drive, (y, dy): (f64, f64), late: f64) -> Self {
        let Oscillator { delta, omega0_squared, .. } = *oscillator;
        let (y, dy) = (y + self.y, dy + self.dy);
        let strength = Complex64::new(omega0_squared, 2.0 * delta * drive.omega);
        let forcing = forced(drive.amplitude, self.phasor, strength);
        Self {
            y: self.y + late * dy,
            dy: self.dy + late * (forcing - omega0_squared * y - 2.0 * delta * dy),
            phasor: rotate(self.phasor, (1.0, drive.omega * late)),
        }
    }
}

/// `G_n(t)`: the response from rest to a base displacement `t^n/n!`, from its Taylor series.
fn moment(oscillator: &Oscillator, n: usize, t: f64) -> f64 {
    let (damping, spring) = (2.0 * oscillator.delta * t, oscillator.omega0_squared * t * t);
    // Coefficients times powers of t.
    let force = (1..=n).fold(1.0, |force, k| force * t / k as f64);
    let base = |k: usize| if k == n { force } else { 0.0 };
    let (mut before, mut last, mut sum) = (0.0, 0.0, 0.0);
    for k in n.max(1) - 1..n + 12 {
        let k1 = (k + 1) as f64;
        let next = (spring * (base(k) - before) + damping * k1 * (base(k + 1) - last)) / (k1 * (k1 + 1.0));
        sum += next;
        (before, last) = (last, next);
    }
    sum
}

#[cfg(test)]
#[path = "../../tests/unit/fast_short_step.rs"]
mod tests;
