//! Backbones of first-order theory for several coefficients of restitution.

use crate::report::figure::{DETUNING, Figure, Legend, Marked, Panel, Place, amplitude, line};
use crate::report::theme::{EXACT, THEORY, UNSTABLE};
use crate::scene::Dimensionless;
use crate::theory::{self, B_SYMMETRY_BREAKING, SlowFlow};

/// Coefficients of restitution beside the scene's own.
const OTHERS: [f64; 4] = [0.3, 0.5, 0.8, 1.0];
const POINTS: usize = 500;
const TOP: f64 = 1.2;
const DETUNINGS: (f64, f64) = (-4.0, 4.0);

/// The backbones, the scene's own emphasised.
pub fn figure(p: &Dimensionless) -> Figure {
    let mut values: Vec<f64> = OTHERS.into_iter().filter(|r| (r - p.r).abs() > 0.09).collect();
    values.push(p.r);
    values.sort_by(f64::total_cmp);
    let caption = format!(
        "λ = {:.3}; amplitudes over b; first order in ε; {}",
        p.lambda,
        p.definition.name()
    );
    let mut panel = Panel::new((DETUNINGS, DETUNING), ((0.0, TOP), amplitude(p)))
        .heading("Backbones for several coefficients of restitution r", &caption)
        .legend(Legend::UpperRight);
    for r in values {
        let own = r == p.r;
        let (colour, width, size) = if own { (EXACT, 34, 17) } else { (THEORY, 18, 14) };
        let flow = SlowFlow::new(p.lambda, r);
        let scene = Dimensionless { r, ..*p };
        let points: Vec<Marked> = theory::backbone(&scene, 1e-3, 1.5 * B_SYMMETRY_BREAKING, POINTS)
            .into_iter()
            .filter(|point| point.c <= TOP && (DETUNINGS.0..=DETUNINGS.1).contains(&point.sigma))
            .map(|point| ((point.sigma, point.c), point.stable()))
            .collect();
        // Without loss at the impacts C vanishes at the fold, and sigma jumps from one side to the other there.
        for piece in points.chunk_by(|one, other| (one.0.0 - other.0.0).abs() < 1.0) {
            let styles = [line(colour, width), line(UNSTABLE, 14)];
            panel.pieces(piece, styles, ["stable", "unstable"]);
        }
        panel.text(format!("r = {r}"), label_place(&flow, &points), size);
    }
    Figure::single(panel)
}

/// Beside the fold, where the curves are distinct; for a fold near the axis, where its curve enters from the left.
fn label_place(flow: &SlowFlow, points: &[Marked]) -> Place {
    let fold = flow.backbone_at(flow.manifold.b_min());
    if fold.c > 0.05 {
        return (fold.sigma.max(0.1) - 0.2, fold.c + 0.045);
    }
    let right = points.iter().filter(|one| one.0.0 > DETUNINGS.0 + 0.2 && one.0.0 < 0.0);
    let left = right.min_by(|one, other| one.0.0.total_cmp(&other.0.0));
    left.map_or((0.0, 0.1), |one| (one.0.0, one.0.1 + 0.045))
}
