//! Backbones of first-order theory for several coefficients of restitution.

use plotters::chart::SeriesLabelPosition;
use plotters::prelude::*;

use super::chart::{FONT, legend, line, plane, px, svg};
use super::lines::pieces;
use super::theme::{EXACT, THEORY, UNSTABLE};
use crate::scene::Dimensionless;
use crate::theory::{B_SYMMETRY_BREAKING, SlowFlow};

/// Coefficients of restitution beside the scene's own.
const OTHERS: [f64; 4] = [0.3, 0.5, 0.8, 1.0];
const POINTS: usize = 500;
const TOP: f64 = 1.2;

/// Draws them, the scene's own emphasised.
pub fn draw(p: &Dimensionless) -> Result<String, String> {
    let mut values: Vec<f64> = OTHERS
        .into_iter()
        .filter(|r| (r - p.r).abs() > 0.09)
        .collect();
    values.push(p.r);
    values.sort_by(f64::total_cmp);
    let x = (-4.0, 4.0);
    let caption = format!(
        "λ = {:.3}; amplitudes over b; first order in ε, at phase resonance",
        p.lambda
    );
    svg(|area| {
        let mut chart = plane(
            area,
            Some((
                "Backbones for several coefficients of restitution r",
                &caption,
            )),
            (x, "detuning σ = (ω/ω₀ − 1)/ε"),
            ((0.0, TOP), "amplitude C of v, over b"),
        )?;
        let mut labels = [Some("stable"), Some("unstable")];
        for r in &values {
            let flow = SlowFlow::new(p.lambda, *r);
            let own = *r == p.r;
            let points: Vec<_> = flow
                .backbone(1e-3, 1.5 * B_SYMMETRY_BREAKING, POINTS)
                .into_iter()
                .filter(|point| point.c <= TOP && (x.0..=x.1).contains(&point.sigma))
                .map(|point| ((point.sigma, point.c), point.stable()))
                .collect();
            let stable = if own {
                line(EXACT, 34)
            } else {
                line(THEORY, 18)
            };
            // Without loss at the impacts C vanishes at the fold, and sigma jumps from one side to the other there.
            let pieces_of = points.chunk_by(|one, other| (one.0.0 - other.0.0).abs() < 1.0);
            for piece in pieces_of {
                pieces(&mut chart, piece, [stable, line(UNSTABLE, 14)], &mut labels)?;
            }
            // The folds tell them apart, but for those near the axis: these are named where they come in from the left.
            let fold = flow.backbone_at(flow.manifold.b_min());
            let place = if fold.c > 0.05 {
                (fold.sigma.max(0.1) + 0.06, fold.c - 0.022)
            } else {
                let right = points
                    .iter()
                    .filter(|one| one.0.0 > x.0 + 0.2 && one.0.0 < 0.0);
                let left = right.min_by(|one, other| one.0.0.total_cmp(&other.0.0));
                left.map_or((0.0, 0.1), |one| (one.0.0, one.0.1 + 0.045))
            };
            let style = (FONT, px(if own { 17 } else { 14 })).into_text_style(area);
            chart.draw_series(std::iter::once(Text::new(format!("r = {r}"), place, style)))?;
        }
        legend(&mut chart, SeriesLabelPosition::UpperRight)
    })
}
