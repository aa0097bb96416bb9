//! When a level is settled: drive and frequency of phase resonance ([`LevelEstimate`]) are known as precisely as the scene asks, from periods whose
//! innovations are white noise. Noise lengthens the window, and so does a transient that the model does not describe.

use std::cmp::Ordering;
use std::fmt::{self, Display, Formatter};

use vines_model::numerics::{Estimate, RANDOM};

use super::{Cycle, LevelEstimate};
use vines_scene::knowledge::Knowledge;

/// What is asked of a level.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Criterion {
    /// What is known of the rig.
    pub knowledge: Knowledge,
    /// Largest standard uncertainty of the drive E, as a share of it, and of the frequency, as a share of `omega0 E/A` at the largest level A.
    pub precision: f64,
    /// The largest level, m.
    pub largest: f64,
    /// The last two points before, the nearest last: amplitude of the response, m, drive, m, and frequency, rad/s.
    pub before: [Option<[f64; 3]>; 2],
}

/// What is not noise in a window of periods.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Unsteady {
    /// Scatter of the periods over what the noise of the sensors explains; `None` where no balance describes them.
    Scatter(Option<f64>),
    /// Correlation of the residuals of neighbouring periods, over what noise would have.
    Drift(f64),
    /// Repeats only after this many periods.
    Repeats(usize),
}

impl Display for Unsteady {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Scatter(None) => write!(f, "no balance describes its periods"),
            Self::Scatter(Some(times)) => write!(
                f,
                "its periods scatter {times:.1} times as much as noise of the response explains: it is modulated or irregular, or noise of the drive moves it"
            ),
            Self::Repeats(periods) => write!(f, "it repeats only after {periods} periods of the drive"),
            Self::Drift(times) => write!(
                f,
                "the residuals of its periods follow from each other, {times:.1} standard deviations of noise: it is modulated, or has not settled"
            ),
        }
    }
}

/// Largest mean phase error, rad: the balances are of the first order in it. At epsilon = 0.02 near the
/// fold, 0.03 rad change sigma at equal C by 1.1e-3.
const LARGEST_PHASE_ERROR: f64 = 0.02;
/// Relative standard uncertainty of the slope of a straight line through two points: away from the fold the slope changes by less from level to
/// level.
const SLOPE: f64 = 0.5;
/// Periods after which a level is taken, settled or not.
pub(crate) const LONGEST_SETTLING: usize = 150;
/// Shares of the periods that are considered, from the last one backwards.
const WINDOWS: [f64; 3] = [1.0, 0.7, 0.5];

/// Whether a mean phase error, rad, with this standard uncertainty is too large for a level.
pub(crate) fn is_off_target(error: f64, u: f64) -> bool {
    error.abs() > LARGEST_PHASE_ERROR + RANDOM * u
}

impl Criterion {
    /// The window with the smallest uncertainties, from the last of these periods backwards, of those that noise explains, if any; `None` for too few.
    pub fn best(&self, cycles: &[Cycle]) -> Option<LevelEstimate> {
        let n = cycles.len();
        let counts = WINDOWS.map(|share| (share * n as f64).round() as usize);
        let considered = counts.into_iter().filter(|count| *count >= 2 * LevelEstimate::FEWEST);
        let rank = |estimate: &LevelEstimate| (estimate.unsteady.is_some(), self.size(estimate));
        considered
            .filter_map(|count| self.of(&cycles[n - count..]))
            .min_by(|one, other| rank(one).partial_cmp(&rank(other)).unwrap_or(Ordering::Equal))
    }

    /// Whether the uncertainties are small enough, and the phase is near its target.
    pub fn is_met(&self, estimate: &LevelEstimate) -> bool {
        let Estimate { value, uncertainty } = estimate.phase_error;
        self.size(estimate) <= 1.0 && estimate.unsteady.is_none() && !is_off_target(value, uncertainty)
    }

    /// Largest uncertainty over the largest allowed.
    fn size(&self, estimate: &LevelEstimate) -> f64 {
        let [_, drive, omega] = estimate.at;
        let allowed = self.precision * drive.value.abs();
        let of_omega = self.knowledge.linear.omega0 * allowed / self.largest;
        (drive.uncertainty / allowed).max(omega.uncertainty / of_omega)
    }

    /// Slopes of drive and frequency over the amplitude at a point: of the parabola through it and the two before, with its distance from the
    /// line through it and the one before as a part of the uncertainty. `None` for the first point.
    fn slopes(&self, here: [f64; 3]) -> Option<[Estimate; 2]> {
        let [before, last] = self.before;
        let last = last?;
        let between = |from: [f64; 3], to: [f64; 3]| [1, 2].map(|i| (to[i] - from[i]) / (to[0] - from[0]));
        let line = between(last, here);
        let bend = before.map_or([0.0; 2], |before| {
            let earlier = between(before, last);
            let ahead = (here[0] - last[0]) / (here[0] - before[0]);
            [0, 1].map(|i| (line[i] - earlier[i]) * ahead)
        });
        let slopes = [0, 1].map(|i| Estimate::new(line[i] + bend[i], &[bend[i], SLOPE * line[i]]));
        slopes.iter().all(|slope| slope.value.is_finite()).then_some(slopes)
    }

    /// The point of a window.
    fn of(&self, cycles: &[Cycle]) -> Option<LevelEstimate> {
        let fit = |slopes| LevelEstimate::of(cycles, &self.knowledge, slopes, true);
        let mut level = fit(None)?;
        if let Some(known) = self.slopes(level.at.map(|quantity| quantity.value)) {
            level = fit(Some(known))?;
        }
        let is_finite = level.at.iter().all(|part| (part.value + part.uncertainty).is_finite());
        is_finite.then_some(level)
    }
}
