//! First-order multiple-scales theory of the 1:1 regime with two symmetric impacts per period.
//!
//! Dimensionless throughout: `v0 = C sin(Omega tau + gamma)` is the centre of mass over b, `w0 = v0 + B Pi(Omega tau + psi)` the
//! relative motion with the triangle wave Pi of slope ±1 and height pi/2, so that B is the particle's speed. On the slow invariant
//! manifold, C is a function of B, and B is the better coordinate: everything below is polynomial in it, and
//! both branches are one curve. All results are of first order in epsilon: the mass ratio itself appears only where
//! fast and slow time are combined: in the modulation from impact to impact, and in a waveform. Equation numbers refer to docs/theory.md.

mod activation;
mod modulation;
mod resonance;
mod slow_flow;

pub use activation::Activation;
pub use resonance::{backbone, backbone_at_level, free_sigma, reading, resonant};
pub use slow_flow::{B_SYMMETRY_BREAKING, BackbonePoint, BranchSide, Equilibrium, Manifold, SlowFlow, impacts_stable};
