//! Loads FMUs of FMI 2.0 for co-simulation: unpacks the archive, reads the description, calls the library.
//!
//! ```no_run
//! use fmi2_import::{Fmu, Instance};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let fmu = Fmu::open("LoViNes.fmu".as_ref())?;
//! let v = fmu.description().variable("v").ok_or("no variable v")?.value_reference;
//! let mut plant = Instance::new(fmu, "plant")?;
//! plant.initialize()?;
//! plant.do_step(0.0, 1e-3)?;
//! let mut value = [0.0];
//! plant.get_real(&[v], &mut value)?;
//! # Ok(())
//! # }
//! ```
//!
//! Messages of an FMU go to the `log` crate; the target is the name of the instance.

mod error;
mod fmu;
mod functions;
mod instance;
mod logger;

pub use error::{CallError, LoadError};
pub use fmi2_description::{Description, Kind};
pub use fmu::Fmu;
pub use instance::Instance;
