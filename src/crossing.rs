//! The flight that most flights are: from somewhere in the cavity straight to the wall ahead, never turning round.
//!
//! While the particle is faster than the primary mass can ever be, `w'` keeps its sign: the wall ahead is met once, and
//! the other one is left behind. That is the certificate, and it costs a dozen operations. The bound on the speed of the
//! primary mass is the energy of its free motion, which never grows, and the amplitude of the steady one:
//!
//! ```text
//! q1 = u0 + y + Im S,   y'' + 2 delta y' + omega0² y = 0,   S = H E e^{i (omega t + phase)}
//! |q1'| <= sqrt(y'² + omega0² y²) + omega |H E|  <  |q2'|
//! ```
//!
//! The instant is found from an *anchor*: a time near it (the last flight's) at which the closed form has been worked out,
//! so that `e^{i omega t}` and the free motion's transition need not be computed again while flights stay alike. From the anchor on the
//! motion is its Taylor polynomial, and the root the polynomial's reversed series (P. Henrici, "Applied and Computational
//! Complex Analysis" I, Wiley 1974, section 1.7).
//!
//! All this is away from an undamped resonance, for a harmonic or held base and displacements that are not large against
//! the cavity. What lies outside is followed by [`crate::flight`], which is slower and knows no limits.

#[cfg(feature = "batch")]
mod lanes;
mod near;

use crate::base_motion::{Drive, product, sincos_of_product};
use crate::lane::Lane;
use crate::oscillator::Oscillator;
use crate::plant::UNRESOLVED;
pub use near::{Anchor, Arrival};
use serde::{Deserialize, Serialize};

/// Farthest arrival from its anchor, in units of the fastest rate's time: what the series leave out is of the fifth order
/// in this, below 1e-17.
const NEAR: f64 = 1.0 / 4096.0;
/// Largest displacements, in half-widths: the digits of `w` are those of `q1`.
const WIDEST: f64 = 64.0;
/// Largest steady amplitude, in amplitudes of the base: near an undamped resonance a large steady motion and a large free
/// one would cancel, and their rounding be left.
const STEEPEST: f64 = 1024.0;
/// Degree of the Taylor polynomial about the anchor.
const DEGREE: usize = 5;

type Pair<T> = (T, T);

/// What follows from rig and drive.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wave<T> {
    /// Half-width of the cavity, m.
    pub half_width: T,
    /// Decay rate, 1/s.
    delta: T,
    /// Natural frequency, 1/s.
    omega0: T,
    /// The fastest rate of the free motion, 1/s.
    fastest: T,
    /// Farthest arrival from its anchor without a drive, s.
    nearest: T,
    /// Natural frequency squared, 1/s².
    pub omega0_squared: T,
    /// Driving frequency, rad/s.
    pub omega: T,
    /// `H E`: steady amplitude, m, real and imaginary part.
    steady: Pair<T>,
    /// `|H E|`, m.
    reach: T,
    /// `omega |H E|`, m/s.
    pub speed: T,
    /// Where the base is held, m.
    pub offset: T,
    /// Largest speed of the free motion that is accepted, squared, (m/s)².
    widest: T,
    /// Farthest arrival from its anchor, s.
    near: T,
    /// A rebound faster than this is no rest, squared, (m/s)².
    pub restless: T,
    /// `y^(n)/n!` of the free motion per `y` and per `y'`, n from 2 on.
    free: [Pair<T>; DEGREE - 1],
    /// `±omega^n/n!`, n from 2 on, with the sign that the derivative brings.
    forced: [T; DEGREE - 1],
}

/// The start of a flight.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Origin<T> {
    /// Position of the primary mass, m.
    pub x: T,
    /// Its velocity, m/s.
    pub v: T,
    /// Relative displacement `w = q1 - q2`, m, carried itself: in a narrow gap the difference of two large displacements
    /// would have lost it.
    pub w: T,
    /// Velocity of the particle, m/s.
    pub particle: T,
    /// `e^{i phase}` of the base.
    pub turn: Pair<T>,
}

impl<T: Lane> Origin<T> {
    /// Relative velocity `w'`.
    #[inline(always)]
    pub fn relative_velocity(&self) -> T {
        self.v - self.particle
    }

    /// Position and velocity of the primary mass.
    pub fn primary(&self) -> (T, T) {
        (self.x, self.v)
    }
}

/// Where the free motion stands: displacement and velocity.
#[derive(Clone, Copy, Debug)]
pub struct Free<T> {
    /// Displacement less that of the held base and of the steady motion, m.
    pub y: T,
    /// Its velocity, m/s.
    pub dy: T,
    /// `dy² + omega0² y²`, (m/s)².
    pub speed_squared: T,
}

/// The product of two complex numbers.
#[inline(always)]
pub(crate) fn times<T: Lane>(a: Pair<T>, b: Pair<T>) -> Pair<T> {
    (a.0 * b.0 - a.1 * b.1, a.0 * b.1 + a.1 * b.0)
}

impl Wave<f64> {
    /// Coefficients for an oscillator in a cavity of this half-width (m), not driven.
    pub fn new(oscillator: &Oscillator, half_width: f64) -> Self {
        let Oscillator {
            delta,
            omega0,
            omega0_squared,
            fastest,
            ..
        } = *oscillator;
        let mut free = [(0.0, 0.0); DEGREE - 1];
        let mut power = (0.0, 1.0);
        for (free, n) in free.iter_mut().zip(2..) {
            let n = f64::from(n);
            // `y'' = -omega0² y - 2 delta y'`, once more at every order.
            power = (
                -omega0_squared * power.1 / n,
                (power.0 - 2.0 * delta * power.1) / n,
            );
            *free = power;
        }
        let within = WIDEST * half_width;
        Self {
            half_width,
            delta,
            omega0,
            fastest,
            nearest: NEAR / fastest,
            omega0_squared,
            omega: 0.0,
            steady: (0.0, 0.0),
            reach: 0.0,
            speed: 0.0,
            offset: 0.0,
            widest: (within * within) * omega0_squared,
            near: NEAR / fastest,
            restless: 0.0,
            free,
            forced: [0.0; DEGREE - 1],
        }
    }

    /// Takes over a drive; false where it is none of those that this way is for.
    pub fn take(&mut self, drive: &Drive) -> bool {
        let [offset, slopes @ ..] = drive.signal;
        let (omega, amplitude) = (drive.omega, drive.amplitude);
        let (delta, omega0_squared) = (self.delta, self.omega0_squared);
        let within = WIDEST * self.half_width;
        self.offset = offset;
        self.omega = omega;
        self.steady = (0.0, 0.0);
        self.reach = 0.0;
        let (square, square_missed) = product(omega, omega);
        if amplitude != 0.0 {
            // With all the digits that `omega0²` has, however near the resonance.
            let detuning = (omega0_squared - square) - square_missed;
            let damping = 2.0 * delta * omega;
            let scale = amplitude / (detuning * detuning + damping * damping);
            // `H E = E (omega0² + i damping)/(detuning + i damping)`.
            self.steady = (
                scale * (omega0_squared * detuning + damping * damping),
                scale * (damping * (detuning - omega0_squared)),
            );
            let (re, im) = self.steady;
            self.reach = libm::sqrt(re * re + im * im);
        }
        self.speed = omega * self.reach;
        self.forced = [
            -square * (1.0 / 2.0),
            -square * omega * (1.0 / 6.0),
            square * square * (1.0 / 24.0),
            square * square * omega * (1.0 / 120.0),
        ];
        self.near = if omega > self.fastest {
            NEAR / omega
        } else {
            self.nearest
        };
        // Displacements and velocities are at most so large while the particle crosses.
        let velocity = within * (self.omega0 + 2.0 * omega);
        let acceleration = omega0_squared * (4.0 * within) + 2.0 * delta * velocity;
        self.restless = 2.0 * UNRESOLVED * self.half_width * acceleration;
        // False also for an undamped resonance, where the reach is not a number.
        slopes == [0.0; 3]
            && omega >= 0.0
            && offset.abs() <= within
            && amplitude.abs() <= within
            && self.reach <= within
            && self.reach <= STEEPEST * amplitude.abs()
    }

    /// Whether both walls are certainly out of reach for `t` seconds: the first bound of [`Self::clear`] alone, without
    /// working out for how long it holds.
    pub fn is_clear(&self, start: &Origin<f64>, free: &Free<f64>, t: f64) -> bool {
        // Displacements are within so many half-widths: see below.
        let rounding = 1e-12 * (3.0 * WIDEST + 1.0) * self.half_width;
        let room = |s: f64| self.half_width - s * start.w - rounding + s * start.particle * t;
        let room = room(1.0).min(room(-1.0)) - self.speed * t;
        room > 0.0
            && free.speed_squared * (t * t) < room * room * (1.0 - 1e-9)
            && free.speed_squared < self.widest
    }

    /// The state `t` seconds after the start, as long as no wall is met.
    pub fn after(&self, oscillator: &Oscillator, start: &Origin<f64>, t: f64) -> Origin<f64> {
        let free = self.free_motion(start);
        let (sin, cos) = sincos_of_product((self.omega, 0.0), t);
        let turn = times(start.turn, (cos, sin));
        self.state(start, oscillator.transition(t).of(free.y, free.dy), turn, t)
    }
}

impl<T: Lane> Wave<T> {
    /// The free motion at the start of a flight.
    #[inline(always)]
    pub fn free_motion(&self, start: &Origin<T>) -> Free<T> {
        let steady = times(self.steady, start.turn);
        let y = start.x - self.offset - steady.1;
        let dy = start.v - self.omega * steady.0;
        Free {
            y,
            dy,
            speed_squared: dy * dy + self.omega0_squared * (y * y),
        }
    }

    /// Whether the particle certainly flies on to the wall ahead without turning round.
    #[inline(always)]
    pub fn certainly_crosses(&self, start: &Origin<T>, free: &Free<T>) -> T::Mask {
        let spare = start.particle.abs() - self.speed;
        // The factor covers the rounding of this very bound, and keeps the approach from being endlessly slow.
        let bound = free.speed_squared * T::splat(1.0 + 1e-3);
        T::both(
            T::splat(0.0).below(spare),
            T::both(
                bound.below(spare * spare),
                free.speed_squared.below(self.widest),
            ),
        )
    }

    /// The wall ahead: +1 or -1 as it is touched at `w = +b` or `-b`.
    #[inline(always)]
    pub fn ahead(start: &Origin<T>) -> T {
        -start.particle.sign()
    }

    /// The state `t` seconds after the start, where free motion and `e^{i phase}` are those; the particle flies straight on.
    #[inline(always)]
    pub fn state(&self, start: &Origin<T>, (y, dy): Pair<T>, turn: Pair<T>, t: T) -> Origin<T> {
        let s = times(self.steady, turn);
        let x = self.offset + y + s.1;
        Origin {
            x,
            v: dy + self.omega * s.0,
            w: start.w + ((x - start.x) - start.particle * t),
            particle: start.particle,
            turn,
        }
    }
}

impl Wave<f64> {
    /// How long both walls are certainly out of reach, s; infinite where they can never be reached.
    ///
    /// Two bounds, each for each wall: the particle cannot close in faster than at the largest speeds of both, and the
    /// primary mass cannot be farther out than at the sum of its amplitudes.
    pub fn clear(&self, start: &Origin<f64>, free: &Free<f64>) -> f64 {
        let speed = libm::sqrt(free.speed_squared);
        let omega0_squared = self.omega0_squared;
        let reach = libm::sqrt(free.speed_squared / omega0_squared) + self.reach;
        let rounding = 1e-12 * (self.half_width + reach + self.offset.abs());
        let until = |s: f64| {
            let gap = self.half_width - s * start.w - rounding;
            let closing = speed + self.speed - s * start.particle;
            let by_speed = if closing <= 0.0 {
                f64::INFINITY
            } else {
                gap.max(0.0) / closing
            };
            let particle = start.x - start.w;
            let room = self.half_width - rounding - reach - s * (self.offset - particle);
            let approach = -s * start.particle;
            let by_room = if room <= 0.0 {
                0.0
            } else if approach <= 0.0 {
                f64::INFINITY
            } else {
                room / approach
            };
            by_speed.max(by_room)
        };
        until(1.0).min(until(-1.0)) * (1.0 - 1e-9)
    }
}
