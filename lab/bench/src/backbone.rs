//! Tracking of the backbone with the loop closed: the controller holds the response at one level after another until it has
//! settled, and the drive amplitude and the frequency are measured.
//!
//! Under a constant drive, the response would take dozens of periods to settle at every level. The controller therefore controls
//! the *response*, and the drive follows. A predictor computes drive and frequency of the next point from the points before, so that
//! the loops have little to correct.

mod bench;
mod peak;
mod point;
mod predictor;
mod settle;
mod sweep;
mod track;

pub use point::{Point, Tracked};
pub use settle::{Criterion, Found};
pub use track::{track, track_into};
