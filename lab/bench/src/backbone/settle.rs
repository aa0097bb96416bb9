//! The criterion for a settled point, and the choice of the periods that it is averaged over.
//!
//! The balances of amplitude and phase ([`Balance`]) give the point for any history of drive and frequency, and their standard
//! uncertainties follow from the noise of the sensors. A remaining transient shows as a difference between the two halves of the
//! periods beyond that noise; half of it counts as a part of the uncertainty. A point is settled when the uncertainties of drive and
//! frequency are small enough. Noise therefore lengthens the dwell, and no random agreement shortens it.

use vines_model::numerics::Estimate;

use crate::identification::{Balance, Cycle, Slopes};

/// The criterion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Criterion {
    /// Natural frequency, rad/s.
    pub omega0: f64,
    /// Largest standard uncertainties of the drive, m, and of the frequency, rad/s.
    pub precision: [f64; 2],
    /// Largest parts of them that are not noise.
    pub tolerance: [f64; 2],
    /// Smallest standard uncertainties: smaller transients are not seen.
    pub least: [f64; 2],
    /// Phase error at which the point is held, rad.
    pub phase: f64,
    /// Largest relative deviation of the amplitude within the periods, unless it is noise.
    pub spread: f64,
    /// Fewest periods.
    pub fewest: usize,
    /// Slopes of the backbone, as far as they are known.
    pub slopes: Slopes,
}

/// A point of the backbone from some periods.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Found {
    /// How many periods.
    pub periods: usize,
    /// Mean amplitude of the response, m.
    pub response: Estimate,
    /// Mean phase error, rad.
    pub phase_error: Estimate,
    /// Drive, m, and frequency, rad/s, of phase resonance at this amplitude.
    pub at: [Estimate; 2],
    /// Parts of their uncertainties that are not noise.
    pub systematic: [f64; 2],
    /// Whether the motion is steady or its change is accounted for.
    pub steady: bool,
}

impl Found {
    /// Means over the periods, of a motion that no balance describes.
    #[must_use]
    pub fn unsettled(cycles: &[Cycle]) -> Self {
        let mean = |value: &dyn Fn(&Cycle) -> f64| Estimate::mean(&cycles.iter().map(value).collect::<Vec<f64>>());
        Self {
            periods: cycles.len(),
            response: mean(&Cycle::amplitude),
            phase_error: mean(&|cycle| cycle.phase_error),
            at: [mean(&|cycle| cycle.base.norm()), mean(&|cycle| cycle.omega)],
            systematic: [f64::INFINITY; 2],
            steady: false,
        }
    }
}

/// Largest deviation of the mean phase, rad, from that which is held: the balances are of the first order in it. At epsilon = 0.02 beside the
/// fold, 0.03 rad change sigma at equal C by 1.1e-3.
const BESIDE: f64 = 0.02;
/// The same for single periods.
const PHASE_RANGE: f64 = 0.3;
/// Difference of the halves, in its standard uncertainties, that still counts as noise.
const RANDOM: f64 = 2.0;
/// Largest scatter of the residuals over the noise of the sensors for a steady motion whose uncertainty is not yet small.
const STEADY: f64 = 2.0;
/// Relative uncertainty of the effect of the curvature.
pub const BENT: f64 = 0.05;
/// Shares of the periods that are considered, from the last one backwards: noise can hide the end of the move in the first ones.
const SHARES: [f64; 5] = [0.85, 0.7, 0.55, 0.45, 0.35];

impl Criterion {
    /// The best estimate from the last of these periods; `None` for too few.
    #[must_use]
    pub fn best(&self, cycles: &[Cycle]) -> Option<Found> {
        let n = cycles.len();
        let counts = SHARES.map(|share| ((share * n as f64).round() as usize).max(self.fewest));
        let considered = counts.into_iter().filter(|count| *count <= n);
        self.best_of(considered.map(|count| &cycles[n - count..]))
    }

    /// The best estimate from all of some periods; `None` for too few.
    #[must_use]
    pub fn best_of<'a>(&self, considered: impl IntoIterator<Item = &'a [Cycle]>) -> Option<Found> {
        considered
            .into_iter()
            .filter_map(|cycles| self.from(cycles))
            .filter(|found| found.at.iter().all(|one| (one.value + one.uncertainty).is_finite()))
            .min_by(|one, other| self.size(one).total_cmp(&self.size(other)))
            .map(|mut found| {
                for (estimate, least) in found.at.iter_mut().zip(self.least) {
                    estimate.uncertainty = estimate.uncertainty.max(least);
                }
                found
            })
    }

    /// Whether the uncertainties are small enough, and the phase is near the one that is held.
    #[must_use]
    pub fn is_met(&self, found: &Found) -> bool {
        let Estimate { value, uncertainty } = found.phase_error;
        self.size(found) <= 1.0 && (value - self.phase).abs() <= BESIDE + RANDOM * uncertainty
    }

    /// Largest uncertainty over the largest allowed.
    fn size(&self, found: &Found) -> f64 {
        let size =
            |i: usize| (found.at[i].uncertainty / self.precision[i]).max(found.systematic[i] / self.tolerance[i]);
        size(0).max(size(1))
    }

    fn from(&self, cycles: &[Cycle]) -> Option<Found> {
        let fit = |cycles: &[Cycle]| Balance::of(cycles, self.omega0, &self.slopes);
        let (first, second) = cycles.split_at(cycles.len() / 2);
        let (whole, first, second) = (fit(cycles)?, fit(first)?, fit(second)?);
        let amplitude = whole.response.value;
        let noise = 4.0 * cycles[0].noise[0].sqrt();
        let is_near = |cycle: &Cycle| {
            let deviation = (cycle.amplitude() - amplitude).abs();
            deviation <= (self.spread * amplitude).max(noise) && (cycle.phase_error - self.phase).abs() <= PHASE_RANGE
        };
        if !cycles.iter().all(is_near) {
            return None;
        }
        let [first, second] = [first, second].map(|half| half.at(amplitude - half.response.value));
        let slopes = whole
            .slopes()
            .map(|slope| slope.value.hypot(slope.uncertainty) * whole.u_level);
        let estimates = whole.at(0.0);
        let drifts = [0, 1].map(|i| {
            let noise = first[i].uncertainty.hypot(second[i].uncertainty);
            ((first[i].value - second[i].value).abs() - RANDOM * noise).max(0.0)
        });
        let bent = whole.bent();
        let systematic = [0, 1].map(|i| drifts[i].hypot(whole.remainders[i]).hypot(BENT * bent[i]));
        Some(Found {
            periods: cycles.len(),
            response: whole.response,
            phase_error: whole.phase_error,
            at: [0, 1].map(|i| {
                Estimate::new(
                    estimates[i].value - bent[i],
                    &[estimates[i].uncertainty, slopes[i], systematic[i]],
                )
            }),
            systematic,
            steady: drifts == [0.0; 2] && whole.excess <= STEADY,
        })
    }
}
