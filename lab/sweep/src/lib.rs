//! Sweeps over any numbers of a scene and of its start, written to a Zarr store as they are computed.
//!
//! A [`Plan`] has the cells in their order, [`run`] computes the chunks that the store does not have. A chunk is complete or
//! absent, and every cell depends only on its position: a sweep that was killed gives the same bytes as one that was not.

#![forbid(unsafe_code)]

mod axis;
mod cell;
mod folder;
mod plan;
mod run;
mod sobol;
mod store;

pub use axis::{Axis, SIGMA, Values};
pub use cell::{ABSENT, Results};
pub use plan::{Plan, PlanError, Settings};
pub use run::{Estimate, Monitor, Shard, estimate, run};
pub use store::StoreError;
