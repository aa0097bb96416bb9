//! The backbone with the decay on it: amplitude over detuning.

use plotters::chart::SeriesLabelPosition;

use super::chart::{
    DECAY_LABEL, Plane, THINNED, caption, decay_points, legend, line, locked_point, plane, svg,
};
use super::lines::{Marked, clipped, pieces, thinned};
use super::theme::{EXACT, FAINT, THEORY, UNSTABLE};
use crate::comparison::Comparison;
use crate::orbit::{self, Limits};
use crate::scene::Dimensionless;
use crate::theory::{BranchSide, SlowFlow};

/// Amplitude drawn up to at least this, C.
const TOP: f64 = 0.8;
/// Distance of drawn points of the exact curve, as a fraction of the picture.
const APART: f64 = 0.004;

pub(super) fn draw(found: &Comparison) -> Result<String, String> {
    let p = &found.parameters;
    let slow_flow = SlowFlow::new(p.lambda, p.r);
    let top = (1.25 * found.lock.c).max(TOP);
    let reach = slow_flow.manifold.b(top, BranchSide::Right).unwrap_or(1.0);
    let theory = slow_flow.backbone(slow_flow.manifold.b_min(), reach, 400);
    // Below the fold there is no backbone, and the frequency of what is left of the motion goes anywhere.
    let fold = slow_flow.manifold.c_min();
    let above = found
        .decay
        .iter()
        .map(|one| one.point)
        .filter(|point| point.c >= fold);
    let (low, high) = theory
        .iter()
        .map(|point| point.sigma)
        .chain(above.map(|point| point.sigma))
        .fold((f64::MAX, f64::MIN), |(low, high), s| {
            (low.min(s), high.max(s))
        });
    let margin = 0.06 * (high - low);
    let (low, high) = (low - margin, high + margin);

    svg(|area| {
        let mut chart = plane(
            area,
            Some((
                "Backbone: phase resonance of the centre of mass",
                &caption(&found.parameters, found.lock.g),
            )),
            ((low, high), "detuning σ = (ω/ω₀ − 1)/ε"),
            ((0.0, top), "amplitude C of v, over b"),
        )?;
        backbones(&mut chart, p, (low, high), (0.0, top))?;
        let decay = found.decay.iter().map(|one| one.point).step_by(THINNED);
        let decay = decay.map(|point| (point.sigma, point.c));
        let inside = decay.filter(|(sigma, _)| (low..=high).contains(sigma));
        decay_points(&mut chart, inside.collect(), DECAY_LABEL)?;
        locked_point(&mut chart, (found.lock.sigma, found.lock.c))?;
        legend(&mut chart, SeriesLabelPosition::UpperRight)
    })
}

/// Draws the right branch of the backbone, by theory and exact, each with its stability, as far as it lies in the ranges.
pub(super) fn backbones<'a, 'b: 'a>(
    chart: &mut Plane<'a, 'b>,
    p: &Dimensionless,
    x: (f64, f64),
    y: (f64, f64),
) -> Result<(), Box<dyn std::error::Error>> {
    let flow = SlowFlow::new(p.lambda, p.r);
    let fold = flow.manifold.b_min();
    let reach = flow.manifold.b(y.1, BranchSide::Right).unwrap_or(1.0);
    let theory: Vec<Marked> = flow
        .backbone(fold, reach, 400)
        .iter()
        .map(|point| ((point.sigma, point.c), point.stable()))
        .collect();
    let exact: Vec<Marked> = orbit::backbone(p, &Limits::default())
        .map(|branch| branch.points)
        .unwrap_or_default()
        .iter()
        .filter(|motion| motion.b >= fold)
        .map(|motion| ((motion.sigma, motion.c), motion.stable))
        .collect();
    let mut labels = [
        Some("first-order theory, stable"),
        Some("first-order theory, unstable"),
    ];
    let styles = [line(THEORY, 20), line(UNSTABLE, 20)];
    for piece in clipped(&theory, x, y) {
        pieces(chart, &piece, styles, &mut labels)?;
    }
    let mut labels = [Some("exact orbits, stable"), Some("exact orbits, unstable")];
    let styles = [line(EXACT, 16), line(FAINT, 16)];
    for piece in clipped(&exact, x, y) {
        pieces(chart, &thinned(&piece, x, y, APART), styles, &mut labels)?;
    }
    Ok(())
}
