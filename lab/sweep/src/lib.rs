//! Sweeps over any numbers of a scene and of its start, written to a Zarr store as they are computed.
//!
//! A [`Plan`] has the cells in their order, [`run`] computes the chunks that the store does not have, or whose checksums are wrong.
//! Every cell depends only on its position: a sweep that was killed gives the same bytes as one that was not.

#![forbid(unsafe_code)]

mod adaptive;
mod axis;
mod cell;
mod error;
mod folder;
mod gzip;
mod monitor;
mod plan;
mod run;
mod settings;
mod store;
mod variables;

pub use axis::{Axis, SIGMA, Values};
pub use cell::Results;
pub use error::StoreError;
pub use monitor::Monitor;
pub use plan::{Plan, Shard};
pub use run::{Estimate, EstimateError, estimate, merge, run, verify};
pub use settings::{PlanError, Settings};
pub use variables::{ABSENT, FAILED, UNCOUNTED};
