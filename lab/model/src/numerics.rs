//! Numerical methods that several modules share: roots, minima, statistics, least squares.

/// Standard errors from which on a difference is not noise: 0.3 % of normal noise is beyond.
pub const SIGNIFICANT: f64 = 3.0;
/// Standard errors of a difference that are taken for noise where what is beyond becomes a part of an uncertainty: 5 % of normal noise.
pub const RANDOM: f64 = 2.0;

mod estimate;
mod least_squares;
mod roots;
mod statistics;

pub use estimate::{Estimate, Prior, Regression, student_factor};
pub use least_squares::{HarmonicBasis, HarmonicFit};
pub use roots::{bisection, golden_section, quadratic, try_bisection};
pub use statistics::{equally_spaced, mean, mean_square, noise, range, slope, standard_deviation};
