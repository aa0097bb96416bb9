//! The table of the outputs, and the names of the inputs: with [`PARAMETERS`](crate::PARAMETERS), what every interface offers.

use crate::range::Value;
use crate::signals::Output;

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
    /// The output of that name.
    #[must_use]
    pub fn find(name: &str) -> Option<&'static Self> {
        OUTPUTS.iter().find(|signal| signal.name == name)
    }

    /// The value, if there is one.
    #[must_use]
    pub fn get(&self, output: &Output) -> Option<Value> {
        (self.get)(output)
    }
}

/// The inputs of a sample, with their units.
pub const INPUTS: [(&str, &str); 3] = [("response", "m"), ("reference", "m"), ("active", "")];

/// The fields of a [`Move`](crate::Move), with their units.
pub const MOVE: [(&str, &str); 5] = [
    ("response", "m"),
    ("duration", "s"),
    ("amplitude", "m"),
    ("omega", "rad/s"),
    ("growth", "m/s"),
];

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
