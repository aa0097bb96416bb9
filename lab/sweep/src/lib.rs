//! Sweeps over any numbers of a scene and of its start: in memory as a regime map, or written to a Zarr store as they are computed.
//!
//! A [`Sweep`] has the cells in their order. [`Map::run`] keeps the regimes of two axes in memory; [`run()`] computes the chunks that
//! the store does not have, or whose checksums are wrong. Every cell depends only on its position: a sweep that was killed gives the same
//! bytes as one that was not.

#![forbid(unsafe_code)]

mod adaptive;
mod axis;
mod cell;
mod map;
mod monitor;
mod run;
mod store;
mod sweep;

pub use axis::{Axis, Grid, SIGMA, Values};
pub use cell::{ABSENT, FAILED, Results, UNCOUNTED};
pub use map::{Map, MapCell};
pub use monitor::Monitor;
pub use run::{Estimate, collect, estimate, run, verify};
pub use store::StoreError;
pub use sweep::{Settings, Shard, Sweep, SweepError};
