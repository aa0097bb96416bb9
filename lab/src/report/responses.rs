//! Frequency responses at several excitations, exact and first-order, with the backbone through their maxima.

use plotters::chart::SeriesLabelPosition;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::chart::{FONT, legend, line, plane, px, svg};
use super::lines::{Marked, clipped, pieces, thinned};
use super::theme::{EXACT, FAINT, THEORY, UNSTABLE};
use crate::orbit::{Branch, Response};
use crate::scene::Dimensionless;
use crate::theory::{B_SYMMETRY_BREAKING, SlowFlow};

const POINTS: usize = 600;
/// Distance of drawn points, as a fraction of the picture.
const APART: f64 = 0.004;

/// Draws the exact responses and, for the same G, those of theory.
pub fn draw(p: &Dimensionless, responses: &[Response]) -> Result<String, String> {
    let flow = SlowFlow::new(p.lambda, p.r);
    let top = responses
        .iter()
        .flat_map(|one| &one.symmetric.points)
        .filter(|one| one.b > flow.manifold.b_min())
        .fold(0.6, |most: f64, one| most.max(1.08 * one.c));
    let (x, y) = ((-5.0, 5.0), (0.0, top));
    let list: Vec<String> = responses
        .iter()
        .map(|one| format!("{:.3}", one.g))
        .collect();
    let caption = format!(
        "ε = {:.5}, λ = {:.3}, r = {}; G = {}; amplitudes over b",
        p.epsilon,
        p.lambda,
        p.r,
        list.join(", ")
    );
    svg(|area| {
        let mut chart = plane(
            area,
            Some(("Frequency responses and backbone", &caption)),
            (x, "detuning σ = (ω/ω₀ − 1)/ε"),
            (y, "amplitude C of v, over b"),
        )?;
        let mut theory = [Some("theory, stable"), Some("theory, unstable")];
        let mut exact = [Some("exact, stable"), Some("exact, unstable")];
        for (n, response) in responses.iter().enumerate() {
            for curve in flow.frequency_responses(response.g, POINTS) {
                let points: Vec<Marked> = curve
                    .iter()
                    .map(|one| {
                        let stable = one.motion.impacts_stable && one.motion.slow_flow_stable;
                        ((one.sigma, one.motion.c), stable)
                    })
                    .collect();
                let styles = [line(THEORY, 12), line(UNSTABLE, 8)];
                for piece in clipped(&points, x, y) {
                    pieces(
                        &mut chart,
                        &thinned(&piece, x, y, APART),
                        styles,
                        &mut theory,
                    )?;
                }
            }
            let branches = std::iter::once(&response.symmetric).chain(&response.asymmetric);
            for branch in branches {
                let styles = [line(EXACT, 30), line(FAINT, 14)];
                for piece in clipped(&marked(branch), x, y) {
                    pieces(
                        &mut chart,
                        &thinned(&piece, x, y, APART),
                        styles,
                        &mut exact,
                    )?;
                }
            }
            // Each is named below its end on the left, where the picture is empty.
            let stable = response.symmetric.points.iter().filter(|one| one.stable);
            let end = stable.min_by(|one, other| one.sigma.total_cmp(&other.sigma));
            if let Some(end) = end {
                let anchor = Pos::new(HPos::Center, VPos::Center);
                let style = (FONT, px(14)).into_text_style(area).pos(anchor);
                let place = (
                    end.sigma.clamp(x.0 + 0.7, x.1),
                    (0.1 - 0.035 * n as f64) * top,
                );
                let text = format!("G = {:.3}", response.g);
                chart.draw_series(std::iter::once(Text::new(text, place, style)))?;
            }
        }
        let mut backbone = [Some("backbone, theory"), None];
        let points: Vec<Marked> = flow
            .backbone(flow.manifold.b_min(), 1.4 * B_SYMMETRY_BREAKING, POINTS)
            .iter()
            .map(|one| ((one.sigma, one.c), true))
            .collect();
        for piece in clipped(&points, x, y) {
            pieces(&mut chart, &piece, [line(BLACK, 24); 2], &mut backbone)?;
        }
        legend(&mut chart, SeriesLabelPosition::UpperRight)
    })
}

fn marked(branch: &Branch) -> Vec<Marked> {
    branch
        .points
        .iter()
        .map(|one| ((one.sigma, one.c), one.stable))
        .collect()
}
