//! What a record says: the locked point, its regime, and the backbone along the free decay.

mod asked;
mod cycle;
mod decay;
mod level;
mod resonance_fit;
mod response;

use std::f64::consts::TAU;

use serde::Serialize;
use thiserror::Error;
use vines_model::numerics::{Estimate, SIGNIFICANT, mean, standard_deviation};

use crate::record::{Record, Sample};
use vines_rig::unit::Quantity;
use vines_scene::knowledge::Knowledge;
use vines_scene::plan::Plan;
use vines_scene::scene::Units;

pub(crate) use asked::{SAME, departure, is_another};
pub(crate) use cycle::Cycle;
pub(crate) use decay::{DECAY_TERMS, PER_PERIOD, base_at_rest, harmonic};
pub use decay::{DECAY_WINDOW, DecayEnd, DecayPoints, FreeDecayPoint, decay_points};
pub(crate) use level::{Criterion, Unsteady};
pub(crate) use level::{LONGEST_SETTLING, is_off_target};
pub(crate) use resonance_fit::LevelEstimate;
pub use response::Tone;
pub(crate) use response::{
    Line, Span, classify, drive_harmonics, foreign_tone, regime_by_response, subharmonic, without_tones,
};
pub use vines_model::regime::{Impact, Regime};

/// Why a record cannot be identified.
#[derive(Debug, Error)]
#[expect(missing_docs, reason = "the messages explain the variants")]
pub enum IdentificationError {
    #[error("the loop is locked, but not as asked: {departure}. There the regime is {regime}")]
    OtherThanAsked { departure: String, regime: Regime },
    #[error("{}", regime_in_words(*regime, *repeats, [*sigma, *c], *silent))]
    Regime {
        regime: Regime,
        /// Periods of the drive after which a motion of an expected regime repeats, if these are several.
        repeats: Option<usize>,
        sigma: f64,
        c: f64,
        /// Frequency, Hz, and response of a rig that does not report impacts: nothing is then said of a particle.
        silent: Option<(f64, Quantity)>,
    },
    #[error(
        "the hold contains no periodic motion: the response or the base reads zero; check the sensors and record.hold_periods"
    )]
    NoMotion,
    #[error(
        "the phase was {error:.3} ± {uncertainty:.3} degrees off its target while the lock was held; phase_lock.lock.phase_tolerance allows \
         {tolerance:.3} degrees. The controller holds another phase than controller.phase_target, or a channel has become late"
    )]
    OffTarget {
        error: f64,
        uncertainty: f64,
        tolerance: f64,
    },
    #[error(
        "readings of the hold are at the end of {range}, where the converter saturates: a larger range, or less drive"
    )]
    Saturated { range: &'static str },
    #[error(
        "a sensor {what} {seconds:.3} s after the release, so that the decay is not recorded: check its cable and converter"
    )]
    SensorAfterRelease { seconds: f64, what: &'static str },
}

/// That a lock is of another regime than the symmetric 1:1 one, or repeats only after several periods.
fn regime_in_words(
    regime: Regime,
    repeats: Option<usize>,
    [sigma, c]: [f64; 2],
    silent: Option<(f64, Quantity)>,
) -> String {
    let repeats = repeats.map(|periods| format!("the motion repeats only after {periods} periods of the drive"));
    if let Some((f_hz, response)) = silent {
        let motion = || format!("the motion is {}, and not steady and nonlinear", regime.motion());
        let motion = repeats.unwrap_or_else(motion);
        return format!(
            "the loop is locked at {f_hz:.5} Hz with a response of {response:.4e}, but {motion}. Try another drive or another [start]"
        );
    }
    let motion = match repeats {
        Some(repeats) => format!("{repeats}: it is not 1:1"),
        None => format!("the regime is {regime}, not symmetric 1:1 with two impacts per period"),
    };
    format!(
        "the loop is locked at sigma = {sigma:.4}, C = {c:.4}, but {motion}. Try another [start] (the particle must be moving) or another G"
    )
}

/// What a record says.
#[derive(Debug, Clone, PartialEq)]
pub struct Identification {
    /// What is known of the rig.
    pub knowledge: Knowledge,
    /// The locked point as measured.
    pub lock: Lock,
    /// The decay, from the release on; without points if it is shorter than the window of the fit.
    pub decay: DecayPoints,
    /// Amplitude of the base after the release, m, where it is least, if the base never rests.
    pub base_after_release: Option<Estimate>,
}

/// Identifies the record of an experiment.
///
/// # Errors
/// No motion, a lock in another regime than the symmetric 1:1 one or off its phase, and a sensor that fails in the decay.
pub fn identify(record: &Record, plan: &Plan) -> Result<Identification, IdentificationError> {
    let knowledge = plan.knowledge;
    if let Some(range) = knowledge
        .target
        .saturated(record.hold().iter().map(|sample| sample.sensors))
    {
        return Err(IdentificationError::Saturated { range });
    }
    let lock = measure(record, plan).ok_or(IdentificationError::NoMotion)?;
    let ResonancePoint { f_hz, a_m, sigma, c, .. } = lock.at;
    let response = Quantity { value: a_m, unit: knowledge.target.units.response.symbol };
    let silent = lock.regime_by_impacts.is_none().then_some((f_hz, response));
    let repeats = subharmonic(record.hold(), &knowledge, TAU * f_hz);
    // Where noise hides the symmetry, a motion that is steady and off the linear mode is accepted; its regime says so. So is one without symmetry where
    // there may be no cavity.
    let is_expected = is_wanted(lock.regime, knowledge.is_symmetric && silent.is_none());
    if !is_expected || repeats.is_some() {
        // Another phase or drive has another motion, of which the wanted one says nothing.
        if let Some(departure) = departure(record.hold(), plan) {
            return Err(IdentificationError::OtherThanAsked { departure, regime: lock.regime });
        }
        let repeats = repeats.filter(|_| is_expected);
        return Err(IdentificationError::Regime { regime: lock.regime, repeats, sigma, c, silent });
    }
    let (error, uncertainty) = (lock.at.phase_error_deg, lock.at.u_phase_deg);
    let tolerance = plan.lock.lock.phase_tolerance.to_degrees();
    // NaN is off the target, too.
    let is_on_target = error.abs() <= tolerance + SIGNIFICANT * uncertainty;
    if !is_on_target {
        return Err(IdentificationError::OffTarget { error, uncertainty, tolerance });
    }
    sensors_after_release(record, &knowledge)?;
    Ok(Identification {
        knowledge,
        lock,
        decay: decay_points(record, &knowledge, DECAY_WINDOW),
        base_after_release: base_at_rest(record, &knowledge).err(),
    })
}

/// Whether a regime is the wanted one, as far as noise shows it; where motions have no mirror images (not `is_symmetric`), also the asymmetric one.
pub(crate) fn is_wanted(regime: Regime, is_symmetric: bool) -> bool {
    matches!(regime, Regime::Symmetric | Regime::Unresolved) || regime == Regime::Asymmetric && !is_symmetric
}

/// Harmonics that are fitted to a displacement.
const HARMONICS: usize = 3;
/// Largest number of harmonics that are fitted: a bound of the work.
const MOST_HARMONICS: usize = 60;

/// All harmonics that as many samples per period can show: an impact makes those of a velocity fall as 1/n, and those of an acceleration not at all.
/// What is not fitted counts as noise, for which two fifths of the samples remain.
fn most_harmonics(samples_per_period: f64) -> usize {
    ((0.42 * samples_per_period) as usize).clamp(HARMONICS, MOST_HARMONICS)
}

// The locked point.

/// The locked point as measured.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Lock {
    /// The point: frequency and base amplitude of phase resonance at the mean amplitude of the response before the release.
    #[serde(flatten)]
    pub at: ResonancePoint,
    /// Requested amplitude of the base, m; of a base that is held from sample to sample, which moves a little less than its samples, what is left.
    #[serde(rename = "E_requested_m", skip_serializing_if = "Option::is_none")]
    pub requested_e_m: Option<f64>,
    /// Of a structure that a force drives, its requested amplitude, N.
    #[serde(rename = "F_requested_N", skip_serializing_if = "Option::is_none")]
    pub requested_f_n: Option<f64>,
    /// Whether the drive of the point is the requested one: within 1 %, or within three standard uncertainties if these are more.
    pub at_requested_drive: bool,
    /// Mean particle speed over `b omega0`; absent if the rig does not report it.
    #[serde(rename = "B")]
    pub b: Option<f64>,
    /// Standard uncertainty of B; absent where B is.
    #[serde(rename = "u_B")]
    pub u_b: Option<f64>,
    /// Number of periods that the point is estimated from: of the hold, and of those before it with about the same amplitude and drive.
    pub averaged: usize,
    /// Growth of a disturbance per period, relative, up to which all of these would not show it: from 1e-6 of the response to the deviation that ends
    /// them.
    pub unseen_growth: f64,
    /// From the start to the settled lock, in periods of the locked motion.
    pub periods_to_lock: f64,
    /// Whether control holds the response; if not, a constant drive.
    pub held: bool,
    /// Impacts per period; NaN if the rig does not report them.
    pub impacts_per_period: f64,
    /// The regime: from the impacts, or from the response alone if the rig does not report them. In files it is the motion without a particle.
    #[serde(rename = "motion", serialize_with = "Regime::serialize_motion")]
    pub regime: Regime,
    /// The regime determined from the impacts, if the rig reports them.
    pub regime_by_impacts: Option<Regime>,
    /// Share of the samples before the release with the command at the limit of a shaker's amplifier, per cent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clipped_percent: Option<f64>,
    /// Mean amplitude of the command of a shaker over the averaged periods, V.
    #[serde(rename = "command_V", skip_serializing_if = "Option::is_none")]
    pub command_v: Option<f64>,
    /// What friction did over the hold; absent without friction, or if the rig does not report it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub friction: Option<Friction>,
    /// A tone in the response that is not part of the motion; not looked for in a simulation.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tone: Option<Tone>,
}

/// What friction in the cavity did over the hold, per period of the motion.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Friction {
    /// How often the particle stuck to the floor inside the cavity.
    pub sticks_per_period: f64,
    /// How long it stuck there, s.
    #[serde(rename = "stuck_s_per_period")]
    pub stuck_time: f64,
    /// Energy lost to friction, J.
    #[serde(rename = "friction_J_per_period")]
    pub loss: f64,
}

impl Friction {
    fn of(hold: &[Sample], periods: f64) -> Option<Self> {
        let totals = |sample: &Sample| sample.ground_truth?.friction;
        let (first, last) = (totals(hold.first()?)?, totals(hold.last()?)?);
        Some(Self {
            sticks_per_period: (last.sticks - first.sticks) as f64 / periods,
            stuck_time: (last.stuck_time - first.stuck_time) / periods,
            loss: (last.loss - first.loss) / periods,
        })
    }
}

impl Lock {
    /// The requested amplitude of the drive, in its unit.
    pub fn requested(&self) -> f64 {
        self.requested_e_m.or(self.requested_f_n).unwrap_or(f64::NAN)
    }

    /// The number of impacts per period, or the note that the regime was determined without it.
    pub fn impacts(&self) -> String {
        if self.impacts_per_period.is_nan() {
            "determined from the response alone".into()
        } else {
            format!("{:.3} impacts per period", self.impacts_per_period)
        }
    }
}

/// Largest number of periods before the release that are evaluated.
const MOST_EVALUATED: f64 = 240.0;
/// Largest relative deviation from the amplitude of the hold, in addition to noise, of the periods from which the lock is evaluated.
const SPREAD: f64 = 0.008;
/// Smallest disturbance of a motion, relative to the response: less than the noise of any rig.
const SMALLEST_DISTURBANCE: f64 = 1e-6;

/// Largest phase error of a period that is evaluated, rad: the balances are of the first order in it.
const PHASE_RANGE: f64 = 0.1;

/// The locked point of a record; `None` without a motion.
fn measure(record: &Record, plan: &Plan) -> Option<Lock> {
    let knowledge = &plan.knowledge;
    let d = &knowledge.numbers;
    let (dt, hold) = (record.sample_time, record.hold());
    let held = Cycle::all(hold, 0.0, knowledge);
    let most = knowledge.samples(MOST_EVALUATED).max(hold.len());
    let last = &record.samples[record.hold_end.saturating_sub(most)..record.hold_end];
    let cycles = Cycle::all(last, 0.0, knowledge);
    let approach = approached(&cycles, &held);
    let largest = mean(held.iter().map(Cycle::amplitude));
    // The balances say which drive and frequency belong to a response, whether it rests or not.
    let level = Criterion {
        knowledge: *knowledge,
        precision: 1.0,
        largest,
        before: [None; 2],
    }
    .best(approach)?;
    let omega = level.at[2];
    let of_level = &approach[approach.len() - level.periods..];
    let averaged = of_level.iter().map(|cycle| cycle.samples).sum::<usize>();
    let speed = |sample: &Sample| Some(d.speed(sample.ground_truth?.particle_velocity.abs()));
    let speeds: Option<Vec<f64>> = record.samples[record.hold_end - averaged..record.hold_end]
        .iter()
        .map(speed)
        .collect();
    let b = speeds.map(|speeds| {
        let periods = speeds.chunks(averaged.div_ceil(level.periods));
        Estimate::mean(&periods.map(|c| mean(c.iter().copied())).collect::<Vec<f64>>())
    });
    let (impacts_per_period, regime) = match classify(hold, dt, omega.value) {
        (count, Regime::Unknown) => (count, regime_by_response(hold, knowledge, level.at, Span::Held)),
        by_impacts => by_impacts,
    };
    let is_simulated = hold.iter().any(|sample| sample.ground_truth.is_some());
    let reference = knowledge.target.units.reference;
    let requested = reference.of_metres(plan.requested(omega.value));
    let [requested_e_m, requested_f_n] = reference.base_or_force(requested);
    let at = ResonancePoint::new(level.at, phase_error(&held, knowledge), knowledge);
    Some(Lock {
        at,
        requested_e_m,
        requested_f_n,
        at_requested_drive: !is_another(at.drive().value - requested, at.drive().uncertainty, requested),
        b: b.map(|b| b.value),
        u_b: b.map(|b| b.uncertainty),
        averaged: level.periods,
        unseen_growth: (SPREAD / SMALLEST_DISTURBANCE).powf(1.0 / approach.len() as f64) - 1.0,
        periods_to_lock: record.settled as f64 * dt * omega.value / TAU,
        held: record.held,
        impacts_per_period,
        regime,
        regime_by_impacts: Some(regime).filter(|_| !impacts_per_period.is_nan()),
        clipped_percent: record.clipped_percent,
        command_v: mean_command(&record.samples[record.released - averaged..record.released], knowledge),
        friction: Friction::of(hold, (hold.len() - 1) as f64 * dt * omega.value / TAU),
        tone: (!is_simulated)
            .then(|| foreign_tone(hold, knowledge, omega.value))
            .flatten(),
    })
}

/// Mean amplitude of the command of a shaker in samples, V; `None` without a shaker.
pub(crate) fn mean_command(samples: &[Sample], knowledge: &Knowledge) -> Option<f64> {
    knowledge.shaker?;
    Some(mean(samples.iter().map(|sample| sample.shaker_command)))
}

/// The cycles with about the amplitude and the drive of the hold; at least as many as the hold has, and as a level needs.
fn approached<'a>(cycles: &'a [Cycle], held: &[Cycle]) -> &'a [Cycle] {
    let near = |value: fn(&Cycle) -> f64| {
        let values: Vec<f64> = held.iter().map(value).collect();
        let (level, scatter) = (mean(values.iter().copied()), standard_deviation(&values));
        move |cycle: &Cycle| (value(cycle) - level).abs() <= (SPREAD * level).max(4.0 * scatter)
    };
    let (response, drive) = (near(Cycle::amplitude), near(|cycle| cycle.base.norm()));
    let is_near = |cycle: &&Cycle| response(cycle) && drive(cycle) && cycle.phase_error.abs() <= PHASE_RANGE;
    let near = cycles.iter().rev().take_while(is_near).count();
    let fewest = held.len().max(2 * LevelEstimate::FEWEST);
    &cycles[cycles.len() - near.max(fewest).min(cycles.len())..]
}

/// Mean phase error over the hold, rad.
fn phase_error(held: &[Cycle], knowledge: &Knowledge) -> Estimate {
    let LevelEstimate { phase_error, at: [response, base, _], .. } = LevelEstimate::means(held);
    let [noise, base_noise] = Cycle::noise_of(held, false).map(|noise| noise / (held.len() as f64).sqrt());
    let mut phase_noise = (noise / response.value).hypot(base_noise / base.value);
    // Behind a shaker noise of the readings turns the force itself, by more than that noise.
    if knowledge.shaker.is_some() {
        phase_noise = phase_noise.hypot(phase_error.uncertainty);
    }
    Estimate { uncertainty: phase_noise, ..phase_error }
}

// A measured point of phase resonance.

/// A point of phase resonance as measured, in hertz and in the units of response and reference, and dimensionless with the parameters of the scene.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ResonancePoint {
    /// Frequency, Hz.
    #[serde(rename = "f_Hz")]
    pub f_hz: f64,
    /// Amplitude of the fundamental of the response: its displacement at the sensor, m.
    #[serde(rename = "A_m")]
    pub a_m: f64,
    /// Base amplitude, m, measured if a sensor reads the base, otherwise commanded.
    #[serde(rename = "E_m", skip_serializing_if = "Option::is_none")]
    pub e_m: Option<f64>,
    /// Of a structure that a force drives, its amplitude, N.
    #[serde(rename = "F_N", skip_serializing_if = "Option::is_none")]
    pub f_n: Option<f64>,
    /// Standard uncertainty of the frequency, Hz.
    #[serde(rename = "u_f_Hz")]
    pub u_f_hz: f64,
    /// Standard uncertainty of the response, m.
    #[serde(rename = "u_A_m")]
    pub u_a_m: f64,
    /// Standard uncertainty of the base amplitude, m.
    #[serde(rename = "u_E_m", skip_serializing_if = "Option::is_none")]
    pub u_e_m: Option<f64>,
    /// Standard uncertainty of the force, N.
    #[serde(rename = "u_F_N", skip_serializing_if = "Option::is_none")]
    pub u_f_n: Option<f64>,
    /// Detuning.
    pub sigma: f64,
    /// Amplitude of the fundamental of the response over b.
    #[serde(rename = "C")]
    pub c: f64,
    /// Base amplitude over `b epsilon`.
    #[serde(rename = "G")]
    pub g: f64,
    /// Target of the phase of the response relative to the base, both as displacements, degrees.
    pub phase_target_deg: f64,
    /// Phase of the response relative to the base, minus the target, degrees.
    pub phase_error_deg: f64,
    /// Standard uncertainty of sigma.
    pub u_sigma: f64,
    /// Standard uncertainty of C.
    #[serde(rename = "u_C")]
    pub u_c: f64,
    /// Standard uncertainty of G.
    #[serde(rename = "u_G")]
    pub u_g: f64,
    /// Standard uncertainty of the phase error, degrees.
    pub u_phase_deg: f64,
}

impl ResonancePoint {
    /// From the amplitudes of response and drive, both in metres of the oscillator, and the frequency, rad/s, and from the phase error, rad.
    pub(crate) fn new(at: [Estimate; 3], phase_error: Estimate, knowledge: &Knowledge) -> Self {
        let d = &knowledge.numbers;
        let [response, base, omega] = knowledge.linear.resolved(at);
        let Units { response: of_response, reference, .. } = knowledge.target.units;
        let drive = |metres: f64| reference.base_or_force(reference.of_metres(metres));
        let ([e_m, f_n], [u_e_m, u_f_n]) = (drive(base.value), drive(base.uncertainty));
        Self {
            f_hz: omega.value / TAU,
            a_m: of_response.of_metres(response.value),
            e_m,
            f_n,
            u_f_hz: omega.uncertainty / TAU,
            u_a_m: of_response.of_metres(response.uncertainty),
            u_e_m,
            u_f_n,
            sigma: d.sigma(omega.value),
            c: response.value / d.b,
            g: d.excitation(base.value),
            phase_target_deg: d.definition.phase_in_degrees(),
            phase_error_deg: phase_error.value.to_degrees(),
            u_sigma: omega.uncertainty / d.omega_change(1.0),
            u_c: response.uncertainty / d.b,
            u_g: d.excitation(base.uncertainty),
            u_phase_deg: phase_error.uncertainty.to_degrees(),
        }
    }

    /// Amplitude of the drive in the unit of the reference, of a base or a force.
    pub fn drive(&self) -> Estimate {
        let either = |base: Option<f64>, force| base.or(force).unwrap_or(f64::NAN);
        Estimate {
            value: either(self.e_m, self.f_n),
            uncertainty: either(self.u_e_m, self.u_f_n),
        }
    }
}

// What makes a record useless: a sensor that fails after the release.

/// Share of a free response that impacts leave in two periods at least. They take the share pi epsilon G_imp/C in each, with
/// G_imp = (4/pi) R B^2/C: 0.14 at epsilon = 0.05, r = 0.65, C = 0.5.
const LEFT: f64 = 0.1;
/// Steps of a converter below which the scatter of a response says nothing.
const CONVERTER_STEPS: f64 = 8.0;

/// Refuses a decay in which a sensor reads no number, or in which the response is lost within two periods.
fn sensors_after_release(record: &Record, knowledge: &Knowledge) -> Result<(), IdentificationError> {
    let decay = record.decay();
    let failed = |n: usize, what| {
        let seconds = n as f64 * record.sample_time;
        Err(IdentificationError::SensorAfterRelease { seconds, what })
    };
    let reads_numbers = |sample: &Sample| {
        let sensors = sample.sensors;
        (sensors.response + sensors.reference.unwrap_or_default()).is_finite()
    };
    if let Some(n) = decay.iter().position(|sample| !reads_numbers(sample)) {
        return failed(n, "reads no number");
    }
    let period = knowledge.samples(1.0);
    let response: Vec<f64> = decay.iter().map(|sample| sample.sensors.response).collect();
    let changes = response.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    let step = changes.filter(|change| *change > 0.0).fold(f64::INFINITY, f64::min);
    let scatters: Vec<f64> = response.chunks_exact(period).map(standard_deviation).collect();
    let linear = &knowledge.linear;
    // The coil of a shaker may take any share: only a reading that stays at one value is lost then.
    let left = match knowledge.shaker {
        Some(_) => 0.0,
        None => LEFT * (-2.0 * TAU * linear.damping_rate / linear.omega0).exp(),
    };
    let is_lost = |three: &[f64]| three[0] > CONVERTER_STEPS * step && three[2] <= left * three[0];
    match scatters.windows(3).position(is_lost) {
        Some(n) => failed((n + 1) * period, "stops reading the response"),
        None => Ok(()),
    }
}
