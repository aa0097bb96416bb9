//! What is known before anything is measured: a *scene* describes a rig, its excitation and how it is measured; *knowledge* is what measuring
//! takes from it or from an earlier measurement, and a *plan* is the experiment that follows.

#![forbid(unsafe_code)]

pub mod cells;
pub mod filter;
pub mod knowledge;
pub mod linear;
pub mod plan;
pub mod scene;
pub mod shaker_path;
pub mod units;
