//! One level: the window of the fit, and the judge of whether the motion is steady.
//!
//! The balances ([`Balance`]) give drive and frequency of phase resonance from any window of periods, with their standard uncertainties.
//! What is not noise shows as a difference between the two halves of the window beyond their noise; it counts as a part of the
//! uncertainty. A level is settled when the uncertainties are as small as the scene asks: noise lengthens the window, and so does a
//! transient.

use vines_model::numerics::{Estimate, RANDOM};

use crate::identification::{Balance, Cycle, Slopes};
use crate::scene::LinearResponse;

/// What is asked of a level.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Criterion {
    /// Linear response of the rig.
    pub linear: LinearResponse,
    /// Largest standard uncertainty of the drive E, as a share of it, and of the frequency, as a share of `omega0 E/A` at the largest level A.
    pub precision: f64,
    /// The largest level, m.
    pub largest: f64,
    /// The last two points before, the nearest last: amplitude of the response, m, drive, m, and frequency, rad/s.
    pub before: [Option<[f64; 3]>; 2],
}

/// A point of the backbone from a window of periods.
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
    /// Whether what is left is noise: the fit describes the window, and the rest is within the precision.
    pub steady: bool,
}

/// Largest mean phase error, rad: the balances are of the first order in it. At epsilon = 0.02 beside the
/// fold, 0.03 rad change sigma at equal C by 1.1e-3.
const BESIDE: f64 = 0.02;
/// Periods by which the impacts follow a change of the amplitude late: the errors of clean points, over slope and rate, are 0.8 to 1.6 periods
/// (studies/off_scene.rs).
const LAG: f64 = 1.6;
/// Largest scatter of the periods about the fit, over the noise of the sensors: chi-square per degree of freedom is then at most 4.
const EXCESS: f64 = 2.0;
/// Relative standard uncertainty of the slope of a straight line through two points: away from the fold it changes by less from level to level.
const SLOPE: f64 = 0.5;
/// Shares of the periods that are considered, from the last one backwards.
const WINDOWS: [f64; 3] = [1.0, 0.7, 0.5];

impl Criterion {
    /// The window with the smallest uncertainties, from the last of these periods backwards; `None` for too few.
    #[must_use]
    pub fn best(&self, cycles: &[Cycle]) -> Option<Found> {
        let n = cycles.len();
        let counts = WINDOWS.map(|share| (share * n as f64).round() as usize);
        let considered = counts.into_iter().filter(|count| *count >= 2 * Balance::FEWEST);
        considered
            .filter_map(|count| self.of(&cycles[n - count..]))
            .filter(|found| found.at.iter().all(|one| (one.value + one.uncertainty).is_finite()))
            .min_by(|one, other| self.size(one).total_cmp(&self.size(other)))
    }

    /// Whether the uncertainties are small enough, and the phase is near its target.
    #[must_use]
    pub fn is_met(&self, found: &Found) -> bool {
        let Estimate { value, uncertainty } = found.phase_error;
        self.size(found) <= 1.0 && value.abs() <= BESIDE + RANDOM * uncertainty
    }

    /// Largest uncertainty over the largest allowed.
    fn size(&self, found: &Found) -> f64 {
        let allowed = self.allowed(found.at[0].value);
        let [base, omega] = [0, 1].map(|i| found.at[i].uncertainty / allowed[i]);
        base.max(omega)
    }

    /// Largest uncertainties allowed of the drive, m, and of the frequency, rad/s, at this drive, m.
    fn allowed(&self, drive: f64) -> [f64; 2] {
        let (base, omega0) = (self.precision * drive.abs(), self.linear.omega0);
        [base, omega0 * base / self.largest]
    }

    /// Slopes of drive and frequency over the amplitude at a point: of the parabola through it and the two before, with its distance from the
    /// line through it and the one before as a part of the uncertainty. `None` for the first point.
    fn slopes(&self, here: [f64; 3]) -> Option<[Estimate; 2]> {
        let [before, last] = self.before;
        let last = last?;
        let between = |one: [f64; 3], other: [f64; 3]| [1, 2].map(|i| (other[i] - one[i]) / (other[0] - one[0]));
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
    fn of(&self, cycles: &[Cycle]) -> Option<Found> {
        let fit = |cycles: &[Cycle], slopes| Balance::of(cycles, &self.linear, slopes);
        let whole = fit(cycles, Slopes::Unknown)?;
        let [base, omega] = whole.at(0.0).map(|one| one.value);
        let known = self.slopes([whole.response.value, base, omega]);
        let slopes = known.map_or(Slopes::Unknown, Slopes::Known);
        let (first, second) = cycles.split_at(cycles.len() / 2);
        let (whole, first, second) = (fit(cycles, slopes)?, fit(first, slopes)?, fit(second, slopes)?);
        let amplitude = whole.response.value;
        let [first, second] = [first, second].map(|half| half.at(amplitude - half.response.value));
        let (estimates, own) = (whole.at(0.0), whole.slopes());
        let slope = |i: usize| {
            let known = known.map_or(0.0, |slopes| slopes[i].value.abs());
            own[i].value.abs().max(known).hypot(own[i].uncertainty)
        };
        // What is not noise belongs to the force of the impacts, a phasor: what is seen of it in one balance may be in the other, too.
        let (units, change) = ([1.0, amplitude / whole.gain], LAG * whole.change);
        let systematic = [0, 1].map(|i| {
            let noise = first[i].uncertainty.hypot(second[i].uncertainty);
            let drift = ((first[i].value - second[i].value).abs() - RANDOM * noise).max(0.0);
            let late = slope(i) * change;
            units[i] * drift.hypot(late)
        });
        let systematic = systematic[0].hypot(systematic[1]);
        let at = [0, 1].map(|i| {
            // The noise of the amplitude moves drive and frequency along their slopes.
            let aside = slope(i) * whole.u_level;
            let one = estimates[i];
            Estimate::new(
                one.value,
                &[one.uncertainty, aside, systematic / units[i], whole.remainders[i]],
            )
        });
        let allowed = self.allowed(at[0].value);
        Some(Found {
            periods: cycles.len(),
            response: whole.response,
            phase_error: whole.phase_error,
            at,
            steady: whole.excess <= EXCESS && systematic <= allowed[0].min(units[1] * allowed[1]),
        })
    }
}

impl Found {
    /// Means over the periods, of a motion that no balance describes.
    #[must_use]
    pub fn means(cycles: &[Cycle]) -> Self {
        let mean = |value: &dyn Fn(&Cycle) -> f64| Estimate::mean(&cycles.iter().map(value).collect::<Vec<f64>>());
        Self {
            periods: cycles.len(),
            response: mean(&Cycle::amplitude),
            phase_error: mean(&|cycle| cycle.phase_error),
            at: [mean(&|cycle| cycle.base.norm()), mean(&|cycle| cycle.omega)],
            steady: false,
        }
    }
}
