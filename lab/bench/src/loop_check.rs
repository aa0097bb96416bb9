//! Check of the loop before the drive rises: an open loop at a hundredth of the drive shows what is connected to what. Where the noise of the sensors
//! leaves the phase uncertain, the drive is raised.
//!
//! One model explains the samples of a channel: oscillations, of which one pole is unknown ([`Oscillations`]). The response has the pole of the drive
//! and that of its mode, whatever its motion was at the start; the base has one pole, whose frequency is that of the clock. With the amplitudes s at
//! the pole of the drive and x of the base, the mode's gain is `s (i omega - pole)/x`. What the fit leaves is the noise.
//!
//! What the fits say stands in two tables, in the order in which a fault hides the next one: quantities with uncertainty, expected value and
//! tolerance, and [verdicts](Verdict).

mod shaker;

use std::f64::consts::{FRAC_PI_4, TAU};

use nalgebra::Vector2;
use num_complex::Complex64;
use phase_lock::Gains;
use serde::Serialize;
use vines_estimate::Oscillations;
use vines_model::numerics::{SIGNIFICANT, mean, mean_square, standard_deviation};

use crate::rig::{Drive, Rig, RigError, Scaled};
use vines_scene::knowledge::Target;
use vines_scene::linear::{LinearResponse, MeasuredLinear, ParticleState};
use vines_scene::plan::Plan;
use vines_scene::scene::{Unit, Units};

/// Drives of the check, over the scene's drive: too small for impacts. The smaller one follows where the particle may have slid.
const SHARES: [f64; 2] = [0.01, 0.01 / 16.0];
/// Factor by which the drive is raised at a time: a fault that noise has hidden is seen at little more.
const RAISE: f64 = 4.0;
/// Numbers of periods: without a drive, and with it.
const CHECK_PERIODS: [usize; 2] = [2, 24];

/// Result of the check.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LoopCheck {
    /// The verdict.
    pub verdict: Verdict,
    /// Amplitude of the drive, in its unit.
    pub amplitude: f64,
    /// It over the scene's drive.
    pub share: f64,
    /// Duration with all waits and smaller drives, periods.
    pub periods: f64,
    /// The response.
    pub response: CheckedChannel,
    /// The base, if a sensor measures it.
    pub base: Option<CheckedChannel>,
    /// The linear response and the gains for it, if the loop is healthy.
    pub linear: Option<Linear>,
    /// What was measured, beside what the scene says.
    pub quantities: Vec<CheckedQuantity>,
    /// Standard uncertainty by the noise of the sensors: of the gain, relative, and of its phase, rad.
    #[serde(skip)]
    u_noise: f64,
}

impl LoopCheck {
    /// Whether the drive was raised, because noise hid what is measured at a hundredth of it.
    pub fn is_raised(&self) -> bool {
        self.share > SHARES[0]
    }

    /// Without what a channel has read.
    fn without_numbers(has_base: bool) -> Self {
        let nothing = f64::NAN;
        let channel = CheckedChannel {
            gain: nothing,
            phase: nothing,
            delay: nothing,
            noise: nothing,
            floor: nothing,
        };
        Self {
            verdict: Verdict::NotANumber,
            amplitude: 0.0,
            share: 0.0,
            periods: 0.0,
            response: channel,
            base: has_base.then_some(channel),
            linear: None,
            quantities: Vec::new(),
            u_noise: 0.0,
        }
    }

    /// Whether noise hides a phase that is to be refused: the drive is too small.
    fn is_too_weak(&self) -> bool {
        // Noise does not look like exchanged channels, and more response would exceed the range of the base.
        let is_certain = matches!(
            self.verdict,
            Verdict::NotANumber | Verdict::NotAtRest | Verdict::Swapped
        );
        !is_certain && SIGNIFICANT * self.u_noise > PHASE.to_radians()
    }

    /// Whether another check is healthy and contradicts each quantity that this one refuses, beyond the uncertainties.
    fn is_contradicted_by(&self, other: &Self) -> bool {
        let pairs = self.quantities.iter().zip(&other.quantities);
        let mut refused = pairs.filter(|(one, _)| one.refusal().is_some()).peekable();
        let differs = |(one, other): (&CheckedQuantity, &CheckedQuantity)| {
            (one.measured - other.measured).abs() > SIGNIFICANT * one.uncertainty.hypot(other.uncertainty)
        };
        other.verdict == Verdict::Healthy && refused.peek().is_some() && refused.all(differs)
    }
}

/// Checks a rig at a hundredth of the drive, after a response that is still falling has come to rest. The phase of the rig's oscillator is
/// a multiple of 2 pi before and after.
///
/// A response that is refused is checked again at less drive: a sensor is late or has a wrong factor at every drive, but a particle that slides on
/// the floor sticks to it. Where noise hides the phase, the drive is raised: to the scene's drive at most, or to a response of half the half-width,
/// which hits no particle in the inner half of the cavity.
pub fn check(rig: &mut (impl Rig + ?Sized), plan: &Plan) -> Result<LoopCheck, RigError> {
    let LinearResponse { omega0, damping_rate, .. } = plan.knowledge.linear;
    let response = match plan.knowledge.shaker {
        Some(_) => 0.5 * omega0 / damping_rate,
        None => expected(plan)[0].norm(),
    };
    let most = f64::min(1.0, 0.5 * plan.knowledge.numbers.b / (response * plan.amplitude));
    let mut found = at_share(rig, plan, SHARES[0], MOST_WAITS)?;
    let is_refused = matches!(
        found.verdict,
        Verdict::ResponseLate | Verdict::BaseLate | Verdict::ResponseGain
    );
    if plan.knowledge.shaker.is_none() && is_refused {
        let again = at_share(rig, plan, SHARES[1], MOST_WAITS.min(relaxed(plan)))?;
        let periods = found.periods + again.periods;
        let is_contradicted = found.is_contradicted_by(&again);
        found = if is_contradicted { again } else { found };
        found.periods = periods;
    }
    while found.is_too_weak() && found.share < most {
        let raised = at_share(rig, plan, most.min(RAISE * found.share), MOST_WAITS)?;
        found = LoopCheck { periods: found.periods + raised.periods, ..raised };
    }
    let Units { response, reference, .. } = plan.knowledge.target.units;
    Ok(LoopCheck {
        amplitude: reference.of_metres(found.amplitude),
        response: found.response.in_unit(response),
        base: found.base.map(|base| base.in_unit(reference)),
        ..found
    })
}

/// Number of waits in which the response to a check falls to 1 %, in five relaxation times; what is left then is noise.
fn relaxed(plan: &Plan) -> usize {
    (5.0 * plan.knowledge.linear.relaxation_periods() / WAIT as f64).ceil() as usize
}

/// The check at this share of the drive, after `waits` at most.
fn at_share(rig: &mut (impl Rig + ?Sized), plan: &Plan, share: f64, waits: usize) -> Result<LoopCheck, RigError> {
    if let Some(stated) = &plan.knowledge.shaker {
        return shaker::check(rig, plan, stated, share);
    }
    let (omega, amplitude, step) = (
        plan.lock.omega_start,
        share * plan.amplitude,
        plan.knowledge.sample_time,
    );
    let target = plan.knowledge.target;
    let mut rig = Scaled::new(rig, target);
    let mut rig = OpenLoop::new(&mut rig, target, step);
    let samples = |periods: usize| (periods as f64 * TAU / (omega * step)).round() as usize;
    let [quiet, driven] = CHECK_PERIODS.map(samples);
    let expected = expected(plan).map(|per_drive| per_drive * amplitude);
    let enough = expected.map(|phasor| NOISE * phasor.norm());
    rig.rest(omega, [quiet, samples(WAIT)], waits, enough)?;
    let begins = rig.readings.len();
    rig.drive(driven, omega, amplitude)?;
    let ends = rig.readings.len();
    rig.end(samples(1))?;
    let mut found = LoopCheck {
        amplitude,
        share,
        periods: rig.readings.len() as f64 / samples(1) as f64,
        ..LoopCheck::without_numbers(rig.has_base)
    };
    let (quiet, driven) = (&rig.readings[begins - quiet..begins], &rig.readings[begins..ends]);
    judge(&mut found, quiet, driven, expected, plan);
    Ok(found)
}

/// Judges readings without a drive and with it; `expected`: phasors of response and base at the end.
fn judge(
    found: &mut LoopCheck,
    quiet: &[[f64; 3]],
    driven: &[[f64; 3]],
    expected: [Complex64; 2],
    plan: &Plan,
) -> Option<()> {
    let (omega, step, target) = (plan.lock.omega_start, plan.knowledge.sample_time, plan.knowledge.target);
    let period = (TAU / (omega * step)).round() as usize;
    // The base may be late by half a period, and reads nothing before.
    let (onset, after) = driven.split_at(period / 2);
    let window = |readings, channel| Window { readings, channel, target, omega, step };
    let base = window(after, 2).fitted(0.5 * after.len() as f64, 0, &[], Complex64::new(0.0, omega))?;
    let (phasor, u_base) = match found.base {
        Some(_) => (
            base.phasor(0),
            base.u(&[1.0 / base.found.amplitudes[0], Complex64::ZERO]),
        ),
        // Without a sensor, the base moves as expected.
        None => (expected[1], 0.0),
    };
    let alone = without_other_modes(driven, plan, omega, found.amplitude);
    let stated = plan.knowledge.linear;
    let start = Complex64::new(-stated.damping_rate, stated.omega0);
    let drive = [Complex64::new(0.0, omega)];
    let late = (plan.lock.delay / step).ceil();
    let response = window(&alone[late as usize..], 1).fitted(-late, 1, &drive, start)?;
    // Exchanged channels: the base grows as the response does.
    let exchanged = window(&driven[late as usize..], 2).fitted(-late, 1, &drive, start)?;
    let white = [1, 2].map(|channel| noise_of(quiet, channel, &target, step));
    let growth = Growth::of(&response, white[0], phasor, plan);
    let per_drive = [response.end(), base.phasor(0)];
    let noise = [&response, &base].map(|one| one.noise());
    let mut channels = [0, 1].map(|n| {
        let floor = scatter(quiet, n + 1);
        let channel = CheckedChannel { noise: noise[n], floor, ..CheckedChannel::default() };
        channel.at(per_drive[n] / expected[n], omega * step)
    });
    // Where noise hides the growth, it is at least the error of the phasor of a few periods.
    let of_phasor = expected.map(|phasor| (2.0 / (EVALUATED * period as f64)).sqrt() / phasor.norm());
    found.u_noise = (white[0] * growth.per_noise.max(of_phasor[0])).hypot(white[1] * of_phasor[1]);
    if found.base.is_some() {
        found.quantities.extend(of_base(&base, found.amplitude, u_base, plan));
    }
    let linear = growth.linear(u_base, plan);
    if let Some(response) = &linear {
        // Amplitude and phase of the response for the natural frequency and the damping that the rig has.
        let reference = plan.knowledge.numbers.definition.reference;
        let ratio = response.gain / response.oscillator_gain(omega, reference);
        channels[0] = channels[0].at(ratio * phasor / expected[1], omega * step);
        found.quantities.extend(of_response(response, ratio, plan));
    }
    let waits = base.is_late(onset, quiet);
    let crossed = [response.end() / expected[1], exchanged.end() / expected[0]];
    let amplitudes = expected.map(|response| response.norm());
    found.response = channels[0];
    found.base = found.base.map(|_| channels[1]);
    found.verdict = found.verdict(&amplitudes, crossed, [waits, relaxed(plan) <= MOST_WAITS]);
    let linear = linear.filter(|_| found.verdict == Verdict::Healthy);
    found.linear = linear.map(|response| Linear::new(response, plan));
    Some(())
}

/// Readings of a channel: 1, the response, or 2, the base.
struct Window<'a> {
    readings: &'a [[f64; 3]],
    channel: usize,
    target: Target,
    /// Frequency of the drive, rad/s.
    omega: f64,
    step: f64,
}

/// The oscillations of a channel.
struct Fitted<'a> {
    window: Window<'a>,
    found: Oscillations,
    /// What makes a phasor of the displacement of the amplitude of a reading, m.
    unit: Complex64,
    /// Variance of the noise about the frequency of the drive, as if it were white.
    variance: f64,
}

impl<'a> Window<'a> {
    /// Fits oscillations with these known poles beside a trend of this degree. Amplitudes are those at the sample `origin`.
    fn fitted(self, origin: f64, trend: usize, known: &[Complex64], start: Complex64) -> Option<Fitted<'a>> {
        let Self { readings, channel, target, omega, step } = self;
        let values = readings.iter().map(|reading| reading[channel]);
        let found = Oscillations::new(values, [-origin * step, step], trend, known, start)?;
        let phase = readings[0][0] + origin * omega * step;
        let unit = target.displacement(channel - 1, omega) * Complex64::cis(-phase);
        let variance = found.variance(omega * step, (TAU / (omega * step)).round() as usize);
        Some(Fitted { window: self, found, unit, variance })
    }
}

impl Fitted<'_> {
    /// The displacement that belongs to an amplitude, relative to the drive, m.
    fn phasor(&self, n: usize) -> Complex64 {
        self.found.amplitudes[n] * self.unit
    }

    /// Standard uncertainty of each component of a sum of amplitudes and the pole.
    fn u(&self, factors: &[Complex64]) -> f64 {
        self.variance.sqrt() * self.found.u(factors)
    }

    /// RMS of everything else, m.
    fn noise(&self) -> f64 {
        mean_square(self.found.rest.iter().copied()).sqrt() * self.unit.norm()
    }

    /// Phasor of a driven mode at the end of the check, m.
    fn end(&self) -> Complex64 {
        let omega = self.window.omega;
        let free = (self.found.pole - Complex64::new(0.0, omega)) * (CHECK_PERIODS[1] as f64 * TAU / omega);
        self.phasor(0) + self.phasor(1) * free.exp()
    }

    /// Whether the first readings under the drive, `onset`, are rather those of a channel that still rests, as in `quiet`, than those of this oscillation: a
    /// delay of half a period looks like the opposite sign.
    fn is_late(&self, onset: &[[f64; 3]], quiet: &[[f64; 3]]) -> bool {
        let Window { channel, target, omega, .. } = self.window;
        let rest = mean(quiet.iter().map(|reading| reading[channel]));
        let amplitude = self.phasor(0) / target.displacement(channel - 1, omega);
        let moved = |reading: &[f64; 3]| (amplitude * Complex64::cis(reading[0])).im;
        let error = |share: f64| mean_square(onset.iter().map(|one| one[channel] - rest - share * moved(one)));
        error(0.0) < error(1.0)
    }
}

/// The readings of the response without what the drawing's structure adds to that of its driven mode, from rest: the beat of two modes may last longer
/// than the check.
fn without_other_modes(readings: &[[f64; 3]], plan: &Plan, omega: f64, amplitude: f64) -> Vec<[f64; 3]> {
    let (target, step, delay) = (plan.knowledge.target, plan.knowledge.sample_time, plan.lock.delay);
    let (order, begin) = (target.measurands[0].order(), readings[0][0]);
    let mut alone = readings.to_vec();
    for (section, pair) in &plan.beside {
        let [x, v] = section.steady(omega).map(|steady| steady * amplitude);
        let started = Vector2::from([x, v].map(|steady| (steady * Complex64::cis(begin)).im));
        let harmonic = (x * pair[0] + v * pair[1]) * Complex64::new(0.0, omega).powi(order);
        if !harmonic.is_finite() {
            continue;
        }
        for (n, reading) in alone.iter_mut().enumerate() {
            let time = n as f64 * step - delay;
            if time < 0.0 {
                continue;
            }
            let mut free = section.propagator(time) * started;
            if order == 2 {
                free = section.rate(free);
            }
            let free = section.at(*pair, free)[usize::from(order > 0)];
            let driven = (harmonic * Complex64::cis(begin + omega * time)).im;
            reading[1] -= (driven - free) * target.scale(0);
        }
    }
    alone
}

/// Phasors of response and base over the amplitude of the drive, at the end of a check of the scene's linear resonator: a mode at rest that is driven
/// at its natural frequency responds with `-i g E (1 - exp(-d t))/d` (`g`: half the frequency, `d`: damping rate).
fn expected(plan: &Plan) -> [Complex64; 2] {
    let omega = plan.lock.omega_start;
    let LinearResponse { omega0, damping_rate, .. } = plan.knowledge.linear;
    let rate = Complex64::new(damping_rate, omega - omega0);
    let time = CHECK_PERIODS[1] as f64 * TAU / omega;
    let growth = Complex64::new(0.0, -0.5 * omega0) * (1.0 - (-rate * time).exp()) / rate;
    // A delay that the chain states is expected.
    let stated = Complex64::from_polar(1.0, -plan.lock.delay * omega);
    [growth * stated, stated]
}

// A rig that is driven with its loop open.

/// Largest number of waits for the rig to come to rest.
const MOST_WAITS: usize = 40;
/// Duration of a wait, periods.
const WAIT: usize = 10;

/// A rig whose loop is open, and what it has read: the phase of its oscillator, rad, response and base.
struct OpenLoop<'a, R: ?Sized> {
    rig: &'a mut R,
    target: Target,
    step: f64,
    phase: f64,
    readings: Vec<[f64; 3]>,
    has_base: bool,
}

impl<'a, R: Rig + ?Sized> OpenLoop<'a, R> {
    fn new(rig: &'a mut R, target: Target, step: f64) -> Self {
        Self {
            rig,
            target,
            step,
            phase: 0.0,
            readings: Vec::new(),
            has_base: false,
        }
    }

    /// Takes `samples` without a drive, at whose end the phase of the rig's oscillator is a multiple of 2 pi, as at the start of a controller.
    fn end(&mut self, samples: usize) -> Result<(), RigError> {
        let last = (TAU - self.phase % TAU) / (samples as f64 * self.step);
        self.drive(samples, last, 0.0)
    }

    /// Drives with a frequency, rad/s, and an amplitude, m, and keeps the readings.
    fn drive(&mut self, samples: usize, omega: f64, amplitude: f64) -> Result<(), RigError> {
        for _ in 0..samples {
            let phase = self.phase;
            let sensors = self.rig.sense()?;
            self.has_base |= sensors.reference.is_some();
            self.readings
                .push([phase, sensors.response, sensors.reference.unwrap_or(0.0)]);
            let drive = Drive { omega, amplitude, displacement: amplitude * phase.sin() };
            self.rig.advance(drive, self.step)?;
            self.phase += omega * self.step;
        }
        Ok(())
    }

    /// Waits until response and base are at most `enough` (RMS, m) over the last `quiet` samples, beside the noise of their sensors; looks after every
    /// `pause`, `waits` times at most. The base is at rest already, unless the channels are exchanged.
    fn rest(&mut self, omega: f64, [quiet, pause]: [usize; 2], waits: usize, enough: [f64; 2]) -> Result<(), RigError> {
        self.drive(quiet, omega, 0.0)?;
        // Variances of normal noise, over the window and from its third differences, differ by this part of it.
        let random = SIGNIFICANT * (8.0 / quiet as f64).sqrt();
        for _ in 0..waits {
            let last = &self.readings[self.readings.len() - quiet..];
            let moves = |n: usize| {
                let noise = noise_of(last, n + 1, &self.target, self.step);
                scatter(last, n + 1).powi(2) > enough[n].powi(2) + (1.0 + random) * noise.powi(2)
            };
            // A sensor that reads no number never rests.
            if !(moves(0) || moves(1)) {
                break;
            }
            self.drive(pause, omega, 0.0)?;
        }
        Ok(())
    }
}

/// RMS of a reading about its mean: a sensor has an offset, and so has the centre of mass of a rig whose particle does not lie in the middle.
fn scatter(readings: &[[f64; 3]], of: usize) -> f64 {
    standard_deviation(&readings.iter().map(|reading| reading[of]).collect::<Vec<f64>>())
}

/// Standard deviation of the noise on a reading that is smooth.
fn noise_of(readings: &[[f64; 3]], of: usize, target: &Target, step: f64) -> f64 {
    let values: Vec<f64> = readings.iter().map(|reading| reading[of]).collect();
    target.noise(&values, step)
}

// What the check of a loop measures, beside what the scene says.

/// Largest relative error of an amplitude: later measurements of response and drive would be wrong by it.
const FACTOR: f64 = 0.05;
/// Largest unexplained phase of the response relative to the base, degrees. On the default scene 1 degree shifts sigma by 0.026.
const PHASE: f64 = 1.0;
/// Largest relative difference of the clocks: later measurements of frequencies in hertz would be wrong by it.
const CLOCK: f64 = 1e-3;
/// Relative differences of natural frequency and damping from which they are reported, beyond their uncertainty.
const NOTED: [f64; 2] = [1e-4, 0.02];

/// A measured quantity.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct CheckedQuantity {
    /// What it is.
    pub name: &'static str,
    /// Its unit; empty for a pure number.
    pub unit: &'static str,
    /// Measured value.
    pub measured: f64,
    /// Standard uncertainty.
    pub uncertainty: f64,
    /// Value of the scene.
    pub expected: f64,
    /// Largest difference beyond the uncertainty.
    pub tolerance: f64,
    /// What a larger difference means; absent where the measured value replaces the scene's.
    pub verdict: Option<Verdict>,
}

impl CheckedQuantity {
    /// Whether it differs from the scene.
    pub fn differs(&self) -> bool {
        let difference = (self.measured - self.expected).abs();
        difference > self.tolerance + SIGNIFICANT * self.uncertainty
    }

    /// What its difference means, where a measurement after it would be wrong.
    fn refusal(&self) -> Option<Verdict> {
        self.verdict.filter(|_| self.differs())
    }
}

/// Natural frequency, damping, and the response over the expected response (`ratio`) of an oscillator that has both.
fn of_response(linear: &LinearResponse, ratio: Complex64, plan: &Plan) -> [CheckedQuantity; 4] {
    let stated = plan.knowledge.linear;
    let u = linear.uncertainty;
    let hertz = [linear.omega0, u, stated.omega0].map(|omega| omega / TAU);
    let damping = [linear.damping_rate, u, stated.damping_rate];
    let phase = [ratio.arg().to_degrees(), linear.u_gain.to_degrees(), 0.0];
    let late = [Verdict::ResponseLate, Verdict::BaseLate][usize::from(ratio.arg() > 0.0)];
    let gain = [ratio.norm(), linear.u_gain, 1.0];
    let (phases, gains) = (
        "phase of the response to the base, less the expected one",
        "response over base, over the expected one",
    );
    [
        quantity("natural frequency", "Hz", hertz, NOTED[0] * hertz[2], None),
        quantity("damping rate", "1/s", damping, NOTED[1] * damping[2], None),
        quantity(phases, "degrees", phase, PHASE, Some(late)),
        quantity(gains, "", gain, FACTOR, Some(Verdict::ResponseGain)),
    ]
}

/// Frequency of the base, and its amplitude over that of the drive.
fn of_base(base: &Fitted, drive: f64, u: f64, plan: &Plan) -> [CheckedQuantity; 2] {
    let omega = plan.lock.omega_start;
    let ratio = base.phasor(0).norm() / drive;
    // A controlled base needs no known shaker.
    let controlled = plan.lock.base_bandwidth.is_some();
    let tolerance = if controlled { GAIN - 1.0 } else { FACTOR };
    let u_clock = base.u(&[Complex64::ZERO, Complex64::ONE]) / omega;
    let clock = [base.found.pole.im / omega, u_clock, 1.0];
    let (name, gain) = ("frequency of the base over that of the drive", [ratio, u * ratio, 1.0]);
    [
        quantity(name, "", clock, CLOCK, Some(Verdict::Clock)),
        quantity("base over drive", "", gain, tolerance, Some(Verdict::BaseGain)),
    ]
}

/// A quantity: measured, standard uncertainty, and as the scene says.
fn quantity(
    name: &'static str,
    unit: &'static str,
    [measured, uncertainty, expected]: [f64; 3],
    tolerance: f64,
    verdict: Option<Verdict>,
) -> CheckedQuantity {
    CheckedQuantity {
        name,
        unit,
        measured,
        uncertainty,
        expected,
        tolerance,
        verdict,
    }
}

// What the check of a loop says of its channels.

/// Largest RMS of the residual of the fit at the drive's frequency, over the amplitude.
const NOISE: f64 = 0.15;
/// Periods from which a phasor is seen at least.
const EVALUATED: f64 = 4.0;
/// Share of the expected amplitude below which a sensor is dead.
const DEAD: f64 = 0.01;
/// Factor by which an amplitude may differ from the expected one, or its inverse: the damping is known roughly.
const GAIN: f64 = 2.0;
/// Deviation of the phase, rad, up to which a channel is in time, or reversed, or exchanged: the nearest quarter of a turn.
const IN_TIME: f64 = FRAC_PI_4;

/// A channel.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct CheckedChannel {
    /// Amplitude at the frequency of the drive over the expected one.
    pub gain: f64,
    /// Phase less the expected one, degrees; a delay is negative.
    pub phase: f64,
    /// This phase as a delay, samples.
    pub delay: f64,
    /// RMS of everything else, as a displacement in m or as a force in N.
    pub noise: f64,
    /// RMS without a drive, in the same unit.
    pub floor: f64,
}

impl CheckedChannel {
    /// What is in metres of the oscillator, in this unit.
    fn in_unit(self, unit: Unit) -> Self {
        let [noise, floor] = [self.noise, self.floor].map(|metres| unit.of_metres(metres));
        Self { noise, floor, ..self }
    }

    /// With another ratio to the expected phasor; `turn`: phase of a sample, rad.
    fn at(self, ratio: Complex64, turn: f64) -> Self {
        Self {
            gain: ratio.norm(),
            phase: ratio.arg().to_degrees(),
            delay: -ratio.arg() / turn,
            ..self
        }
    }
}

/// What the check found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, thiserror::Error)]
#[serde(rename_all = "kebab-case")]
#[expect(missing_docs, reason = "the messages say what each means")]
pub enum Verdict {
    #[error("signs, gains, delays and noise are as expected")]
    Healthy,
    #[error("a sensor reads no number: check its converter")]
    NotANumber,
    #[error("the response moves without a drive: wait until the rig is at rest")]
    NotAtRest,
    #[error("no sensor answers the drive: check the amplifier of the shaker and the cables")]
    ShakerOff,
    #[error("the response does not answer the drive, or too weakly to be seen: check its sensor, cable and factor")]
    ResponseDead,
    #[error("the base sensor does not answer the drive: check it and its cable")]
    BaseDead,
    #[error("response and base are exchanged: swap the two channels")]
    Swapped,
    #[error("the response has the opposite sign: reverse its sensor, or its factor")]
    ResponseReversed,
    #[error("the base sensor has the opposite sign: reverse it, or its factor")]
    BaseReversed,
    #[error("both sensors have the opposite sign: the shaker is reversed")]
    BothReversed,
    #[error(
        "the amplitude of the response is not as expected: check its unit and factor, and whether the base moves the structure through its spring"
    )]
    ResponseGain,
    #[error(
        "the amplitude of the base is not that of the drive: check its unit and factor, and the gain of the shaker"
    )]
    BaseGain,
    #[error("the response is late: check its filter and delay; a lock would hold another phase than it reports")]
    ResponseLate,
    #[error("the base sensor is late: check its filter and delay; a lock would hold another phase than it reports")]
    BaseLate,
    #[error(
        "the base has another frequency than the drive: check the clocks and the sample times of rig and controller"
    )]
    Clock,
    #[error(
        "shaker and structure have another resonance so near the natural frequency that the force cannot be controlled: change the mass of the \
         armature, its suspension or the drive point"
    )]
    ShakerResonance,
    #[error("the response is noisy: check its shield and range")]
    ResponseNoisy,
    #[error("the base sensor is noisy: check its shield and range")]
    BaseNoisy,
}

impl LoopCheck {
    /// The first fault of the table. `expected`: amplitudes of response and base, m; `crossed`: what each channel is of the other's expected phasor.
    /// `waits`: the base moves later than the drive, so that its phase is that of a delay. `relaxes`: a free motion of the mode ends in the waits before the
    /// drive; another one is in the fit.
    fn verdict(&self, expected: &[f64; 2], crossed: [Complex64; 2], [waits, relaxes]: [bool; 2]) -> Verdict {
        let (has_base, response) = (self.base.is_some(), self.response);
        // Without a sensor, the base is as expected.
        let base = self
            .base
            .unwrap_or(CheckedChannel { gain: 1.0, ..CheckedChannel::default() });
        let is_near = |gain: f64| (1.0 / GAIN..GAIN).contains(&gain);
        let is_at = |phase: f64, degrees: f64| ((phase - degrees).to_radians().sin_cos().1) > IN_TIME.cos();
        let is_noisy = |channel: &CheckedChannel, expected: f64| channel.noise > NOISE * channel.gain * expected;
        let dead = [response, base].map(|channel| channel.gain < DEAD);
        // Exchanged sensors read each other's signal. The response's converter may be too coarse for the motion of the base.
        let [is_base, is_response] = crossed.map(|one| is_near(one.norm()) && is_at(one.arg().to_degrees(), 0.0));
        // What delays both, such as a connection, cancels in the phase that the controller holds.
        let apart = response.phase - base.phase;
        let base_reversed = !waits && is_at(base.phase, 180.0);
        let base_in_time = is_at(base.phase, 0.0);
        let still = (SIGNIFICANT * response.noise).hypot(NOISE * response.gain.max(1.0) * expected[0]);
        let refuses = |verdict: Verdict| self.quantities.iter().any(|one| one.refusal() == Some(verdict));
        let late = !is_at(apart, 0.0);
        let base_gain = !is_near(base.gain) || refuses(Verdict::BaseGain);
        let response_gain = !is_near(response.gain) || refuses(Verdict::ResponseGain);
        let numbers = response.gain + base.gain + response.noise + base.noise;
        let faults = [
            (Verdict::NotANumber, !numbers.is_finite()),
            (Verdict::ShakerOff, dead[0] && (dead[1] || !has_base)),
            (Verdict::Swapped, has_base && (dead[0] || is_base) && is_response),
            (Verdict::ResponseDead, dead[0]),
            (Verdict::BaseDead, dead[1]),
            (
                Verdict::NotAtRest,
                relaxes && response.floor > still && (base_gain || response_gain),
            ),
            (Verdict::BaseGain, base_gain),
            (Verdict::BaseNoisy, is_noisy(&base, expected[1])),
            (Verdict::Clock, refuses(Verdict::Clock)),
            // A signal that exceeds the range of its converter is distorted, too.
            (Verdict::ResponseGain, !is_near(response.gain)),
            (Verdict::ResponseNoisy, is_noisy(&response, expected[0])),
            (Verdict::BothReversed, base_reversed && is_at(apart, 0.0)),
            (Verdict::BaseReversed, base_reversed && is_at(apart, 180.0)),
            (Verdict::ResponseReversed, base_in_time && is_at(apart, 180.0)),
            (Verdict::BaseLate, late && !base_in_time || refuses(Verdict::BaseLate)),
            (Verdict::ResponseLate, late || refuses(Verdict::ResponseLate)),
            (Verdict::ResponseGain, response_gain),
        ];
        let fault = faults.into_iter().find(|(_, is)| *is);
        fault.map_or(Verdict::Healthy, |(verdict, _)| verdict)
    }
}

// The linear response of a rig, and the gains that follow from it.

/// The linear response, and the tuning of the loop for it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Linear {
    /// Natural frequency, rad/s.
    pub omega_0: f64,
    /// Damping rate, rad/s.
    pub damping_rate: f64,
    /// Standard uncertainty of each of the two, rad/s.
    pub u_damping_rate: f64,
    /// Growth rate of the response at resonance per amplitude of the base, 1/s.
    pub response_gain: f64,
    /// Standard uncertainty of the gain, relative, and of its phase, rad.
    pub u_gain: f64,
    /// Phase of the response at resonance relative to the base, degrees: -90, less what is late.
    pub phase: f64,
    /// Bandwidth of the detector, rad/s, from which the gains follow.
    pub bandwidth: f64,
    /// Proportional gain, rad/s per rad, and integral gain, rad/s² per rad.
    pub gains: [f64; 2],
    /// Phase margin of the loop with a delay of one sample, degrees.
    pub phase_margin: f64,
    /// The frequency response. The particle is carried if the friction in the drawing holds it at the largest acceleration of the check.
    #[serde(skip)]
    pub response: LinearResponse,
    /// It as data.
    #[serde(flatten)]
    pub data: MeasuredLinear,
}

impl Linear {
    /// A frequency response, and the tuning for it.
    fn new(response: LinearResponse, plan: &Plan) -> Self {
        let (bandwidth, rate) = (plan.lock.bandwidth, response.damping_rate.max(0.0));
        let gains = Gains::from_bandwidth(bandwidth, rate);
        let margin = gains.phase_margin(bandwidth, rate, plan.knowledge.sample_time);
        Self {
            omega_0: response.omega0,
            damping_rate: response.damping_rate,
            u_damping_rate: response.uncertainty,
            response_gain: response.gain.norm(),
            u_gain: response.u_gain,
            phase: response.gain.arg().to_degrees(),
            bandwidth,
            gains: [gains.proportional, gains.integral],
            phase_margin: margin.to_degrees(),
            data: response.data(),
            response,
        }
    }
}

/// The growth of the response.
struct Growth<'a> {
    response: &'a Fitted<'a>,
    /// Gain, 1/s, and `i omega - pole`.
    gain: Complex64,
    rate: Complex64,
    /// Largest amplitude, m.
    largest: f64,
    /// Standard uncertainties of the rate, rad/s, and of the gain, relative; the latter for white noise of the standard deviation 1 m in the readings, 1/m.
    u_rate: f64,
    u_gain: f64,
    per_noise: f64,
}

impl<'a> Growth<'a> {
    /// Of a response with this noise, m, to a base with this phasor, m.
    fn of(response: &'a Fitted, white: f64, base: Complex64, plan: &Plan) -> Self {
        let Fitted { found, window: Window { omega, step, .. }, .. } = response;
        let rate = Complex64::new(0.0, *omega) - found.pole;
        let steady = found.amplitudes[0];
        let at = |time: f64| (response.phasor(0) + response.phasor(1) * (-rate * time).exp()).norm();
        let period = TAU / omega;
        let sizes = (0..=CHECK_PERIODS[1]).map(|n| at(n as f64 * period));
        // The gain is proportional to amplitude and rate.
        let slope = [1.0 / steady, Complex64::ZERO, -1.0 / rate];
        // The modes of a drawing are not quite those of the rig: what the fit leaves beyond noise does not average out.
        let degrees = 2.0 * CHECK_PERIODS[1] as f64 - 6.0;
        let of_noise = white * white * response.window.target.colour(*omega, *step);
        let explained = of_noise * (1.0 + SIGNIFICANT * (2.0 / degrees).sqrt());
        let misfit = if plan.beside.is_empty() {
            0.0
        } else {
            (response.variance - explained).max(0.0)
        };
        let inflation = (1.0 + misfit / response.variance * CHECK_PERIODS[1] as f64).sqrt();
        Self {
            response,
            gain: response.phasor(0) * rate / base,
            rate,
            largest: sizes.fold(0.0, f64::max),
            u_rate: inflation * response.u(&[Complex64::ZERO, Complex64::ZERO, Complex64::ONE]),
            u_gain: inflation * response.u(&slope),
            per_noise: found.u(&slope),
        }
    }

    /// The linear response, if its growth is more than noise. `u_base`: relative standard uncertainty of the base.
    fn linear(&self, u_base: f64, plan: &Plan) -> Option<LinearResponse> {
        if !(self.gain.norm().is_finite() && self.u_gain < DETERMINED) {
            return None;
        }
        let omega = self.response.window.omega;
        let is_carried = FRICTION * omega * omega * self.largest < plan.knowledge.carried_up_to;
        Some(LinearResponse {
            omega0: self.response.found.pole.norm(),
            damping_rate: self.rate.re,
            uncertainty: self.u_rate,
            gain: self.gain,
            u_gain: self.u_gain.hypot(u_base),
            particle: if is_carried {
                ParticleState::Carried
            } else {
                ParticleState::Unknown
            },
            shaker: None,
        })
    }
}

/// Largest friction in a drawing over the rig's.
const FRICTION: f64 = 2.0;
/// Largest relative standard uncertainty of the gain of a response that is more than noise.
const DETERMINED: f64 = 0.1;
