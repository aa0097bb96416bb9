//! The backbone, tracked with the loop closed: the response is stepped from level to level, held there until it is still,
//! and the drive and the frequency that this takes are measured.
//!
//! Under a constant drive the response would relax over dozens of periods at every level. The controller holds
//! the *response* instead, and the drive does what it must; what the points before tell of the next one is fed forward, so
//! that little is left to settle.

mod cycle;
mod predictor;
mod settle;
mod track;

pub use cycle::Cycle;
pub use settle::{Criterion, Estimate};
pub use track::{Point, TrackError, Tracked, track};
