//! Phase resonance from the balances of amplitude and phase: the estimator of locked and of tracked points.
//!
//! Near phase resonance, amplitude A and phase Theta of the response to a base of the amplitude E obey
//!
//! ```text
//! A' = g (E cos phi - E_R(A)),      Theta' = omega_R(A) - (g E/A) sin phi,      g = omega0^2/(2 omega)
//! ```
//!
//! with the phase error phi. The drive `E_R` and the frequency `omega_R` of phase resonance follow for any history of drive and
//! frequency, from straight lines in time:
//!
//! ```text
//! A - integral of g E cos phi = const - g E_R t,      Theta + integral of (g E/A) sin phi = const + omega_R t
//! ```
//!
//! Where A varies within the periods used, `E_R` and `omega_R` are linear in it, which adds the integral of `A - mean A` to the
//! lines. docs/estimators.md derives the uncertainties.

use nalgebra::Complex;
use vines_model::numerics::{Estimate, Prior, Regression, mean, slope};

use super::motion::{Motion, motion};
use super::{Cycle, Slopes};

/// The two lines, fitted to some periods.
#[derive(Debug, Clone)]
pub struct Balance {
    /// Mean amplitude of the response, m.
    pub response: Estimate,
    /// Standard uncertainty of the amplitude, m, that drive and frequency belong to: its noise within the integrals.
    pub u_level: f64,
    /// Mean phase error, rad.
    pub phase_error: Estimate,
    /// Largest scatter of the residuals over the noise of the sensors.
    pub excess: f64,
    /// g.
    gain: f64,
    /// Variance of the amplitude within the periods, m², and the curvatures of the backbone.
    bend: (f64, [f64; 2]),
    /// Measured over commanded amplitude of the base.
    calibration: f64,
    /// Coefficients: constant, time, and integral of the amplitude's deviation.
    drive: Regression,
    turning: Regression,
    /// Sizes of the neglected terms of `E_R`, m, and `omega_R`, rad/s.
    pub remainders: [f64; 2],
    /// Standard uncertainties of `E_R` and `omega_R` by the phase errors and the base within the integrals.
    within: [f64; 2],
}

/// Size of the neglected terms relative to those of the second order.
const REMAINDER: f64 = 0.7;
/// Relative uncertainty of the effect of a phase beyond that which is held.
const ASIDE: f64 = 0.5;
/// A slope weighs integrated noise by a parabola, whose variance is this multiple of that of a mean.
pub const PARABOLA: f64 = 1.2;

impl Balance {
    /// From at least four periods of an oscillator of the natural frequency `omega0`, rad/s.
    #[must_use]
    pub fn of(cycles: &[Cycle], omega0: f64, slopes: &Slopes) -> Option<Self> {
        let n = cycles.len() as f64;
        if cycles.len() < 4 {
            return None;
        }
        let omega = mean(cycles.iter().map(|cycle| cycle.omega));
        let gain = 0.5 * omega0 * omega0 / omega;
        let motion = motion(cycles);
        let response = mean(motion.iter().map(|one| one.amplitude));
        let base = mean(cycles.iter().map(|cycle| cycle.base.norm()));
        let phase_error = mean(cycles.iter().map(|cycle| cycle.phase_error));
        let [noise, base_noise] = [0, 1].map(|i| mean(cycles.iter().map(|cycle| cycle.noise[i])).sqrt());
        // Rounding is the least noise.
        let noise = noise.max(1e-14 * response);
        let middle = mean(cycles.iter().map(|cycle| cycle.time));
        let time: Vec<f64> = cycles.iter().map(|cycle| cycle.time - middle).collect();
        let spread = mean(motion.iter().map(|one| (one.amplitude - response).powi(2)));
        // The effect of the drift is curved as well.
        let rate = growth(cycles, Cycle::amplitude);
        let curvature = [0, 1].map(|i| slopes.curvature[i] + rate * slopes.bending[i]);
        let bend = ((spread - noise * noise).max(0.0), curvature);
        let deviation = integral(&time, motion.iter().map(|one| one.amplitude - response));
        let columns = [vec![1.0; cycles.len()], time, deviation];
        let calibration = total(cycles, |cycle| cycle.base.norm()) / total(cycles, |cycle| cycle.commanded[0].norm());
        let drives = drives(cycles, &motion, calibration);
        // The integral of A' is A. Terms of the second order: z' of the complex amplitude z contains i z''/(2 omega).
        let inertia = 0.25 * (omega0 * omega0) / (omega * omega);
        let [late, turned] = [1.0 + gain * slopes.drift[0], slopes.drift[1]];
        let balanced = motion.into_iter().zip(&drives).map(|(one, Drive { force, work })| {
            let worked = gain * (work.re + slopes.beyond(*work));
            let phase = one.phase + (gain * work.im - inertia * force.re) / response - turned * one.amplitude;
            (one.amplitude * late - inertia * force.im - worked, phase)
        });
        let (amplitudes, phases): (Vec<f64>, Vec<f64>) = balanced.unzip();
        let prior = |[value, uncertainty]: [f64; 2]| [Prior { coefficient: 2, value, uncertainty }];
        let [slope, width] = slopes.base;
        let drive = Regression::fit(&columns, &amplitudes, &prior([-gain * slope, gain * width]), noise)?;
        let turning = Regression::fit(&columns, &phases, &prior(slopes.omega), noise / response)?;
        let remainders = remainders(cycles, &drives, [inertia, gain, response], slopes);
        let phase_noise = (noise / response).hypot(base_noise / base);
        let excess = drive.excess.max(turning.excess);
        let of = |value, noise: f64| Estimate { value, uncertainty: noise / n.sqrt() };
        Some(Self {
            response: of(response, noise),
            u_level: noise * (PARABOLA / n).sqrt(),
            phase_error: of(phase_error, phase_noise),
            excess,
            gain,
            bend,
            calibration,
            drive,
            turning,
            remainders,
            within: [
                base_noise / n.sqrt(),
                gain * base / response * phase_noise * (PARABOLA / n).sqrt(),
            ],
        })
    }

    /// `E_R`, m, and `omega_R`, rad/s, at the mean amplitude plus `ahead`, m.
    #[must_use]
    pub fn at(&self, ahead: f64) -> [Estimate; 2] {
        let weights = [0.0, 1.0, ahead];
        let drive = self.drive.estimate(&weights).scaled(-1.0 / self.gain);
        let turning = self.turning.estimate(&weights);
        [(drive, self.within[0]), (turning, self.within[1])]
            .map(|(one, within)| Estimate::new(one.value, &[one.uncertainty, within]))
    }

    /// Slopes of `E_R` and `omega_R` over the amplitude.
    #[must_use]
    pub fn slopes(&self) -> [Estimate; 2] {
        let weights = [0.0, 0.0, 1.0];
        [
            self.drive.estimate(&weights).scaled(-1.0 / self.gain),
            self.turning.estimate(&weights),
        ]
    }

    /// What the curvature of the backbone adds to `E_R`, m, and `omega_R`, rad/s, of amplitudes that vary evenly: a slope weighs the
    /// rates by a parabola.
    #[must_use]
    pub fn bent(&self) -> [f64; 2] {
        let (spread, curvature) = self.bend;
        curvature.map(|curvature| 0.3 * curvature * spread)
    }

    /// Frequency, rad/s, and amplitude, m, that a constant base of the commanded amplitude `command`, m, leads to.
    ///
    /// The base sensor calibrates both this base and the drive that it is compared with; its noise cancels.
    #[must_use]
    pub fn limit(&self, command: f64) -> [Estimate; 2] {
        let [by_base, by_omega] = self.slopes().map(|slope| slope.value);
        let ahead = (command * self.calibration - self.at(0.0)[0].value) / by_base;
        let drive = self.drive.estimate(&[0.0, 1.0, ahead]).scaled(1.0 / self.gain);
        // The backbone is not straight from the amplitudes measured to the limit.
        let (spread, curvature) = self.bend;
        let bent = curvature.map(|curvature| 0.5 * curvature * (ahead * ahead + spread));
        // The uncertainty of the slope is in that of the drive at the limit.
        let aside = drive.uncertainty.hypot(bent[0]) / by_base;
        let turning = self.at(ahead)[1];
        // The noise within the integrals moves the amplitude that the frequency belongs to as it moves the limit: it cancels.
        [
            Estimate::new(turning.value, &[turning.uncertainty, by_omega * aside, bent[1]]),
            Estimate::new(self.response.value + ahead, &[self.u_level, aside]),
        ]
    }
}

/// Slope of a value over time.
fn growth(cycles: &[Cycle], value: impl FnMut(&Cycle) -> f64) -> f64 {
    let duration = cycles[cycles.len() - 1].time - cycles[0].time;
    slope(&cycles.iter().map(value).collect::<Vec<f64>>()) * cycles.len() as f64 / duration
}

/// Sizes of the terms beyond those of the second order and beyond the drift: a share of them.
fn remainders(cycles: &[Cycle], drives: &[Drive], [inertia, gain, response]: [f64; 3], slopes: &Slopes) -> [f64; 2] {
    let mut force = drives.iter().map(|drive| drive.force.re);
    let inertial = REMAINDER * inertia * growth(cycles, |_| force.next().unwrap_or_default());
    let drift = slopes.late * growth(cycles, Cycle::amplitude);
    let aside = mean(drives.iter().map(|drive| slopes.beyond(drive.force)));
    [
        (inertial / gain).hypot(drift * slopes.drift[0]).hypot(ASIDE * aside),
        (inertial / response).hypot(drift * slopes.drift[1]),
    ]
}

/// Integral over time from the first value on, by the trapezoidal rule.
fn integral(time: &[f64], rates: impl Iterator<Item = f64>) -> Vec<f64> {
    let (mut sum, mut before) = (0.0, None);
    time.iter()
        .zip(rates)
        .map(|(time, rate)| {
            sum += before.map_or(0.0, |(earlier, slower): (f64, f64)| {
                0.5 * (rate + slower) * (time - earlier)
            });
            before = Some((*time, rate));
            sum
        })
        .collect()
}

/// The drive of a period, from the command, which has no noise; the sensor calibrates it.
struct Drive {
    /// Base amplitude by `exp(i phase error)`, m.
    force: Complex<f64>,
    /// Its integral from the first period on, m s; the mean over this period.
    work: Complex<f64>,
}

fn total(cycles: &[Cycle], value: fn(&Cycle) -> f64) -> f64 {
    cycles.iter().map(value).sum()
}

fn drives(cycles: &[Cycle], motion: &[Motion], calibration: f64) -> Vec<Drive> {
    let relative = |cycle: &Cycle| {
        let turned = cycle.response[0] * cycle.commanded[0].conj();
        turned / turned.norm()
    };
    // Target phase, and phase of the base relative to the command.
    let turn: Complex<f64> = cycles
        .iter()
        .map(|cycle| relative(cycle).conj() * Complex::from_polar(1.0, cycle.phase_error))
        .sum();
    let mut sum = Complex::<f64>::default();
    cycles
        .iter()
        .zip(motion)
        .map(|(cycle, motion)| {
            let [middle, change] = cycle.commanded;
            let growth = (change * middle.conj()).re / middle.norm();
            let corrected = Complex::from_polar(1.0, motion.correction);
            let share = relative(cycle) * corrected * turn / turn.norm() * calibration;
            let before = sum;
            sum += share * cycle.duration * middle.norm();
            Drive {
                force: share * middle.norm(),
                work: before + share * cycle.duration * (0.5 * middle.norm() - growth / 6.0),
            }
        })
        .collect()
}
