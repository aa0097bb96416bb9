//! First-order multiple-scales theory of the 1:1 regime with two symmetric impacts per period.
//!
//! Dimensionless throughout: `v0 = C sin(Omega tau + gamma)` is the centre of mass over b, `w0 = v0 + B Pi(Omega tau + psi)` the
//! relative motion with the triangle wave Pi of slope ±1 and height pi/2, so that B is the particle's speed. On the slow invariant
//! manifold, C is a function of B, and B is the better coordinate: everything below is polynomial in it, and
//! both branches are one curve. All results are of first order in epsilon: the mass ratio itself appears only where
//! fast and slow time are combined: in the modulation from impact to impact, and in a waveform. Equation numbers are those of docs/theory.md.

mod activation;
mod backbone;
mod decay;
mod drift;
mod equilibrium;
mod manifold;
mod modulation;
mod polynomial;
mod resonance;
mod response;
mod slow_flow;
mod stability;
mod waveform;

pub use activation::Activation;
pub use backbone::BackbonePoint;
pub use decay::{Decay, DecayPoint};
pub use drift::Drift;
pub use equilibrium::Equilibrium;
pub use manifold::{BranchSide, Manifold};
pub use modulation::{ImpactSequence, Modulation};
pub use resonance::{backbone, backbone_at_level, free_sigma, reading, resonant};
pub use response::ResponsePoint;
pub use slow_flow::SlowFlow;
pub use stability::{B_SYMMETRY_BREAKING, half_period_map, half_period_multipliers, impacts_stable};
pub use waveform::{Waveform, triangle_wave};
