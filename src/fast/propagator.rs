//! A propagator: the closed form at one time, applied to any start.

use crate::arithmetic::{Sum, halves, product, product_with};
use crate::base_motion::{Drive, Phase};
use crate::forcing::{Forcing, Response};
use crate::oscillator::{FreeIncrement, Oscillator, Regime, Transition};
use core::f64::consts::TAU;
use num_complex::Complex64;

/// Where the motion stands, relative to the line that follows the base signal.
#[derive(Clone, Copy, Debug)]
pub(super) struct PhasePoint {
    /// Displacement, m.
    pub y: f64,
    /// Velocity, m/s.
    pub dy: f64,
    /// `e^{i phase}` of the base: cosine and sine.
    pub phasor: (f64, f64),
}

/// What is added to a start, and the phasor then.
#[derive(Clone, Copy, Debug)]
pub(super) struct Increment {
    pub y: f64,
    pub dy: f64,
    pub phasor: (f64, f64),
}

impl Increment {
    /// Where it leads.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn to(&self, start: &PhasePoint) -> PhasePoint {
        PhasePoint {
            y: start.y + self.y,
            dy: start.dy + self.dy,
            phasor: self.phasor,
        }
    }
}

/// The closed form at time `t`; what follows from that is computed when it is needed. By default it is that over no time.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Propagator {
    /// The key of the free motion: time, s.
    pub t: f64,
    /// The key of the response beside it, rad/s; NaN where it has not been computed.
    pub omega: f64,
    /// What the free motion adds: the sum of both, because a propagator is used many times and the same rounding error would add up.
    pub free: (Transition, Transition),
    response: Response,
    /// `omega t` from -2π to 2π.
    pub angle: Sum,
}

/// The product of two complex numbers.
#[cfg_attr(not(target_arch = "wasm32"), inline(always))]
pub(super) fn rotate(a: (f64, f64), b: (f64, f64)) -> (f64, f64) {
    (a.0 * b.0 - a.1 * b.1, a.0 * b.1 + a.1 * b.0)
}

/// Coefficients of cosine and sine over angle, in the square of the angle: with alternating sign `1/(2n)!` and `1/(2n + 1)!`. Up to 1/8 they
/// leave out less than 1e-19.
pub(super) const ROTATION: [[f64; 2]; 6] = [
    [1.0, 1.0],
    [-1.0 / 2.0, -1.0 / 6.0],
    [1.0 / 24.0, 1.0 / 120.0],
    [-1.0 / 720.0, -1.0 / 5040.0],
    [1.0 / 40_320.0, 1.0 / 362_880.0],
    [-1.0 / 3_628_800.0, -1.0 / 39_916_800.0],
];

/// Polynomials with these coefficients, at `x`.
#[cfg_attr(not(target_arch = "wasm32"), inline(always))]
pub(super) fn polynomials(coefficients: &[[f64; 2]], x: f64) -> [f64; 2] {
    let last = coefficients.len() - 1;
    (coefficients[..last].iter().rev()).fold(coefficients[last], |[a, b], c| [c[0] + x * a, c[1] + x * b])
}

/// `E Im(z K)` for the phasor `z`.
#[cfg_attr(not(target_arch = "wasm32"), inline(always))]
pub(super) fn forced(amplitude: f64, (cos, sin): (f64, f64), k: Complex64) -> f64 {
    amplitude * (k.re * sin + k.im * cos)
}

/// `omega t` from -2π to 2π.
#[cfg_attr(not(target_arch = "wasm32"), inline(always))]
pub(super) fn angle(omega: f64, t: f64) -> Sum {
    let (mut value, mut error) = product(omega, t);
    if value.abs() >= TAU {
        Phase(value, error) = Phase::default().advanced(omega, t);
    }
    Sum { value, error }
}

impl Propagator {
    /// Makes it the propagator over `t` seconds; `free` is what the free motion adds in that time.
    pub fn set(&mut self, t: f64, free: (Transition, Transition)) {
        (self.t, self.omega, self.free) = (t, f64::NAN, free);
    }

    /// Makes the response that of these coefficients' frequency.
    #[inline(never)]
    pub fn respond(&mut self, oscillator: &Oscillator, coefficients: &Coefficients) {
        let (head, tail) = &self.free;
        let free = Transition {
            xx: 1.0 + (head.xx + tail.xx),
            xv: head.xv + tail.xv,
            vx: head.vx + tail.vx,
            vv: 1.0 + (head.vv + tail.vv),
        };
        let decayed = match oscillator.regime {
            Regime::Oscillating { omega_d } => Complex64::new(free.xx - oscillator.delta * free.xv, omega_d * free.xv),
            Regime::Overdamped { .. } => Complex64::ZERO,
        };
        let omega = coefficients.omega;
        self.response = coefficients.forcing.response(self.t, &free, decayed);
        self.angle = angle(omega, self.t);
        self.omega = omega;
    }

    /// What the propagator adds to `start`.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn increment(&self, amplitude: f64, start: &PhasePoint) -> Increment {
        let (head, tail) = &self.free;
        let (y, dy) = head.of(start.y, start.dy);
        let (more_y, more_dy) = tail.of(start.y, start.dy);
        let Response { base, position, velocity } = &self.response;
        Increment {
            y: y + (more_y + forced(amplitude, start.phasor, *position)),
            dy: dy + (more_dy + forced(amplitude, start.phasor, *velocity)),
            phasor: rotate(start.phasor, (base.re, base.im)),
        }
    }
}

/// The motion near an instant, as a Taylor polynomial of degree `N + 1`.
pub(super) struct Nearby<const N: usize> {
    /// What has been added to the start until then.
    pub there: Increment,
    /// Velocity then, m/s.
    pub dy: f64,
    /// `y^(n)/n!` for n from 2 on.
    pub c: [f64; N],
    omega: f64,
}

impl<const N: usize> Nearby<N> {
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn new(coefficients: &Coefficients, amplitude: f64, start: &PhasePoint, there: &Increment) -> Self {
        let (f, df) = coefficients.forcing_at(there.phasor);
        let (f, df) = (amplitude * f, amplitude * df);
        let (y, dy) = (start.y + there.y, start.dy + there.dy);
        let [per_y, per_dy, per_f, per_df] = &coefficients.taylor;
        let mut c = [0.0; N];
        for (n, c) in c.iter_mut().enumerate() {
            *c = (per_y[n] * y + per_dy[n] * dy) + (per_f[n] * f + per_df[n] * df);
        }
        Self { there: *there, dy, c, omega: coefficients.omega }
    }

    /// What `h` seconds add to the displacement beyond uniform motion, m, and to the velocity, m/s.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn change(&self, h: f64) -> (f64, f64) {
        let c = &self.c;
        let (mut deviation, mut gained) = (0.0, 0.0);
        let square = h * h;
        for n in (0..N).step_by(2).rev() {
            let (c0, c1) = (c[n], c[n + 1]);
            let k = (n + 2) as f64;
            deviation = (c0 + h * c1) + square * deviation;
            gained = (k * c0 + h * ((k + 1.0) * c1)) + square * gained;
        }
        (square * deviation, h * gained)
    }

    /// The phasor of the base then.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn phasor(&self, h: f64) -> (f64, f64) {
        let angle = self.omega * h;
        let [cos, sin] = polynomials(&ROTATION[..N / 2 + 2], angle * angle);
        rotate(self.there.phasor, (cos, angle * sin))
    }

    /// What is added to the start, `h` seconds after that instant.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn at(&self, h: f64) -> Increment {
        let (deviation, gained) = self.change(h);
        Increment {
            y: self.there.y + (h * self.dy + deviation),
            dy: self.there.dy + gained,
            phasor: self.phasor(h),
        }
    }
}

// Coefficients of the motion at one frequency of the base.

/// Farthest distance of an instant from that of a propagator, in units of the fastest rate's time: Taylor polynomials of degree
/// 5 then leave out less than 1e-17.
pub(super) const PROPAGATOR_REACH: f64 = 1.0 / 2048.0;
/// Distance of the points of a grid, in units of the fastest rate's time: Taylor polynomials of degree 9 then leave out less than
/// 1e-18 halfway between two of them.
const SPACING: f64 = 0.0958;
/// Farthest distance of an instant from its point, in distances between points.
const REACH: f64 = 0.7;
/// Points of the grid: its span is a little more than half a period of the fastest rate.
pub(super) const GRID_POINTS: usize = 36;
/// Points in a stretch of a march.
pub(super) const STRETCH_POINTS: usize = 24;
/// Number of Taylor coefficients: of degrees 2 to 9.
pub(super) const TAYLOR_TERMS: usize = 8;

/// What follows from an oscillator and a frequency.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Coefficients {
    /// The key, rad/s; none before the first use.
    key: Option<f64>,
    pub omega: f64,
    pub forcing: Forcing,
    /// Farthest distance from a propagator's time, s.
    pub near: f64,
    /// Distance of the points of a grid, and farthest distance of an instant from its point, s.
    pub spacing: f64,
    pub reach: f64,
    /// Length of a stretch of a march, and of the whole grid, s.
    pub stretch: f64,
    pub span: f64,
    /// `y^(n)/n!` for n from 2 on, per `y`, `y'`, forcing `f` and `f'`, where `y'' + 2 delta y' + omega0² y = f`.
    pub taylor: [[f64; TAYLOR_TERMS]; 4],
}

impl Coefficients {
    /// Makes these the coefficients for `omega`, rad/s, 0 or above.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn prepare(&mut self, oscillator: &Oscillator, omega: f64) {
        if self.key != Some(omega) {
            *self = Self::new(oscillator, omega);
        }
    }

    #[inline(never)]
    fn new(oscillator: &Oscillator, omega: f64) -> Self {
        let Oscillator { delta, omega0_squared, fastest, .. } = *oscillator;
        // `f'' = -omega² f`: every derivative is a combination of the same four numbers.
        let (mut last, mut now) = ([0.0, 1.0, 0.0, 0.0], [-omega0_squared, -2.0 * delta, 1.0, 0.0]);
        let mut forcing = [1.0, 0.0];
        let mut factorial = 1.0;
        let mut taylor = [[0.0; TAYLOR_TERMS]; 4];
        for n in 0..TAYLOR_TERMS {
            factorial *= (n + 2) as f64;
            for (terms, c) in taylor.iter_mut().zip(now) {
                terms[n] = c / factorial;
            }
            forcing = [-omega * omega * forcing[1], forcing[0]];
            let mut next: [f64; 4] = core::array::from_fn(|i| -2.0 * delta * now[i] - omega0_squared * last[i]);
            next[2] += forcing[0];
            next[3] += forcing[1];
            (last, now) = (now, next);
        }
        // The grid stays the same while the frequency of the base changes little.
        let rate = if omega <= 1.25 * fastest {
            fastest
        } else {
            1.25 * leading_bits(omega, 2)
        };
        // Multiples of so few bits are exact.
        let spacing = leading_bits(SPACING / rate, 30);
        Self {
            key: Some(omega),
            omega,
            forcing: Forcing::new(oscillator, omega),
            near: PROPAGATOR_REACH / fastest.max(omega),
            spacing,
            reach: REACH * spacing,
            stretch: spacing * STRETCH_POINTS as f64,
            span: spacing * GRID_POINTS as f64,
            taylor,
        }
    }

    /// Forcing and its rate of change at a phasor, per unit amplitude.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn forcing_at(&self, (cos, sin): (f64, f64)) -> (f64, f64) {
        let strength = self.forcing.strength;
        (
            strength.re * sin + strength.im * cos,
            self.omega * (strength.re * cos - strength.im * sin),
        )
    }
}

/// `x` with only the first `bits` bits of its mantissa.
fn leading_bits(x: f64, bits: u32) -> f64 {
    f64::from_bits(x.to_bits() & (u64::MAX << (52 - bits)))
}

// Short steps: the propagator of a step that is short against every rate and repeated many times.
//
// The base moves as a polynomial or a sine. Either is its Taylor series, so that the response from rest is
// `sum b_n G_n(t)`: `b_n` the n-th derivative of the base displacement at the start, `G_n` the response to `t^n/n!`. The `G_n`
// belong to the step, not to the drive: a drive that changes at every sample costs two polynomials in `omega²`, and needs
// neither a sine nor a division. That holds for every damping ratio, at resonance and away from it.

/// Longest step, in units of the fastest rate's time: the first term left out is below 1e-17.
pub(super) const LONGEST_SERIES: f64 = 1.0 / 8.0;
/// Steps whose lengths differ by less, relative, are the same but for a correction of first order; the second order is below 1e-20.
pub(super) const SAME_STEP: f64 = 1e-9;
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
    response: StepResponse,
}

/// What a harmonic base adds in one step.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct StepResponse {
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
            response: StepResponse { omega: f64::NAN, ..StepResponse::default() },
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
        t * oscillator.fastest.max(omega.abs()) <= LONGEST_SERIES && t > 0.0
    }

    /// Whether it serves for a step that is longer by `late` seconds: masters compute equal steps with rounding errors.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn serves(&self, drive: &Drive, late: f64) -> bool {
        late == 0.0 || (!super::without("late step") && late.abs() <= SAME_STEP * self.t && drive.is_straight())
    }

    /// Forgets the step if it is not short against the drive.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn drive_changed(&mut self, drive: &Drive) {
        if drive.omega.abs() * self.t > LONGEST_SERIES {
            *self = Self::default();
        }
    }

    /// The response at a frequency, kept for the next step.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn response(&mut self, oscillator: &Oscillator, omega: f64) -> StepResponse {
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
        let response = StepResponse {
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
    pub fn increment(&self, response: &StepResponse, amplitude: f64, start: &PhasePoint) -> Increment {
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

// Grid
//
// Propagators over equal distances of time.
//
// Any instant within the grid is so near a point of it that a Taylor polynomial about that point gives the motion to rounding.
// No sine and no exponential is left to compute, however irregular the contacts.

/// The propagators over 1 to [`GRID_POINTS`] times the spacing, as far as they have been needed: of a regular motion, few are.
#[derive(Clone, Copy, Debug)]
pub(super) struct Grid([Propagator; GRID_POINTS]);

impl Default for Grid {
    fn default() -> Self {
        Self([Propagator::default(); GRID_POINTS])
    }
}

impl Grid {
    /// What the free motion adds over `n` times the spacing: what two shorter times add.
    fn free(&mut self, oscillator: &Oscillator, spacing: f64, n: usize) -> FreeIncrement {
        let t = n as f64 * spacing;
        if self.0[n - 1].t != t {
            let increment = if n == 1 || super::without("grid") {
                oscillator.increment(t)
            } else {
                let most = 1 << (n - 1).ilog2();
                let parts = [most, n - most].map(|n| self.free(oscillator, spacing, n));
                oscillator.composed(&parts[0], &parts[1])
            };
            self.0[n - 1].set(t, oscillator.split(&increment));
        }
        // The same bits whether it has just been computed or not.
        FreeIncrement::from(&self.0[n - 1].free)
    }

    /// What the free motion adds over `t` seconds: over the nearest point, if there is one, and the rest.
    pub fn increment(&mut self, oscillator: &Oscillator, spacing: f64, t: f64) -> FreeIncrement {
        match (t / spacing + 0.5) as usize {
            n @ 1..=GRID_POINTS if !super::without("grid") => {
                let rest = oscillator.increment(t - n as f64 * spacing);
                oscillator.composed(&self.free(oscillator, spacing, n), &rest)
            }
            _ => oscillator.increment(t),
        }
    }

    #[inline(never)]
    fn fill(&mut self, oscillator: &Oscillator, coefficients: &Coefficients, n: usize) {
        self.free(oscillator, coefficients.spacing, n);
        self.0[n - 1].respond(oscillator, coefficients);
    }

    /// The propagator over `n` times the spacing, n from 1 to [`GRID_POINTS`].
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn over(&mut self, oscillator: &Oscillator, coefficients: &Coefficients, n: usize) -> &Propagator {
        let propagator = &self.0[(n - 1) % GRID_POINTS];
        if super::without("grid") {
            self.0[n - 1].t = f64::NAN;
            self.fill(oscillator, coefficients, n);
        } else if propagator.t != n as f64 * coefficients.spacing || propagator.omega != coefficients.omega {
            self.fill(oscillator, coefficients, n);
        }
        &self.0[(n - 1) % GRID_POINTS]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base_motion::BaseMotion;
    use crate::segment::Segment;

    #[test]
    fn a_short_step_agrees_with_the_closed_form_for_every_drive() {
        for zeta in [0.0, 0.006, 0.5, 1.0, 3.0] {
            let oscillator = Oscillator::new(1.0, 1.0, 2.0 * zeta);
            let t = LONGEST_SERIES / oscillator.fastest;
            let mut step = ShortStep::from(t);
            for omega in [0.0, 0.3, -0.3, 1.0, oscillator.fastest] {
                let drive = Drive { signal: [0.3, -0.2, 0.1, 0.7], ..Drive::harmonic(0.4, omega) };
                let base = BaseMotion { drive, ..BaseMotion::default() };
                let [x, v, ..] = Segment::new(&oscillator, base, (0.7, -0.4)).derivatives(t);
                let start = PhasePoint { y: 0.7 - 0.3, dy: -0.4 + 0.2, phasor: (1.0, 0.0) };
                let response = step.response(&oscillator, omega);
                let mut increment = step.increment(&response, drive.amplitude, &start);
                increment.bend(drive.signal, &step);
                let (got, dgot) = (0.7 + increment.y - 0.2 * t, -0.4 + increment.dy);
                assert!((got - x).abs() < 2e-15, "{zeta} {omega}: {got} {x}");
                assert!(
                    (dgot - v).abs() < 2e-15 * oscillator.fastest,
                    "{zeta} {omega}: {dgot} {v}"
                );
            }
        }
    }
}
