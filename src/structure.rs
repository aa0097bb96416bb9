//! A structure of several sections as what carries the cavity: sums over the sections, and sums of their bounds.
//!
//! Between events every section has its closed form. The displacement at the cavity is `sum a x + b v`, and `v = x' - d u - k0 f`. A constant
//! force `f` (friction, gravity) shifts every section to its equilibrium. The state is carried in the sections of the free structure. While the
//! particle is at rest on it, the sections of structure and particle tell how that state changes.

use core::ops::Index;

use num_complex::Complex64;

use crate::arithmetic::Sums;
use crate::base_motion::{BaseMotion, Drive, shift};
use crate::clearance::{Gap, Look};
use crate::flight::{FlightEnd, Sticking};
use crate::forcing::Forcing;
use crate::host::{Host, InvalidHost, Row, Section, mobility};
use crate::oscillator::{Oscillator, Regime, is_apart};
use crate::parameters::{InvalidValue, Parameters};
use crate::plant::Plant;
use crate::primary::Primary;
use crate::segment::{Derivatives, Instant, Motion, SERIES_DEGREE, SERIES_REACH, Series, phasor};
use crate::system::{Masses, Moving, System};

/// A structure with the state of its sections.
#[derive(Clone, Debug)]
pub struct Structure {
    host: Host,
    /// The sections of structure and particle as one.
    stuck: Vec<Section>,
    /// `(x, v)` of these from those of the free structure, `2n` by `2n`, row by row, and the part of the drive; and back.
    to_stuck: (Vec<f64>, Vec<f64>),
    to_free: (Vec<f64>, Vec<f64>),
    /// `S`, 1/kg.
    mobility: f64,
    /// `(x, v)` of every section.
    state: Vec<Sums>,
    /// What is left of a start with a given velocity once the drive has a value: `(x, v)` per unit of the drive.
    held: Vec<[f64; 2]>,
}

// Motion between events

/// The motion of one section: `X = x - x_eq f`, which no constant force moves.
#[derive(Clone, Copy, Debug)]
struct Part {
    oscillator: Oscillator,
    row: [f64; 2],
    /// `c` and `d`.
    drive: [f64; 2],
    forcing: Forcing,
    /// The polynomial that follows the signal, or, where the rates are far apart, the forcing by the signal.
    polynomial: [f64; 4],
    is_apart: bool,
    x0: f64,
    v0: f64,
    /// Position and velocity of its free motion beside the steady response and the polynomial, where these exist.
    free: Option<[f64; 2]>,
    /// Bounds of the third derivative of the output's part: by the steady response and the polynomial, and what the forcing adds per second.
    steady_jerk: f64,
    forced_jerk: f64,
}

/// What the sections from one on contribute by their free motions, which decay: value, velocity and acceleration now, and a bound of the value from
/// now on; and a bound of the third derivative of all other parts, with what is added to it per second.
#[derive(Clone, Copy, Debug, Default)]
struct Split {
    now: [f64; 3],
    amplitude: f64,
    jerk: [f64; 2],
}

/// The sum is split after the first section, the first two and the first four.
const SPLITS: usize = 3;

/// A section at an instant: position and velocity, and those of its free motion.
#[derive(Clone, Copy, Debug, Default)]
struct SectionState {
    x: f64,
    v: f64,
    y: f64,
    dy: f64,
}

/// A sum of sections under one drive.
#[derive(Clone, Debug)]
pub struct SumOfSections {
    parts: Vec<Part>,
    base: BaseMotion,
    /// `E e^{i phase}` at the start and the frequency, 0 or above.
    phasor: Complex64,
    omega: f64,
    /// `-sum b d`: what the output contains of the drive itself.
    feed: f64,
    fastest: f64,
    /// Bounds of what forces the third to fifth derivatives: per second, and at once.
    forced: [[f64; 2]; 3],
    /// Whether the bounds of the fourth and fifth derivatives are needed.
    all_bounds: bool,
    start: SumLook,
}

/// Position, its first six derivatives, and bounds of the free motion's third to fifth derivatives from now on.
#[derive(Clone, Copy, Debug, Default)]
pub struct SumLook {
    derivatives: Derivatives,
    ceilings: [f64; 3],
    splits: [Split; SPLITS],
}

impl Index<usize> for SumLook {
    type Output = f64;

    fn index(&self, n: usize) -> &f64 {
        &self.derivatives[n]
    }
}

impl Look for SumLook {}

/// The drive and its first six derivatives at an instant.
type DriveDerivatives = [f64; 7];

impl Part {
    fn new(section: &Section, state: [f64; 2], force: f64, drive: &Drive, omega: f64, (u, _): (f64, f64)) -> Self {
        let Section { oscillator, drive: [c, d], kick: [k0, k1], cavity } = *section;
        let Oscillator { delta, omega0_squared, .. } = oscillator;
        let [u0, u1, u2, u3] = drive.signal;
        let forcing = [c * u0 + d * u1, c * u1 + 2.0 * d * u2, c * u2 + 3.0 * d * u3, c * u3];
        let is_apart = is_apart(&oscillator);
        let polynomial = if is_apart {
            forcing
        } else {
            follower(&oscillator, forcing)
        };
        let forcing = Forcing::with_strength(&oscillator, omega, Complex64::new(c, d * omega));
        Self {
            polynomial,
            is_apart,
            free: None,
            steady_jerk: 0.0,
            forced_jerk: 0.0,
            forcing,
            oscillator,
            row: cavity,
            drive: [c, d],
            x0: state[0] - (k1 + 2.0 * delta * k0) / omega0_squared * force,
            v0: state[1] + d * u + k0 * force,
        }
    }

    /// Tells the free motion from the rest, where the drive has the phasor `phasor` at the start.
    fn split(&mut self, phasor: Complex64, omega: f64, signal: &[f64; 4]) {
        let ([a, b], [c, d]) = (self.row.map(f64::abs), self.drive.map(f64::abs));
        let size = phasor.l1_norm() * omega * omega * omega;
        let (harmonic, cubic) = ((c + d * omega) * size, 6.0 * signal[3].abs());
        self.forced_jerk = self.oscillator.reach * (a * (harmonic + c * cubic) + b * harmonic * omega);
        let [p0, p1, _, p3] = self.polynomial;
        self.free = self.forcing.steady().filter(|_| !self.is_apart).map(|steady| {
            let response = phasor * steady;
            self.steady_jerk = (a + b * omega) * response.l1_norm() * omega * omega * omega + 6.0 * a * p3.abs();
            [self.x0 - p0 - response.im, self.v0 - p1 - omega * response.re]
        });
    }

    fn at_start(&self) -> SectionState {
        let [y, dy] = self.free.unwrap_or_default();
        SectionState { x: self.x0, v: self.v0, y, dy }
    }

    /// Its state after `t` seconds; `turned` is `e^{i omega t}`.
    #[inline]
    fn closed_form(&self, t: f64, phasor: Complex64, turned: Complex64) -> SectionState {
        let [p0, p1, p2, p3] = self.polynomial;
        let (free, decayed) = self.oscillator.flow(t);
        let (mut x, mut v);
        if self.is_apart {
            (x, v) = free.of(self.x0, self.v0);
            let [once, twice, thrice, last] = pushed(&self.oscillator, t);
            x += p0 * once + p1 * twice + 2.0 * p2 * thrice + 6.0 * p3 * last;
            v += p0 * free.xv + p1 * once + 2.0 * p2 * twice + 6.0 * p3 * thrice;
        } else {
            let (y, dy) = free.of(self.x0 - p0, self.v0 - p1);
            x = p0 + t * (p1 + t * (p2 + t * p3)) + y;
            v = p1 + t * (2.0 * p2 + t * 3.0 * p3) + dy;
        }
        if phasor != Complex64::ZERO {
            let response = self.forcing.response_to(turned, t, &free, decayed);
            x += (phasor * response.position).im;
            v += (phasor * response.velocity).im;
        }
        let (y, dy) = self.free.map_or((0.0, 0.0), |[y, dy]| free.of(y, dy));
        SectionState { x, v, y, dy }
    }

    /// Position and its first seven derivatives.
    #[inline]
    fn derivatives(&self, &SectionState { x, v, .. }: &SectionState, u: &DriveDerivatives) -> [f64; 8] {
        let Oscillator { delta, omega0_squared, .. } = self.oscillator;
        let [c, d] = self.drive;
        let mut of = [x, v, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        for n in 2..8 {
            of[n] = (c * u[n - 2] + d * u[n - 1]) - (2.0 * delta * of[n - 1] + omega0_squared * of[n - 2]);
        }
        of
    }
}

impl SumOfSections {
    fn new(
        sections: &[Section],
        state: impl Iterator<Item = [f64; 2]>,
        force: f64,
        base: BaseMotion,
        all_bounds: bool,
    ) -> Self {
        let phasor = phasor(&base).unwrap_or_default();
        let omega = if phasor == Complex64::ZERO {
            0.0
        } else {
            base.drive.omega.abs()
        };
        let u = drive_derivatives(&base.drive, phasor, omega, 0.0);
        let parts: Vec<_> = (sections.iter().zip(state))
            .map(|(section, state)| Part::new(section, state, force, &base.drive, omega, (u[0], u[1])))
            .collect();
        let feed = -parts.iter().map(|part| part.row[1] * part.drive[1]).sum::<f64>();
        let fastest = parts.iter().map(|part| part.oscillator.fastest).fold(omega, f64::max);
        let mut motion = Self {
            base,
            phasor,
            omega,
            feed,
            fastest,
            forced: [[0.0; 2]; 3],
            all_bounds: true,
            start: SumLook::default(),
            parts,
        };
        if motion.parts.len() > 1 {
            (motion.parts.iter_mut()).for_each(|part| part.split(phasor, omega, &base.drive.signal));
        }
        motion.forced = [3, 4, 5].map(|order| motion.forcing_bound(order));
        motion.start = motion.look(motion.parts.iter().map(Part::at_start), &u);
        motion.all_bounds = all_bounds;
        motion
    }

    /// A bound of what forces a derivative of this order: what it adds per second, and what the output contains of the drive at once.
    fn forcing_bound(&self, order: i32) -> [f64; 2] {
        let size = self.phasor.l1_norm() * self.omega.powi(order);
        let cubic = |order: i32| {
            if order == 3 {
                6.0 * self.base.drive.signal[3].abs()
            } else {
                0.0
            }
        };
        let per_second = (self.parts.iter())
            .map(|part| {
                let ([a, b], [c, d]) = (part.row.map(f64::abs), part.drive.map(f64::abs));
                let harmonic = (c + d * self.omega) * size;
                part.oscillator.reach * (a * (harmonic + c * cubic(order)) + b * harmonic * self.omega)
            })
            .sum();
        [per_second, self.feed.abs() * (size + cubic(order))]
    }

    /// Output and bounds from positions and velocities of the sections.
    #[inline]
    fn look(&self, states: impl Iterator<Item = SectionState>, u: &DriveDerivatives) -> SumLook {
        let mut derivatives: Derivatives = u.map(|u| self.feed * u);
        let mut ceilings = [0.0; 3];
        let bounds = if self.all_bounds { 3 } else { 1 };
        let mut splits = [Split::default(); SPLITS];
        for (number, (part, state)) in self.parts.iter().zip(states).enumerate() {
            let d = part.derivatives(&state, u);
            let [a, b] = part.row;
            for (n, sum) in derivatives.iter_mut().enumerate() {
                *sum += a * d[n] + b * d[n + 1];
            }
            for (n, sum) in ceilings.iter_mut().enumerate().take(bounds) {
                *sum += a.abs() * part.oscillator.ceiling(d[n + 3], d[n + 4]);
                if b != 0.0 {
                    // The eighth derivative is needed for the last bound only.
                    let next = if n < 2 { d[n + 5] } else { part.eighth(&d, self, u) };
                    *sum += b.abs() * part.oscillator.ceiling(d[n + 4], next);
                }
            }
            if self.parts.len() > 1 {
                part.add_to(&mut splits, number, &state, ceilings[0]);
            }
        }
        SumLook { derivatives, ceilings, splits }
    }

    /// Positions and velocities of the sections after `t` seconds, and the drive then.
    fn after(&self, t: f64) -> (impl Iterator<Item = SectionState>, DriveDerivatives) {
        let (sin, cos) = crate::arithmetic::sincos_of_product((self.omega, 0.0), t);
        let turned = Complex64::new(cos, sin);
        let u = self.drive(t, self.phasor * turned);
        (
            self.parts
                .iter()
                .map(move |part| part.closed_form(t, self.phasor, turned)),
            u,
        )
    }

    /// What `(x, v)` of every section change within `t` seconds, and the drive before and after.
    fn change(&self, t: f64) -> (impl Iterator<Item = [f64; 2]>, [f64; 2]) {
        let series = (t * self.fastest <= SERIES_REACH).then(|| self.drive_series());
        let (mut states, u) = self.after(t);
        let before = self.drive(0.0, self.phasor)[0];
        let by_drive = series.as_ref().map_or(u[0] - before, |series| change_of(series, t));
        let changes = self.parts.iter().map(move |part| {
            let (dx, dv) = match &series {
                Some(series) => part.short_change(series, t),
                None => states
                    .next()
                    .map_or((0.0, 0.0), |now| (now.x - part.x0, now.v - part.v0)),
            };
            [dx, dv - part.drive[1] * by_drive]
        });
        (changes, [before, before + by_drive])
    }

    /// The drive and its derivatives `t` seconds after the start, where its oscillator has the phasor `phasor`.
    fn drive(&self, t: f64, phasor: Complex64) -> DriveDerivatives {
        drive_derivatives(&self.base.drive, phasor, self.omega, t)
    }

    fn bound(&self, order: usize, d: &SumLook, window: f64) -> f64 {
        let [per_second, at_once] = self.forced[order - 3];
        // The last factor covers the rounding of this very bound.
        (d.ceilings[order - 3] + at_once + window * per_second) * (1.0 + 1e-12)
    }
}

/// Coefficients of a Taylor series about the start: one more than the output needs, for its velocity.
type Coefficients = [f64; SERIES_DEGREE + 2];

impl SumOfSections {
    /// The Taylor series of the drive.
    fn drive_series(&self) -> Coefficients {
        let mut u = [0.0; SERIES_DEGREE + 2];
        u[..4].copy_from_slice(&self.base.drive.signal);
        let mut term = self.phasor;
        for (n, u) in u.iter_mut().enumerate() {
            *u += term.im;
            let scale = self.omega / (n as f64 + 1.0);
            term = Complex64::new(-term.im * scale, term.re * scale);
        }
        u
    }
}

/// The change within `t` of a motion with these coefficients, with all its digits.
fn change_of(coefficients: &Coefficients, t: f64) -> f64 {
    coefficients[1..]
        .iter()
        .rev()
        .fold(0.0, |sum, coefficient| sum * t + coefficient)
        * t
}

impl Part {
    /// Adds section number `number` to the splits: to the free motions of those before it, to the rest of those behind; `ceiling` is the bound of the
    /// third derivative of the free motions up to it.
    #[inline]
    fn add_to(&self, splits: &mut [Split; SPLITS], number: usize, state: &SectionState, ceiling: f64) {
        let Oscillator { delta, omega0_squared, .. } = self.oscillator;
        let ([a, b], SectionState { y, dy, .. }) = (self.row, *state);
        let ddy = -(2.0 * delta * dy + omega0_squared * y);
        let dddy = -(2.0 * delta * ddy + omega0_squared * dy);
        let mut amplitude = a.abs() * self.oscillator.ceiling(y, dy);
        if b != 0.0 {
            amplitude += b.abs() * self.oscillator.ceiling(dy, ddy);
        }
        if self.free.is_none() {
            amplitude = f64::INFINITY;
        }
        for (n, split) in splits.iter_mut().enumerate() {
            let slow = 1 << n;
            if number >= slow {
                let [x, v, acceleration] = &mut split.now;
                *x += a * y + b * dy;
                *v += a * dy + b * ddy;
                *acceleration += a * ddy + b * dddy;
                split.amplitude += amplitude;
                split.jerk[0] += self.steady_jerk;
            } else {
                split.jerk[1] += self.forced_jerk;
                if number + 1 == slow {
                    split.jerk[0] += ceiling;
                }
            }
        }
    }

    /// The Taylor series of the position; `u` is that of the drive.
    fn series(&self, u: &Coefficients) -> Coefficients {
        let Oscillator { delta, omega0_squared, .. } = self.oscillator;
        let [c, d] = self.drive;
        let mut x = [0.0; SERIES_DEGREE + 2];
        (x[0], x[1]) = (self.x0, self.v0);
        for n in 0..SERIES_DEGREE {
            let (n1, n2) = (n as f64 + 1.0, n as f64 + 2.0);
            let forcing = c * u[n] + d * n1 * u[n + 1];
            x[n + 2] = (forcing - (2.0 * delta * n1 * x[n + 1] + omega0_squared * x[n])) / (n1 * n2);
        }
        x
    }

    /// What position and velocity change within a time that is short against every rate.
    fn short_change(&self, u: &Coefficients, t: f64) -> (f64, f64) {
        let x = self.series(u);
        let v: Coefficients = core::array::from_fn(|n| x.get(n + 1).map_or(0.0, |x| (n as f64 + 1.0) * x));
        (change_of(&x, t), change_of(&v, t))
    }

    /// The eighth derivative of the section, where the output contains its velocity.
    fn eighth(&self, d: &[f64; 8], motion: &SumOfSections, u: &DriveDerivatives) -> f64 {
        let Oscillator { delta, omega0_squared, .. } = self.oscillator;
        // Beyond the third derivative the drive is harmonic.
        let seventh = -motion.omega * motion.omega * u[5];
        self.drive[0] * u[6] + self.drive[1] * seventh - 2.0 * delta * d[7] - omega0_squared * d[6]
    }
}

impl Motion for SumOfSections {
    type Look = SumLook;

    fn fastest(&self) -> f64 {
        self.fastest
    }

    fn derivatives_at_start(&self) -> SumLook {
        self.start
    }

    fn series(&self) -> Series {
        let u = self.drive_series();
        let mut sum: [f64; SERIES_DEGREE + 1] = core::array::from_fn(|n| self.feed * u[n]);
        for part in &self.parts {
            let (x, [a, b]) = (part.series(&u), part.row);
            for (n, sum) in sum.iter_mut().enumerate() {
                *sum += a * x[n] + b * (n as f64 + 1.0) * x[n + 1];
            }
        }
        Series { coefficients: sum, reach: SERIES_REACH / self.fastest }
    }

    fn later(&self, series: &Series, t: f64) -> Instant<SumLook> {
        let (states, u) = self.after(t);
        let derivatives = self.look(states, &u);
        let [x0, v0] = [self.start[0], self.start[1]];
        let departure = if t <= series.reach {
            series.departure(t)
        } else {
            (derivatives[0] - x0 - v0 * t, derivatives[1] - v0)
        };
        let moved = if t <= series.reach {
            v0 * t + departure.0
        } else {
            derivatives[0] - x0
        };
        Instant { moved, departure, derivatives }
    }

    /// Far from the wall a fast section matters little: its free motion stays within a small amplitude, while its third derivative would cut the
    /// steps short. Each split takes the sections behind it by their amplitude and the others by Taylor's theorem; the longest certificate counts.
    fn certainly_open(&self, sign: f64, gap: &Gap, d: &SumLook, window: f64) -> f64 {
        let mut open = gap.certainly_open(window, |h| self.third_derivative_bound(d, h));
        let splits = (0..SPLITS).filter(|n| self.parts.len() > 1 << n).count();
        for Split { now: [y, dy, ddy], amplitude, jerk: [jerk, per_second] } in &d.splits[..splits] {
            let slow = Gap {
                gap: gap.gap + sign * y - amplitude * (1.0 + 1e-12),
                closing: gap.closing - sign * dy,
                acceleration: gap.acceleration - sign * ddy,
                jerk: 0.0,
            };
            if slow.gap > 0.0 && open < window {
                open = open
                    .max(slow.certainly_open(window, |h| (jerk + h * per_second + self.forced[0][1]) * (1.0 + 1e-12)));
            }
        }
        open
    }

    fn third_derivative_bound(&self, d: &SumLook, window: f64) -> f64 {
        self.bound(3, d, window)
    }

    fn fourth_derivative_bound(&self, d: &SumLook, window: f64) -> f64 {
        self.bound(4, d, window)
    }

    fn fifth_derivative_bound(&self, d: &SumLook, window: f64) -> f64 {
        self.bound(5, d, window)
    }
}

/// The drive and its derivatives `t` seconds after the start, where its oscillator has the phasor `phasor`.
pub(crate) fn drive_derivatives(drive: &Drive, phasor: Complex64, omega: f64, t: f64) -> DriveDerivatives {
    let [u0, u1, u2, u3] = if t == 0.0 { drive.signal } else { shift(drive.signal, t) };
    let square = omega * omega;
    let (sin, cos) = (phasor.im, omega * phasor.re);
    [
        u0 + sin,
        u1 + cos,
        2.0 * u2 - square * sin,
        6.0 * u3 - square * cos,
        square * square * sin,
        square * square * cos,
        -square * square * square * sin,
    ]
}

/// The polynomial that a section follows under a forcing that is a polynomial.
fn follower(oscillator: &Oscillator, [f0, f1, f2, f3]: [f64; 4]) -> [f64; 4] {
    let Oscillator { delta, omega0_squared, .. } = *oscillator;
    let p3 = f3 / omega0_squared;
    let p2 = (f2 - 6.0 * delta * p3) / omega0_squared;
    let p1 = (f1 - 4.0 * delta * p2 - 6.0 * p3) / omega0_squared;
    let p0 = (f0 - 2.0 * delta * p1 - 2.0 * p2) / omega0_squared;
    [p0, p1, p2, p3]
}

/// Positions after `t` seconds from rest under forcings of 1, t, t²/2 and t³/6, where the rates are apart.
fn pushed(oscillator: &Oscillator, t: f64) -> [f64; 4] {
    let Regime::Overdamped { slow, fast, .. } = oscillator.regime else {
        return [0.0; 4];
    };
    let (of_slow, of_fast) = (integrals(slow, t), integrals(fast, t));
    core::array::from_fn(|n| (of_slow[n] - of_fast[n]) / (slow - fast))
}

/// The repeated integrals of `e^{rate t}` from 0 to `t`, for a rate of 0 or below.
fn integrals(rate: f64, t: f64) -> [f64; 4] {
    let z = rate * t;
    if z > -1.0 {
        // `phi_4(z)`, the series with `1/(n + 4)!`; then `phi_k = z phi_(k+1) + 1/k!`. The first term left out is below 1e-19.
        let mut phi = 0.0;
        for n in (0..=18).rev() {
            phi = (phi * z + 1.0) / f64::from(if n == 0 { 24 } else { n + 4 });
        }
        let four = phi;
        let three = z * four + 1.0 / 6.0;
        let two = z * three + 0.5;
        let one = z * two + 1.0;
        [one * t, two * t * t, three * t * t * t, four * t * t * t * t]
    } else {
        let once = libm::expm1(z) / rate;
        let twice = (once - t) / rate;
        let thrice = (twice - 0.5 * t * t) / rate;
        [once, twice, thrice, (thrice - t * t * t / 6.0) / rate]
    }
}

// The structure as what carries the cavity

impl Structure {
    /// The structure with a particle of mass `m`, kg, at rest.
    fn new(host: Host, m: f64) -> Result<Self, InvalidHost> {
        let n = host.modal.stiffness.len();
        let (stuck, expansion) = host.modal.sections(m)?;
        let (to_modal, from_modal) = host.maps();
        let flat = |matrix: nalgebra::DMatrix<f64>| matrix.transpose().as_slice().to_vec();
        let to_stuck = flat(&expansion.to_sections * &to_modal);
        let to_free = flat(&from_modal * &expansion.to_modal);
        let drive_to_free = &from_modal * &expansion.drive_to_modal;
        let mut momenta = nalgebra::DVector::zeros(2 * n + host.modal.beside.count());
        momenta.rows_mut(n, n).copy_from(&-&host.modal.drive_rate);
        let held = from_modal * momenta;
        Ok(Self {
            mobility: mobility(host.sections()),
            to_stuck: (to_stuck, expansion.drive_to_sections.as_slice().to_vec()),
            to_free: (to_free, drive_to_free.as_slice().to_vec()),
            held: held.as_slice().chunks_exact(2).map(|pair| [pair[0], pair[1]]).collect(),
            state: vec![Sums::default(); host.sections().len()],
            stuck,
            host,
        })
    }

    fn states(&self) -> impl Iterator<Item = [f64; 2]> {
        self.state.iter().map(|sums| sums.values)
    }

    /// Adds to `(x, v)` of every section.
    fn add(&mut self, changes: impl Iterator<Item = [f64; 2]>) {
        for (sums, change) in self.state.iter_mut().zip(changes) {
            *sums = sums.plus(change);
        }
    }

    /// Displacement (m), velocity (m/s) and acceleration (m/s²) of a point under the drive `u`, `u'`, without any force at the cavity, after an
    /// impulse there, N s.
    fn point(&self, row: &[[f64; 2]], [u, du]: [f64; 2], impulse: f64) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for ((section, state), [a, b]) in self.host.sections().iter().zip(&self.state).zip(row) {
            let Oscillator { delta, omega0_squared, .. } = section.oscillator;
            let [c, d] = section.drive;
            let [x, v] = [0, 1].map(|n| state.values[n] + section.kick[n] * impulse + state.errors[n]);
            let dx = v + d * u;
            let by_drive = c - 2.0 * delta * d;
            let dv = by_drive * u - (omega0_squared * x + 2.0 * delta * v);
            let ddx = dv + d * du;
            let ddv = by_drive * du - (omega0_squared * dx + 2.0 * delta * dv);
            sum[0] += a * x + b * v;
            sum[1] += a * dx + b * dv;
            sum[2] += a * ddx + b * ddv;
        }
        sum
    }

    /// Sets displacement and velocity at the cavity from the sections, under the drive `u`.
    fn renew(&self, masses: &mut Masses, u: f64) {
        let [q, dq, _] = self.cavity([u, 0.0], 0.0);
        masses.primary = Sums { values: [q, dq], errors: [0.0; 2] };
    }

    fn cavity(&self, u: [f64; 2], impulse: f64) -> [f64; 3] {
        self.point(self.host.cavity_row(), u, impulse)
    }
}

/// The drive and its slope now.
fn drive_now(base: &BaseMotion) -> [f64; 2] {
    let z = phasor(base).unwrap_or_default();
    let [u, du, ..] = drive_derivatives(&base.drive, z, base.drive.omega.abs(), 0.0);
    [u, du]
}

/// A matrix times a vector, plus a vector times a number, pair by pair.
fn map<'a>(
    (matrix, with): &'a (Vec<f64>, Vec<f64>),
    state: &'a [[f64; 2]],
    u: f64,
) -> impl Iterator<Item = [f64; 2]> + 'a {
    let state = state.as_flattened();
    let entry = move |row: usize| {
        let row_of = &matrix[row * state.len()..][..state.len()];
        row_of.iter().zip(state).map(|(a, x)| a * x).sum::<f64>() + with[row] * u
    };
    (0..state.len() / 2).map(move |k| [entry(2 * k), entry(2 * k + 1)])
}

impl Primary for Structure {
    type Motion = SumOfSections;
    type State = Vec<Sums>;
    const HAS_FAST_PATH: bool = false;

    fn alone(&self, moving: &Moving, acceleration: f64) -> SumOfSections {
        let force = moving.system.parameters.particle_mass * acceleration;
        let all = moving.system.forces.holding > 0.0;
        SumOfSections::new(self.host.sections(), self.states(), force, moving.base, all)
    }

    fn with_particle(&self, moving: &Moving) -> SumOfSections {
        let force = moving.system.parameters.particle_mass * moving.system.forces.gravity;
        let state: Vec<_> = self.states().collect();
        let state = map(&self.to_stuck, &state, drive_now(&moving.base)[0]);
        SumOfSections::new(&self.stuck, state, force, moving.base, true)
    }

    fn fly(&mut self, moving: &mut Moving, motion: &SumOfSections, end: &FlightEnd) {
        let (changes, [_, u]) = motion.change(end.t);
        self.add(changes);
        self.renew(&mut moving.masses, u);
    }

    fn stay(&mut self, moving: &mut Moving, motion: &SumOfSections, stay: &Sticking) {
        let (changes, [before, u]) = motion.change(stay.t);
        let changes: Vec<_> = changes.collect();
        let changes: Vec<_> = map(&self.to_free, &changes, u - before).collect();
        self.add(changes.into_iter());
        self.renew(&mut moving.masses, u);
    }

    fn kick(&mut self, masses: &mut Masses, kick: f64) {
        let impulse = kick / self.mobility;
        for (sums, section) in self.state.iter_mut().zip(self.host.sections()) {
            *sums = sums.plus(section.kick.map(|kick| kick * impulse));
        }
        masses.primary = masses.primary.plus([0.0, kick]);
    }

    fn velocity_per_jump(&self, _moving: &Moving) -> f64 {
        self.host.velocity_per_jump(self.host.cavity_row())
    }

    fn carry(&mut self, moving: &mut Moving, _jump: f64, kick: f64) {
        let both = kick / (1.0 + moving.system.parameters.particle_mass * self.mobility);
        moving.masses.primary = moving.masses.primary.plus([0.0, kick]);
        self.kick(&mut moving.masses, both - kick);
    }

    fn acceleration(&self, moving: &Moving, velocity: f64) -> f64 {
        let u = drive_now(&moving.base);
        let impulse = (velocity - self.cavity(u, 0.0)[1]) / self.mobility;
        self.cavity(u, impulse)[2]
    }

    fn acceleration_bound(&self, moving: &Moving, velocity: f64) -> f64 {
        let drive = &moving.base.drive;
        let u = drive.signal[0].abs() + drive.amplitude.abs();
        let du = drive.signal[1].abs() + (drive.amplitude * drive.omega).abs();
        let impulse = ((velocity - moving.masses.primary.values[1]) / self.mobility).abs();
        let mut sum = 0.0;
        for (section, state) in self.host.sections().iter().zip(&self.state) {
            let Oscillator { delta, omega0_squared, .. } = section.oscillator;
            let ([c, d], [a, b]) = (section.drive.map(f64::abs), section.cavity.map(f64::abs));
            let [x, v] = [0, 1].map(|n| state.values[n].abs() + section.kick[n].abs() * impulse);
            let dx = v + d * u;
            let dv = (c + 2.0 * delta * d) * u + omega0_squared * x + 2.0 * delta * v;
            sum += a * (dv + d * du);
            if b != 0.0 {
                sum += b * ((c + 2.0 * delta * d) * du + omega0_squared * dx + 2.0 * delta * dv);
            }
        }
        sum * (1.0 + 1e-9)
    }

    fn begin(&mut self, jump: f64) {
        let held: Vec<_> = self.held.iter().map(|pair| pair.map(|held| held * jump)).collect();
        self.add(held.into_iter());
    }

    fn state(&self) -> Vec<Sums> {
        self.state.clone()
    }

    fn restore(&mut self, state: &Vec<Sums>) {
        self.state.clone_from(state);
    }
}

// The plant of a structure

/// Displacements and velocities of a structure's coordinates (modes: m sqrt(kg); degrees of freedom: m), and of the particle (m, m/s).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StructureState {
    /// Displacements of the coordinates; empty: all 0.
    pub displacements: Vec<f64>,
    /// Velocities of the coordinates; empty: all 0.
    pub velocities: Vec<f64>,
    /// Displacement of the particle, m.
    pub q2: f64,
    /// Velocity of the particle, m/s.
    pub dq2: f64,
}

/// Why a plant of a structure is refused.
#[derive(Clone, Debug, PartialEq)]
pub enum Refused {
    /// The structure.
    Host(InvalidHost),
    /// A parameter of particle and cavity, or a start.
    Value(InvalidValue),
}

impl core::fmt::Display for Refused {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Host(host) => host.fmt(f),
            Self::Value(value) => value.fmt(f),
        }
    }
}

impl core::error::Error for Refused {}

impl From<InvalidHost> for Refused {
    fn from(host: InvalidHost) -> Self {
        Self::Host(host)
    }
}

impl From<InvalidValue> for Refused {
    fn from(value: InvalidValue) -> Self {
        Self::Value(value)
    }
}

impl Plant<Structure> {
    /// The plant of a structure. Of `parameters` those of the particle and its cavity count; mass, stiffness and damping are the structure's.
    ///
    /// # Errors
    /// Invalid parameters; a start that is not finite or has the wrong size; a particle outside its cavity.
    pub fn with_host(host: Host, parameters: Parameters, start: &StructureState) -> Result<Self, Refused> {
        let parameters = Self::equivalent(&host, parameters);
        parameters.validate()?;
        let structure = Structure::new(host, parameters.particle_mass)?;
        let mut plant = Self::of(structure, parameters);
        plant.set_coordinates(start)?;
        Ok(plant)
    }

    /// Replaces the structure, which begins in this state. The parameters of the cavity and the totals stay.
    ///
    /// # Errors
    /// As for [`Self::with_host`]; the plant stays as it is.
    pub fn replace_host(&mut self, host: Host, start: &StructureState) -> Result<(), Refused> {
        let plant = Self::with_host(host, *self.parameters(), start)?;
        let totals = self.status.totals;
        *self = plant;
        self.status.totals = totals;
        Ok(())
    }

    /// The parameters whose primary mass is that which an impact feels, `1/S`, on the stiffest spring of the structure.
    fn equivalent(host: &Host, parameters: Parameters) -> Parameters {
        let mass = 1.0 / host.mobility();
        let fastest = host.sections().iter().map(|section| section.oscillator);
        let fastest = fastest.max_by(|a, b| a.fastest.total_cmp(&b.fastest));
        let [stiffness, damping] = fastest.map_or([0.0; 2], |o| [mass * o.omega0_squared, 2.0 * mass * o.delta]);
        Parameters { primary_mass: mass, stiffness, damping, ..parameters }
    }

    /// Changes the parameters of the cavity from now on; displacements, velocities and totals stay. A change of half-width has no physical
    /// meaning here.
    ///
    /// # Errors
    /// Invalid parameters, another mass of the particle; the old ones stay.
    pub fn set_parameters(&mut self, parameters: Parameters) -> Result<(), InvalidValue> {
        let parameters = Self::equivalent(&self.primary.host, parameters);
        parameters.validate()?;
        let (m, present) = (parameters.particle_mass, self.parameters().particle_mass);
        InvalidValue::unless(m == present, "m (particle mass)", m, "kg", "the mass at the start")?;
        self.moving.system = System::from(parameters);
        self.fast.parameters_changed(&self.moving.base);
        Ok(())
    }

    /// Sets displacements and velocities; contact is decided anew. Drive, time and totals stay.
    ///
    /// # Errors
    /// A state that is not finite or has the wrong size, a particle outside its cavity; the plant stays as it is.
    pub fn set_coordinates(&mut self, state: &StructureState) -> Result<(), Refused> {
        let u = self.base_displacement();
        let sections = self.primary.host.state(&state.displacements, &state.velocities, u)?;
        Ok(self.set_sections(&sections, [state.q2, state.dq2])?)
    }

    /// Sets `(x, v)` of every section, and displacement and velocity of the particle. Otherwise as [`Self::set_coordinates`].
    ///
    /// # Errors
    /// As there. A wrong number of sections leaves the others as they are.
    pub fn set_sections(&mut self, sections: &[[f64; 2]], [q2, dq2]: [f64; 2]) -> Result<(), InvalidValue> {
        let u = self.base_displacement();
        let before = self.primary.state.clone();
        for (sums, values) in self.primary.state.iter_mut().zip(sections) {
            *sums = Sums { values: *values, errors: [0.0; 2] };
        }
        let [q1, dq1, _] = self.primary.cavity([u, 0.0], 0.0);
        let set = self.set_state_at_cavity(crate::State { q1, dq1, q2, dq2 });
        if set.is_err() {
            self.primary.state = before;
        }
        set
    }

    /// The structure.
    pub fn host(&self) -> &Host {
        &self.primary.host
    }

    /// Displacement (m), velocity (m/s) and acceleration (m/s²) of a point, given by its row ([`Host::row`]).
    pub fn point(&self, row: &Row) -> [f64; 3] {
        let u = drive_now(&self.moving.base);
        let [q, dq, ddq] = self.primary.point(row, u, 0.0);
        let host = &self.primary.host;
        [q, dq, ddq + host.velocity_per_impulse(row) * self.force_at_cavity(u)]
    }

    /// Force of the particle on the structure between impacts, N.
    fn force_at_cavity(&self, u: [f64; 2]) -> f64 {
        let m = self.moving.system.parameters.particle_mass;
        let (gravity, friction) = self.constant_accelerations();
        if self.status.contact.is_none() {
            return -m * friction;
        }
        let alone = self.primary.cavity(u, 0.0)[2];
        -m * (alone - gravity) / (1.0 + m * self.primary.mobility)
    }

    /// Mechanical energy, J: kinetic and elastic energy of the structure (relative to a base at its displacement now), kinetic energy of the
    /// particle and its weight on a tilted axis (0 at `q2 = 0`).
    pub fn energy(&self) -> f64 {
        let [u, _] = drive_now(&self.moving.base);
        let state: Vec<_> = self.primary.states().collect();
        let crate::State { q2, dq2, .. } = self.state();
        let m = self.moving.system.parameters.particle_mass;
        self.primary.host.energy(&state, u) + m * (0.5 * dq2 * dq2 - self.moving.system.forces.gravity * q2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_section_follows_a_polynomial_forcing() {
        let (delta, square) = (0.3, 2.5);
        let oscillator = Oscillator::new(1.0, square, 2.0 * delta);
        let forcing = [0.7, -0.4, 0.9, 0.6];
        let [p0, p1, p2, p3] = follower(&oscillator, forcing);
        let [rate, acceleration] = [[p1, 2.0 * p2, 3.0 * p3, 0.0], [2.0 * p2, 6.0 * p3, 0.0, 0.0]];
        for (n, p) in [p0, p1, p2, p3].into_iter().enumerate() {
            let sum = acceleration[n] + 2.0 * delta * rate[n] + square * p;
            assert!((sum - forcing[n]).abs() < 1e-15, "{n}: {sum}");
        }
    }

    #[test]
    fn repeated_integrals_of_an_exponential_are_their_series_at_any_rate() {
        for rate in [0.0, -0.3, -0.99, -1.01, -2.0, -5.0] {
            let t = 1.3;
            // Of z^k/(k + n)!, times t^n.
            let series = |n: i32| {
                let terms = (0..60).scan((1..=n).map(f64::from).product::<f64>().recip(), |term, k| {
                    let now = *term;
                    *term *= rate * t / f64::from(k + 1 + n);
                    Some(now)
                });
                terms.sum::<f64>() * t.powi(n)
            };
            for (n, integral) in integrals(rate, t).into_iter().enumerate() {
                let exact = series(n as i32 + 1);
                assert!((integral / exact - 1.0).abs() < 1e-13, "{rate} {n}: {integral} {exact}");
            }
        }
    }

    #[test]
    fn the_bound_of_the_steady_third_derivative_is_above_it_by_no_more_than_its_two_roundings_up() {
        let section = Section {
            oscillator: Oscillator::new(1.0, 4.0, 0.5),
            drive: [0.8, 0.3],
            kick: [0.0, 1.0],
            cavity: [0.9, 0.4],
        };
        let drive = Drive::harmonic(100.0, 3.0);
        let phasor = Complex64::from_polar(100.0, 0.4);
        let mut part = Part::new(&section, [0.0; 2], 0.0, &drive, drive.omega, (0.0, 0.0));
        part.split(phasor, drive.omega, &drive.signal);
        let [y, dy] = part.free.expect("a steady response");
        (part.x0, part.v0) = (part.x0 - y, part.v0 - dy);
        let third = |n: i32| {
            let t = f64::from(n) * 0.01;
            let turned = Complex64::from_polar(1.0, drive.omega * t);
            let u = drive_derivatives(&drive, phasor * turned, drive.omega, t);
            let d = part.derivatives(&part.closed_form(t, phasor, turned), &u);
            (part.row[0] * d[3] + part.row[1] * d[4]).abs()
        };
        let largest = (0..300).map(third).fold(0.0, f64::max);
        // Sums instead of moduli, of the response and of the two parts of the row: at most sqrt(2) each.
        assert!(
            (1.0..2.0).contains(&(part.steady_jerk / largest)),
            "{} {largest}",
            part.steady_jerk
        );
    }
}
