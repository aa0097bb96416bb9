//! The lab of the LO–VI NES test bench: scenes, theory, exact orbits and FMU packing.
//!
//! A *scene* describes a linear oscillator (LO) with a vibro-impact nonlinear energy sink (VI NES), its excitation
//! and how it is measured. [`theory`] says to first order in the mass ratio where its backbone lies, [`orbit`] says it
//! exactly. Both work with dimensionless quantities: lengths over the half-width b of the cavity, times multiplied by
//! omega0 = sqrt(k/M), and `Omega = omega/omega0 = 1 + epsilon sigma`.

#![forbid(unsafe_code)]

pub mod backbone;
pub mod estimators;
pub mod experiment;
mod files;
pub mod identification;
pub mod map;
pub mod net;
pub mod orbit;
pub mod pack;
pub mod report;
pub mod rig;
pub mod scene;
pub mod stages;
pub mod theory;
