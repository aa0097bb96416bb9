//! The regime map: the regime of the response over a grid of two parameters, from simulated impact sequences.
//!
//! Every point of the grid is one plant, driven at a fixed frequency from the scene's start until its regime is decided: by a motion
//! that repeats itself or, after the largest number of periods, by its largest Lyapunov exponent. Where several regimes are stable,
//! another start may lead to another regime.

mod axis;
mod decide;
mod grid;
mod island;
mod observe;
mod response;
mod run;

pub use axis::{Axis, Range};
pub use grid::{CONFIRMATIONS, Cell, LIMIT, Map, MapError, Plan};
pub use island::outline;
pub use observe::{observe, observe_confirmed};
pub use response::Response;
pub use run::{Point, Run};
