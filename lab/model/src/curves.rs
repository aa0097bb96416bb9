//! Curves of the live bench: manifold, and backbones of theory and of exact orbits.

use crate::Dimensionless;
use crate::numerics::equally_spaced;
use crate::orbit::exact_backbone;
use crate::theory::{B_SYMMETRY_BREAKING, Manifold, SlowFlow};

/// `points` points (B, C, 1 if the impacts are stable) of the slow invariant manifold up to `b_max`.
pub fn manifold(scene: &Dimensionless, b_max: f64, points: usize) -> impl Iterator<Item = [f64; 3]> {
    let manifold = Manifold::new(scene.r);
    let stable = manifold.b_min()..B_SYMMETRY_BREAKING;
    equally_spaced(0.0, b_max, points).map(move |b| [b, manifold.c(b), f64::from(u8::from(stable.contains(&b)))])
}

/// `points` points (sigma, C, 1 if stable) of the backbone by first-order theory.
pub fn backbone(scene: &Dimensionless, points: usize) -> impl Iterator<Item = [f64; 3]> {
    let slow_flow = SlowFlow::new(scene.lambda, scene.r);
    let from = slow_flow.manifold.b_min();
    equally_spaced(from, 1.2 * B_SYMMETRY_BREAKING, points).map(move |b| {
        let point = slow_flow.backbone_at(b);
        [point.sigma, point.c, f64::from(u8::from(point.stable()))]
    })
}

/// Points (sigma, C, 0 if unstable, G) of the backbone by exact orbits, at the detunings of the theory's backbone.
pub fn exact(scene: &Dimensionless, points: usize) -> impl Iterator<Item = [f64; 4]> {
    backbone(scene, points).filter_map(|[sigma, c, _]| {
        let orbits = exact_backbone(scene, 1.0 + scene.epsilon * sigma);
        let distance = |c_exact: f64| (c_exact - c).abs();
        let nearest = orbits
            .into_iter()
            .min_by(|first, second| distance(first.c).total_cmp(&distance(second.c)))?;
        Some([
            nearest.sigma,
            nearest.c,
            f64::from(u8::from(!nearest.is_unstable())),
            nearest.g,
        ])
    })
}
