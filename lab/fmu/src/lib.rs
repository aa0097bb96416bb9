//! FMUs on the bench: any FMI 2.0 co-simulation component as a rig or as a controller.

#![forbid(unsafe_code)]

mod controller;
mod error;
mod instance;
mod rig;

pub use controller::FmuController;
pub use error::{CallError, LoadError};
pub use instance::{FmuError, Kind};
pub use rig::FmuRig;
