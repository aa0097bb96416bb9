//! What a shaker makes of its command, and how fast the control of its reference can be on a structure: as fast as Nyquist's criterion allows.

use std::f64::consts::PI;

use nalgebra::RowVector2;
use num_complex::Complex64;
use vines_model::numerics::complex_fit;

/// What a shaker makes of its command near the natural frequency, without impacts: reference over command is `gain (s + d)/(s + pole)`, where
/// `s = i (omega - omega0)`, d is the damping rate of the structure, and amplitudes are those of the bench, in m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShakerPath {
    /// Reference per command of a structure that does not move.
    pub gain: Complex64,
    /// Rate, rad/s, with which the response of structure and shaker settles.
    pub pole: Complex64,
    /// Damping rate of the structure, rad/s.
    pub damping_rate: f64,
    /// Largest command, m; infinite without a limit.
    pub largest: f64,
    /// Bandwidths of the control of the reference, over those without another resonance of structure and shaker.
    pub speed: f64,
    /// Largest amplitude, m, by which harmonics of the force beside the sampling frequency change its fundamental as it is read.
    pub aliased: f64,
}

impl ShakerPath {
    /// Least squares of the relative errors of reference over command at some frequencies, rad/s, for a structure with this natural frequency
    /// and damping rate, rad/s.
    pub fn fitted(self, omega0: f64, damping_rate: f64, values: &[(f64, Complex64)]) -> Self {
        let rows = values.iter().map(|(omega, value)| {
            let s = Complex64::new(0.0, omega - omega0);
            let row = RowVector2::new(s, Complex64::ONE) * (value / (s + damping_rate));
            (row, Complex64::ONE)
        });
        let [inverse, of_pole] = complex_fit(rows).map_or([Complex64::ONE; 2], |(found, _)| found.into());
        Self {
            gain: 1.0 / inverse,
            pole: of_pole / inverse,
            damping_rate,
            ..self
        }
    }

    /// Largest relative error of reference over command at these frequencies.
    pub fn error(&self, omega0: f64, values: &[(f64, Complex64)]) -> f64 {
        let error = |(omega, value): &(f64, Complex64)| (value / self.at(omega - omega0) - 1.0).norm();
        values.iter().map(error).fold(0.0, f64::max)
    }

    /// Reference over command at `omega0 + detuning`, rad/s.
    pub fn at(&self, detuning: f64) -> Complex64 {
        let s = Complex64::new(0.0, detuning);
        self.gain * (s + self.damping_rate) / (s + self.pole)
    }

    /// What is left of the reference at the natural frequency: the drop-out.
    pub fn drop_out(&self) -> f64 {
        self.damping_rate / self.pole.norm()
    }

    /// Phase by which the reference turns within the half-power bandwidth, rad.
    pub fn turn(&self) -> f64 {
        (self.at(self.damping_rate) * self.at(-self.damping_rate).conj()).arg()
    }
}

// The design of the control.

/// Bandwidth of the observer of response and impacts, over the natural frequency: at half of it, the force on an oscillator of 1.8 % drop-out
/// (scenes/shaker-oscillator.toml) is so late behind the impacts that the loop does not settle.
pub const OBSERVER: f64 = 0.6;
/// Bandwidth of the detector of the error.
pub const DETECTOR: f64 = 0.5 * OBSERVER;
/// Rate of a second integrator over the bandwidth of the first: both roots of the loop are then equal, at half of this bandwidth. The
/// harmonics above `FAST` change at this share of a detector's bandwidth.
pub const SECOND: f64 = 0.25;
/// Bandwidth of the control.
pub const BANDWIDTH: f64 = SECOND * DETECTOR;
/// Number of odd harmonics that both detectors know, as far as they are sampled. Impacts of one period are alternating impulses. A resonance of armature
/// and stinger can make a harmonic of the force ten times the fundamental: unknown, it would be in the command, and another motion the result.
pub const ODD_HARMONICS: usize = 15;
/// How many of them change as fast as the fundamental: the strongest harmonics of impacts follow a change of the motion.
const FAST: usize = 3;

/// Rate at which a detector changes a harmonic, by its place among the odd ones, over the rate of the fundamental.
pub fn rate_of(n: usize) -> f64 {
    if n < FAST { 1.0 } else { SECOND }
}

/// Share of the bandwidths at which the control is slow enough for the other resonances of structure and shaker: 1, or the largest power of 1/2 at
/// which it is stable (Nyquist) also when it is twice as fast; 1/16 if none is. `exact`: reference and response per command at a frequency, rad/s.
pub fn speed(path: &ShakerPath, omega0: f64, exact: impl Fn(f64) -> [Complex64; 2]) -> f64 {
    let is_stable = |speed: &f64| {
        let of = |x: f64| return_difference(path, omega0, *speed, x, exact(omega0 * (1.0 + x)));
        let turns: f64 = (-REACH..REACH)
            .map(|n| turned(&of, [n, n + 1].map(|n| f64::from(n) * DETUNING_STEP), MOST_HALVINGS))
            .sum();
        turns > -PI
    };
    let slower = [1.0, 0.5, 0.25, 0.125].into_iter().find(is_stable);
    match slower {
        Some(1.0) => 1.0,
        stable => 0.5 * stable.unwrap_or(0.125),
    }
}

/// Detunings at which stability is judged, over omega0: a multiple of this to each side, and between where the phase turns fast.
const DETUNING_STEP: f64 = 0.01;
const REACH: i32 = 70;
/// Number of times that such an interval is halved at most.
const MOST_HALVINGS: u32 = 12;

/// Phase by which a function turns between two points, rad; not a number where the function is not, as for a structure without damping.
fn turned(of: &impl Fn(f64) -> Complex64, [begin, end]: [f64; 2], finest: u32) -> f64 {
    let turn = (of(end) / of(begin)).arg();
    if finest == 0 || turn.is_nan() || turn.abs() < 0.5 {
        return turn;
    }
    let middle = 0.5 * (begin + end);
    turned(of, [begin, middle], finest - 1) + turned(of, [middle, end], finest - 1)
}

/// Return difference of the control at `omega0 (1 + x)`, times `s/(s + bandwidth)`, which takes the pole of the integrator away. It turns by -2 pi
/// for every unstable pole of the closed loop.
fn return_difference(
    path: &ShakerPath,
    omega0: f64,
    speed: f64,
    x: f64,
    [reference, response]: [Complex64; 2],
) -> Complex64 {
    let s = Complex64::new(0.0, x);
    let [observer, detector, bandwidth] = [OBSERVER, DETECTOR, BANDWIDTH].map(|bandwidth| bandwidth * speed);
    // What offset and harmonics of a detector take of what it reads; the fundamental is at x = 0.
    let orders = (0..ODD_HARMONICS).flat_map(|n| [1.0, -1.0].map(|sign| (n, sign * (2 * n + 1) as f64)));
    let others = orders.filter(|(_, order)| *order != 1.0);
    let comb: Complex64 = others
        .map(|(n, order)| rate_of(n) / Complex64::new(0.0, 1.0 + x - order))
        .sum();
    let comb = comb + 1.0 / Complex64::new(0.0, 1.0 + x);
    let (pole, damping) = (path.pole / omega0, path.damping_rate / omega0);
    let gain = Complex64::new(0.0, -0.5);
    // All times s.
    let corrected = observer * (s + SECOND * observer) / (1.0 + observer * comb);
    let rate = s * (s + pole) + corrected;
    let observed = (s * gain * path.gain + corrected * response) / rate;
    let error = detector / (s * (1.0 + detector * comb) + detector);
    let moved = (pole - damping) / gain * observed;
    (s * (1.0 - moved / path.gain) + bandwidth * error * reference / path.gain) / (s + bandwidth)
}
