//! The test bench: an *experiment* couples a controller to a rig and records what the sensors read; *identification* evaluates the record, and
//! *comparison* puts theory and exact orbits beside the result.

#![forbid(unsafe_code)]

pub mod advice;
pub mod backbone;
pub mod comparison;
pub mod experiment;
pub mod fit;
pub mod identification;
pub mod live;
pub mod loop_check;
pub mod record;
pub mod rig;
pub mod survey;

pub use vines_scene::{cells, knowledge, linear, plan, scene};
