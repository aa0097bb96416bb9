//! FMUs as a master sees them: shared libraries, called through C pointers with good and with bad arguments.
//!
//! This is a crate of its own because all libraries export the same names: they can be loaded into one program, but
//! not linked into one.

mod functions;
pub mod fuzz;
mod library;
mod master;
pub mod pair;

pub use functions::{Functions, Raw};
pub use library::{CONTROLLER, Fmu, PLANT};
pub use master::{Interface, Line, Master, callbacks};
