//! The dimensionless model of an LO–VI NES: first-order theory, exact periodic orbits, and maps of its regimes.
//!
//! Lengths are over the half-width b of the cavity, times multiplied by omega0 = sqrt(k/M), and
//! `Omega = omega/omega0 = 1 + epsilon sigma`. [`theory`] gives the backbone to first order in the mass
//! ratio, [`orbit`] gives it exactly.

#![forbid(unsafe_code)]

mod argument;
mod definition;
mod dimensionless;
pub mod map;
pub mod numerics;
pub mod orbit;
pub mod regime;
pub mod theory;

pub use argument::ArgumentError;
pub use definition::{Definition, Reference, Resonance, Sensor};
pub use dimensionless::Dimensionless;
