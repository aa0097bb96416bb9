//! Numerical methods that several modules share: roots, minima, statistics, least squares.

mod least_squares;
mod roots;
mod statistics;

pub use least_squares::{HarmonicBasis, HarmonicFit};
pub use roots::{bisection, golden_section, quadratic, try_bisection};
pub use statistics::{Line, equally_spaced, mean, mean_square, noise, range, standard_deviation};
