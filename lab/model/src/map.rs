//! The regime map: the regime of the response over a grid of two parameters, from simulated impact sequences.
//!
//! Every point of the grid is one plant, driven at a fixed frequency from the scene's start. After its transient, the
//! regime is classified from the impacts. Without a repeating pattern, the growth of a disturbance distinguishes chaos from
//! modulation. Where several regimes are stable, another start may lead to another regime.

mod axis;
mod grid;
mod island;
mod run;

pub use axis::{Axis, Range};
pub use grid::{Cell, Map, MapError, Plan};
pub use island::outline;
pub use run::{Point, observe};
