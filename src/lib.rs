//! A linear oscillator with a vibro-impact nonlinear energy sink, exact between events.
#![forbid(unsafe_code)]

pub mod base_motion;
#[cfg(feature = "batch")]
pub mod batch;
pub mod clearance;
mod creep;
pub mod crossing;
pub mod equations;
pub mod flight;
#[cfg(feature = "fmu")]
mod fmu;
pub mod forcing;
pub mod hybrid;
pub mod lane;
pub mod motion;
pub mod oscillator;
pub mod parameters;
pub mod plant;
pub mod rates;
pub mod span;
pub mod sticking;
pub mod wall;

pub use base_motion::{BaseMotion, Drive};
pub use parameters::{InvalidValue, Parameters};
pub use plant::{Event, Outcome, Plant, State, Tally};
pub use wall::Wall;
