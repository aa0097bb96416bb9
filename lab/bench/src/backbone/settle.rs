//! The criterion for a settled point, and the estimates of its drive and frequency.
//!
//! A point can be evaluated before the loops have settled completely, because near phase resonance the response obeys the balances
//! `A' = g (E - E_R)` and `phase' = omega_R - omega - delta phase`, with `g = omega/2` for a base-excited structure and
//! `delta = g E_R/A`: the drive `E_R` and the frequency `omega_R` of phase resonance are the slopes of straight lines in time,
//!
//! ```text
//! integral of E - A/g = E_R t + const,      integral of (omega + delta phase) + phase = omega_R t + const
//! ```
//!
//! for any history of drive and frequency. A point is settled when these lines are straight and their slopes are accurate: both halves
//! of the periods agree within a tolerance, or within the random scatter from period to period if that is larger.

use vines_model::numerics::{Line, mean, noise, standard_deviation};

use super::cycle::Cycle;

/// The criterion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Criterion {
    /// Largest difference between both halves, and largest standard error, of the drive, relative, and of the frequency,
    /// relative to the damping rate.
    pub tolerance: f64,
    /// Largest standard error of the same quantities where noise dominates.
    pub precision: f64,
    /// Fewest periods.
    pub fewest: usize,
}

/// Estimates of phase resonance from a number of periods.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// How many periods.
    pub periods: usize,
    /// Mean amplitude of the response, m.
    pub response: f64,
    /// Amplitude of the base that holds it there, m.
    pub base: f64,
    /// Frequency of phase resonance, rad/s.
    pub omega: f64,
    /// Mean phase error, rad.
    pub phase_error: f64,
    /// Damping rate, rad/s.
    pub damping_rate: f64,
    /// Standard deviation of the response's amplitude, relative, and of its random part.
    pub spread: [f64; 2],
    /// Standard errors of the base, relative, and of the frequency, relative to the damping rate.
    pub errors: [f64; 2],
    /// Whether the residuals of each line are random from period to period.
    pub random: [bool; 2],
}

/// Phase error, rad, up to which the balances count as linear.
const PHASE_RANGE: f64 = 0.1;
/// Standard deviation of the response's amplitude, in units of the tolerance, up to which the backbone counts as straight.
const SPREAD: f64 = 3.0;
/// Fewest periods of a half.
const HALF: usize = 3;
/// Residuals count as random where third differences find at least this share of their standard deviation: they respond
/// fully to white noise and hardly to smooth signals.
const RANDOM_SHARE: f64 = 0.6;

impl Criterion {
    /// The estimate from the longest settled stretch at the end of `cycles`, if there is one.
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
        // The variance of a slope over half the periods is eight times larger, that of the difference of two slopes sixteen times.
        let is_straight = |i: usize| {
            let (difference, error) = (differences[i].abs(), whole.errors[i]);
            let smooth = difference <= self.tolerance && error <= self.tolerance;
            let random = whole.random[i] && difference <= 8.0 * error && error <= self.precision;
            smooth || random
        };
        let [spread, random] = whole.spread;
        let near = spread <= (SPREAD * self.tolerance).max(2.0 * random);
        near && whole.phase_error.abs() <= PHASE_RANGE && is_straight(0) && is_straight(1)
    }
}

impl Estimate {
    /// From at least three periods.
    #[must_use]
    pub fn of(cycles: &[Cycle]) -> Self {
        let amplitudes: Vec<f64> = cycles.iter().map(|c| c.response[0].norm()).collect();
        let response = mean(amplitudes.iter().copied());
        let phase_error = mean(cycles.iter().map(|cycle| cycle.phase_error));
        let gain = 0.5 * mean(cycles.iter().map(|cycle| cycle.omega));
        let period = std::f64::consts::PI / gain;
        let base = |cycle: &Cycle| cycle.base.norm() * period;
        let drive = Balance::of(cycles, base, |cycle| -cycle.response[0].norm() / gain);
        let base = drive.line.slope / period;
        let damping_rate = gain * base / response;
        let rate = |cycle: &Cycle| (cycle.omega + damping_rate * cycle.phase_error) * period;
        let turning = Balance::of(cycles, rate, |cycle| cycle.phase_error);
        Self {
            periods: cycles.len(),
            response,
            base,
            omega: turning.line.slope / period,
            phase_error,
            damping_rate,
            spread: [standard_deviation(&amplitudes), noise(&amplitudes)].map(|one| one / response),
            errors: [
                drive.line.slope_error / drive.line.slope.abs(),
                turning.line.slope_error / (period * damping_rate).abs(),
            ],
            random: [drive.random, turning.random],
        }
    }
}

/// A balance as a straight line in time.
struct Balance {
    line: Line,
    /// The residuals are random.
    random: bool,
}

impl Balance {
    /// The line through the integral of `rate` (per period) from the middle of the first period on, plus `level`.
    fn of(cycles: &[Cycle], rate: impl Fn(&Cycle) -> f64, level: impl Fn(&Cycle) -> f64) -> Self {
        let mut integral = 0.0;
        let mut before: Option<f64> = None;
        let mut value = |cycle: &Cycle| {
            let now = rate(cycle);
            integral += before.map_or(0.0, |before| 0.5 * (before + now));
            before = Some(now);
            integral + level(cycle)
        };
        let values: Vec<f64> = cycles.iter().map(&mut value).collect();
        let line = Line::fit(&values);
        Self { random: noise(&values) >= RANDOM_SHARE * line.residual, line }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Complex;

    const CRITERION: Criterion = Criterion { tolerance: 5e-4, precision: 2e-3, fewest: 8 };
    /// Drive and frequency of phase resonance.
    const TRUTH: (f64, f64) = (0.02, 3.0);

    /// Periods in which the loops still oscillate, with disturbances of `noise` on amplitude and phase.
    fn cycles(count: usize, swing: f64, noise: impl Fn(usize) -> f64) -> Vec<Cycle> {
        let (base, omega) = TRUTH;
        let period = std::f64::consts::TAU / omega;
        let (mut a, mut phase) = (1.0, 0.0);
        let steps = 1000;
        (0..count)
            .map(|n| {
                let dt = period / f64::from(steps);
                let damping_rate = 0.5 * omega * base / a;
                let turn = 0.7 * n as f64;
                let (e, w) = (
                    base * (1.0 + swing * turn.sin()),
                    omega + swing * damping_rate * turn.cos(),
                );
                let (mut amplitude, mut error) = (0.0, 0.0);
                for _ in 0..steps {
                    a += dt * 0.5 * omega * (e - base * a);
                    phase += dt * (omega - w - damping_rate * phase);
                    amplitude += a / f64::from(steps);
                    error += phase / f64::from(steps);
                }
                Cycle {
                    omega: w,
                    response: [
                        Complex::new(amplitude + noise(2 * n), 0.0),
                        Complex::default(),
                        Complex::default(),
                    ],
                    base: Complex::new(e, 0.0),
                    phase_error: error + noise(2 * n + 1),
                }
            })
            .collect()
    }

    #[test]
    fn what_the_loops_still_do_is_accounted_for() {
        // The drive swings by a percent: a mean over these periods would be off by thousandths.
        let found = CRITERION.judge(&cycles(9, 0.01, |_| 0.0)).unwrap();
        assert!((found.base / found.response / TRUTH.0 - 1.0).abs() < 5e-4);
        assert!((found.omega - TRUTH.1).abs() < 5e-4 * found.damping_rate);
    }

    #[test]
    fn too_few_periods_are_never_settled() {
        assert_eq!(CRITERION.judge(&cycles(7, 0.0, |_| 0.0)), None);
    }

    #[test]
    fn a_swing_too_wide_is_not_settled() {
        assert_eq!(CRITERION.judge(&cycles(12, 0.3, |_| 0.0)), None);
    }

    #[test]
    fn noise_is_waited_out() {
        // A fixed sequence of uniform numbers, a golden angle apart.
        let noise = |n: usize| 5e-3 * ((n as f64 * 7.318_033_99).sin() * 1e4).fract();
        let settled = (8..200).find_map(|n| CRITERION.judge(&cycles(n, 0.0, noise)));
        let found = settled.unwrap();
        assert!(found.periods > 12, "{found:?}");
        assert!((found.base / TRUTH.0 - 1.0).abs() < 4e-3, "{found:?}");
        assert!((found.omega - TRUTH.1).abs() < 4.0 * CRITERION.precision * found.damping_rate);
    }
}
