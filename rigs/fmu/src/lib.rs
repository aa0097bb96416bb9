//! FMUs on the bench: any FMI 2.0 co-simulation component as a rig or as a controller. An FMU must not step asynchronously
//! (`fmi2Pending`).

mod archive;
mod controller;
mod instance;
mod library;
pub mod process;
mod rig;
mod units;

pub use archive::{PLATFORMS, own_platforms};
pub use controller::FmuController;
pub use instance::{Connection, FmuError, Obstacle, Use};
pub use library::check;
pub use rig::{Asked, FmuRig};
