//! A phase-locked loop (PLL) that drives a shaker to phase resonance and holds it there.
//!
//! | | |
//! |---|---|
//! | type | 2: one integrator in the loop filter, one in the oscillator that turns frequency into phase |
//! | order | 3: detector low pass, loop filter, and the phase of the lightly damped structure |
//! | gains | from one knob, the detector's `bandwidth` (usefully 0.02 to 0.5 times the resonance frequency); see [`Gains`] |
//! | sign | both gains are positive. The response of an oscillator lags more the higher the frequency, so too great a lag is a negative phase error, and lowers the frequency |
//! | response | may be held instead of the drive ([`PhaseLock::hold_response`]): a loop of type 1 and order 3 on the response's amplitude, its gains positive and from the same knob |
//! | sampling | one call of [`PhaseLock::process`] every `sample_time`; nothing else keeps time |
//!
//! The phase error is `wrap(arg response - arg reference - phase_target)`, both phases being those of the
//! fundamental. With a displacement response and a base displacement as the reference, `phase_target = -pi/2` is phase
//! resonance.
//!
//! **Timing.** [`PhaseLock::process`] takes what the sensors read at the instant `t` and yields the frequency and the
//! amplitude that hold from `t` to `t + sample_time`. The own oscillator starts with phase 0 at the first sample and never
//! stops, so a rig whose built-in oscillator is handed `omega` stays in step with it. `drive` is `E sin(phase)` at `t`.
//!
//! **Reference.** A reference channel which is absent, or has never read other than exactly zero, counts as not
//! connected: then the own oscillator, late by the stated `delay`, is the reference. From the first other reading on
//! the channel is believed. Both channels pass identical detectors, so that what these do to the phase cancels.
//!
//! **Safety.** Whatever the sensors read, NaN included, every output is finite and within the configured limits, and a
//! reading that cannot be trusted ramps the drive down and latches; see [`Phase`].
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

mod angle;
mod config;
mod controller;
mod detector;
mod drive;
mod error;
mod gains;
mod harmonics;
mod loop_filter;
mod oscillator;
mod response_loop;
mod sample_clock;
mod signals;
mod stationarity;
mod supervisor;

pub use config::{Config, Detector, LockCriterion};
pub use controller::{PhaseLock, State};
pub use error::ConfigError;
pub use gains::Gains;
pub use harmonics::MAX_HARMONICS;
pub use response_loop::Move;
pub use sample_clock::SampleClock;
pub use signals::{Input, Output};
pub use supervisor::{Fault, Phase};
