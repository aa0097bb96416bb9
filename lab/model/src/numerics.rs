//! Numerical methods that several modules share: roots, minima, statistics, least squares.

mod estimate;
mod least_squares;
mod roots;
mod statistics;

pub use estimate::{Estimate, Prior, Regression, student_factor};
pub use least_squares::{HarmonicBasis, HarmonicFit};
pub use roots::{bisection, golden_section, quadratic, try_bisection};
pub use statistics::{equally_spaced, mean, mean_square, noise, range, slope, standard_deviation};
