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
//! so that `e^{i omega t}` and `e^{lambda t}` need not be computed again while flights stay alike. From the anchor on the
//! motion is its Taylor polynomial, and the root the polynomial's reversed series (P. Henrici, "Applied and Computational
//! Complex Analysis" I, Wiley 1974, section 1.7).
//!
//! All this is for light damping, away from an undamped resonance, a harmonic or held base and displacements that are
//! not large against the cavity. What lies outside is followed by [`crate::flight`], which is slower and knows no limits.

use crate::base_motion::{Drive, Phase, sincos_of_product};
use crate::lane::{Lane, Lanes};
use crate::oscillator::{Oscillator, Regime};
use crate::plant::UNRESOLVED;
use core::array::from_fn;
use num_complex::Complex64;
use serde::{Deserialize, Serialize};

/// Farthest arrival from its anchor, in units of the fastest rate's time: what the series leave out is of the fifth order
/// in this, below 1e-17.
const NEAR: f64 = 1.0 / 4096.0;
/// Largest displacements, in half-widths: the digits of `w` are those of `q1`.
const WIDEST: f64 = 64.0;
/// Largest damping ratio.
const LIGHT_DAMPING: f64 = 0.5;
/// Largest steady amplitude, in amplitudes of the base: near an undamped resonance a large steady motion and a large free
/// one would cancel, and their rounding be left.
const STEEPEST: f64 = 1024.0;
/// Degree of the Taylor polynomial about the anchor.
const DEGREE: usize = 5;

type Pair<T> = (T, T);

/// What follows from rig and drive.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Wave<T> {
    /// Half-width of the cavity, m.
    pub half_width: T,
    /// Decay rate, 1/s.
    delta: T,
    omega_d: T,
    inverse_omega_d: T,
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
    /// `lambda^n/n!`, n from 2 on.
    free: [Pair<T>; DEGREE - 1],
    /// `±omega^n/n!`, n from 2 on, with the sign that the derivative brings.
    forced: [T; DEGREE - 1],
}

/// A time at which the closed form has been worked out; that is no time at all by default.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Anchor<T> {
    /// Seconds since the start of a flight.
    pub t: T,
    /// `omega t` reduced to one turn, rad, and what rounding has kept out of it.
    pub angle: Pair<T>,
    /// `e^{i omega t}`.
    pub turned: Pair<T>,
    /// `e^{lambda t}`.
    pub decayed: Pair<T>,
}

impl Default for Anchor<f64> {
    fn default() -> Self {
        Self {
            t: 0.0,
            angle: (0.0, 0.0),
            turned: (1.0, 0.0),
            decayed: (1.0, 0.0),
        }
    }
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

/// The end of a crossing, just before the impact.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Arrival<T> {
    /// Seconds after the anchor.
    pub beyond: T,
    /// Position of the primary mass, m.
    pub x: T,
    /// Its velocity, m/s.
    pub v: T,
    /// `e^{i phase}` of the base.
    pub turn: Pair<T>,
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

#[inline(always)]
fn times<T: Lane>(a: Pair<T>, b: Pair<T>) -> Pair<T> {
    (a.0 * b.0 - a.1 * b.1, a.0 * b.1 + a.1 * b.0)
}

impl Wave<f64> {
    /// Coefficients for an oscillator in a cavity of this half-width (m), not driven; `None` where damping is not light.
    pub fn new(oscillator: &Oscillator, half_width: f64) -> Option<Self> {
        let Oscillator {
            delta,
            omega0_squared,
            omega0,
            ..
        } = *oscillator;
        let Regime::Oscillating { omega_d } = oscillator.regime else {
            return None;
        };
        if delta >= LIGHT_DAMPING * omega0 {
            return None;
        }
        let lambda = Complex64::new(-delta, omega_d);
        let mut free = [(0.0, 0.0); DEGREE - 1];
        let mut power = lambda;
        for n in 2..=DEGREE {
            power = power * lambda * (1.0 / n as f64);
            free[n - 2] = (power.re, power.im);
        }
        let within = WIDEST * half_width;
        Some(Self {
            half_width,
            delta,
            omega_d,
            inverse_omega_d: 1.0 / omega_d,
            omega0_squared,
            omega: 0.0,
            steady: (0.0, 0.0),
            reach: 0.0,
            speed: 0.0,
            offset: 0.0,
            widest: (within * within) * omega0_squared,
            near: NEAR / omega0,
            restless: 0.0,
            free,
            forced: [0.0; DEGREE - 1],
        })
    }

    /// Takes over a drive; false where it is none of those that this way is for.
    pub fn take(&mut self, drive: &Drive) -> bool {
        let [offset, slopes @ ..] = drive.signal;
        let (omega, amplitude) = (drive.omega, drive.amplitude);
        let (delta, omega0_squared) = (self.delta, self.omega0_squared);
        let omega0 = libm::sqrt(omega0_squared);
        let within = WIDEST * self.half_width;
        self.offset = offset;
        self.omega = omega;
        self.steady = (0.0, 0.0);
        self.reach = 0.0;
        if amplitude != 0.0 {
            let (detuning, damping) = ((omega0 - omega) * (omega0 + omega), 2.0 * delta * omega);
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
        let square = omega * omega;
        self.forced = [
            -square * (1.0 / 2.0),
            -square * omega * (1.0 / 6.0),
            square * square * (1.0 / 24.0),
            square * square * omega * (1.0 / 120.0),
        ];
        self.near = NEAR / omega0.max(omega);
        // Displacements and velocities are at most so large while the particle crosses.
        let velocity = within * (omega0 + 2.0 * omega);
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

    /// The closed form at `t` seconds.
    pub fn anchor(&self, t: f64) -> Anchor<f64> {
        let (sin, cos) = sincos_of_product((self.omega_d, 0.0), t);
        let decay = libm::exp(-self.delta * t);
        self.turned(&Anchor {
            t,
            decayed: (decay * cos, decay * sin),
            ..Anchor::default()
        })
    }

    /// The next anchor for a crossing that is not near the last one.
    #[cold]
    pub(crate) fn next_anchor(
        &self,
        start: &Origin<f64>,
        free: &Free<f64>,
        anchor: &Anchor<f64>,
        beyond: f64,
    ) -> Anchor<f64> {
        let speed = start.particle.abs();
        let distance = self.half_width - Wave::ahead(start) * start.w;
        let primary = self.speed + libm::sqrt(free.speed_squared);
        let (soonest, latest) = (distance / (speed + primary), distance / (speed - primary));
        let guess = anchor.t + beyond;
        // Far from the anchor the series may lead anywhere.
        let possible = anchor.t > 0.0 && guess >= soonest && guess <= latest;
        self.anchor(if possible { guess } else { distance / speed })
    }

    /// The same instant at the frequency that this wave has.
    pub fn turned(&self, anchor: &Anchor<f64>) -> Anchor<f64> {
        let (sin, cos) = sincos_of_product((self.omega, 0.0), anchor.t);
        Anchor {
            angle: Phase::default().advanced(self.omega, anchor.t).parts(),
            turned: (cos, sin),
            ..*anchor
        }
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

    /// The arrival at the wall ahead, and whether it is near enough to the anchor for its digits to be trusted. If not,
    /// `beyond` is still a better guess.
    #[inline(always)]
    pub fn arrival(
        &self,
        start: &Origin<T>,
        free: &Free<T>,
        anchor: &Anchor<T>,
    ) -> (Arrival<T>, T::Mask) {
        let n = T::splat;
        // `y = Im(A e^{lambda t})`.
        let at_start = (
            (free.dy + self.delta * free.y) * self.inverse_omega_d,
            free.y,
        );
        let a = times(at_start, anchor.decayed);
        let turn = times(start.turn, anchor.turned);
        let s = times(self.steady, turn);
        let x = self.offset + a.1 + s.1;
        let v = self.omega_d * a.0 - self.delta * a.1 + self.omega * s.0;
        let term = |n: usize, s: T| {
            let (re, im) = self.free[n - 2];
            re * a.1 + im * a.0 + self.forced[n - 2] * s
        };
        let (c2, c3, c4, c5) = (term(2, s.1), term(3, s.0), term(4, s.1), term(5, s.0));

        let w = start.w + ((x - start.x) - start.particle * anchor.t);
        let target = Self::ahead(start) * self.half_width;
        let slowness = (v - start.particle).inverse();
        let y = (target - w) * slowness;
        let (a2, a3, a4) = (c2 * slowness, c3 * slowness, c4 * slowness);
        let (bend, a22, y2) = (a2 * y, a2 * a2, y * y);
        let third = (a22 + a22) - a3;
        let fourth = n(5.0) * (a2 * (a3 - a22)) - a4;
        let h = y * ((n(1.0) - bend) + y2 * (third + y * fourth));

        let h2 = h * h;
        let quickened =
            h * ((n(2.0) * c2 + h * (n(3.0) * c3)) + h2 * (n(4.0) * c4 + h * (n(5.0) * c5)));
        let angle = self.omega * h;
        let angle2 = angle * angle;
        let sin = angle - angle * (angle2 * n(1.0 / 6.0));
        let cos = n(1.0) - angle2 * (n(0.5) - angle2 * n(1.0 / 24.0));
        let arrival = Arrival {
            beyond: h,
            // At the wall the primary mass is where the particle is, and that flies straight on.
            x: ((start.x - start.w) + start.particle * anchor.t) + (target + start.particle * h),
            v: v + quickened,
            turn: times(turn, (cos, sin)),
        };
        // Far from the anchor, or where the approach is slow and bent, the reversed series means nothing.
        let near = T::both(y.abs().below(self.near), bend.abs().below(T::splat(NEAR)));
        (arrival, near)
    }

    /// The start moved on by the anchor's time, as long as no wall is met; the particle flies straight on.
    #[inline(always)]
    pub fn stride(&self, start: &Origin<T>, anchor: &Anchor<T>) -> Origin<T> {
        let free = self.free_motion(start);
        let at_start = (
            (free.dy + self.delta * free.y) * self.inverse_omega_d,
            free.y,
        );
        let a = times(at_start, anchor.decayed);
        let turn = times(start.turn, anchor.turned);
        let s = times(self.steady, turn);
        let x = self.offset + a.1 + s.1;
        Origin {
            x,
            v: self.omega_d * a.0 - self.delta * a.1 + self.omega * s.0,
            w: start.w + ((x - start.x) - start.particle * anchor.t),
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

impl<const N: usize> Wave<Lanes<N>> {
    /// Several waves abreast.
    pub(crate) fn abreast(waves: [&Wave<f64>; N]) -> Self {
        let all = |f: fn(&Wave<f64>) -> f64| Lanes(waves.map(f));
        Self {
            half_width: all(|wave| wave.half_width),
            delta: all(|wave| wave.delta),
            omega_d: all(|wave| wave.omega_d),
            inverse_omega_d: all(|wave| wave.inverse_omega_d),
            omega0_squared: all(|wave| wave.omega0_squared),
            omega: all(|wave| wave.omega),
            steady: (all(|wave| wave.steady.0), all(|wave| wave.steady.1)),
            reach: all(|wave| wave.reach),
            speed: all(|wave| wave.speed),
            offset: all(|wave| wave.offset),
            widest: all(|wave| wave.widest),
            near: all(|wave| wave.near),
            restless: all(|wave| wave.restless),
            free: from_fn(|n| {
                (
                    Lanes(waves.map(|wave| wave.free[n].0)),
                    Lanes(waves.map(|wave| wave.free[n].1)),
                )
            }),
            forced: from_fn(|n| Lanes(waves.map(|wave| wave.forced[n]))),
        }
    }
}

impl<const N: usize> Anchor<Lanes<N>> {
    /// Several anchors abreast.
    pub(crate) fn abreast(anchors: [&Anchor<f64>; N]) -> Self {
        let all = |f: fn(&Anchor<f64>) -> f64| Lanes(anchors.map(f));
        Self {
            t: all(|anchor| anchor.t),
            angle: (all(|anchor| anchor.angle.0), all(|anchor| anchor.angle.1)),
            turned: (all(|anchor| anchor.turned.0), all(|anchor| anchor.turned.1)),
            decayed: (
                all(|anchor| anchor.decayed.0),
                all(|anchor| anchor.decayed.1),
            ),
        }
    }

    /// One of them.
    pub(crate) fn of_lane(&self, lane: usize) -> Anchor<f64> {
        Anchor {
            t: self.t.0[lane],
            angle: (self.angle.0.0[lane], self.angle.1.0[lane]),
            turned: (self.turned.0.0[lane], self.turned.1.0[lane]),
            decayed: (self.decayed.0.0[lane], self.decayed.1.0[lane]),
        }
    }

    /// Replaces one of them.
    pub(crate) fn put(&mut self, lane: usize, anchor: &Anchor<f64>) {
        self.t.0[lane] = anchor.t;
        self.angle.0.0[lane] = anchor.angle.0;
        self.angle.1.0[lane] = anchor.angle.1;
        self.turned.0.0[lane] = anchor.turned.0;
        self.turned.1.0[lane] = anchor.turned.1;
        self.decayed.0.0[lane] = anchor.decayed.0;
        self.decayed.1.0[lane] = anchor.decayed.1;
    }
}

impl<const N: usize> Origin<Lanes<N>> {
    /// Several states abreast.
    pub(crate) fn abreast(states: [&Origin<f64>; N]) -> Self {
        let all = |f: fn(&Origin<f64>) -> f64| Lanes(states.map(f));
        Self {
            x: all(|state| state.x),
            v: all(|state| state.v),
            w: all(|state| state.w),
            particle: all(|state| state.particle),
            turn: (all(|state| state.turn.0), all(|state| state.turn.1)),
        }
    }

    /// One of them.
    pub(crate) fn of_lane(&self, lane: usize) -> Origin<f64> {
        Origin {
            x: self.x.0[lane],
            v: self.v.0[lane],
            w: self.w.0[lane],
            particle: self.particle.0[lane],
            turn: (self.turn.0.0[lane], self.turn.1.0[lane]),
        }
    }
}
