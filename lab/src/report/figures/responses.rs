//! Frequency responses at several excitations, exact and first-order, with the backbone near their maxima.

use crate::orbit::{Branch, FrequencyResponse};
use crate::report::figure::{
    BLACK, DETUNING, Figure, Legend, Marked, Panel, Place, amplitude, clipped, line, rig, thinned,
};
use crate::report::theme::{EXACT, FAINT, THEORY, UNSTABLE};
use crate::scene::Dimensionless;
use crate::theory::{self, B_SYMMETRY_BREAKING, ResponsePoint, SlowFlow};

const POINTS: usize = 600;
const DETUNINGS: (f64, f64) = (-5.0, 5.0);

/// The exact responses and, for the same G, those of theory.
pub fn figure(p: &Dimensionless, responses: &[FrequencyResponse]) -> Figure {
    let flow = SlowFlow::new(p.lambda, p.r);
    let top = responses
        .iter()
        .flat_map(FrequencyResponse::symmetric)
        .flat_map(|one| &one.points)
        .filter(|one| one.b > flow.manifold.b_min())
        .fold(0.6, |most: f64, one| most.max(1.08 * one.c));
    let (x, y) = (DETUNINGS, (0.0, top));
    let list: Vec<String> = responses.iter().map(|one| format!("{:.3}", one.g)).collect();
    let caption = format!("{}; G = {}; amplitudes over b", rig(p), list.join(", "));
    let mut panel = Panel::new((x, DETUNING), (y, amplitude(p)))
        .heading("Frequency responses and backbone", &caption)
        .legend(Legend::UpperRight);
    for response in responses {
        add_response(&mut panel, p, response, (x, y));
        // The label is beside the left end of the curve, or above its end at the axis.
        let stable = response
            .symmetric()
            .flat_map(|one| &one.points)
            .filter(|one| one.stable);
        let end = stable.min_by(|one, other| one.sigma.total_cmp(&other.sigma));
        if let Some(end) = end {
            let place = match end.sigma > x.0 + 0.9 {
                true => (end.sigma - 0.45, end.c),
                false => (end.sigma.max(x.0) + 0.5, end.c + 0.14 * top),
            };
            panel.centred_text(format!("G = {:.3}", response.g), place, 14, BLACK);
        }
    }
    let backbone: Vec<Marked> = theory::backbone(p, flow.manifold.b_min(), 1.4 * B_SYMMETRY_BREAKING, POINTS)
        .iter()
        .map(|one| ((one.sigma, one.c), true))
        .collect();
    for piece in clipped(&backbone, x, y) {
        panel.pieces(&piece, [line(BLACK, 24); 2], ["backbone, theory", ""]);
    }
    Figure::single(panel)
}

/// One response, by theory and exact.
fn add_response(panel: &mut Panel, p: &Dimensionless, response: &FrequencyResponse, (x, y): (Place, Place)) {
    let styles = [line(THEORY, 12), line(UNSTABLE, 8)];
    for curve in SlowFlow::new(p.lambda, p.r).frequency_responses(response.g, POINTS) {
        let mark = |one: &ResponsePoint| {
            let stable = one.motion.impacts_stable && one.motion.slow_flow_stable;
            let c = one.motion.c * theory::reading(p, one.motion.b, one.sigma);
            ((one.sigma, c), stable)
        };
        let points: Vec<Marked> = curve.iter().map(mark).collect();
        for piece in clipped(&points, x, y) {
            let labels = ["theory, stable", "theory, unstable"];
            panel.pieces(&thinned(&piece, x, y), styles, labels);
        }
    }
    let styles = [line(EXACT, 30), line(FAINT, 14)];
    for branch in response.components.iter().map(|one| &one.branch) {
        for piece in clipped(&marked(branch), x, y) {
            let labels = ["exact, stable", "exact, unstable"];
            panel.pieces(&thinned(&piece, x, y), styles, labels);
        }
    }
}

fn marked(branch: &Branch) -> Vec<Marked> {
    let points = branch.points.iter();
    points.map(|one| ((one.sigma, one.c), one.stable)).collect()
}
