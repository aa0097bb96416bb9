//! Check of the loop before the drive rises: an open loop at a hundredth of the drive shows what is connected to what.
//!
//! A linear resonator at rest that is driven at its natural frequency with the amplitude E responds with `-i g E (1 - exp(-d t))/d`
//! (`g`: half the frequency, `d`: damping rate). Response and base are compared with this and with E, by amplitude and phase.

mod linear;
mod lock_times;
mod trials;

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::fmt;

use num_complex::Complex64;
use serde::Serialize;

use crate::rig::{Drive, Rig, RigError};
use crate::scene::Scene;

pub use linear::Linear;
pub use lock_times::{LockTime, LockTimeError, lock_times};
pub use trials::{Trials, trials};

/// Drive, as a share of that of the scene.
const SHARE: f64 = 0.01;
/// Periods without a drive, with it, and at their end those that are evaluated.
const PERIODS: [usize; 3] = [2, 24, 4];
/// Share of the expected amplitude below which a sensor is dead.
const DEAD: f64 = 0.02;
/// Factor by which an amplitude may differ from the expected one, or its inverse: the damping is known roughly.
const GAIN: f64 = 2.0;
/// Largest RMS of what is not the drive's frequency, as a share of the amplitude.
const NOISE: f64 = 0.15;
/// Periods between looks at a response that falls, how often, and the share of it that is left at most.
const DECAY: usize = 10;
/// As above.
const PAUSES: usize = 40;
/// As above.
const FALLS: f64 = 0.98;
/// RMS of the response without a drive over that of its noise with it, from which the rig moves.
const AT_REST: f64 = 3.0;
/// Deviation of the phase, rad, up to which a channel is in time, and from which it is reversed.
const IN_TIME: f64 = 0.7;

/// What the check found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// Signs, gains, delays and noise are as expected.
    Healthy,
    /// A sensor reads no number.
    NotANumber,
    /// The response moves before there is a drive.
    NotAtRest,
    /// Neither channel answers the drive: the shaker is off.
    ShakerOff,
    /// A channel does not answer the drive.
    ResponseDead,
    /// As above.
    BaseDead,
    /// Response and base are exchanged.
    Swapped,
    /// A channel has the opposite sign.
    ResponseReversed,
    /// As above.
    BaseReversed,
    /// Both have: the shaker is reversed.
    BothReversed,
    /// A channel has another amplitude: a wrong unit or factor.
    ResponseGain,
    /// As above.
    BaseGain,
    /// A channel is late.
    ResponseLate,
    /// As above.
    BaseLate,
    /// A channel is noisy.
    ResponseNoisy,
    /// As above.
    BaseNoisy,
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Healthy => "signs, gains, delays and noise are as expected",
            Self::NotANumber => "a sensor reads no number: check its converter",
            Self::NotAtRest => "the response moves without a drive: wait until the rig is at rest",
            Self::ShakerOff => "no sensor answers the drive: check the amplifier of the shaker and the cables",
            Self::ResponseDead => "the response does not answer the drive: check its sensor and cable",
            Self::BaseDead => "the base sensor does not answer the drive: check it and its cable",
            Self::Swapped => "response and base are exchanged: swap the two channels",
            Self::ResponseReversed => "the response has the opposite sign: reverse its sensor, or its factor",
            Self::BaseReversed => "the base sensor has the opposite sign: reverse it, or its factor",
            Self::BothReversed => "both sensors have the opposite sign: the shaker is reversed",
            Self::ResponseGain => "the response has another amplitude: check its unit and factor, and mass, spring and damper of the scene",
            Self::BaseGain => "the base has another amplitude than the drive: check its unit and factor, and the gain of the shaker",
            Self::ResponseLate => "the response is late: check its filter and delay, and the natural frequency of the scene",
            Self::BaseLate => "the base sensor is late: check its filter and delay, and that of the shaker",
            Self::ResponseNoisy => "the response is noisy: check its shield and range",
            Self::BaseNoisy => "the base sensor is noisy: check its shield and range",
        })
    }
}

/// A channel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
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

/// Result of the check.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
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
}

/// Checks a rig at a hundredth of the drive, after a response that is still falling has come to rest. The phase of the rig's oscillator is a multiple of 2 pi before and after.
///
/// # Errors
/// A failure of the rig.
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
    let time = (driven - window / 2) as f64 * step;
    let damping = 0.5 * d.epsilon * d.lambda * d.omega0;
    let rate = Complex64::new(damping, omega - d.omega0);
    let growth = Complex64::new(0.0, -0.5 * d.omega0) * (1.0 - (-rate * time).exp()) / rate;
    // A delay that the chain states is expected.
    let stated = Complex64::from_polar(1.0, -scene.controller_config().delay * omega);
    let expected = [growth * amplitude * stated, stated * amplitude];
    rig.rest(quiet, samples(DECAY), NOISE * expected[0].norm())?;
    let begins = rig.readings.len();
    rig.drive(driven, amplitude)?;
    rig.end(samples(1))?;
    let OpenLoop { readings, has_base, .. } = rig;
    let channels = [0, 1].map(|n| {
        let seen = Seen::of(&readings[begins + driven - window..], n + 1);
        let ratio = seen.phasor / expected[n];
        let floor = rms(readings[begins - quiet..begins].iter().map(|reading| reading[n + 1]));
        Channel {
            gain: ratio.norm(),
            phase: ratio.arg().to_degrees(),
            delay: -ratio.arg() / (omega * step),
            noise: seen.noise,
            floor,
        }
    });
    let amplitudes = expected.map(|one| one.norm());
    let verdict = verdict(&channels, &amplitudes, has_base);
    let base = if has_base {
        channels[1].gain * amplitudes[1]
    } else {
        amplitude
    };
    let period = samples(1);
    let phasors: Vec<_> = readings[begins..]
        .chunks_exact(period)
        .map(|readings| Seen::of(readings, 1).phasor)
        .collect();
    let linear = Linear::of(&phasors, base, omega, period as f64 * step, scene);
    Ok(LoopCheck {
        verdict,
        linear: linear.filter(|_| verdict == Verdict::Healthy),
        amplitude,
        response: channels[0],
        base: has_base.then_some(channels[1]),
    })
}

/// A rig whose loop is open, and what it has read: the phase of its oscillator, rad, response and base.
struct OpenLoop<'a, R: ?Sized> {
    rig: &'a mut R,
    omega: f64,
    step: f64,
    phase: f64,
    readings: Vec<[f64; 3]>,
    has_base: bool,
}

impl<R: Rig + ?Sized> OpenLoop<'_, R> {
    fn drive(&mut self, samples: usize, amplitude: f64) -> Result<(), RigError> {
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
    fn rest(&mut self, quiet: usize, pause: usize, enough: f64) -> Result<(), RigError> {
        let mut before = f64::INFINITY;
        for n in 0..=PAUSES {
            self.drive(if n == 0 { quiet } else { pause }, 0.0)?;
            let last = &self.readings[self.readings.len() - quiet..];
            let response = rms(last.iter().map(|reading| reading[1]));
            // Noise does not fall.
            if !(response > enough && response < FALLS * before) {
                break;
            }
            before = response;
        }
        Ok(())
    }

    /// Brings the phase of the rig's oscillator to a multiple of 2 pi, with no drive.
    fn end(&mut self, samples: usize) -> Result<(), RigError> {
        let omega = (TAU - self.phase % TAU) / (samples as f64 * self.step);
        for _ in 0..samples {
            self.rig.sense()?;
            self.rig.advance(Drive { omega, ..Drive::default() }, self.step)?;
        }
        Ok(())
    }
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value * value, count + 1.0));
    f64::sqrt(sum / f64::max(count, 1.0))
}

/// A signal at the frequency of the drive, m, and the rest of it, RMS.
struct Seen {
    phasor: Complex64,
    noise: f64,
}

impl Seen {
    fn of(readings: &[[f64; 3]], channel: usize) -> Self {
        let n = readings.len() as f64;
        let mean = readings.iter().map(|reading| reading[channel]).sum::<f64>() / n;
        let phasor: Complex64 = readings
            .iter()
            .map(|reading| (reading[channel] - mean) * Complex64::new(reading[0].sin(), reading[0].cos()) * 2.0 / n)
            .sum();
        let rest = |reading: &[f64; 3]| reading[channel] - mean - (phasor * Complex64::cis(reading[0])).im;
        Self { phasor, noise: rms(readings.iter().map(rest)) }
    }
}

fn verdict(channels: &[Channel; 2], expected: &[f64; 2], has_base: bool) -> Verdict {
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
        () if has_base && reversed(response) && reversed(base) => Verdict::BothReversed,
        () if reversed(response) => Verdict::ResponseReversed,
        () if has_base && reversed(base) => Verdict::BaseReversed,
        // What delays both, such as a connection, cancels in the phase that the controller holds.
        () if has_base && in_time(is_off(response.phase - base.phase, 0.0)) => Verdict::Healthy,
        () if has_base && !in_time(base.phase.to_radians()) => Verdict::BaseLate,
        () if !in_time(response.phase.to_radians()) => Verdict::ResponseLate,
        () => Verdict::Healthy,
    }
}
