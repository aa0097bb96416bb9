//! The one fit: phase resonance from the balances of amplitude and phase, over any window of periods.
//!
//! Near resonance a rig, whatever is inside it, is described by two functions of the amplitude A of its response: the drive `E_R(A)` that
//! holds it at phase resonance, and the frequency `omega_R(A)`. For any slow history of drive E, frequency and phase error phi,
//!
//! ```text
//! A' = g (E cos phi - E_R(A)),      Theta' = omega_R(A) - (g E/A) sin phi,      g = Knowledge::growth.
//! ```
//!
//! Integrated over time, these are straight lines if A is constant. Where it varies within the window, `E_R` and `omega_R` are linear in it:
//!
//! ```text
//! A - integral of g E cos phi = const - g E_R t - g dE_R/dA integral of (A - mean A),
//! Theta + integral of (g E/A) sin phi = const + omega_R t + domega_R/dA integral of (A - mean A).
//! ```
//!
//! At another phase target, `p` beyond phase resonance, phi is the sum of p and the phase error. The drive `E_p = E_R/cos p` and the frequency
//! `omega_p = omega_R - (g E_p/A) sin p` then hold A at the target; the left sides become
//!
//! ```text
//! A/cos p - integral of g E (cos - tan p sin) of the error,    Theta + tan p A/mean A + integral of (g E/(A cos p)) sin of the error.
//! ```
//!
//! Both are linear least squares, weighted by the noise that the fits of the periods find. Nothing in them is known of the rig but
//! `omega0` and the damping. A slope is measured where the amplitude varies and has no influence where it does not; a prior, wide or from
//! the neighbouring points of the backbone, bounds what noise may make of it.

use std::f64::consts::TAU;

use nalgebra::{Complex, DMatrix, DVector};
use vines_model::numerics::{Estimate, HarmonicBasis, Regression, mean, slope};

use super::harmonics_of;
use crate::record::{Sample, drive_phases};
use vines_scene::knowledge::{Knowledge, Target};
use vines_scene::linear::LinearResponse;
use vines_scene::scene::{Definition, Measurand, Reference, Sensor};

/// The two lines, fitted to some periods.
#[derive(Debug, Clone)]
pub struct ResonanceFit {
    /// Mean amplitude of the response, m.
    pub response: Estimate,
    /// Standard uncertainty of the amplitude, m, that drive and frequency belong to: its noise within the integrals.
    pub u_level: f64,
    /// Mean change of the amplitude in a period, m.
    pub change: f64,
    /// Mean phase error, rad.
    pub phase_error: Estimate,
    /// Largest scatter of the residuals over the noise of the sensors: the root of chi-square per degree of freedom.
    pub excess: f64,
    /// g, 1/s.
    pub gain: f64,
    /// Coefficients: constant, time, and integral of the amplitude's deviation.
    drive: Regression,
    turning: Regression,
    /// What the phase error and the uncertainty of g add to the uncertainty of `E_R`, m, of `omega_R`, rad/s, and of the amplitude, m, that both belong
    /// to.
    pub remainders: [f64; 3],
    /// Standard uncertainties of `E_R` and `omega_R` by the phase errors and the base within the integrals.
    within: [f64; 2],
}

/// Variance of integrated white noise in a slope, which weighs it by a parabola, over its variance in a mean: 6/5.
const PARABOLA: f64 = 1.2;
/// Prior standard deviation of an unknown slope, in units of its natural scale: `E/A`, and `g E/A²`. Vibro-impact rigs have slopes from -1 to 3
/// of these units.
const SLOPE_PRIOR: f64 = 3.0;

impl ResonanceFit {
    /// Fewest periods: one more than the coefficients.
    pub(crate) const FEWEST: usize = 4;

    /// From at least four periods of a rig of which this is known; `slopes`: of `E_R` and `omega_R` over the amplitude, from neighbouring points of the
    /// backbone.
    pub fn of(cycles: &[Cycle], knowledge: &Knowledge, slopes: Option<[Estimate; 2]>) -> Option<Self> {
        let n = cycles.len() as f64;
        if cycles.len() < Self::FEWEST {
            return None;
        }
        let cleaned = knowledge.shaker.map(|_| without_aliases(cycles, knowledge.sample_time));
        let cycles = cleaned.as_deref().unwrap_or(cycles);
        let LinearResponse { omega0, damping_rate, .. } = knowledge.linear;
        let omega = mean(cycles.iter().map(|cycle| cycle.omega));
        let growth = knowledge.growth(omega);
        let gain = growth.value;
        let motion = motion(cycles);
        let response = mean(motion.iter().map(|cycle| cycle.amplitude));
        let base = mean(cycles.iter().map(|cycle| cycle.base.norm()));
        let phase_error = mean(cycles.iter().map(|cycle| cycle.phase_error));
        let [noise, base_noise] = [0, 1].map(|i| mean(cycles.iter().map(|cycle| cycle.noise[i])).sqrt());
        let middle = mean(cycles.iter().map(|cycle| cycle.time));
        let time: Vec<f64> = cycles.iter().map(|cycle| cycle.time - middle).collect();
        let deviation = integral(&time, motion.iter().map(|cycle| cycle.amplitude - response));
        let columns = [vec![1.0; cycles.len()], time, deviation];
        let total = |value: fn(&Cycle) -> f64| cycles.iter().map(value).sum::<f64>();
        let calibration = total(|cycle| cycle.base.norm()) / total(|cycle| cycle.commanded.norm());
        let drives = drives(cycles, &motion, calibration);
        // At equal A, the drive belongs to another frequency than `omega_R` by `omega E sin phi/(2 A)`. It grows with the frequency: against damping
        // with omega, of v with its third power where the base moves the damper's other end; against impacts, of q1, with its square.
        let definition = knowledge.numbers.definition;
        let Definition { sensor, reference, .. } = definition;
        let zeta = damping_rate / omega0;
        let lead = match sensor {
            Sensor::V => 2.0 * zeta,
            Sensor::Q1 => base / response,
        } + match reference {
            Reference::Base => zeta,
            Reference::Force => -zeta,
        };
        let beyond = |drive: Complex<f64>| lead * drive.im;
        let (cosine, tangent) = (definition.off_resonance().cos(), definition.off_resonance().tan());
        // The integral of A' is A. Terms of the second order: z' of the complex amplitude z contains i z''/(2 omega).
        let inertia = 0.25 * (omega0 * omega0) / (omega * omega);
        let balanced = motion
            .into_iter()
            .zip(&drives)
            .map(|(cycle, DriveIntegrals { force, work })| {
                let force = force * Complex::from_polar(1.0, definition.off_resonance());
                let amplitude = cycle.amplitude - inertia * force.im;
                let turned = tangent * amplitude + gain / cosine * work.im - inertia * force.re;
                (
                    amplitude / cosine - gain * (work.re + beyond(*work) - tangent * work.im),
                    cycle.phase + turned / response,
                )
            });
        let (amplitudes, phases): (Vec<f64>, Vec<f64>) = balanced.unzip();
        let scale = [base / response, gain * base / (response * response)];
        let unknown = || scale.map(|scale| Estimate { value: 0.0, uncertainty: SLOPE_PRIOR * scale });
        let [by_base, by_omega] = slopes.unwrap_or_else(unknown);
        let drive = Regression::fit(&columns, &amplitudes, Some((2, by_base.scaled(-gain))), noise / cosine)?;
        let turning = Regression::fit(&columns, &phases, Some((2, by_omega)), noise / (response * cosine))?;
        let duration = cycles[cycles.len() - 1].time - cycles[0].time;
        let phase_noise = (noise / response).hypot(base_noise / base);
        let change = slope(&cycles.iter().map(Cycle::amplitude).collect::<Vec<f64>>());
        // What the drive adds to the balances is as uncertain as g.
        let added =
            [change * n / duration, gain * base / response * phase_error].map(|rate| rate * growth.uncertainty / gain);
        // Friction and gravity have a frequency of their own: they change the force of the particle, and the amplitude at the fold, by up to twice
        // the relative change of the frequency by the phase error.
        let detuned = base / response * phase_error / 3_f64.sqrt();
        let of = |value, noise: f64| Estimate { value, uncertainty: noise / n.sqrt() };
        Some(Self {
            response: of(response, noise),
            u_level: noise * (PARABOLA / n).sqrt(),
            change,
            phase_error: of(phase_error, phase_noise),
            excess: drive.excess.max(turning.excess),
            gain,
            drive,
            turning,
            remainders: [
                Estimate::new(0.0, &[added[0] / gain, detuned * base]).uncertainty,
                Estimate::new(0.0, &[added[1], detuned * gain * base / response]).uncertainty,
                detuned * response,
            ],
            within: [
                base_noise / n.sqrt(),
                gain * base / response * phase_noise * (PARABOLA / n).sqrt(),
            ],
        })
    }

    /// `E_R`, m, and `omega_R`, rad/s, at the mean amplitude plus `ahead`, m.
    pub fn at(&self, ahead: f64) -> [Estimate; 2] {
        let weights = [0.0, 1.0, ahead];
        let drive = self.drive.estimate(&weights).scaled(-1.0 / self.gain);
        let turning = self.turning.estimate(&weights);
        [(drive, self.within[0]), (turning, self.within[1])]
            .map(|(estimate, within)| Estimate::new(estimate.value, &[estimate.uncertainty, within]))
    }

    /// Slopes of `E_R` and `omega_R` over the amplitude.
    pub fn slopes(&self) -> [Estimate; 2] {
        let weights = [0.0, 0.0, 1.0];
        [
            self.drive.estimate(&weights).scaled(-1.0 / self.gain),
            self.turning.estimate(&weights),
        ]
    }
}

/// The response of a period.
struct PeriodResponse {
    /// m
    amplitude: f64,
    /// rad
    phase: f64,
    /// Correction of the phase by the drift of the amplitude, rad.
    correction: f64,
}

/// Amplitudes and phases of the response, continuous from period to period, without the influence of their own drift.
///
/// Over one period from the phase 0 on, a drift z' of the complex amplitude per radian changes the fitted amplitude by
/// -i conj(z')/2.
fn motion(cycles: &[Cycle]) -> Vec<PeriodResponse> {
    let mut before = cycles[0].response;
    let mut turned = before.arg();
    let phases: Vec<f64> = cycles
        .iter()
        .map(|cycle| {
            turned += (cycle.response * before.conj()).arg();
            before = cycle.response;
            cycle.drive_phase + turned
        })
        .collect();
    let last = cycles.len() - 1;
    (0..=last)
        .map(|n| {
            let (from, to) = (n.saturating_sub(1), (n + 1).min(last));
            let time = (cycles[to].time - cycles[from].time) * cycles[n].omega;
            let growth = (cycles[to].amplitude() - cycles[from].amplitude()) / time;
            let amplitude = cycles[n].amplitude();
            // The frequency of the drive may jump from period to period, but the frequency of the response does not.
            let turning = amplitude * ((phases[to] - phases[from]) / time - 1.0);
            let z = cycles[n].response;
            let drift = Complex::new(growth, turning) * z / amplitude;
            // A sensor of a derivative reads (i omega + s)^n times a displacement that drifts at the complex rate s.
            let derived = Complex::new(-turning, growth) * (f64::from(cycles[n].order) / amplitude);
            let correction = Complex::new(0.0, 0.5) * drift.conj() / z + derived;
            PeriodResponse {
                amplitude: amplitude * (1.0 + correction.re),
                phase: phases[n] + correction.im,
                correction: correction.im,
            }
        })
        .collect()
}

/// Multiples of the sampling rate whose neighbours [`without_aliases`] takes for aliased.
const ALIASES: i32 = 2;
/// Rounds in which it finds the noise: each keeps the share of it that a short window cannot tell from the beats.
const ALIAS_ROUNDS: usize = 4;

/// The same periods without what the edges of a shaker's force alias into its fundamental.
///
/// Of N samples per period, harmonics q N - 1 and q N + 1 look like the fundamental, and turn against it by the fraction of q N in each period: beats
/// of known frequencies, whose amplitudes fall as 1/q. They are fitted beside a straight line, and removed. The noise of the periods becomes what the
/// mean has of it, with what stays in the mean of that part of the residuals which does not change it from period to period: a beat of less
/// than a turn in each half of the window, which looks like a transient, and the sample by which a period is not a whole number of them.
fn without_aliases(cycles: &[Cycle], sample_time: f64) -> Vec<Cycle> {
    let n = cycles.len() as f64;
    let in_period = TAU / (mean(cycles.iter().map(|cycle| cycle.omega)) * sample_time);
    let turns = |order: &i32| {
        let turn = f64::from(*order) * in_period;
        n * (turn - turn.round()).abs()
    };
    let (beats, slow): (Vec<i32>, Vec<i32>) = (1..=ALIASES).partition(|order| turns(order) >= 2.0);
    let beat = |cycle: &Cycle| {
        let turned = in_period.round() * cycle.drive_phase - TAU * (cycle.time / sample_time).fract();
        Complex::cis(turned)
    };
    let rows = DMatrix::from_fn(cycles.len(), 2 + 2 * beats.len(), |k, column| match column {
        0 => Complex::ONE,
        1 => Complex::from((k as f64 - 0.5 * (n - 1.0)) / n),
        _ => {
            let order = beats[column / 2 - 1];
            beat(&cycles[k]).powi(if column % 2 == 0 { order } else { -order })
        }
    });
    let base = DVector::from_iterator(cycles.len(), cycles.iter().map(|cycle| cycle.base));
    let (products, right) = (rows.ad_mul(&rows), rows.ad_mul(&base));
    let prior = mean(cycles.iter().map(|cycle| cycle.noise[1]));
    let (mut noise, mut found) = (prior, None);
    for _ in 0..ALIAS_ROUNDS {
        let mut normal = products.clone();
        for (n, order) in beats.iter().enumerate() {
            let weight = noise / prior * f64::from(order * order);
            for column in [2 + 2 * n, 3 + 2 * n] {
                normal[(column, column)] += weight;
            }
        }
        let Some(inverse) = normal.try_inverse() else { break };
        let coefficients = &inverse * &right;
        let rest = (&base - &rows * &coefficients).norm_squared();
        let variance = noise * inverse[(0, 0)].re;
        // Expectation maximisation: a coefficient takes its share of the noise with it. Of two components each.
        noise = (0.5 * rest + noise * (inverse * &products).trace().re) / n;
        found = Some((coefficients, variance));
    }
    let Some((mut coefficients, variance)) = found else {
        return cycles.to_vec();
    };
    let shares = slow.iter().map(|order| f64::from(*order)).chain([in_period]);
    let stays: f64 = shares.map(|share| (prior - noise).max(0.0) / (share * share)).sum();
    coefficients.rows_mut(0, 2).fill(Complex::ZERO);
    let aliased = rows * coefficients;
    let cleaned = cycles.iter().zip(&aliased).map(|(cycle, aliased)| {
        let base = cycle.base - aliased;
        Cycle {
            base,
            commanded: base,
            phase_error: cycle.phase_error - (base * cycle.base.conj()).arg(),
            noise: [cycle.noise[0], n * (variance + stays)],
            ..*cycle
        }
    });
    cleaned.collect()
}

/// Integral over time from the first value on, by the trapezoidal rule.
fn integral(time: &[f64], rates: impl Iterator<Item = f64>) -> Vec<f64> {
    let (mut sum, mut before) = (0.0, None);
    let steps = time.iter().zip(rates).map(|(&time, rate)| {
        let step = before.map_or(0.0, |(earlier, slower)| 0.5 * (rate + slower) * (time - earlier));
        before = Some((time, rate));
        sum += step;
        sum
    });
    steps.collect()
}

/// The drive of a period, from the command, which has no noise; the sensor calibrates it.
struct DriveIntegrals {
    /// Base amplitude by `exp(i phase error)`, m.
    force: Complex<f64>,
    /// Its integral from the first period on, m s; the mean over this period.
    work: Complex<f64>,
}

/// The drive of each period; `calibration`: measured over commanded amplitude of the base.
fn drives(cycles: &[Cycle], motion: &[PeriodResponse], calibration: f64) -> Vec<DriveIntegrals> {
    let relative = |cycle: &Cycle| {
        let turned = cycle.response * cycle.commanded.conj();
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
            let amplitude = cycle.commanded.norm();
            let corrected = Complex::from_polar(1.0, motion.correction);
            let share = relative(cycle) * corrected * turn / turn.norm() * calibration;
            let before = sum;
            sum += share * cycle.duration * amplitude;
            DriveIntegrals {
                force: share * amplitude,
                work: before + share * cycle.duration * 0.5 * amplitude,
            }
        })
        .collect()
}

// Harmonics of one period of the drive.

/// Harmonics of the sensor signals over one period of the drive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cycle {
    /// Mean time, s.
    pub time: f64,
    /// Mean phase of the drive, rad, counted on from period to period.
    pub drive_phase: f64,
    /// Mean frequency of the drive, rad/s.
    pub omega: f64,
    /// Fundamental of the commanded base motion, m, without noise, or of the measured reference behind a shaker.
    pub commanded: Complex<f64>,
    /// Fundamental of the response relative to the drive's phase, m: `Im a exp(i phase)`.
    pub response: Complex<f64>,
    /// Fundamental of the base, m: measured if a sensor reads it, otherwise commanded.
    pub base: Complex<f64>,
    /// Phase error, rad: response minus base minus target.
    pub phase_error: f64,
    /// Variances of the fundamental of response and base by the noise of the sensors, m²: of each of its two components.
    pub noise: [f64; 2],
    /// How often the sensor of the response differentiates the displacement.
    pub order: i32,
    /// Number of samples.
    pub samples: usize,
    /// Their duration, s.
    pub duration: f64,
}

/// Harmonics that are fitted to a displacement.
const HARMONICS: usize = 3;

/// What is fitted to a channel over one period of the drive.
struct Bases {
    harmonics: usize,
    /// Offset and harmonics.
    basis: HarmonicBasis,
    /// The first harmonic drifts as well: a change of the amplitude within the period is not noise.
    drifting: HarmonicBasis,
}

impl Bases {
    fn new(phases: &[f64], harmonics: usize) -> Self {
        let mut degrees = vec![Some(0); harmonics];
        let basis = HarmonicBasis::new(phases, 0, &degrees);
        degrees[0] = Some(1);
        let drifting = HarmonicBasis::new(phases, 0, &degrees);
        Self { harmonics, basis, drifting }
    }

    /// The fundamental of a signal, and the variance of each of its components by noise. `coloured`: spectrum of the noise at the fundamental, over its
    /// mean.
    fn fundamental(&self, values: &DVector<f64>, coloured: f64) -> Option<(Complex<f64>, f64)> {
        let fit = self.basis.fit(values)?;
        let residual = self.drifting.residual(values, &self.drifting.fit(values)?);
        let variance = residual.norm_squared() / (values.len() - self.drifting.terms()) as f64;
        Some((fit.harmonic(1), variance * coloured * 2.0 / values.len() as f64))
    }
}

impl Cycle {
    /// The samples of one period; `phase` (rad): phase of the drive at the first, `target`: phase target of the response relative to the base, and
    /// what both channels measure. `None` for too few samples.
    pub fn of(samples: &[Sample], sample_time: f64, phase: f64, target: Target) -> Option<Self> {
        // Offset, sine and cosine of the harmonics, and the drift of the first.
        if samples.len() <= 2 * HARMONICS + 3 {
            return None;
        }
        let phases = drive_phases(samples, sample_time, phase);
        let mean_omega = mean(samples.iter().map(|s| s.command.drive.omega));
        let drive_phase = mean(phases.iter().copied());
        // The response does not follow every change of the drive's frequency: its phase grows uniformly.
        let middle = 0.5 * (samples.len() - 1) as f64;
        let uniform: Vec<f64> = (0..samples.len())
            .map(|n| drive_phase + (n as f64 - middle) * sample_time * mean_omega)
            .collect();
        let harmonics = |measurand| harmonics_of(measurand, samples.len() as f64, HARMONICS);
        // Impacts jerk the force of a shaker as they jerk an acceleration.
        let in_base = if target.through_shaker {
            harmonics(Measurand::Acceleration)
        } else {
            HARMONICS
        };
        let in_response = harmonics(target.measurands[0]);
        let of_base = Bases::new(&uniform, in_base);
        let of_response = (in_response != in_base).then(|| Bases::new(&uniform, in_response));
        let Bases { basis, drifting, .. } = &of_base;
        let fitted = |channel: usize, value: fn(&Sample) -> f64| {
            let bases = of_response.as_ref().filter(|_| channel == 0).unwrap_or(&of_base);
            let values = DVector::from_iterator(samples.len(), samples.iter().map(value));
            // Above many harmonics a sensor shows impacts rather than noise.
            let least = if bases.harmonics > HARMONICS { 0 } else { HARMONICS };
            let coloured = target.colour_of_fundamental(mean_omega, sample_time, least);
            let (fundamental, variance) = bases.fundamental(&values, coloured)?;
            let displacement = target.displacement(channel, mean_omega);
            Some((fundamental * displacement, variance * displacement.norm_sqr()))
        };
        let (response, noise) = fitted(0, |s| s.sensors.response)?;
        let mean = |value: fn(&Sample) -> f64| mean(samples.iter().map(value));
        // The amplitude commanded at a sample begins there; a sensor reads what the one before left.
        let before = |n: usize| samples[n.saturating_sub(1)].command.drive.amplitude;
        let motion =
            |amplitude: &dyn Fn(usize) -> f64| DVector::from_fn(samples.len(), |n, _| amplitude(n) * phases[n].sin());
        let mut commanded = drifting
            .fit(&motion(&|n| 0.5 * (before(n) + samples[n].command.drive.amplitude)))?
            .harmonic(1);
        let as_read = basis.fit(&motion(&before))?.harmonic(1);
        let measured = samples.iter().all(|s| s.sensors.reference.is_some());
        let (base, base_noise) = if measured {
            let (mut base, noise) = fitted(1, |s| s.sensors.reference.unwrap_or(0.0))?;
            match target.through_shaker {
                true => commanded = base,
                false => base = base * commanded / as_read,
            }
            (base, noise)
        } else {
            let base = mean(|s| s.command.drive.amplitude) * target.base_per_sample(mean_omega, sample_time);
            (Complex::new(base, 0.0), 0.0)
        };
        let phase_error = if measured {
            (response * base.conj() * Complex::from_polar(1.0, -target.phase)).arg()
        } else {
            let asked = DVector::from_iterator(samples.len(), samples.iter().map(|s| s.command.drive.displacement));
            let asked = basis.fit(&asked).map(|fit| fit.harmonic(1));
            match asked.filter(|asked| *asked != Complex::ZERO) {
                // The drive of then. (The estimate of a controller is of some periods before.)
                Some(asked) => {
                    let late = Complex::from_polar(1.0, mean_omega * target.delay - target.phase);
                    (response * asked.conj() * late).arg()
                }
                // A controller that tells no displacement compensates the delay.
                None => mean(|s| s.command.phase_error.unwrap_or(0.0)),
            }
        };
        Some(Self {
            commanded,
            time: mean(|s| s.time),
            drive_phase,
            omega: mean_omega,
            response,
            base,
            phase_error,
            noise: [noise, base_noise],
            order: target.measurands[0].order(),
            samples: samples.len(),
            duration: samples.len() as f64 * sample_time,
        })
    }

    /// The complete periods of the drive in these samples, in order.
    pub fn all(samples: &[Sample], sample_time: f64, target: Target) -> Vec<Self> {
        let (mut cycles, mut begin, mut turns, mut phase) = (Vec::new(), 0, 0.0, 0.0);
        for (n, sample) in samples.iter().enumerate() {
            turns += sample.command.drive.omega * sample_time / TAU;
            if turns >= f64::floor(phase) + 1.0 {
                cycles.extend(Self::of(&samples[begin..=n], sample_time, phase * TAU, target));
                (begin, phase) = (n + 1, turns);
            }
        }
        cycles
    }

    /// Amplitude of the response, m.
    pub fn amplitude(&self) -> f64 {
        self.response.norm()
    }
}

#[cfg(test)]
mod tests {
    use vines_scene::scene::Scene;

    use super::*;
    use crate::rig::{Command, Drive, Sensors};

    #[test]
    fn edges_that_alias_do_not_move_the_force_of_a_window() {
        let target = Target {
            phase: -std::f64::consts::FRAC_PI_2,
            measurands: [Measurand::Displacement; 2],
            omega0: 1.0,
            through_shaker: true,
            filter: None,
            delay: 0.0,
            units: Scene::load(None, &[]).unwrap().units(),
            held: false,
        };
        for in_period in [100.03, 100.1, 100.3, 100.51, 100.97] {
            let sample_time = TAU / in_period;
            let samples: Vec<Sample> = (0..6060)
                .map(|n| {
                    let time = f64::from(n) * sample_time;
                    // A sine and an edge, whose fundamental is 4/pi of its height.
                    let force = time.sin() + 0.2 * (time + 0.3).sin().signum();
                    let sensors = Sensors { response: -time.cos(), reference: Some(force) };
                    let drive = Drive { omega: 1.0, amplitude: 1.0, displacement: 0.0 };
                    let command = Command { drive, ..Command::default() };
                    Sample { time, sensors, command, ..Sample::default() }
                })
                .collect();
            let cycles = Cycle::all(&samples, sample_time, target);
            let n = cycles.len() as f64;
            let exact = Complex::<f64>::ONE + Complex::from_polar(0.8 / std::f64::consts::PI, 0.3);
            let cleaned = without_aliases(&cycles, sample_time);
            let sum: Complex<f64> = cleaned.iter().map(|cycle| cycle.base - exact).sum();
            let error = sum / n;
            let u = (cleaned[0].noise[1] / n).sqrt();
            let as_noise = (mean(cycles.iter().map(|cycle| cycle.noise[1])) / n).sqrt();
            assert!(error.norm() < 3.0 * u, "{in_period}: {:e} ± {u:e}", error.norm());
            // Where the beats are fast, they do not look like noise.
            let is_slow = [100.03, 100.51, 100.97].contains(&in_period);
            assert!(is_slow || u < 0.4 * as_noise, "{in_period}: {u:e}, {as_noise:e}");
        }
    }
}
