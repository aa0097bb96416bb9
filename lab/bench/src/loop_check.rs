//! Check of the loop before the drive rises: an open loop at a hundredth of the drive shows what is connected to what.
//!
//! A linear resonator at rest that is driven at its natural frequency with the amplitude E responds with `-i g E (1 - exp(-d t))/d`
//! (`g`: half the frequency, `d`: damping rate). Response and base are compared with this and with E, by amplitude and phase.

mod linear;

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use num_complex::Complex64;
use serde::Serialize;
use vines_model::numerics::{SIGNIFICANT, mean, mean_square, standard_deviation};

use crate::rig::{Drive, Rig, RigError};
use crate::scene::{LinearResponse, Scene};

pub use linear::Linear;

/// Drive, as a share of that of the scene.
const SHARE: f64 = 0.01;
/// Periods without a drive, with it, and at their end those that are evaluated.
const PERIODS: [usize; 3] = [2, 24, 4];

/// Result of the check.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LoopCheck {
    /// The verdict.
    pub verdict: Verdict,
    /// Amplitude of the drive, m.
    pub amplitude: f64,
    /// The response.
    pub response: Channel,
    /// The base, if a sensor measures it.
    pub base: Option<Channel>,
    /// The linear response and the gains for it, if the loop is healthy.
    pub linear: Option<Linear>,
    /// What was measured, beside what the scene says.
    pub quantities: Vec<Quantity>,
}

/// Checks a rig at a hundredth of the drive, after a response that is still falling has come to rest. The phase of the rig's oscillator is
/// a multiple of 2 pi before and after.
pub fn check(rig: &mut (impl Rig + ?Sized), scene: &Scene) -> Result<LoopCheck, RigError> {
    let (d, step) = (scene.dimensionless(), scene.sample_time());
    let omega = scene.controller.omega_start * d.omega0;
    let amplitude = SHARE * scene.amplitude;
    let samples = |periods: usize| (periods as f64 * TAU / (omega * step)).round() as usize;
    let [quiet, driven, window] = PERIODS.map(samples);
    let mut rig = OpenLoop {
        rig,
        omega,
        step,
        phase: 0.0,
        readings: Vec::new(),
        has_base: false,
    };
    let expected = expected(scene);
    rig.rest(quiet, samples(DECAY), NOISE * expected[0].norm())?;
    let begins = rig.readings.len();
    rig.drive(driven, amplitude)?;
    rig.end(samples(1))?;
    let OpenLoop { mut readings, has_base, .. } = rig;
    without_drift(&mut readings[begins..]);
    let mut channels = [0, 1].map(|n| {
        let signal = SineFit::of(&readings[begins + driven - window..], n + 1);
        let ratio = signal.phasor / expected[n];
        let floor = scatter(&readings[begins - quiet..begins], n + 1);
        let channel = Channel { noise: signal.noise, floor, ..Channel::default() };
        channel.at(ratio, omega * step)
    });
    let amplitudes = expected.map(|one| one.norm());
    // A delay that looks like the opposite sign is at least this long. Until then, the base rests; one of the opposite sign moves.
    let first = (samples(1) as f64 * (PI - IN_TIME) / TAU) as usize;
    let begin = &readings[begins..begins + first];
    let rest = mean(readings[begins - quiet..begins].iter().map(|reading| reading[2]));
    let moved = mean_square(begin.iter().map(|reading| reading[2] - rest));
    let expected_move = mean_square(
        begin
            .iter()
            .map(|reading| channels[1].gain * amplitude * reading[0].sin()),
    );
    let waits = moved < 0.5 * expected_move;
    // Without a sensor, the base moves as expected.
    let base = if has_base {
        let signal = SineFit::of(&readings[begins + driven - window..], 2);
        (
            signal.phasor,
            signal.noise / signal.phasor.norm() * (2.0 / window as f64).sqrt(),
        )
    } else {
        (expected[1], 0.0)
    };
    let period = samples(1);
    let phasors = |of: usize| -> Vec<Complex64> {
        let periods = readings[begins..].chunks_exact(period);
        periods.map(|readings| SineFit::of(readings, of).phasor).collect()
    };
    let linear = Linear::of(&phasors(1), base, omega, period, scene);
    let mut quantities = Vec::new();
    if has_base {
        quantities.extend(of_base(base, amplitude, &phasors(2), scene));
    }
    if let Some(linear) = &linear {
        // Amplitude and phase of the response for the natural frequency and the damping that the rig has.
        let gain = Complex64::from_polar(linear.response_gain, linear.phase.to_radians());
        let ratio = gain / linear.expected_gain(omega, scene.resonance.reference);
        channels[0] = channels[0].at(ratio * base.0 / expected[1], omega * step);
        quantities.extend(measured(linear, ratio, scene));
    }
    let verdict = verdict(&channels, &amplitudes, has_base, waits);
    let refused = quantities.iter().find_map(Quantity::refusal);
    let verdict = refused.filter(|refusal| verdict.may_be(*refusal)).unwrap_or(verdict);
    Ok(LoopCheck {
        verdict,
        linear: linear.filter(|_| verdict == Verdict::Healthy),
        amplitude,
        response: channels[0],
        base: has_base.then_some(channels[1]),
        quantities,
    })
}

/// Removes the drift of the response: a particle that flies slowly moves the centre of mass, which looks like a response in every period.
fn without_drift(readings: &mut [[f64; 3]]) {
    let half = readings.len() / 2;
    let [first, second] =
        [&readings[..half], &readings[half..2 * half]].map(|part| mean(part.iter().map(|one| one[1])));
    let slope = (second - first) / half as f64;
    for (n, reading) in readings.iter_mut().enumerate() {
        reading[1] -= slope * n as f64;
    }
}

/// Phasors of response and base, m, at the end of a check of the scene's linear resonator.
fn expected(scene: &Scene) -> [Complex64; 2] {
    let d = scene.dimensionless();
    let omega = scene.controller.omega_start * d.omega0;
    let amplitude = SHARE * scene.amplitude;
    let time = (PERIODS[1] as f64 - 0.5 * PERIODS[2] as f64) * TAU / omega;
    let rate = Complex64::new(scene.linear().damping_rate, omega - d.omega0);
    let growth = Complex64::new(0.0, -0.5 * d.omega0) * (1.0 - (-rate * time).exp()) / rate;
    // A delay that the chain states is expected.
    let stated = Complex64::from_polar(1.0, -scene.controller_config().delay * omega);
    [growth * amplitude * stated, stated * amplitude]
}

/// A signal at the frequency of the drive, m, and the rest of it, RMS.
struct SineFit {
    phasor: Complex64,
    noise: f64,
}

impl SineFit {
    fn of(readings: &[[f64; 3]], channel: usize) -> Self {
        let n = readings.len() as f64;
        let mean = mean(readings.iter().map(|reading| reading[channel]));
        let phasor: Complex64 = readings
            .iter()
            .map(|reading| (reading[channel] - mean) * Complex64::new(reading[0].sin(), reading[0].cos()) * 2.0 / n)
            .sum();
        let rest = |reading: &[f64; 3]| reading[channel] - mean - (phasor * Complex64::cis(reading[0])).im;
        Self { phasor, noise: mean_square(readings.iter().map(rest)).sqrt() }
    }
}

// A rig that is driven with its loop open.

/// Periods between looks at a response that falls.
const DECAY: usize = 10;
/// Most looks.
const PAUSES: usize = 40;
/// Share of the response that is left at most from look to look.
const FALLS: f64 = 0.98;
/// Looks in succession at which the response has not fallen: a particle that still hits the walls now and then makes it rise for a while.
const PATIENCE: usize = 4;

/// A rig whose loop is open, and what it has read: the phase of its oscillator, rad, response and base.
struct OpenLoop<'a, R: ?Sized> {
    pub rig: &'a mut R,
    pub omega: f64,
    pub step: f64,
    pub phase: f64,
    pub readings: Vec<[f64; 3]>,
    pub has_base: bool,
}

impl<R: Rig + ?Sized> OpenLoop<'_, R> {
    /// Drives with an amplitude, m, and keeps the readings.
    pub fn drive(&mut self, samples: usize, amplitude: f64) -> Result<(), RigError> {
        for _ in 0..samples {
            let (omega, phase) = (self.omega, self.phase);
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

    /// Listens for `quiet` samples, and as long as a response above `enough` (RMS, m) falls from one `pause` to the next.
    pub fn rest(&mut self, quiet: usize, pause: usize, enough: f64) -> Result<(), RigError> {
        let (mut least, mut since) = (f64::INFINITY, 0);
        for n in 0..=PAUSES {
            self.drive(if n == 0 { quiet } else { pause }, 0.0)?;
            let last = &self.readings[self.readings.len() - quiet..];
            let response = scatter(last, 1);
            // Noise does not fall.
            since = if response < FALLS * least { 0 } else { since + 1 };
            least = least.min(response);
            if response <= enough || since >= PATIENCE {
                break;
            }
        }
        Ok(())
    }

    /// Brings the phase of the rig's oscillator to a multiple of 2 pi, with no drive.
    pub fn end(&mut self, samples: usize) -> Result<(), RigError> {
        let omega = (TAU - self.phase % TAU) / (samples as f64 * self.step);
        for _ in 0..samples {
            self.rig.sense()?;
            self.rig.advance(Drive { omega, ..Drive::default() }, self.step)?;
        }
        Ok(())
    }
}

/// RMS of a reading about its mean: a sensor has an offset, and so has the centre of mass of a rig whose particle does not lie in the middle.
fn scatter(readings: &[[f64; 3]], of: usize) -> f64 {
    standard_deviation(&readings.iter().map(|reading| reading[of]).collect::<Vec<f64>>())
}

// What the check of a loop measures, beside what the scene says.

/// Largest relative error of a factor: amplitudes and drives that are measured later have the same.
const FACTOR: f64 = 0.05;
/// Largest phase of the response relative to the base that is not explained, degrees. On the default scene 1 degree shifts sigma by 0.026.
const PHASE: f64 = 1.0;
/// Largest relative difference of the clocks: frequencies in hertz that are measured later have the same.
const CLOCK: f64 = 1e-3;
/// Relative differences of natural frequency and damping below which nothing is said, whatever the uncertainty.
const NOTED: [f64; 2] = [1e-4, 0.02];

/// A measured quantity.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Quantity {
    /// What it is.
    pub name: &'static str,
    /// Its unit; empty for a pure number.
    pub unit: &'static str,
    /// As measured.
    pub measured: f64,
    /// Standard uncertainty.
    pub uncertainty: f64,
    /// As the scene says.
    pub expected: f64,
    /// Largest difference beyond the uncertainty.
    pub tolerance: f64,
    /// What a larger difference means; absent where the measured value replaces the scene's.
    pub verdict: Option<Verdict>,
}

impl Quantity {
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

/// Natural frequency, damping, and the response relative to that of such an oscillator (`ratio`).
fn measured(linear: &Linear, ratio: Complex64, scene: &Scene) -> Vec<Quantity> {
    let stated = LinearResponse::of(scene);
    let u = linear.u_damping_rate;
    let replaced = |name, unit, [measured, uncertainty, expected]: [f64; 3], noted: f64| Quantity {
        name,
        unit,
        measured,
        uncertainty,
        expected,
        tolerance: noted * expected,
        verdict: None,
    };
    let hertz = [linear.omega_0, u, stated.omega0].map(|omega| omega / TAU);
    let late = if ratio.arg() > 0.0 {
        Verdict::BaseLate
    } else {
        Verdict::ResponseLate
    };
    vec![
        replaced("natural frequency", "Hz", hertz, NOTED[0]),
        replaced(
            "damping rate",
            "1/s",
            [linear.damping_rate, u, stated.damping_rate],
            NOTED[1],
        ),
        Quantity {
            name: "phase of the response to the base, less the expected one",
            unit: "degrees",
            measured: ratio.arg().to_degrees(),
            uncertainty: linear.u_gain.to_degrees(),
            expected: 0.0,
            tolerance: PHASE,
            verdict: Some(late),
        },
        factor(
            "response over base, over the expected one",
            ratio.norm(),
            linear.u_gain,
            Verdict::ResponseGain,
            FACTOR,
        ),
    ]
}

/// Amplitude of the base, whose phasor, m, and its relative uncertainty are given, over that of the drive, and its frequency from its
/// phasors, period by period.
fn of_base((phasor, u): (Complex64, f64), drive: f64, periods: &[Complex64], scene: &Scene) -> [Quantity; 2] {
    // A delay may shift the beginning by some periods.
    let last = &periods[periods.len() / 2..];
    let turned: Complex64 = last.windows(2).map(|pair| pair[0].conj() * pair[1]).sum();
    let ratio = phasor.norm() / drive;
    // A controlled base needs no known shaker.
    let controlled = scene.controller_config().base_bandwidth.is_some();
    let tolerance = if controlled { GAIN - 1.0 } else { FACTOR };
    // The phases of a window's ends.
    let u_clock = u * (periods.len() as f64).sqrt() / (TAU * (last.len() as f64 - 1.0));
    [
        factor(
            "frequency of the base over that of the drive",
            1.0 + turned.arg() / TAU,
            u_clock,
            Verdict::Clock,
            CLOCK,
        ),
        factor("base over drive", ratio, u * ratio, Verdict::BaseGain, tolerance),
    ]
}

fn factor(name: &'static str, measured: f64, uncertainty: f64, verdict: Verdict, tolerance: f64) -> Quantity {
    Quantity {
        name,
        unit: "",
        measured,
        uncertainty,
        expected: 1.0,
        tolerance,
        verdict: Some(verdict),
    }
}

// What the check of a loop says of its channels.

/// Largest RMS of what is not the drive's frequency, as a share of the amplitude.
const NOISE: f64 = 0.15;
/// Share of the expected amplitude below which a sensor is dead.
const DEAD: f64 = 0.01;
/// Factor by which an amplitude may differ from the expected one, or its inverse: the damping is known roughly.
const GAIN: f64 = 2.0;
/// RMS of the response without a drive over that of its noise with it, from which the rig moves.
const AT_REST: f64 = 3.0;
/// Deviation of the phase, rad, up to which a channel is in time, or reversed.
const IN_TIME: f64 = 0.7;

/// A channel.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Channel {
    /// Amplitude at the frequency of the drive over the expected one.
    pub gain: f64,
    /// Phase less the expected one, degrees; a delay is negative.
    pub phase: f64,
    /// The same as a delay, samples.
    pub delay: f64,
    /// RMS of everything else, m.
    pub noise: f64,
    /// RMS without a drive, m.
    pub floor: f64,
}

impl Channel {
    /// The same with another ratio to what is expected; `turn`: phase of a sample, rad.
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
        "the base moves at another frequency than the drive: check the clocks and the sample times of rig and controller"
    )]
    Clock,
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
fn verdict(channels: &[Channel; 2], expected: &[f64; 2], has_base: bool, waits: bool) -> Verdict {
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
    let reversed = |channel: &Channel| in_time(is_off(channel.phase, PI));
    let noisy = |channel: &Channel, expected: f64| channel.noise > NOISE * channel.gain * expected;
    let dead = channels.map(|channel| channel.gain < DEAD);
    // The response's converter may be too coarse for the motion of the base.
    let as_base = dead[0] || near(crossed[0]) && in_time(crossed_phases[0]);
    match () {
        () if response.floor > (AT_REST * response.noise).max(NOISE * expected[0]) => Verdict::NotAtRest,
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
