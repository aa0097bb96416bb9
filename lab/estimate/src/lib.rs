//! Drive and frequency of phase resonance, `E_R(A)` and `omega_R(A)`, with their covariance, from any record of response and base.
//!
//! The fundamental of the response, less the exact linear response to the measured base, obeys one linear equation with one unknown force:
//!
//! ```text
//! u' = (pole - i omega0) u + gain [(psi'/omega0)^power d exp(i psi) + noise],    lag d' + d = S(A),
//! measured u = u + far(omega) d + noise,
//! ```
//!
//! where `A exp(i psi)` is the fundamental of the response. The force S of steady motion is a cubic spline over the amplitude, with the prior of an
//! integrated random walk. A Kalman filter over periods whitens the record, generalised least squares gives S, and the curves follow from it. There
//! are no windows: held levels, sweeps and mixtures are one case. What is particular to the element that makes the force is behind the trait
//! [`Element`].

#![forbid(unsafe_code)]

mod columns;
mod curve;
mod filter;
mod fit;
mod harmonics;
mod interpolation;
mod level;
mod linear;
mod oscillations;
mod periods;
mod record;
mod search;
mod windows;

pub use curve::{Backbone, Curve, Resonance};
pub use fit::{Estimate, Hyper, Solution};
pub use harmonics::{HarmonicBasis, HarmonicFit, transform};
pub use interpolation::{Basis, CubicSpline};
pub use level::{Disturbance, Level, Motion};
pub use linear::Linear;
pub use oscillations::Oscillations;
pub use periods::Periods;
pub use record::{Element, Path, Record, Signals};
pub use windows::{Window, probabilities, windows};
