//! A phase-locked loop (PLL) that drives a shaker to phase resonance and keeps it there.
//!
//! | | |
//! |---|---|
//! | type | 2: one integrator in the loop filter, one in the oscillator that turns frequency into phase |
//! | order | 3: low-pass filter of the detector, loop filter, and the phase of the lightly damped structure |
//! | gains | from one tuning parameter, the detector's `bandwidth` (useful range 0.02 to 0.5 times the resonance frequency); see [`Gains`] |
//! | sign | both gains are positive. The response of an oscillator lags more at a higher frequency. Too large a lag is a negative phase error, and decreases the frequency |
//! | amplitude | the response amplitude may be controlled instead of the drive amplitude ([`PhaseLock::hold_response`]): a loop of type 1 and order 3 with positive gains from the same parameter |
//! | sampling | one call of [`PhaseLock::process`] every `sample_time`; the controller has no other clock |
//!
//! The phase error is `arg response - arg reference - phase_target`, in [-pi, pi], where both phases are those of the
//! fundamental. With a displacement response and a base displacement as the reference, phase resonance is
//! `phase_target = -pi/2`.
//!
//! **Timing.** [`PhaseLock::process`] takes the sensor readings at the instant `t` and returns the frequency and the
//! amplitude from `t` to `t + sample_time`. The internal oscillator starts with phase 0 at the first sample and never
//! stops. A rig with an oscillator of its own that receives `omega` therefore stays in phase with it. `drive` is
//! `E sin(phase)` at `t`.
//!
//! **Reference.** Where no sensor measures the base ([`Input::reference`] is `None`, or `reference_connected` is false), the
//! internal oscillator with the configured `delay` is the reference. Both channels have identical detectors, so that their phase
//! shifts cancel.
//!
//! **Safety.** For any sensor readings, including NaN, every output is finite and within the configured limits. An
//! invalid reading ramps the drive down and latches; see [`LoopState`].
//!
//! ```
//! use phase_lock::{Config, Input};
//!
//! # fn sensors() -> (f64, f64) { (0.0, 0.0) }
//! # fn actuate(_omega: f64, _amplitude: f64) {}
//! # fn main() -> Result<(), phase_lock::ConfigError> {
//! let controller = Config::for_resonance(55.39, 92.5e-6).build()?;
//! let mut state = controller.start();
//! for _ in 0..100 {
//!     let (response, reference) = sensors();
//!     let output = controller.process(&mut state, Input { response, reference: Some(reference), active: true });
//!     actuate(output.omega, output.amplitude);
//!     if output.locked {
//!         break;
//!     }
//! }
//! # Ok(())
//! # }
//! ```
#![no_std]
#![forbid(unsafe_code)]

mod amplitude_loop;
mod balance;
mod config;
mod controller;
mod detector;
mod drive;
mod gains;
mod loop_filter;
mod oscillator;
mod real;
mod sensing;
mod signals;
mod stationarity;
mod supervisor;

/// `modelDescription.xml` of the controller's FMU (FMI 2.0): its variables, written once.
pub const MODEL_DESCRIPTION: &str = include_str!("../modelDescription.xml");

pub use amplitude_loop::{MOVE, Move};
pub use config::{
    Config, ConfigError, Detector, LockCriterion, MAX_HARMONICS, NONE, Number, PARAMETERS, Parameter, Range, Value,
};
pub use controller::{PhaseLock, State};
pub use gains::Gains;
pub use real::Real;
pub use signals::{INPUTS, Input, OUTPUTS, Output, Signal};
pub use supervisor::{Fault, LoopState};
