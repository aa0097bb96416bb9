//! What a record says: the locked point, its regime, and the backbone along the free decay.

mod crossings;
mod decay;
mod fit;
mod lock;
mod regime;
mod response;

use serde::Serialize;
use thiserror::Error;

use crate::experiment::Record;
use crate::scene::{Dimensionless, Scene};
use vines_model::orbit::{self, Orbit};
use vines_model::theory::{BackbonePoint, SlowFlow};

pub use decay::DecayPoint;
pub(crate) use decay::points as decay_points;
pub use lock::Lock;
pub(crate) use regime::classify;
pub use regime::{Impact, Regime, impacts};
pub use response::regime_by_response;

/// Amplitudes above which the decay is compared with theory, C.
///
/// Nearer to the fold (C = Cmin) the slow flow is no longer slow against a period.
pub const COMPARED_ABOVE: f64 = 0.2;

/// Phase of the response at phase resonance, degrees: theory and exact orbits are for that one.
const PHASE_RESONANCE: f64 = -90.0;

/// Why a record cannot be identified.
#[derive(Debug, Error)]
pub enum IdentificationError {
    /// The loop locked something else than the symmetric 1:1 regime.
    #[error(
        "the loop is locked at sigma = {sigma:.4}, C = {c:.4}, but the regime is {regime}, not symmetric 1:1 with two \
         impacts per period. Try another [start] (the particle must be moving) or another G"
    )]
    Regime {
        /// What was found instead.
        regime: Regime,
        /// Detuning at the lock.
        sigma: f64,
        /// Amplitude at the lock.
        c: f64,
    },
    /// A window with too few samples, or none that could be fitted.
    #[error("the decay holds no window of {periods} periods with synchronous impacts")]
    NoDecay {
        /// Window length asked for.
        periods: f64,
    },
}

/// The identified system; dimensionless throughout.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Identification {
    /// The numbers all of this belongs to.
    pub parameters: Dimensionless,
    /// The locked point as measured.
    pub lock: Lock,
    /// First-order theory at the same G: the stable solution nearest to the lock; absent where another phase than that of
    /// resonance was sought.
    pub theory: Option<BackbonePoint>,
    /// The exact phase-resonant orbit at the same G nearest to the lock; absent as above.
    pub exact: Option<Orbit>,
    /// The decay, from the release to the loss of synchrony.
    pub decay: Vec<DecayPoint>,
    /// RMS of decay sigma less theory, over the points with C > 0.2.
    pub rms_sigma_error: Option<f64>,
}

/// Identifies a record of `scene`.
///
/// # Errors
/// A lock in another regime than the symmetric 1:1 one, or a decay too short to fit.
pub fn identify(record: &Record, scene: &Scene) -> Result<Identification, IdentificationError> {
    let parameters = scene.dimensionless();
    let lock = lock::measure(record, scene);
    // Where noise hides the symmetry, a motion that is steady and off the linear mode is taken as it is, and said to be that.
    if !matches!(lock.regime, Regime::Symmetric | Regime::Unresolved) {
        return Err(IdentificationError::Regime {
            regime: lock.regime,
            sigma: lock.sigma,
            c: lock.c,
        });
    }
    let slow_flow = SlowFlow::new(parameters.lambda, parameters.r);
    let at_resonance = scene.controller.phase_target == PHASE_RESONANCE;
    let nearest = |sigma: f64, c: f64| (sigma - lock.sigma).hypot(c - lock.c);
    let theory = slow_flow
        .phase_resonant(parameters.g)
        .into_iter()
        .filter(|point| at_resonance && point.stable())
        .min_by(|a, b| nearest(a.sigma, a.c).total_cmp(&nearest(b.sigma, b.c)));
    let exact = orbit::phase_resonant(&parameters)
        .into_iter()
        .filter(|_| at_resonance)
        .min_by(|a, b| nearest(a.sigma, a.c).total_cmp(&nearest(b.sigma, b.c)));
    let decay = decay::points(record, scene, &slow_flow);
    if decay.is_empty() {
        return Err(IdentificationError::NoDecay {
            periods: scene.record.window_periods,
        });
    }
    Ok(Identification {
        rms_sigma_error: decay::rms_sigma_error(&decay),
        parameters,
        lock,
        theory,
        exact,
        decay,
    })
}
