//! An FMI 2.0 shell: write a struct, get an FMU.

pub mod abi;
mod archive;
mod component;
mod export;
mod instance;
mod life_cycle;
mod log;
mod model;
mod refusal;
mod serial;
mod session;
mod snapshots;
mod status;
mod variable;

pub use archive::Archive;
pub use component::{BooleanOf, Component, IntegerOf, RealOf, StringOf};
pub use log::{Category, Log, Logger};
pub use model::{Key, Model};
pub use refusal::{Refusal, Severity};
pub use status::Status;
pub use variable::{Causality, Initial, Variability, Variable};
