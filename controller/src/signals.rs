//! What a sample brings in, and what it puts out.

use crate::supervisor::{Fault, Phase};

/// What the sensors read at a sample, and what the operator wants.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Input {
    /// Response of the structure, m.
    pub response: f64,
    /// Displacement of the base, m. None, or a channel that has never read other than exactly zero, makes the own
    /// oscillator the reference.
    pub reference: Option<f64>,
    /// Whether the drive is wanted. Going from false to true arms the controller, also after a fault.
    pub active: bool,
}

/// What the controller wants until the next sample, and what it knows.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Output {
    /// Drive frequency, rad/s; always between `omega_min` and `omega_max`.
    pub omega: f64,
    /// Drive amplitude `E`, m; always between 0 and `amplitude_max` (where that is set).
    pub amplitude: f64,
    /// The base displacement wanted at this sample, `E sin(phase)`, m, for a rig that takes samples.
    pub drive: f64,
    /// Phase of the response relative to the reference, less the target, rad, in [-pi, pi]; 0 while there is nothing to
    /// measure.
    pub phase_error: f64,
    /// Amplitude of the response's fundamental, m.
    pub response_amplitude: f64,
    /// Response amplitude that is held now, m; 0 where the drive amplitude is what is held.
    pub response_target: f64,
    /// Amplitude of the reference's fundamental, m: measured, or the own drive's.
    pub reference_amplitude: f64,
    /// Power of the response's fundamental relative to itself and what the detector leaves unexplained, 0 to 1.
    pub coherence: f64,
    /// Mean frequency, rad/s, over the complete blocks of the running dwell; `omega` where there is none yet.
    pub frequency: f64,
    /// Mean of `response_amplitude`, m, over the same blocks; `response_amplitude` where there is none yet.
    pub response_mean: f64,
    /// Phase resonance is held: the lock criterion has been met, and the phase has not escaped since.
    pub locked: bool,
    /// The lock criterion is met now: phase, frequency and amplitude have been stationary for the whole dwell. Turns
    /// false at once where the controller is retuned, and true again once the new point has settled.
    pub settled: bool,
    /// State of the sequence.
    pub state: Phase,
    /// Why the drive was taken away; kept until the controller is armed again.
    pub fault: Option<Fault>,
}
