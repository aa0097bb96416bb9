//! What the check of a loop says of its channels.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use num_complex::Complex64;
use serde::Serialize;

/// Largest RMS of what is not the drive's frequency, as a share of the amplitude.
pub(super) const NOISE: f64 = 0.15;
/// Share of the expected amplitude below which a sensor is dead.
const DEAD: f64 = 0.01;
/// Factor by which an amplitude may differ from the expected one, or its inverse: the damping is known roughly.
pub(super) const GAIN: f64 = 2.0;
/// RMS of the response without a drive over that of its noise with it, from which the rig moves.
const AT_REST: f64 = 3.0;
/// Deviation of the phase, rad, up to which a channel is in time, or reversed.
pub(super) const IN_TIME: f64 = 0.7;

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
    pub(super) fn at(self, ratio: Complex64, turn: f64) -> Self {
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
    pub(super) fn may_be(self, refusal: Self) -> bool {
        let by_phase = matches!(
            self,
            Self::ResponseReversed | Self::BaseReversed | Self::BothReversed | Self::ResponseLate | Self::BaseLate
        );
        self == Self::Healthy || by_phase && refusal == Self::Clock
    }
}

/// Judges response and base, whose expected amplitudes are `expected`, m. `waits`: the base moves later than the drive, so that its phase is that
/// of a delay.
pub(super) fn verdict(channels: &[Channel; 2], expected: &[f64; 2], has_base: bool, waits: bool) -> Verdict {
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
