//! FMUs on the bench: any FMI 2.0 co-simulation component as a rig or as a controller.
//!
//! The `fmi` crate loads them. Its limits are those of the bench: an FMU must not step asynchronously (`fmi2Pending`), and macOS on
//! ARM is not supported.

mod controller;
mod instance;
mod rig;

pub use controller::FmuController;
pub use instance::{FmiType, FmuError, check};
pub use rig::FmuRig;
