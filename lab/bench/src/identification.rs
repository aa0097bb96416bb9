//! What a record says: the locked point, its regime, and the backbone along the free decay.

mod balance;
mod decay;
mod lock;
mod response;

use thiserror::Error;

use crate::record::Record;
use crate::scene::{Dimensionless, Scene};

pub use balance::{Balance, Cycle, Slopes};
pub use decay::{DecayEnd, DecayPoint, DecayPoints, Harmonic, decay_points, harmonic};
pub use lock::{Friction, Lock, Measured};
use lock::{measure, on_target, sensors_after_release};
use response::longer_after;
pub(crate) use response::{ASYMMETRIC, without_tones};
pub use response::{Tone, classify, foreign_tone, impacts, regime_by_response};
pub use vines_model::regime::{Impact, Regime};

/// Why a record cannot be identified.
#[derive(Debug, Error)]
pub enum IdentificationError {
    /// The loop locked another regime than symmetric 1:1.
    #[error(
        "the loop is locked at sigma = {sigma:.4}, C = {c:.4}, but the regime is {regime}, not symmetric 1:1 with two \
         impacts per period. Try another [start] (the particle must be moving) or another G{}",
        mirrored(*longer)
    )]
    Regime {
        /// What was found instead.
        regime: Regime,
        /// Detuning at the lock.
        sigma: f64,
        /// Amplitude at the lock.
        c: f64,
        /// The wall, -1 or 1, after which an asymmetric motion's longer flight begins, if the rig reports the impacts.
        longer: Option<i8>,
    },
    /// The hold contains no periodic motion.
    #[error(
        "the hold contains no periodic motion: the response or the base reads zero; check the sensors and record.hold_periods"
    )]
    NoMotion,
    /// The phase was off its target while the lock was held.
    #[error(
        "the phase was {error:.3} ± {uncertainty:.3} degrees off its target while the lock was held; controller.phase_tolerance allows \
         {tolerance} degrees. A channel may have become late: `vines check` measures its delay"
    )]
    OffTarget {
        /// Mean phase error of the hold, degrees.
        error: f64,
        /// Its standard uncertainty, degrees.
        uncertainty: f64,
        /// Degrees.
        tolerance: f64,
    },
    /// A sensor failed after the release.
    #[error(
        "a sensor {what} {seconds:.3} s after the release, so that the decay is not recorded: check its cable and converter"
    )]
    SensorAfterRelease {
        /// Time since the release, s.
        seconds: f64,
        /// What it does.
        what: &'static str,
    },
}

/// Names the one of two mirror images that was followed.
fn mirrored(longer: Option<i8>) -> String {
    longer.map_or_else(String::new, |wall| {
        format!(
            ". An asymmetric motion has a mirror image with the same sigma and C; this is the one whose longer flight begins at w = {}b",
            if wall > 0 { '+' } else { '-' }
        )
    })
}

/// What a record says.
#[derive(Debug, Clone, PartialEq)]
pub struct Identification {
    /// The numbers all of this belongs to.
    pub parameters: Dimensionless,
    /// The locked point as measured.
    pub lock: Lock,
    /// The decay, from the release on; without points if it is shorter than the window of the fit.
    pub decay: DecayPoints,
}

/// Identifies a record of `scene`.
///
/// # Errors
/// A lock in another regime than the symmetric 1:1 one, or no motion.
pub fn identify(record: &Record, scene: &Scene) -> Result<Identification, IdentificationError> {
    let lock = measure(record, scene).ok_or(IdentificationError::NoMotion)?;
    // Where noise hides the symmetry, a motion that is steady and off the linear mode is accepted; its regime says so.
    let is_expected = match lock.regime {
        Regime::Symmetric | Regime::Unresolved => true,
        Regime::Asymmetric => !scene.has_mirror_images(),
        _ => false,
    };
    if !is_expected {
        return Err(IdentificationError::Regime {
            regime: lock.regime,
            sigma: lock.at.sigma,
            c: lock.at.c,
            longer: (lock.regime == Regime::Asymmetric)
                .then(|| longer_after(record.hold()))
                .flatten(),
        });
    }
    on_target(&lock, scene)?;
    sensors_after_release(record, scene)?;
    let decay = decay_points(record, scene);
    Ok(Identification { parameters: scene.dimensionless(), lock, decay })
}
