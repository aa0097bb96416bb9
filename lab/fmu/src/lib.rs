//! FMUs on the bench: any FMI 2.0 co-simulation component as a rig or as a controller.
//!
//! This is also the one master of the tests: [`Master`] calls the C functions of a library as it is told to. An FMU must
//! not step asynchronously (`fmi2Pending`).

mod controller;
mod error;
mod functions;
mod instance;
mod judge;
pub mod library;
mod master;
mod rig;

pub use controller::FmuController;
pub use error::{CallError, LoadError};
pub use functions::{Answer, Functions, Raw};
pub use instance::{FmuError, Kind};
pub use master::{Hear, Interface, Line, Master};
pub use rig::FmuRig;
