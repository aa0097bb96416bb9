//! Sweeps over any numbers of a scene and of its start: in memory as a regime map, or written to a Zarr store as they are computed.
//!
//! A [`Sweep`] has the cells in their order. [`Map::run`] keeps the regimes of two axes in memory; [`run()`] computes the chunks that
//! the store does not have, or whose checksums are wrong. Every cell depends only on its position: a sweep that was killed gives the same
//! bytes as one that was not. Without the feature `store`, no part of Zarr is compiled.

#![forbid(unsafe_code)]
#![cfg_attr(
    not(feature = "store"),
    allow(dead_code, reason = "chunks and variables serve the store")
)]

mod axis;
mod cell;
mod map;
mod sweep;

#[cfg(feature = "store")]
mod adaptive;
#[cfg(feature = "store")]
mod run;
#[cfg(feature = "store")]
mod store;

pub use axis::{Axis, Grid, SIGMA, Values};
pub use cell::{ABSENT, FAILED, Results, UNCOUNTED};
pub use map::{Map, MapCell};
pub use sweep::{Settings, Shard, Sweep, SweepError};

#[cfg(feature = "store")]
pub use run::{Estimate, EstimateError, Monitor, collect, estimate, run, verify};
#[cfg(feature = "store")]
pub use store::StoreError;
