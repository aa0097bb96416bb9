//! Tracking of the backbone with the loop closed: the controller holds the response at one level after another until it has
//! settled, and the drive amplitude and the frequency are measured.
//!
//! Under a constant drive, the response would take dozens of periods to settle at every level. The controller therefore controls
//! the *response*, and the drive follows. The points before predict drive and frequency of the next one,
//! so that the loops have little to correct.

mod level;
mod track;

pub use level::{Criterion, Found};
pub use track::{Point, Tracked, track, track_into};
