#![doc = include_str!("README.md")]
#![forbid(unsafe_code)]

mod advance;
mod arithmetic;
pub mod base_motion;
pub mod cavity;
pub mod clearance;
pub mod contact;
mod fast;
pub mod flight;
pub mod forcing;
pub mod host;
pub mod oscillator;
pub mod parameters;
pub mod plant;
mod primary;
pub mod segment;
mod shaker;
mod structure;
mod system;
pub mod table;
pub mod variation;

/// `modelDescription.xml` of the plant's FMU (FMI 2.0): its variables, written once.
pub const MODEL_DESCRIPTION: &str = include_str!("../modelDescription.xml");

pub use base_motion::{BaseMotion, Drive};
pub use contact::Wall;
pub use host::{Excitation, Host, InvalidHost, Mode, Row, Section};
pub use parameters::{Cavity, InvalidValue, Parameters, Restitution};
pub use plant::{Event, Outcome, Plant, State, Totals};
pub use primary::{Primary, Single};
pub use shaker::{Amplifier, Piece, Shaker, ShakerRows};
pub use structure::{Refused, Structure, StructureState};
pub use variation::Variation;
