//! Run time against error: this plant, the methods that it is compared with, and how they take turns.

#![forbid(unsafe_code)]

pub mod baseline;
pub mod cost;
#[cfg(feature = "diffsol")]
pub mod diffsol;
pub mod map;
pub mod method;
pub mod scene;
pub mod solvers;
