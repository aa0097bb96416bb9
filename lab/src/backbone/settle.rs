//! When a point is settled, and what it says.
//!
//! What still drifts need not be waited for as long as it is accounted for. Near phase resonance the response obeys
//! `A' = g (E - E_R)` and `phase' = omega_R - omega - delta phase` with `g = omega/2` for a structure shaken through its base and
//! `delta = g E_R/A`, so that straight lines through amplitude and phase over some periods give the drive `E_R` and the
//! frequency `omega_R` of phase resonance at the mean amplitude. A point is settled where both halves of these periods say
//! the same, to within the tolerance or the noise, and where the noise leaves them known to within the tolerance.

use super::cycle::Cycle;

/// The criterion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Criterion {
    /// Largest difference between both halves and largest standard error: of the drive, relative, and of the frequency,
    /// relative to the damping rate.
    pub tolerance: f64,
    /// Fewest periods.
    pub fewest: usize,
}

/// What some periods say about phase resonance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// How many periods.
    pub periods: usize,
    /// Mean amplitude of the response, m.
    pub response: f64,
    /// Amplitude of the base that holds it there, m.
    pub base: f64,
    /// Frequency at which it does, rad/s.
    pub omega: f64,
    /// Mean phase error, rad.
    pub phase_error: f64,
    /// Damping rate, rad/s.
    pub damping_rate: f64,
    /// Standard errors of response and base, relative, and of the frequency, relative to the damping rate.
    pub errors: [f64; 3],
}

/// Phase error, rad, up to which the phase's equation is taken as linear.
const PHASE_RANGE: f64 = 0.1;
/// Fewest periods of a half.
const HALF: usize = 3;

impl Criterion {
    /// What the longest settled stretch at the end of `cycles` says, if there is one.
    #[must_use]
    pub fn judge(&self, cycles: &[Cycle]) -> Option<Estimate> {
        (self.fewest.max(2 * HALF)..=cycles.len())
            .rev()
            .map(|periods| &cycles[cycles.len() - periods..])
            .find_map(|last| {
                let whole = Estimate::of(last);
                self.is_settled(last, &whole).then_some(whole)
            })
    }

    fn is_settled(&self, cycles: &[Cycle], whole: &Estimate) -> bool {
        let (first, second) = cycles.split_at(cycles.len() / 2);
        let (first, second) = (Estimate::of(first), Estimate::of(second));
        let differences = [
            (first.base - second.base) / whole.base,
            (first.omega - second.omega) / whole.damping_rate,
        ];
        let known = whole.errors.iter().all(|error| *error <= self.tolerance);
        known
            && whole.phase_error.abs() <= PHASE_RANGE
            && differences.iter().enumerate().all(|(i, difference)| {
                let noise = first.errors[i + 1].hypot(second.errors[i + 1]);
                difference.abs() <= self.tolerance.max(2.0 * noise)
            })
    }
}

impl Estimate {
    /// From at least [`HALF`] periods.
    #[must_use]
    pub fn of(cycles: &[Cycle]) -> Self {
        let line = |value: fn(&Cycle) -> f64| Line::through(cycles.iter().map(value));
        let response = line(|cycle| cycle.response[0].norm());
        let base = line(|cycle| cycle.base.norm());
        let phase = line(|cycle| cycle.phase_error);
        let omega = line(|cycle| cycle.omega);
        // From a change per period to a rate.
        let per_second = omega.mean / std::f64::consts::TAU;
        let gain = 0.5 * omega.mean;
        let drive = base.mean - response.slope * per_second / gain;
        let damping_rate = gain * drive / response.mean;
        let errors = [
            response.mean_error / response.mean,
            base.mean_error.hypot(response.slope_error * per_second / gain) / drive,
            (omega.mean_error / damping_rate)
                .hypot(phase.slope_error * per_second / damping_rate)
                .hypot(phase.mean_error),
        ];
        Self {
            periods: cycles.len(),
            response: response.mean,
            base: drive,
            omega: omega.mean + phase.slope * per_second + damping_rate * phase.mean,
            phase_error: phase.mean,
            damping_rate,
            errors,
        }
    }
}

/// The straight line that fits equally spaced values best.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Line {
    /// Value at the middle.
    mean: f64,
    /// Change from a value to the next.
    slope: f64,
    /// Standard error of each.
    mean_error: f64,
    slope_error: f64,
}

impl Line {
    /// Through at least three values.
    fn through(values: impl Iterator<Item = f64>) -> Self {
        let values: Vec<f64> = values.collect();
        let n = values.len() as f64;
        let middle = 0.5 * (n - 1.0);
        let mean = values.iter().sum::<f64>() / n;
        let spread = n * (n * n - 1.0) / 12.0;
        let about = |sum: f64, (i, value): (usize, &f64)| sum + (i as f64 - middle) * (value - mean);
        let slope = values.iter().enumerate().fold(0.0, about) / spread;
        let squares = |sum: f64, (i, value): (usize, &f64)| {
            sum + (value - mean - slope * (i as f64 - middle)).powi(2)
        };
        let variance = values.iter().enumerate().fold(0.0, squares) / (n - 2.0);
        Self {
            mean,
            slope,
            mean_error: (variance / n).sqrt(),
            slope_error: (variance / spread).sqrt(),
        }
    }
}
