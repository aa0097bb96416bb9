//! Drive and frequency of phase resonance from periods at about one amplitude.
//!
//! Near resonance a rig, whatever is inside it, is described by two functions of the amplitude A of its response: the drive `E_R(A)` that
//! holds it at phase resonance, and the frequency `omega_R(A)`. For any slow history of drive E, frequency and phase phi beyond resonance,
//!
//! ```text
//! A' = g (E cos phi - E_R(A)),      Theta' = omega_R(A) - (g E/A) sin phi,      g = Knowledge::growth,
//! ```
//!
//! which [`Level`] estimates as one complex equation, `Lambda = -g E_R/A + i omega_R`. At a phase target `p` beyond phase resonance, the drive
//! `E_p = E_R/cos p` and the frequency `omega_p = omega_R - (g E_p/A) sin p` hold the same amplitude.
//!
//! The command has no noise: the sensor of the reference calibrates it. Behind a shaker the force itself is measured, and of N samples per period its
//! harmonics q N - 1 and q N + 1 look like the fundamental: beats of known frequencies, whose amplitudes fall as 1/q.

use std::f64::consts::{FRAC_1_SQRT_2, TAU};

use nalgebra::Complex;
use vines_estimate::{Disturbance, Level, Motion};
use vines_model::numerics::{Estimate, mean};

use super::{Cycle, SMALLEST_DISTURBANCE, Unsteady};
use vines_scene::knowledge::Knowledge;
use vines_scene::scene::{Definition, Reference, Sensor};

/// A point of the backbone from a window of periods.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LevelEstimate {
    /// Number of periods.
    pub periods: usize,
    /// Mean amplitude of the response, m, and drive, m, and frequency, rad/s, of phase resonance at this amplitude.
    pub at: [Estimate; 3],
    /// Mean phase error, rad.
    pub phase_error: Estimate,
    /// What in the window is not noise; `None` if the fit describes it.
    pub unsteady: Option<Unsteady>,
}

/// Largest lag of the impacts behind a change of the amplitude, periods (studies/tracking.rs).
const LAG: f64 = 1.6;

impl LevelEstimate {
    /// Fewest periods: one more than a steady motion has unknowns.
    pub(crate) const FEWEST: usize = 4;

    /// From at least four periods of a rig of which this is known. If `is_held`, at a level, where impacts may lag and other modes ring; otherwise as if the
    /// force followed at once and nothing rang: the first question to a motion, whether it needs impacts. `slopes`: of `E_R` and `omega_R` over the
    /// amplitude, from neighbouring points of the backbone.
    pub fn of(cycles: &[Cycle], knowledge: &Knowledge, slopes: Option<[Estimate; 2]>, is_held: bool) -> Option<Self> {
        if cycles.len() < Self::FEWEST {
            return None;
        }
        let n = cycles.len() as f64;
        let omega = mean(cycles.iter().map(|cycle| cycle.omega));
        let growth = knowledge.growth(omega);
        let (gain, u_gain) = (growth.value, growth.uncertainty / growth.value);
        let motion = motion(cycles, knowledge.target.measurands[0].order());
        let response = mean(motion.iter().map(|cycle| cycle.amplitude));
        let base = mean(cycles.iter().map(|cycle| cycle.base.norm()));
        let [noise, base_noise] = Cycle::noise_of(cycles, is_held);
        let target = knowledge.numbers.definition.off_resonance();
        let drives = drives(cycles, &motion);
        // Terms of the second order: z' of the complex amplitude z contains i z''/(2 omega).
        let inertia = 0.25 * (knowledge.linear.omega0 / omega).powi(2);
        let logarithm = |(cycle, drive): (&PeriodResponse, &Complex<f64>)| {
            let force = drive * Complex::cis(target);
            let phase = cycle.phase - inertia * force.re / cycle.amplitude;
            Complex::new((cycle.amplitude - inertia * force.im).ln(), phase)
        };
        let middle = mean(cycles.iter().map(|cycle| cycle.time));
        let time: Vec<f64> = cycles.iter().map(|cycle| cycle.time - middle).collect();
        let in_frame = |(both, time)| logarithm(both) - Complex::new(0.0, omega * time);
        let logarithms: Vec<_> = motion.iter().zip(&drives).zip(&time).map(in_frame).collect();
        let lead = lead(knowledge, base / response);
        let rate = |(cycle, drive): (&PeriodResponse, &Complex<f64>)| {
            let force = (drive * Complex::cis(target)).conj() + lead * target.cos() * drive.im;
            force * (gain / cycle.amplitude)
        };
        let rates: Vec<_> = motion.iter().zip(&drives).map(rate).collect();
        let is_measured = knowledge.target.through_shaker;
        // Behind a shaker what is read is the force itself, with its noise from period to period.
        let (sensor, process) = match is_measured {
            true => (0.0, gain * base_noise / response),
            false => (base_noise / (base * n.sqrt()), 0.0),
        };
        let mut disturbances = calibrations(&rates, [u_gain, sensor]);
        if is_measured {
            let growth = gain * Complex::cis(knowledge.target.phase - target);
            disturbances.extend(aliases(cycles, knowledge, growth));
        }
        let mean_before = mean(logarithms.iter().map(|z| z.re));
        let rings = knowledge.rings.into_iter().flatten().filter(|_| is_held);
        let level = Level::of(&Motion {
            time,
            response: logarithms,
            drive: rates,
            noise: [(noise / response).hypot(SMALLEST_DISTURBANCE), process].map(|deviation| deviation * deviation),
            disturbances,
            rings: rings.map(|pole| pole - Complex::new(0.0, omega)).collect(),
            slope: slopes.map(|slopes| expected(slopes, base / response, gain, response, target)),
            lag: if is_held { LAG * TAU / omega } else { 0.0 },
        })?;
        let phase_noise = (noise / response).hypot(base_noise / base);
        let of = |value, noise: f64| Estimate { value, uncertainty: noise / n.sqrt() };
        let response = of(response * (level.amplitude - mean_before).exp(), noise);
        let unsteady = match () {
            () if !level.is_noise() => Some(Unsteady::Scatter(Some(level.scatter()))),
            () if !level.is_white() => Some(Unsteady::Drift(level.correlation())),
            () => None,
        };
        Some(Self {
            periods: cycles.len(),
            at: resonance(&level, response, [gain, u_gain], [omega, target]),
            phase_error: of(mean(cycles.iter().map(|cycle| cycle.phase_error)), phase_noise),
            unsteady,
        })
    }

    /// Means over the periods, of a motion that no balance describes.
    pub fn means(cycles: &[Cycle]) -> Self {
        let mean = |value: &dyn Fn(&Cycle) -> f64| Estimate::mean(&cycles.iter().map(value).collect::<Vec<f64>>());
        Self {
            periods: cycles.len(),
            at: [
                mean(&Cycle::amplitude),
                mean(&|cycle| cycle.base.norm()),
                mean(&|cycle| cycle.omega),
            ],
            phase_error: mean(&|cycle| cycle.phase_error),
            unsteady: Some(Unsteady::Scatter(None)),
        }
    }
}

/// A response, m, and the drive, m, and the frequency, rad/s, that hold it; `gain`: g, 1/s, with its relative uncertainty. The frame turns with `omega`, rad/s,
/// and the phase target is `target` beyond phase resonance, rad.
fn resonance(level: &Level, response: Estimate, [gain, u_gain]: [f64; 2], [omega, target]: [f64; 2]) -> [Estimate; 3] {
    let (force, tangent) = (level.force(), target.tan());
    // The first disturbance is that of g, which changes the force and what it is over alike.
    let is_uncertain = usize::from(u_gain > 0.0);
    let gain = gain * (1.0 + level.disturbances()[..is_uncertain].iter().sum::<f64>());
    let scale = -response.value / (gain * target.cos());
    let drive = scale * force.re;
    let by_gain = &[-drive][..is_uncertain];
    [
        response,
        Estimate {
            value: drive,
            uncertainty: level.uncertainty(scale.into(), by_gain),
        },
        Estimate {
            value: omega + force.im + tangent * force.re,
            uncertainty: level.uncertainty(Complex::new(tangent, 1.0), &[]),
        },
    ]
}

/// Expected components of Lambda1 and their standard deviations, 1/s, from the slopes of drive and frequency over the amplitude; `relative`: drive over
/// amplitude.
fn expected([drive, omega]: [Estimate; 2], relative: f64, gain: f64, response: f64, target: f64) -> [[f64; 2]; 2] {
    let (scale, tangent) = (gain * target.cos(), target.tan());
    let [real, u_real] = [scale * (relative - drive.value), scale * drive.uncertainty];
    let imaginary = response * omega.value - tangent * real;
    [
        [real, u_real],
        [imaginary, (response * omega.uncertainty).hypot(tangent * u_real)],
    ]
}

/// At equal amplitude, the drive belongs to another frequency than `omega_R` by `omega E sin phi/(2 A)`. It grows with the frequency: against damping
/// with omega, of v with its third power where the base moves the damper's other end; against impacts, of q1, with its square.
fn lead(knowledge: &Knowledge, relative: f64) -> f64 {
    let zeta = knowledge.linear.damping_rate / knowledge.linear.omega0;
    let Definition { sensor, reference, .. } = knowledge.numbers.definition;
    let of_sensor = match sensor {
        Sensor::V => 2.0 * zeta,
        Sensor::Q1 => relative,
    };
    let of_reference = match reference {
        Reference::Base => zeta,
        Reference::Force => -zeta,
    };
    of_sensor + of_reference
}

/// Common factors of the drive: of g, and of what the sensor of the reference reads, by their relative uncertainties, as far as these are not zero.
fn calibrations(rates: &[Complex<f64>], [growth, sensor]: [f64; 2]) -> Vec<Disturbance> {
    let parts: [(Complex<f64>, f64); 3] = [(Complex::ONE, growth), (Complex::ONE, sensor), (Complex::i(), sensor)];
    let uncertain = parts.into_iter().filter(|(_, deviation)| *deviation > 0.0);
    let factor = |(part, deviation): (Complex<f64>, f64)| Disturbance {
        rates: rates.iter().map(|rate| part * rate).collect(),
        deviation,
    };
    uncertain.map(factor).collect()
}

/// What the edges of a shaker's force alias into its fundamental; `growth`: growth rate of the response by the force, with its phase.
fn aliases(cycles: &[Cycle], knowledge: &Knowledge, growth: Complex<f64>) -> Vec<Disturbance> {
    let largest = knowledge.shaker.map_or(0.0, |path| path.aliased);
    let in_period = TAU / (mean(cycles.iter().map(|cycle| cycle.omega)) * knowledge.sample_time);
    let beat = |cycle: &Cycle, order: i32| {
        let turned = in_period.round() * cycle.drive_phase - TAU * (cycle.time / knowledge.sample_time).fract();
        growth * Complex::cis(f64::from(order) * turned) / cycle.response
    };
    // The neighbours of the third multiple of the sampling rate have a ninth of the power of those of the first.
    let orders = (1..=2).filter(|_| largest > 0.0).flat_map(|order| [order, -order]);
    let parts = orders.flat_map(|order| [(order, Complex::ONE), (order, Complex::i())]);
    let disturbance = |(order, part): (i32, Complex<f64>)| Disturbance {
        rates: cycles.iter().map(|cycle| part * beat(cycle, order)).collect(),
        deviation: FRAC_1_SQRT_2 * largest / f64::from(order.abs()),
    };
    parts.map(disturbance).collect()
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
/// -i conj(z')/2. `order`: how often the sensor of the response differentiates the displacement.
fn motion(cycles: &[Cycle], order: i32) -> Vec<PeriodResponse> {
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
            let derived = Complex::new(-turning, growth) * (f64::from(order) / amplitude);
            let correction = Complex::new(0.0, 0.5) * drift.conj() / z + derived;
            PeriodResponse {
                amplitude: amplitude * (1.0 + correction.re),
                phase: phases[n] + correction.im,
                correction: correction.im,
            }
        })
        .collect()
}

/// The drive of each period, from the command, which has no noise; the sensor calibrates it: amplitude of the base, m, by `exp(i phase error)`.
fn drives(cycles: &[Cycle], motion: &[PeriodResponse]) -> Vec<Complex<f64>> {
    let total = |value: fn(&Cycle) -> f64| cycles.iter().map(value).sum::<f64>();
    let calibration = total(|cycle| cycle.base.norm()) / total(|cycle| cycle.commanded.norm());
    let relative = |cycle: &Cycle| {
        let turned = cycle.response * cycle.commanded.conj();
        turned / turned.norm()
    };
    // Target phase, and phase of the base relative to the command.
    let turn: Complex<f64> = cycles
        .iter()
        .map(|cycle| relative(cycle).conj() * Complex::cis(cycle.phase_error))
        .sum();
    let turn = turn / turn.norm() * calibration;
    let drive = |(cycle, motion): (&Cycle, &PeriodResponse)| {
        relative(cycle) * Complex::cis(motion.correction) * turn * cycle.commanded.norm()
    };
    cycles.iter().zip(motion).map(drive).collect()
}
