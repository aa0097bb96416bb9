//! Input and output of a sample, and the tables of their names and units: with [`PARAMETERS`](crate::PARAMETERS), what every interface offers.

use crate::config::Value;
use crate::real::Real;
use crate::supervisor::{Fault, LoopState};

/// Sensor readings of a sample, and the operator's request.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Input {
    /// Response of the structure, m.
    pub response: Real,
    /// Displacement of the base, m. If it is `None`, the internal oscillator is the reference.
    pub reference: Option<Real>,
    /// Whether the drive is requested. A change from false to true arms the controller, also after a fault.
    pub active: bool,
}

/// Drive until the next sample, and the controller's estimates.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Output {
    /// Drive frequency, rad/s; always between `omega_min` and `omega_max`.
    pub omega: Real,
    /// Drive amplitude `E`, m; always between 0 and `amplitude_max` (where that is set).
    pub amplitude: Real,
    /// Setpoint of the base displacement at this sample, `E sin(phase)`, m, for a rig that takes samples.
    pub drive: Real,
    /// Phase of the response relative to the reference, minus the target, rad, in [-pi, pi]. `None` while one of the two
    /// amplitudes is 0, or their product is below the smallest normal number.
    pub phase_error: Option<Real>,
    /// Amplitude of the response's fundamental, m.
    pub response_amplitude: Real,
    /// Present setpoint of the response amplitude, m. `None` while the drive amplitude is controlled instead.
    pub response_target: Option<Real>,
    /// Amplitude of the reference's fundamental, m: measured, or that of the drive.
    pub reference_amplitude: Real,
    /// Power of the response's fundamental over the sum of itself and the detector's residual power, 0 to 1.
    pub coherence: Real,
    /// Mean frequency, rad/s, over the complete blocks of the running dwell; `omega` before the first one.
    pub frequency: Real,
    /// Mean of `response_amplitude`, m, over the same blocks; `response_amplitude` before the first one.
    pub response_mean: Real,
    /// Whether the loop is locked: the lock criterion has been met, and the lock has not been lost since.
    pub locked: bool,
    /// Whether the lock criterion is met now: phase, frequency and amplitude have been stationary for the whole dwell.
    /// A retuned controller is not settled until the new operating point is stationary.
    pub settled: bool,
    /// State of the loop.
    pub state: LoopState,
    /// Reason why the drive was switched off; kept until the controller is armed again.
    pub fault: Option<Fault>,
}

impl Output {
    /// The output before the first sample: no drive, no measurements.
    #[must_use]
    pub fn idle(omega: Real) -> Self {
        Self { omega, frequency: omega, ..Self::default() }
    }
}

/// An output of the controller.
#[derive(Clone, Copy, Debug)]
pub struct Signal {
    /// Name, as in the FMU.
    pub name: &'static str,
    /// Unit; empty for a pure number.
    pub unit: &'static str,
    /// Name of the Boolean that says whether there is a value, where the interface knows only numbers.
    pub present: Option<&'static str>,
    get: fn(&Output) -> Option<Value>,
}

impl Signal {
    /// The value, if there is one.
    #[must_use]
    pub fn get(&self, output: &Output) -> Option<Value> {
        (self.get)(output)
    }
}

/// The inputs of a sample, with their units.
pub const INPUTS: [(&str, &str); 3] = [("response", "m"), ("reference", "m"), ("active", "")];

macro_rules! outputs {
    ($($name:literal, $unit:literal, $present:expr, $get:expr;)*) => {
        /// All outputs.
        pub static OUTPUTS: [Signal; [$($name),*].len()] =
            [$(Signal { name: $name, unit: $unit, present: $present, get: $get },)*];
    };
}

outputs! {
    "omega", "rad/s", None, |o| Some(Value::Real(o.omega));
    "E", "m", None, |o| Some(Value::Real(o.amplitude));
    "drive", "m", None, |o| Some(Value::Real(o.drive));
    "phase_error", "rad", Some("phase_measured"), |o| o.phase_error.map(Value::Real);
    "response_amplitude", "m", None, |o| Some(Value::Real(o.response_amplitude));
    "reference_amplitude", "m", None, |o| Some(Value::Real(o.reference_amplitude));
    "coherence", "", None, |o| Some(Value::Real(o.coherence));
    "frequency", "rad/s", None, |o| Some(Value::Real(o.frequency));
    "response_mean", "m", None, |o| Some(Value::Real(o.response_mean));
    "response_target", "m", Some("response_controlled"), |o| o.response_target.map(Value::Real);
    "locked", "", None, |o| Some(Value::Boolean(o.locked));
    "settled", "", None, |o| Some(Value::Boolean(o.settled));
    "state", "", None, |o| Some(Value::Integer(o.state as i32));
    "fault", "", None, |o| Some(Value::Integer(o.fault.map_or(0, |fault| fault as i32)));
}
