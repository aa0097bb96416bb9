//! The test bench: a *scene* describes a rig, its excitation and how it is measured; an *experiment* couples a controller to
//! a rig and records what the sensors read; *identification* evaluates the record, and
//! *comparison* puts theory and exact orbits beside the result.

#![forbid(unsafe_code)]

pub mod advice;
pub mod backbone;
pub mod cells;
pub mod comparison;
pub mod experiment;
mod filter;
pub mod fit;
pub mod identification;
pub mod knowledge;
pub mod linear;
pub mod live;
pub mod loop_check;
pub mod plan;
pub mod record;
pub mod rig;
pub mod scene;
pub mod shaker_path;
pub mod survey;
