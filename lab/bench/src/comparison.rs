//! Measurements beside first-order theory and exact orbits at the same parameters.

mod decay;
mod exact_curve;
mod tracked;

use serde::Serialize;
use vines_model::Dimensionless;
use vines_model::numerics::mean_square;
use vines_model::orbit::{self, Orbit};
use vines_model::theory::{BackbonePoint, free_sigma, resonant};

use crate::identification::{DecayEnd, DecayPoint, Identification, Lock};
use crate::scene::Scene;

pub use exact_curve::{Distance, ExactCurve};
pub use tracked::{TrackedComparison, TrackedPoint, Worst};

/// Amplitudes above which the decay is compared with theory, C.
///
/// Nearer to the fold (C = Cmin) the slow flow is no longer slow compared with a period.
pub const COMPARED_ABOVE: f64 = 0.2;

/// An identified system beside theory and exact orbits; dimensionless throughout.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// The numbers all of this belongs to.
    pub parameters: Dimensionless,
    /// The phase of the response relative to the reference that the lock held, degrees.
    pub phase_target_deg: f64,
    /// The locked point as measured.
    pub lock: Lock,
    /// First-order theory at the same G: the stable solution nearest to the lock; absent if the phase target is not
    /// phase resonance.
    pub theory: Option<BackbonePoint>,
    /// The exact phase-resonant orbit at the same G nearest to the lock; absent as above.
    pub exact: Option<Orbit>,
    /// All exact phase-resonant orbits at the same G, by rising C; the lock followed `exact`.
    pub orbits: Vec<Orbit>,
    /// The decay, from the release on.
    pub decay: Vec<ComparedPoint>,
    /// What ended its points.
    pub decay_end: DecayEnd,
    /// RMS of the decay's sigma minus theory, over the points with C > 0.2.
    pub rms_sigma_error: Option<f64>,
    /// RMS of the decay's sigma minus that of the exact backbone at the same C, over the same points.
    pub rms_sigma_exact: Option<f64>,
    /// RMS of the decay's sigma minus that of the exact plant, released on the exact orbit and evaluated alike, over the same points.
    pub rms_sigma_predicted: Option<f64>,
}

/// A point along the decay beside theory.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ComparedPoint {
    /// The point.
    #[serde(flatten)]
    pub point: DecayPoint,
    /// Detuning of the backbone at this C, to first order; absent below the fold.
    pub sigma_theory: Option<f64>,
    /// Detuning of the exact backbone at this C; absent outside it.
    pub sigma_exact: Option<f64>,
    /// Detuning at this C of the decay that the slow flow predicts, to the first order in its rate; absent below the fold.
    pub sigma_slow_flow: Option<f64>,
    /// Detuning at this C of the decay of the exact plant from the exact orbit; absent outside it.
    pub sigma_predicted: Option<f64>,
}

impl Comparison {
    /// Compares what was identified on `scene`.
    pub fn of(found: &Identification, scene: &Scene) -> Self {
        let (parameters, lock) = (found.parameters, found.lock);
        let at_resonance = scene.controller.is_at_phase_resonance();
        let distance = |sigma: f64, c: f64| (sigma - lock.at.sigma).hypot(c - lock.at.c);
        let theory = resonant(&parameters)
            .into_iter()
            .filter(|point| at_resonance && point.stable())
            .min_by(|a, b| distance(a.sigma, a.c).total_cmp(&distance(b.sigma, b.c)));
        let orbits: Vec<Orbit> = orbit::phase_resonant(&parameters)
            .into_iter()
            .filter(|_| at_resonance)
            .collect();
        let exact = nearest(&orbits, &lock);
        let curve = ExactCurve::of(&parameters);
        let samples = crate::experiment::Plan::of(scene).decay;
        let predicted = exact.map_or(Vec::new(), |orbit| decay::predicted(&orbit, scene, samples));
        let decay: Vec<ComparedPoint> = found
            .decay
            .points
            .iter()
            .map(|point| ComparedPoint {
                point: *point,
                sigma_theory: free_sigma(&parameters, point.c),
                sigma_exact: curve.at(point.c).map(|[sigma, _]| sigma),
                sigma_slow_flow: decay::by_slow_flow(&parameters, point.c),
                sigma_predicted: decay::sigma_at(&predicted, point.c),
            })
            .collect();
        Self {
            rms_sigma_error: rms(&decay, |one| Some(one.point.sigma - one.sigma_theory?)),
            rms_sigma_exact: rms(&decay, |one| Some(one.point.sigma - one.sigma_exact?)),
            rms_sigma_predicted: rms(&decay, |one| Some(one.point.sigma - one.sigma_predicted?)),
            parameters,
            phase_target_deg: scene.controller.phase_target,
            lock,
            theory,
            exact,
            orbits,
            decay,
            decay_end: found.decay.end,
        }
    }

    /// The stable orbits at this G that the lock did not follow.
    pub fn others(&self) -> impl Iterator<Item = &Orbit> {
        self.orbits
            .iter()
            .filter(|orbit| orbit.stable && self.exact.as_ref() != Some(*orbit))
    }
}

/// The orbit that is nearest to a lock.
fn nearest(orbits: &[Orbit], lock: &Lock) -> Option<Orbit> {
    let distance = |one: &Orbit| (one.sigma - lock.at.sigma).hypot(one.c - lock.at.c);
    orbits
        .iter()
        .copied()
        .min_by(|one, other| distance(one).total_cmp(&distance(other)))
}

/// RMS of an error over the points above [`COMPARED_ABOVE`]; `None` where there is none.
fn rms(points: &[ComparedPoint], error: impl Fn(&ComparedPoint) -> Option<f64>) -> Option<f64> {
    let errors = points
        .iter()
        .filter(|one| one.point.c > COMPARED_ABOVE)
        .filter_map(error);
    let mean_square = mean_square(errors);
    (!mean_square.is_nan()).then(|| mean_square.sqrt())
}
