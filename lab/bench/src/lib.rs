//! The test bench: a *scene* describes a rig, its excitation and how it is measured; an *experiment* couples a controller to
//! a rig and records what the sensors read; *identification* says what the record means.

#![forbid(unsafe_code)]

pub mod backbone;
pub mod chain_effects;
pub mod comparison;
pub mod estimators;
pub mod experiment;
pub mod identification;
pub mod rig;
pub mod scene;
