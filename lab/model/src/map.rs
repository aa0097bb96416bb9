//! The regime map: what the response settles into over a grid of two parameters, from simulated impact sequences.
//!
//! Every point of the grid is one plant, driven at a fixed frequency from the scene's start. What it does after its transient is
//! classified from its impacts alone; only what does not repeat is looked at twice, for a disturbance that grows is chaos.
//! Another start may lead elsewhere where several regimes are stable: the map is for this one.

mod axis;
mod grid;
mod island;
mod run;

pub use axis::{Axis, Range};
pub use grid::{Cell, Map, MapError, Plan};
pub use island::outline;
pub use run::{Point, observe};
