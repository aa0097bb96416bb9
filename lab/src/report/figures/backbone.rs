//! The backbone with the decay on it: amplitude over detuning.

use super::{DECAY_LABEL, THINNED, decay_points, error_bars, locked_point};
use crate::comparison::Comparison;
use crate::numerics::range;
use crate::orbit::{self, ContinuationLimits};
use crate::report::figure::{DETUNING, Figure, Legend, Marked, Panel, amplitude, caption, clipped, line, thinned};
use crate::report::theme::{EXACT, FAINT, LOCK, THEORY, UNSTABLE};
use crate::scene::{Definition, Dimensionless};
use crate::theory::{self, BranchSide, SlowFlow};

/// Amplitude drawn up to at least this, C.
const TOP: f64 = 0.8;

/// The identified backbone beside theory and exact orbits.
pub fn figure(found: &Comparison) -> Figure {
    let p = &found.parameters;
    let slow_flow = SlowFlow::new(p.lambda, p.r);
    let top = (1.25 * found.lock.at.c).max(TOP);
    let reach = slow_flow.manifold.b(top, BranchSide::Right).unwrap_or(1.0);
    let theory = theory::backbone(p, slow_flow.manifold.b_min(), reach, 400);
    // Below the fold there is no backbone, and the frequency of the remaining motion is arbitrary.
    let fold = slow_flow.manifold.c_min();
    let decay = || found.decay.iter().map(|one| one.point);
    let sigmas = theory.iter().map(|point| point.sigma);
    let sigmas = sigmas.chain(decay().filter(|point| point.c >= fold).map(|point| point.sigma));
    let (low, high) = range((f64::MAX, f64::MIN), sigmas);
    let margin = 0.06 * (high - low);
    let (low, high) = (low - margin, high + margin);

    let title = match p.definition == Definition::default() {
        true => "Backbone: phase resonance of the centre of mass".into(),
        false => format!("Backbone: {}", p.definition.name()),
    };
    let mut panel = Panel::new(((low, high), DETUNING), ((0.0, top), amplitude(p)))
        .heading(&title, &caption(p, found.lock.at.g))
        .legend(Legend::UpperRight);
    add_backbones(&mut panel, p, (low, high), (0.0, top));
    let drawn = decay().step_by(THINNED);
    let places = drawn.clone().map(|point| (point.sigma, point.c));
    let inside = places.filter(|(sigma, _)| (low..=high).contains(sigma));
    decay_points(&mut panel, inside, DECAY_LABEL);
    let predicted = found
        .decay
        .iter()
        .filter_map(|one| Some((one.sigma_predicted?, one.point.c)));
    let predicted: Vec<_> = predicted
        .filter(|(sigma, c)| (low..=high).contains(sigma) && *c > fold)
        .collect();
    panel.curve(predicted, line(LOCK, 12), "free decay, predicted by the exact plant");
    let place = (found.lock.at.sigma, found.lock.at.c);
    for (u, upright) in [(found.lock.at.u_sigma, false), (found.lock.at.u_c, true)] {
        error_bars(&mut panel, std::iter::once((place, 1.96 * u)), upright);
    }
    locked_point(&mut panel, place);
    Figure::single(panel)
}

/// The right branch of the backbone, by theory and exact, each with its stability, as far as it lies in the ranges.
pub fn add_backbones(panel: &mut Panel, p: &Dimensionless, x: (f64, f64), y: (f64, f64)) {
    let flow = SlowFlow::new(p.lambda, p.r);
    let fold = flow.manifold.b_min();
    let reach = flow.manifold.b(y.1, BranchSide::Right).unwrap_or(1.0);
    let theory: Vec<Marked> = theory::backbone(p, fold, reach, 400)
        .iter()
        .map(|point| ((point.sigma, point.c), point.stable()))
        .collect();
    let exact: Vec<Marked> = orbit::backbone(p, &ContinuationLimits::default())
        .map(|branch| branch.points)
        .unwrap_or_default()
        .iter()
        .filter(|motion| motion.b >= fold)
        .map(|motion| ((motion.sigma, motion.c), motion.stable))
        .collect();
    let labels = ["first-order theory, stable", "first-order theory, unstable"];
    for piece in clipped(&theory, x, y) {
        panel.pieces(&piece, [line(THEORY, 20), line(UNSTABLE, 20)], labels);
    }
    let labels = ["exact orbits, stable", "exact orbits, unstable"];
    for piece in clipped(&exact, x, y) {
        let styles = [line(EXACT, 16), line(FAINT, 16)];
        panel.pieces(&thinned(&piece, x, y), styles, labels);
    }
}
