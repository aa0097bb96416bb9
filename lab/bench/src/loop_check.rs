//! Check of the loop before the drive rises: an open loop at a hundredth of the drive shows what is connected to what. Where the noise of the sensors
//! leaves the phase uncertain, the drive is raised.
//!
//! A linear resonator at rest that is driven at its natural frequency with the amplitude E responds with `-i g E (1 - exp(-d t))/d`
//! (`g`: half the frequency, `d`: damping rate). Response and base are compared with this and with E, by amplitude and phase.

mod shaker;

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};

use nalgebra::{DVector, RowVector3, Vector2};
use num_complex::Complex64;
use phase_lock::Gains;
use serde::Serialize;
use vines_model::numerics::{HarmonicBasis, SIGNIFICANT, complex_fit, mean, mean_square, standard_deviation};

use crate::rig::{Drive, Rig, RigError, Scaled};
use vines_scene::knowledge::Target;
use vines_scene::linear::LinearResponse;
use vines_scene::linear::{MeasuredLinear, ParticleState};
use vines_scene::plan::Plan;
use vines_scene::scene::{Unit, Units};

/// Drives of the check, over the scene's drive: too small for impacts. The smaller one follows where the particle may have slid.
const SHARES: [f64; 2] = [0.01, 0.01 / 16.0];
/// Factor by which the drive is raised at a time: a fault that noise has hidden is seen at little more.
const RAISE: f64 = 4.0;
/// Numbers of periods: without a drive, with it, and evaluated at the end of it.
const CHECK_PERIODS: [usize; 3] = [2, 24, 4];

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
    // The response to a check falls to 1 % in five relaxation times; what is left then is noise.
    let relaxed = (5.0 * plan.knowledge.linear.relaxation_periods() / WAIT as f64).ceil() as usize;
    if plan.knowledge.shaker.is_none() && is_refused {
        let again = at_share(rig, plan, SHARES[1], MOST_WAITS.min(relaxed))?;
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

/// The check at this share of the drive, after `waits` at most.
fn at_share(rig: &mut (impl Rig + ?Sized), plan: &Plan, share: f64, waits: usize) -> Result<LoopCheck, RigError> {
    if let Some(stated) = &plan.knowledge.shaker {
        return shaker::check(rig, plan, stated, share);
    }
    let (omega, amplitude) = (plan.lock.omega_start, share * plan.amplitude);
    let step = plan.knowledge.sample_time;
    let samples = |periods: usize| (periods as f64 * TAU / (omega * step)).round() as usize;
    let [quiet, driven, window] = CHECK_PERIODS.map(samples);
    let target = plan.knowledge.target;
    let mut rig = Scaled::new(rig, target);
    let mut rig = OpenLoop::new(&mut rig, target, step);
    let expected = expected(plan).map(|per_drive| per_drive * amplitude);
    rig.rest(
        omega,
        [quiet, samples(WAIT)],
        waits,
        expected.map(|phasor| NOISE * phasor.norm()),
    )?;
    let begins = rig.readings.len();
    rig.drive(driven, omega, amplitude)?;
    let ends = rig.readings.len();
    rig.end(samples(1))?;
    let OpenLoop { mut readings, has_base, .. } = rig;
    let periods = readings.len() as f64 / samples(1) as f64;
    let white = [1, 2].map(|of| noise_of(&readings[begins - quiet..begins], of, &target, step));
    readings.truncate(ends);
    without_drift(&mut readings[begins..]);
    let fits = [1, 2].map(|channel| fitted(&readings[begins + driven - window..], channel, 0, &target, omega));
    let mut channels = [0, 1].map(|n| {
        let (phasor, noise) = fits[n];
        let ratio = phasor / expected[n];
        let floor = scatter(&readings[begins - quiet..begins], n + 1);
        let channel = CheckedChannel { noise, floor, ..CheckedChannel::default() };
        channel.at(ratio, omega * step)
    });
    // A delay that looks like the opposite sign is at least this long.
    let first = (samples(1) as f64 * (PI - IN_TIME) / TAU) as usize;
    let lead = target.measurands[1].lead();
    let begin = &readings[begins - quiet..begins + first];
    let waits = is_late(begin, quiet, channels[1].gain * amplitude, lead);
    // Without a sensor, the base moves as expected.
    let (phasor, noise) = fits[1];
    let base = if has_base {
        (phasor, noise / phasor.norm() * (2.0 / window as f64).sqrt())
    } else {
        (expected[1], 0.0)
    };
    let period = samples(1);
    let readings = &readings[begins..];
    let phasors = |readings: &[[f64; 3]], channel| by_period(readings, channel, period, &target, omega);
    let (response, rests) = phasors(readings, 1);
    let (beside, _) = phasors(&beside_driven_mode(readings, plan, omega, amplitude), 1);
    let alone: Vec<Complex64> = response.iter().zip(&beside).map(|(z, other)| z - other).collect();
    let (linear, per_noise) =
        Linear::of(&alone, mean_square(rests).sqrt(), base, omega, period, plan).unwrap_or((None, 0.0));
    let u_noise = by_noise(white, per_noise, &expected, window);
    let mut quantities = Vec::new();
    if has_base {
        quantities.extend(of_base(base, amplitude, &phasors(readings, 2).0, plan));
    }
    if let Some(linear) = &linear {
        // Amplitude and phase of the response for the natural frequency and the damping that the rig has.
        let (response, reference) = (linear.response, plan.knowledge.numbers.definition.reference);
        let ratio = response.gain / response.oscillator_gain(omega, reference);
        channels[0] = channels[0].at(ratio * base.0 / expected[1], omega * step);
        quantities.extend(of_response(&response, ratio, plan));
    }
    let amplitudes = expected.map(|response| response.norm());
    let verdict = verdict(&channels, &amplitudes, has_base, waits);
    let refused = quantities.iter().find_map(CheckedQuantity::refusal);
    let verdict = refused.filter(|refusal| verdict.may_be(*refusal)).unwrap_or(verdict);
    Ok(LoopCheck {
        verdict,
        linear: linear.filter(|_| verdict == Verdict::Healthy),
        amplitude,
        share,
        periods,
        response: channels[0],
        base: has_base.then_some(channels[1]),
        quantities,
        u_noise,
    })
}

/// Whether the base rests in the readings after the first `quiet` ones, although the drive has begun: a delayed base rests, but a base of the opposite
/// sign moves with this amplitude, m, and this lead, rad.
fn is_late(readings: &[[f64; 3]], quiet: usize, amplitude: f64, lead: f64) -> bool {
    let (before, begin) = readings.split_at(quiet);
    let rest = mean(before.iter().map(|reading| reading[2]));
    let moved = mean_square(begin.iter().map(|reading| reading[2] - rest));
    let moves = begin.iter().map(|[phase, ..]| amplitude * (phase + lead).sin());
    moved < 0.5 * mean_square(moves)
}

/// Standard uncertainty of response over base, relative, and of its phase, rad, by white noise of these standard deviations, m, in both channels;
/// `per_noise`, 1/m: the part of the growth. Where noise hides the growth, it is at least the error of the phasor of the last `window` samples.
fn by_noise(white: [f64; 2], per_noise: f64, expected: &[Complex64; 2], window: usize) -> f64 {
    let of_phasor = expected.map(|phasor| (2.0 / window as f64).sqrt() / phasor.norm());
    (white[0] * per_noise.max(of_phasor[0])).hypot(white[1] * of_phasor[1])
}

/// What the drawing's structure adds to the response of its driven mode, from rest, at the phases of these readings: the beat of two modes may last
/// longer than the check.
fn beside_driven_mode(readings: &[[f64; 3]], plan: &Plan, omega: f64, amplitude: f64) -> Vec<[f64; 3]> {
    let (target, step, delay) = (plan.knowledge.target, plan.knowledge.sample_time, plan.lock.delay);
    let (order, begin) = (target.measurands[0].order(), readings[0][0]);
    let mut beside: Vec<_> = readings.iter().map(|[phase, ..]| [*phase, 0.0, 0.0]).collect();
    for (section, pair) in &plan.beside {
        let [x, v] = section.steady(omega).map(|steady| steady * amplitude);
        let started = Vector2::from([x, v].map(|steady| (steady * Complex64::cis(begin)).im));
        let harmonic = (x * pair[0] + v * pair[1]) * Complex64::new(0.0, omega).powi(order);
        if !harmonic.is_finite() {
            continue;
        }
        for (n, reading) in beside.iter_mut().enumerate() {
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
            reading[1] += (driven - free) * target.scale(0);
        }
    }
    without_drift(&mut beside);
    beside
}

/// Removes the drift of the response: a particle that flies slowly moves the centre of mass, which looks like a response in every period.
fn without_drift(readings: &mut [[f64; 3]]) {
    let half = readings.len() / 2;
    let [first, second] =
        [&readings[..half], &readings[half..2 * half]].map(|part| mean(part.iter().map(|reading| reading[1])));
    let slope = (second - first) / half as f64;
    for (n, reading) in readings.iter_mut().enumerate() {
        reading[1] -= slope * n as f64;
    }
}

/// Phasors of response and base over the amplitude of the drive, at the end of a check of the scene's linear resonator.
fn expected(plan: &Plan) -> [Complex64; 2] {
    let omega = plan.lock.omega_start;
    let LinearResponse { omega0, damping_rate, .. } = plan.knowledge.linear;
    let time = (CHECK_PERIODS[1] as f64 - 0.5 * CHECK_PERIODS[2] as f64) * TAU / omega;
    let rate = Complex64::new(damping_rate, omega - omega0);
    let growth = Complex64::new(0.0, -0.5 * omega0) * (1.0 - (-rate * time).exp()) / rate;
    // A delay that the chain states is expected.
    let stated = Complex64::from_polar(1.0, -plan.lock.delay * omega);
    [growth * stated, stated]
}

/// The displacement of a signal at the frequency of the drive, `omega` (rad/s), m, beside an offset that is a polynomial of the degree `trend`, and the
/// rest of it, RMS; NaN for readings that are no numbers.
fn fitted(readings: &[[f64; 3]], channel: usize, trend: usize, target: &Target, omega: f64) -> (Complex64, f64) {
    let displacement = target.displacement(channel - 1, omega);
    let phases: Vec<f64> = readings.iter().map(|reading| reading[0]).collect();
    let basis = HarmonicBasis::new(&phases, trend, &[Some(0)]);
    let values = DVector::from_iterator(readings.len(), readings.iter().map(|reading| reading[channel]));
    basis
        .fit(&values)
        .map_or((Complex64::new(f64::NAN, f64::NAN), f64::NAN), |fit| {
            let rest = basis.residual(&values, &fit);
            let rest = mean_square(rest.iter().copied()).sqrt();
            (fit.harmonic(1) * displacement, rest * displacement.norm())
        })
}

/// Phasors of a signal period by period, each of `period` samples, and the rests; as [`fitted`] gives them.
fn by_period(
    readings: &[[f64; 3]],
    channel: usize,
    period: usize,
    target: &Target,
    omega: f64,
) -> (Vec<Complex64>, Vec<f64>) {
    let periods = readings.chunks_exact(period);
    periods
        .map(|readings| fitted(readings, channel, 0, target, omega))
        .unzip()
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

/// Amplitude of the base, whose phasor, m, and its relative uncertainty are given, over the amplitude of the drive, and its frequency from its
/// phasors, period by period.
fn of_base((phasor, u): (Complex64, f64), drive: f64, periods: &[Complex64], plan: &Plan) -> [CheckedQuantity; 2] {
    // A delay may shift the beginning by some periods.
    let last = &periods[periods.len() / 2..];
    let turned: Complex64 = last.windows(2).map(|pair| pair[0].conj() * pair[1]).sum();
    let ratio = phasor.norm() / drive;
    // A controlled base needs no known shaker.
    let controlled = plan.lock.base_bandwidth.is_some();
    let tolerance = if controlled { GAIN - 1.0 } else { FACTOR };
    // The phases of a window's ends.
    let u_clock = u * (periods.len() as f64).sqrt() / (TAU * (last.len() as f64 - 1.0));
    let clock = [1.0 + turned.arg() / TAU, u_clock, 1.0];
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

impl Verdict {
    /// Whether what the quantities show, `refusal`, may be the reason: phases say nothing where the clocks differ.
    fn may_be(self, refusal: Self) -> bool {
        let by_phase = matches!(
            self,
            Self::ResponseReversed | Self::BaseReversed | Self::BothReversed | Self::ResponseLate | Self::BaseLate
        );
        self == Self::Healthy || by_phase && refusal == Self::Clock
    }
}

/// Judges response and base, whose expected amplitudes are `expected`, m. `waits`: the base moves later than the drive, so that its phase is that
/// of a delay.
fn verdict(channels: &[CheckedChannel; 2], expected: &[f64; 2], has_base: bool, waits: bool) -> Verdict {
    let [response, base] = channels;
    if !(response.gain + base.gain + response.noise + base.noise).is_finite() {
        return Verdict::NotANumber;
    }
    // Amplitudes in the other channel's units: exchanged sensors read each other's signal.
    let crossed = [
        response.gain * expected[0] / expected[1],
        base.gain * expected[1] / expected[0],
    ];
    let near = |gain: f64| (1.0 / GAIN..GAIN).contains(&gain);
    let is_off = |phase: f64, from: f64| (phase.to_radians() - from + PI).rem_euclid(TAU) - PI;
    let crossed_phases = [is_off(response.phase, FRAC_PI_2), is_off(base.phase, -FRAC_PI_2)];
    let in_time = |phase: f64| phase.abs() < IN_TIME;
    let reversed = |channel: &CheckedChannel| in_time(is_off(channel.phase, PI));
    let noisy = |channel: &CheckedChannel, expected: f64| channel.noise > NOISE * channel.gain * expected;
    let dead = channels.map(|channel| channel.gain < DEAD);
    // The response's converter may be too coarse for the motion of the base.
    let as_base = dead[0] || near(crossed[0]) && in_time(crossed_phases[0]);
    match () {
        () if response.floor > (SIGNIFICANT * response.noise).hypot(NOISE * expected[0]) => Verdict::NotAtRest,
        () if dead[0] && (dead[1] || !has_base) => Verdict::ShakerOff,
        () if has_base && as_base && near(crossed[1]) && in_time(crossed_phases[1]) => Verdict::Swapped,
        () if dead[0] => Verdict::ResponseDead,
        () if has_base && dead[1] => Verdict::BaseDead,
        // A signal that exceeds the range of its converter is distorted, too.
        () if has_base && !near(base.gain) => Verdict::BaseGain,
        () if !near(response.gain) => Verdict::ResponseGain,
        () if noisy(response, expected[0]) => Verdict::ResponseNoisy,
        () if has_base && noisy(base, expected[1]) => Verdict::BaseNoisy,
        () if has_base && !waits && reversed(response) && reversed(base) => Verdict::BothReversed,
        () if has_base && waits && reversed(base) && in_time(is_off(response.phase - base.phase, 0.0)) => {
            Verdict::Healthy
        }
        () if reversed(response) => Verdict::ResponseReversed,
        () if has_base && !waits && reversed(base) => Verdict::BaseReversed,
        // What delays both, such as a connection, cancels in the phase that the controller holds.
        () if in_time(is_off(response.phase - if has_base { base.phase } else { 0.0 }, 0.0)) => Verdict::Healthy,
        () if has_base && !in_time(base.phase.to_radians()) => Verdict::BaseLate,
        () => Verdict::ResponseLate,
    }
}

// The linear response of a rig from its growth in the loop check, and the gains that follow from it.
//
// In the n-th period the phasor of the response is `z = s + a q^n` with `q = exp(-r T)`, `r = delta + i (omega - omega_d)` and
// `s = -i g E/r`, less what the growth within a period adds at twice the frequency, `conj(a q^n) (1 - p)/(1 - p exp(-4 pi i/N))` with
// `p = exp(-conj(r) T/N)` and N samples per period; it turns against the drive.
// Least squares over all periods (Gauss and Newton) give `s`, `a` and `q`; `a` is free because of delays and of what was left of an
// earlier motion. The covariance of the fit gives the uncertainties. The modes of a drawing are not quite those of the rig: beside them, what the
// residual has beyond the noise within the periods does not average out. The natural frequency is `omega_0 = |omega_d + i delta|`.

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

    /// The response whose phasors, m, are given period by period, each of `samples` samples; `noise` is the RMS of the readings about them, m,
    /// `base` the phasor of the base, m, and `u_base` its relative standard uncertainty. `None` without a growth from rest that is more than noise.
    /// And the standard uncertainty of the gain, relative, by white noise of the standard deviation 1 m in the readings, 1/m.
    fn of(
        phasors: &[Complex64],
        noise: f64,
        (base, u_base): (Complex64, f64),
        omega: f64,
        samples: usize,
        plan: &Plan,
    ) -> Option<(Option<Self>, f64)> {
        let step = plan.knowledge.sample_time;
        let period = samples as f64 * step;
        // The counter-rotating part turns by this in a period, whose number of samples is rounded.
        let turn = Complex64::cis(-2.0 * omega * period);
        let (mut q, [mut steady, mut initial]) = start(phasors)?;
        let [mut u_q, mut u_gain, mut per_noise] = [f64::NAN; 3];
        for _ in 0..NEWTON_STEPS {
            let (mut power, mut turned, mut rest) = (Complex64::ONE, Complex64::ONE, 0.0);
            let p = q.conj().powf(1.0 / samples as f64);
            let within = (1.0 - p) / (1.0 - p * Complex64::cis(-4.0 * PI / samples as f64));
            let rows = phasors.iter().enumerate().map(|(n, z)| {
                let row = RowVector3::new(Complex64::ONE, power, initial * power / q * n as f64);
                let residual = z - steady - initial * power + (initial * power).conj() * within * turned;
                rest += residual.norm_sqr();
                power *= q;
                turned *= turn;
                (row, residual)
            });
            let (change, inverse) = complex_fit(rows)?;
            // Two components of each phasor, and of each of three unknowns.
            let degrees = 2.0 * phasors.len() as f64 - 6.0;
            let explained = 2.0 * noise * noise / samples as f64 * (1.0 + SIGNIFICANT * (2.0 / degrees).sqrt());
            let misfit = match plan.beside.is_empty() {
                true => 0.0,
                false => (rest / degrees - explained).max(0.0),
            };
            let variance = rest / degrees + misfit * phasors.len() as f64;
            u_q = (variance * inverse[(2, 2)].re).sqrt();
            // Relative change of the gain, which is proportional to `s r`.
            let slope = RowVector3::new(1.0 / steady, Complex64::ZERO, 1.0 / (q * q.ln()));
            let spread = (slope * inverse * slope.adjoint())[0].re;
            u_gain = (variance * spread).sqrt();
            per_noise = (2.0 / samples as f64 * spread).sqrt();
            (steady, initial, q) = (steady + change[0], initial + change[1], q + change[2]);
        }
        let rate = -q.ln() / period;
        let gain = steady * rate / base;
        let is_growth = (steady + initial).norm() < FROM_REST * steady.norm();
        if !(gain.norm().is_finite() && u_gain < DETERMINED && q.norm() > 0.0 && is_growth) {
            return Some((None, per_noise));
        }
        let largest = omega * omega * phasors.iter().map(|z| z.norm()).fold(0.0, f64::max);
        let particle = match FRICTION * largest < plan.knowledge.carried_up_to {
            true => ParticleState::Carried,
            false => ParticleState::Unknown,
        };
        let response = LinearResponse {
            omega0: (omega - rate.im).hypot(rate.re),
            damping_rate: rate.re,
            uncertainty: u_q / (q.norm() * period),
            gain,
            u_gain: u_gain.hypot(u_base),
            particle,
            shaker: None,
        };
        Some((Some(Self::new(response, plan)), per_noise))
    }
}

/// Largest friction in a drawing over the rig's.
const FRICTION: f64 = 2.0;
/// Largest response at the start, as a share of the steady one, of a growth from rest.
const FROM_REST: f64 = 0.5;
/// Largest relative standard uncertainty of the gain of a response that is more than noise.
const DETERMINED: f64 = 0.1;
/// Number of steps of Newton's method; each squares the relative error.
const NEWTON_STEPS: usize = 8;

/// First values of `q`, and of `s` and `a`, by the recursion `z' = q z + (1 - q) s` from period to period. `None` without a growth.
fn start(phasors: &[Complex64]) -> Option<(Complex64, [Complex64; 2])> {
    let steps = phasors.len().checked_sub(4)? as f64 + 3.0;
    let (before, after) = (&phasors[..phasors.len() - 1], &phasors[1..]);
    let mean = |values: &[Complex64]| values.iter().sum::<Complex64>() / steps;
    let (mean_before, mean_after) = (mean(before), mean(after));
    let power: f64 = before.iter().map(|z| (z - mean_before).norm_sqr()).sum();
    let products = before.iter().zip(after);
    let q = products
        .map(|(z, next)| (z - mean_before).conj() * next)
        .sum::<Complex64>()
        / power;
    let steady = (mean_after - q * mean_before) / (1.0 - q);
    (steady.norm().is_finite() && q.norm() > 0.0).then(|| (q, [steady, phasors[0] - steady]))
}
