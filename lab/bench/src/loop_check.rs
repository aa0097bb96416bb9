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

use std::f64::consts::{FRAC_1_SQRT_2, TAU};

use nalgebra::Vector2;
use num_complex::Complex64;
use phase_lock::Gains;
use serde::Serialize;
use vines_estimate::Oscillations;
use vines_model::numerics::{SIGNIFICANT, mean, mean_square, standard_deviation};

use crate::rig::{Drive, Rig, RigError, Scaled};
use vines_scene::knowledge::Target;
use vines_scene::linear::{LinearResponse, MeasuredLinear, POINT_RESOLUTION, ParticleState};
use vines_scene::plan::Plan;
use vines_scene::scene::{Unit, Units};

/// Drive of the check, over the scene's drive: too small for impacts.
const SHARE: f64 = 0.01;
/// Factor by which the drive is raised at a time, and lowered twice where the particle may have slid: a fault that noise has hidden is seen at little more.
const RAISE: f64 = 4.0;
/// Largest relative difference of the frequency of a mode from the expected one: the range of a controller.
const RANGE: f64 = 0.1;
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
        self.share > SHARE
    }

    /// Whether the phase of the response is refused.
    fn is_late(&self) -> bool {
        matches!(self.verdict, Verdict::ResponseLate | Verdict::BaseLate)
    }

    /// Whether its phase or its gain is refused.
    fn is_refused(&self) -> bool {
        self.is_late() || self.verdict == Verdict::ResponseGain
    }

    /// Of this check and one at `more` drive the latter, which noise disturbs less, unless it is refused: a sensor is late or has a wrong factor at
    /// every drive, but a particle that slides on the floor sticks to it at less.
    fn or(self, more: Self) -> Self {
        let periods = self.periods + more.periods;
        let phase = |found: &Self| found.quantities.iter().find(|one| one.name == PHASES).copied();
        let differs = phase(&self).zip(phase(&more)).is_some_and(|(less, more)| {
            (less.measured - more.measured).abs() > SIGNIFICANT * less.uncertainty.hypot(more.uncertainty)
        });
        let is_certain = self.verdict == Verdict::Healthy && !self.is_too_weak();
        let found = match more.is_refused() {
            true if is_certain => self,
            true if more.is_late() && (differs || self.verdict == Verdict::NotProportional) => {
                Self { verdict: Verdict::NotProportional, ..more }
            }
            _ => more,
        };
        Self { periods, ..found }
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
}

/// Checks a rig at a hundredth of the drive, after a response that is still falling has come to rest. The phase of the rig's oscillator is
/// a multiple of 2 pi before and after.
///
/// A response that is refused is checked again at less drive. Where noise hides the phase, the drive is raised: to the scene's drive at most, or to a
/// response of half the half-width, which hits no particle in the inner half of the cavity.
pub fn check(rig: &mut (impl Rig + ?Sized), plan: &Plan) -> Result<LoopCheck, RigError> {
    let LinearResponse { omega0, damping_rate, .. } = plan.knowledge.linear;
    let response = match plan.knowledge.shaker {
        Some(_) => 0.5 * omega0 / damping_rate,
        None => expected(plan)[0].norm(),
    };
    let most = f64::min(1.0, 0.5 * plan.knowledge.numbers.b / (response * plan.amplitude));
    let mut found = at_share(rig, plan, SHARE, MOST_WAITS)?;
    if plan.knowledge.shaker.is_none() && found.is_refused() {
        let less = at_share(rig, plan, SHARE / RAISE.powi(2), MOST_WAITS.min(relaxed(plan)))?;
        found = less.or(found);
    }
    while found.is_too_weak() && found.share < most {
        let share = most.min(RAISE * found.share);
        found = found.or(at_share(rig, plan, share, MOST_WAITS)?);
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
    let (omega, amplitude) = (plan.lock.omega_start, share * plan.amplitude);
    let mut rig = OpenLoop::new(rig, plan);
    let samples = |periods: usize| (periods as f64 * TAU / (omega * plan.knowledge.sample_time)).round() as usize;
    let [quiet, driven] = CHECK_PERIODS.map(samples);
    let expected = expected(plan).map(|per_drive| per_drive * amplitude);
    let enough = expected.map(|phasor| NOISE * phasor.norm());
    rig.rest(omega, [quiet, samples(WAIT)], waits, enough)?;
    let begins = rig.readings.len();
    rig.drive(driven, omega, amplitude)?;
    let ends = rig.readings.len();
    rig.end(samples(1))?;
    let periods = rig.readings.len() as f64 / samples(1) as f64;
    let (quiet, driven) = (&rig.readings[begins - quiet..begins], &rig.readings[begins..ends]);
    let found = judge([quiet, driven], rig.has_base, amplitude, expected, plan);
    Ok(LoopCheck { share, periods, ..found })
}

/// Judges readings without a drive and with it; `expected`: phasors of response and base at the end.
fn judge(
    [quiet, driven]: [&[[f64; 3]]; 2],
    has_base: bool,
    amplitude: f64,
    expected: [Complex64; 2],
    plan: &Plan,
) -> LoopCheck {
    let (target, step, omega) = (plan.knowledge.target, plan.knowledge.sample_time, plan.lock.omega_start);
    let (sine, turn) = (Sine { target, omega, step }, omega * step);
    // The base may be late by half a period, and reads nothing before.
    let (onset, after) = driven.split_at(sine.period() / 2);
    let base = sine.fitted(after, 2, 0.5 * after.len() as f64, 0, &[sine.pole()]);
    let (phasor, u_base) = match has_base {
        true => (
            base.phasor(0),
            base.u(&[1.0 / base.found.amplitudes[0], Complex64::ZERO]),
        ),
        // Without a sensor, the base moves as expected.
        false => (expected[1], 0.0),
    };
    let late = (plan.lock.delay / step).ceil();
    let stated = plan.knowledge.linear;
    let poles = [sine.pole(), Complex64::new(-stated.damping_rate, stated.omega0)];
    let mode = |readings: &[[f64; 3]], channel| sine.fitted(&readings[late as usize..], channel, -late, 1, &poles);
    let response = mode(&without_other_modes(driven, plan, omega, amplitude), 1);
    let white = [1, 2].map(|channel| noise_of(quiet, channel, &target, step));
    let (linear, per_noise) = growth(&response, white[0], (phasor, u_base), plan);
    let ends = [response.end(), base.phasor(0)];
    let noises = [response.noise(), base.noise()];
    let [mut channel, of_base] = [0, 1].map(|n| {
        let (noise, floor) = (noises[n], scatter(quiet, n + 1));
        CheckedChannel { noise, floor, ..CheckedChannel::default() }.at(ends[n] / expected[n], turn)
    });
    let mut quantities = Vec::new();
    if has_base {
        quantities.extend(quantities_of_base(&base, u_base, amplitude, plan));
    }
    if let Some(linear) = &linear {
        // Amplitude and phase of the response for the natural frequency and the damping that the rig has.
        let reference = plan.knowledge.numbers.definition.reference;
        let ratio = linear.gain / linear.oscillator_gain(omega, reference);
        channel = channel.at(ratio * phasor / expected[1], turn);
        quantities.extend(of_response(linear, ratio, plan));
    }
    // Where noise hides the growth, it is at least the error of a phasor.
    let of_phasor = expected.map(|phasor| (2.0 / driven.len() as f64).sqrt() / phasor.norm());
    let mut found = LoopCheck {
        verdict: Verdict::Healthy,
        amplitude,
        share: 0.0,
        periods: 0.0,
        response: channel,
        base: has_base.then_some(of_base),
        linear: None,
        quantities,
        u_noise: (white[0] * per_noise.max(of_phasor[0])).hypot(white[1] * of_phasor[1]),
    };
    // Exchanged channels: the base grows as the response does.
    let crossed = [
        response.end() / expected[1],
        mode(driven, 2).growth() / (stated.gain * expected[1]),
    ];
    let waits = [base.is_late(onset, quiet), relaxed(plan) <= MOST_WAITS];
    found.verdict = found.verdict(&expected.map(|phasor| phasor.norm()), crossed, waits);
    let linear = linear.filter(|_| found.verdict == Verdict::Healthy);
    found.linear = linear.map(|response| Linear::new(response, plan));
    found
}

/// A drive of constant frequency, rad/s.
#[derive(Clone, Copy)]
struct Sine {
    target: Target,
    omega: f64,
    step: f64,
}

impl Sine {
    fn pole(&self) -> Complex64 {
        Complex64::new(0.0, self.omega)
    }

    /// Samples in a period.
    fn period(&self) -> usize {
        (TAU / (self.omega * self.step)).round() as usize
    }

    /// Fits oscillations to the readings of a channel, 1, the response, or 2, the base, beside a trend of this degree. Amplitudes are those at the sample
    /// `origin`; the last pole is a first value, the others are known.
    fn fitted(self, readings: &[[f64; 3]], channel: usize, origin: f64, trend: usize, poles: &[Complex64]) -> Fitted {
        let Self { target, omega, step } = self;
        let values = readings.iter().map(|reading| reading[channel]);
        let (start, known) = poles.split_last().unwrap_or((&Complex64::ZERO, &[]));
        let found = Oscillations::new(values, [-origin * step, step], trend, known, *start, RANGE);
        let displacement = target.displacement(channel - 1, omega);
        let unit = displacement * Complex64::cis(-readings[0][0] - origin * omega * step);
        let variance = found.variance(omega * step, self.period());
        Fitted { sine: self, channel, found, unit, variance }
    }
}

/// The oscillations of a channel.
struct Fitted {
    sine: Sine,
    channel: usize,
    found: Oscillations,
    /// What makes a phasor of the displacement of the amplitude of a reading, m.
    unit: Complex64,
    /// Variance of the noise about the frequency of the drive, as if it were white.
    variance: f64,
}

impl Fitted {
    /// The displacement that belongs to an amplitude, relative to the drive, m.
    fn phasor(&self, n: usize) -> Complex64 {
        self.found.amplitudes[n] * self.unit
    }

    /// Phasor of a driven mode after some periods, m.
    fn after(&self, periods: usize) -> Complex64 {
        let time = periods as f64 * TAU / self.sine.omega;
        self.phasor(0) + self.phasor(1) * ((self.found.pole - self.sine.pole()) * time).exp()
    }

    /// This at the end of the check.
    fn end(&self) -> Complex64 {
        self.after(CHECK_PERIODS[1])
    }

    /// Growth rate of a driven mode, m/s, whatever its motion was at the start.
    fn growth(&self) -> Complex64 {
        self.phasor(0) * (self.sine.pole() - self.found.pole)
    }

    /// Standard uncertainty of each component of a sum of amplitudes and the pole.
    fn u(&self, factors: &[Complex64]) -> f64 {
        self.variance.sqrt() * self.found.u(factors)
    }

    /// RMS of everything else, m.
    fn noise(&self) -> f64 {
        mean_square(self.found.rest.iter().copied()).sqrt() * self.unit.norm()
    }

    /// Whether the first readings under the drive, `onset`, are rather those of a channel that still rests, as in `quiet`, than those of this oscillation: a
    /// delay of half a period looks like the opposite sign.
    fn is_late(&self, onset: &[[f64; 3]], quiet: &[[f64; 3]]) -> bool {
        let rest = mean(quiet.iter().map(|reading| reading[self.channel]));
        let amplitude = self.phasor(0) / self.sine.target.displacement(self.channel - 1, self.sine.omega);
        let moved = |reading: &[f64; 3]| (amplitude * Complex64::cis(reading[0])).im;
        let error = |share: f64| mean_square(onset.iter().map(|one| one[self.channel] - rest - share * moved(one)));
        error(0.0) < error(1.0)
    }
}

/// The linear response with this gain on a base with this phasor, m, and relative standard uncertainty, if it is more than noise; and the standard
/// uncertainty of the gain, relative, for white noise of the standard deviation 1 m in the readings, 1/m. `white`: the noise, m.
fn growth(
    response: &Fitted,
    white: f64,
    (base, u_base): (Complex64, f64),
    plan: &Plan,
) -> (Option<LinearResponse>, f64) {
    let (found, sine, periods) = (&response.found, response.sine, CHECK_PERIODS[1] as f64);
    let rate = sine.pole() - found.pole;
    let gain = response.growth() / base;
    // The gain is proportional to amplitude and rate.
    let slope = [1.0 / found.amplitudes[0], Complex64::ZERO, -1.0 / rate];
    let [u_rate, u_gain] = [[Complex64::ZERO, Complex64::ZERO, Complex64::ONE], slope].map(|one| found.u(&one));
    // The modes of a drawing are not quite those of the rig: what the fit leaves beyond noise does not average out.
    let of_noise = white * white * sine.target.colour(sine.omega, sine.step);
    let explained = of_noise * (1.0 + SIGNIFICANT * (1.0 / (periods - 3.0)).sqrt());
    let misfit = match plan.beside.is_empty() {
        true => 0.0,
        false => (response.variance - explained).max(0.0),
    };
    let deviation = (response.variance + misfit * periods).sqrt();
    let sizes = (0..=CHECK_PERIODS[1]).map(|n| response.after(n).norm());
    let largest = sine.omega * sine.omega * sizes.fold(0.0, f64::max);
    let particle = match FRICTION * largest < plan.knowledge.carried_up_to {
        true => ParticleState::Carried,
        false => ParticleState::Unknown,
    };
    let linear = LinearResponse {
        omega0: found.pole.norm(),
        damping_rate: rate.re,
        uncertainty: deviation * u_rate,
        gain,
        u_gain: (deviation * u_gain).hypot(u_base),
        particle,
        shaker: None,
    };
    let is_determined = gain.norm().is_finite() && deviation * u_gain < DETERMINED;
    (is_determined.then(|| linear.stated()), u_gain)
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
    let turned = Complex64::new(damping_rate, omega - omega0) * (CHECK_PERIODS[1] as f64 * TAU / omega);
    let growth = plan.knowledge.linear.at(omega) * (1.0 - (-turned).exp());
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
    rig: Scaled<'a, R>,
    target: Target,
    step: f64,
    phase: f64,
    readings: Vec<[f64; 3]>,
    has_base: bool,
}

impl<'a, R: Rig + ?Sized> OpenLoop<'a, R> {
    fn new(rig: &'a mut R, plan: &Plan) -> Self {
        Self {
            rig: Scaled::new(rig, plan.knowledge.target),
            target: plan.knowledge.target,
            step: plan.knowledge.sample_time,
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
            let displacement = amplitude * phase.sin();
            let drive = Drive { omega, amplitude, displacement, is_held: false };
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

/// Name of the phase of a response.
const PHASES: &str = "phase of the response to the base, less the expected one";

/// Natural frequency, damping, and the response over the expected response (`ratio`) of an oscillator that has both.
fn of_response(linear: &LinearResponse, ratio: Complex64, plan: &Plan) -> [CheckedQuantity; 4] {
    let stated = plan.knowledge.linear;
    let u = linear.uncertainty;
    let hertz = [linear.omega0, u, stated.omega0].map(|omega| omega / TAU);
    let damping = [linear.damping_rate, u, stated.damping_rate];
    let phase = [ratio.arg().to_degrees(), linear.u_gain.to_degrees(), 0.0];
    let late = [Verdict::ResponseLate, Verdict::BaseLate][usize::from(ratio.arg() > 0.0)];
    let gain = [ratio.norm(), linear.u_gain, 1.0];
    let gains = "response over base, over the expected one";
    [
        quantity("natural frequency", "Hz", hertz, NOTED[0] * hertz[2], None),
        quantity("damping rate", "1/s", damping, NOTED[1] * damping[2], None),
        quantity(PHASES, "degrees", phase, PHASE, Some(late)),
        quantity(gains, "", gain, FACTOR, Some(Verdict::ResponseGain)),
    ]
}

/// Frequency of the base, and its amplitude over that of the drive.
fn quantities_of_base(base: &Fitted, u: f64, drive: f64, plan: &Plan) -> [CheckedQuantity; 2] {
    let omega = plan.lock.omega_start;
    let ratio = base.phasor(0).norm() / drive;
    // A controlled base needs no known shaker.
    let controlled = plan.lock.base_bandwidth.is_some();
    let tolerance = if controlled { GAIN - 1.0 } else { FACTOR };
    let u_clock = base.u(&[Complex64::ZERO, Complex64::ONE]) / omega;
    // As of a stated point.
    let u_clock = u_clock.hypot(POINT_RESOLUTION * plan.knowledge.linear.bandwidth());
    let u = u.hypot(POINT_RESOLUTION);
    let clock = [base.found.pole.im / omega, u_clock, 1.0];
    let (name, gain) = ("frequency of the base over that of the drive", [ratio, u * ratio, 1.0]);
    [
        // Beyond that, later measurements of frequencies in hertz would be wrong.
        quantity(name, "", clock, 1e-3, Some(Verdict::Clock)),
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
/// Largest friction in a drawing over the rig's.
const FRICTION: f64 = 2.0;
/// Factor by which an amplitude may differ from the expected one, or its inverse: the damping is known roughly.
const GAIN: f64 = 2.0;

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
    #[error(
        "the response is late: check its filter and delay, and whether the particle slides on its floor; a lock would hold another phase than it reports"
    )]
    ResponseLate,
    #[error(
        "the response is late, but not at every drive, as with a particle that slides on its floor: hold the particle while the loop is checked, or \
         reduce the noise"
    )]
    NotProportional,
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
        // In the nearest quarter of a turn a channel is in time, or reversed, or exchanged.
        let is_at = |phase: f64, degrees: f64| (phase - degrees).to_radians().cos() > FRAC_1_SQRT_2;
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
        first_of(&faults)
    }
}

/// The first verdict of a table that holds.
fn first_of(faults: &[(Verdict, bool)]) -> Verdict {
    let fault = faults.iter().find(|(_, is)| *is);
    fault.map_or(Verdict::Healthy, |(verdict, _)| *verdict)
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

/// Largest relative standard uncertainty of the gain of a response that is more than noise.
const DETERMINED: f64 = 0.1;
