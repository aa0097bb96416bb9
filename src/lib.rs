//! A linear oscillator with a vibro-impact nonlinear energy sink, exact between events.
#![forbid(unsafe_code)]

mod arithmetic;
pub mod base_motion;
pub mod clearance;
pub mod contact;
mod fast;
pub mod flight;
pub mod forcing;
mod moving;
pub mod oscillator;
mod overdamped;
pub mod parameters;
pub mod plant;
pub mod segment;
pub mod sticking;

pub use base_motion::{BaseMotion, Drive};
pub use contact::Wall;
pub use parameters::{InvalidValue, Parameters};
pub use plant::{Event, Outcome, Plant, State, Totals};
