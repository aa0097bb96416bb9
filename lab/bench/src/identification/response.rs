//! The regime from the response alone, as on a real rig.
//!
//! The centre of mass moves smoothly, so impacts have little effect on it. The triangle wave of a particle with the speed `B`
//! excites the harmonic of odd order n of v to the amplitude `4 epsilon B/(pi n^2 (n^2 - 1))`. Uneven impacts add even
//! harmonics. Irregular impacts make amplitude and phase fluctuate, which leaves a residual. The motion without impacts is
//! the linear mode: it needs the frequency `omega0` and the drive `c omega A/k`.

use nalgebra::DVector;
use vines_model::numerics::{HarmonicBasis, noise};
use vines_model::regime::Regime;

use crate::experiment::Sample;
use crate::scene::Scene;

/// Largest residual of a steady motion, relative to the amplitude, unless it is noise.
const STEADY: f64 = 3e-3;
/// A residual counts as noise if third differences find at least this share of it.
const NOISE_SHARE: f64 = 0.5;
/// Smallest significant harmonic, in standard errors.
const SIGNIFICANT: f64 = 4.0;
/// Largest second harmonic of a symmetric motion, relative to the expected third.
const EVEN_SHARE: f64 = 0.5;
/// Deviations within which a motion counts as the linear mode: of the frequency, relative to the damping rate, and of the drive.
const LINEAR: [f64; 2] = [0.1, 0.05];
/// Degrees of the amplitudes of the harmonics in time: quadratic for the fundamental, constant for the others.
const HARMONICS: [Option<usize>; 5] = [Some(2), Some(0), Some(0), Some(0), Some(0)];

/// Harmonic content of the response, relative to its fundamental.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Content {
    /// Amplitude of the fundamental, m.
    amplitude: f64,
    /// Amplitudes of the second and the third harmonic, relative.
    second: f64,
    third: f64,
    /// Standard error of either.
    error: f64,
    /// RMS of the residual, relative, and its part that is noise.
    rest: f64,
    noise: f64,
}

impl Content {
    /// Fits the samples; `None` for too few samples or no motion.
    fn of(samples: &[Sample], sample_time: f64, omega: f64) -> Option<Self> {
        let n = samples.len();
        // The phase of the response is more uniform than that of a drive that a loop still corrects.
        let phases: Vec<f64> = (0..n).map(|n| n as f64 * sample_time * omega).collect();
        let basis = HarmonicBasis::new(&phases, 1, &HARMONICS);
        if n < 2 * basis.terms() {
            return None;
        }
        let values = DVector::from_iterator(n, samples.iter().map(|s| s.sensors.response));
        let fit = basis.fit(&values)?;
        let rest = basis.residual(&values, &fit);
        let [amplitude, second, third] = [1, 2, 3].map(|n| fit.harmonic(n).norm());
        if amplitude == 0.0 || !amplitude.is_finite() {
            return None;
        }
        let rms = (rest.norm_squared() / (n - basis.terms()) as f64).sqrt();
        Some(Self {
            amplitude,
            second: second / amplitude,
            third: third / amplitude,
            error: rms * (2.0 / n as f64).sqrt() / amplitude,
            rest: rms / amplitude,
            noise: noise(rest.as_slice()) / amplitude,
        })
    }
}

/// The regime determined from the response of these samples. Of the rig, this uses only the results of a linear test at small
/// amplitude (`omega0`, `c`, `k`) and the mass ratio, from which the expected third harmonic follows. `base` (m) is the base
/// amplitude that holds the motion at phase resonance, and `omega` (rad/s) its frequency.
#[must_use]
pub fn regime_by_response(samples: &[Sample], scene: &Scene, base: f64, omega: f64) -> Regime {
    let Some(content) = Content::of(samples, scene.sample_time(), omega) else {
        return Regime::Unknown;
    };
    if content.rest > STEADY && content.noise < NOISE_SHARE * content.rest {
        return Regime::Other;
    }
    if is_linear(content.amplitude, scene, base, omega) {
        return Regime::NoImpacts;
    }
    // The particle's speed is about b omega; the order of magnitude is sufficient.
    let expected = 4.0 * scene.dimensionless().amplitude(1.0) / (72.0 * std::f64::consts::PI * content.amplitude);
    let significant = SIGNIFICANT * content.error;
    if content.second > significant.max(EVEN_SHARE * expected) {
        Regime::Asymmetric
    } else if content.third > significant && significant < expected {
        Regime::Symmetric
    } else {
        Regime::Unresolved
    }
}

/// Whether frequency and drive are those of the linear mode at this amplitude.
fn is_linear(amplitude: f64, scene: &Scene, drive: f64, omega: f64) -> bool {
    let (plant, omega0) = (&scene.plant, scene.dimensionless().omega0);
    let needed = plant.damping * omega0 / plant.stiffness * amplitude;
    let damping_rate = 0.5 * omega * drive / amplitude;
    (omega - omega0).abs() <= LINEAR[0] * damping_rate && (drive - needed).abs() <= LINEAR[1] * drive
}
