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
pub mod structures;

/// The middle value; not a number for no values.
#[must_use]
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}
