//! The regime from the response alone, as a rig must tell it.
//!
//! The centre of mass moves smoothly, so impacts leave little in it: while the particle flies to and fro at the speed `B`, its triangle
//! wave drives the harmonic of odd order n of v to the amplitude `4 epsilon B/(pi n^2 (n^2 - 1))`. Uneven impacts
//! bring in even harmonics. Irregular impacts let amplitude and phase wander, which no harmonic explains. And what holds the motion
//! without impacts is known: the linear mode, at `omega0` with the drive `c omega A/k`.

use nalgebra::{DMatrix, DVector};

use super::regime::Regime;
use crate::experiment::Sample;
use crate::scene::Scene;

/// Share of the amplitude that may stay unexplained in a steady motion, where it is not noise.
const STEADY: f64 = 3e-3;
/// What is unexplained is noise if it changes from sample to sample: third differences then see at least this share of it.
const NOISE_SHARE: f64 = 0.5;
/// How many standard errors a harmonic must have.
const SIGNIFICANT: f64 = 4.0;
/// Share of the third harmonic expected that the second may have in a symmetric motion.
const EVEN_SHARE: f64 = 0.5;
/// Shares of the damping rate (frequency) and of the drive within which a motion is the linear mode's.
const LINEAR: [f64; 2] = [0.1, 0.05];
/// Harmonics followed.
const HARMONICS: usize = 5;
/// Offset, drift, three terms each for sine and cosine of the fundamental, two for each other harmonic.
const TERMS: usize = 8 + 2 * (HARMONICS - 1);

/// What the response is made of, relative to its fundamental.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Content {
    /// Amplitude of the fundamental, m.
    amplitude: f64,
    /// Amplitudes of the second and the third harmonic, relative.
    second: f64,
    third: f64,
    /// Standard error of either.
    error: f64,
    /// Effective value of what is left, relative, and how much of that looks like noise.
    rest: f64,
    noise: f64,
}

impl Content {
    /// Fits the samples; `None` where they are too few or silent.
    fn of(samples: &[Sample], sample_time: f64) -> Option<Self> {
        let n = samples.len();
        if n < 2 * TERMS {
            return None;
        }
        let mut phase = 0.0;
        let phases: Vec<f64> = samples
            .iter()
            .map(|sample| {
                let now = phase;
                phase += sample.command.drive.omega * sample_time;
                now
            })
            .collect();
        let basis = DMatrix::from_fn(n, TERMS, |row, term| {
            let t = 2.0 * row as f64 / (n - 1) as f64 - 1.0;
            let wave = |harmonic: usize, cosine: bool| {
                let angle = harmonic as f64 * phases[row];
                if cosine { angle.cos() } else { angle.sin() }
            };
            match term {
                0 => 1.0,
                1 => t,
                2..8 => t.powi((term as i32 - 2) / 2) * wave(1, term % 2 == 1),
                _ => wave(2 + (term - 8) / 2, term % 2 == 1),
            }
        });
        let values = DVector::from_iterator(n, samples.iter().map(|s| s.sensors.response));
        let c = basis
            .tr_mul(&basis)
            .cholesky()?
            .solve(&basis.tr_mul(&values));
        let rest = values - basis * &c;
        let amplitude = c[2].hypot(c[3]);
        if amplitude == 0.0 || !amplitude.is_finite() {
            return None;
        }
        let effective = (rest.norm_squared() / (n - TERMS) as f64).sqrt();
        let thirds: f64 = rest
            .as_slice()
            .windows(4)
            .map(|v| (v[3] - 3.0 * v[2] + 3.0 * v[1] - v[0]).powi(2))
            .sum();
        Some(Self {
            amplitude,
            second: c[8].hypot(c[9]) / amplitude,
            third: c[10].hypot(c[11]) / amplitude,
            error: effective * (2.0 / n as f64).sqrt() / amplitude,
            rest: effective / amplitude,
            noise: (thirds / (20.0 * (n - 3) as f64)).sqrt() / amplitude,
        })
    }
}

/// The regime that the response of these samples tells: of the rig only what a linear test at small amplitude gives is used
/// (`omega0`, `c`, `k`), and the mass ratio for how much of a third harmonic to expect.
#[must_use]
pub fn regime_by_response(samples: &[Sample], scene: &Scene) -> Regime {
    let Some(content) = Content::of(samples, scene.sample_time()) else {
        return Regime::Unknown;
    };
    if content.rest > STEADY && content.noise < NOISE_SHARE * content.rest {
        return Regime::Other;
    }
    if is_linear(samples, content.amplitude, scene) {
        return Regime::Silent;
    }
    // The particle's speed is about b omega: what matters is the order of magnitude.
    let expected = 4.0 * scene.plant.epsilon() * scene.plant.half_width
        / (72.0 * std::f64::consts::PI * content.amplitude);
    let significant = SIGNIFICANT * content.error;
    if content.second > significant.max(EVEN_SHARE * expected) {
        Regime::Asymmetric
    } else if content.third > significant && significant < expected {
        Regime::Symmetric
    } else {
        Regime::Unresolved
    }
}

/// Frequency and drive are those that the linear mode needs at this amplitude.
fn is_linear(samples: &[Sample], amplitude: f64, scene: &Scene) -> bool {
    let mean =
        |value: fn(&Sample) -> f64| samples.iter().map(value).sum::<f64>() / samples.len() as f64;
    let plant = &scene.plant;
    let (omega, drive) = (
        mean(|s| s.command.drive.omega),
        mean(|s| s.command.drive.amplitude),
    );
    let needed = plant.damping * plant.omega0() / plant.stiffness * amplitude;
    let damping_rate = 0.5 * omega * drive / amplitude;
    (omega - plant.omega0()).abs() <= LINEAR[0] * damping_rate
        && (drive - needed).abs() <= LINEAR[1] * drive
}
