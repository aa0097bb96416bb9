//! The slow invariant manifold with the decay on it: particle speed over amplitude.

use super::{DECAY_LABEL, THINNED, decay_points, locked_point};
use crate::comparison::Comparison;
use crate::numerics::equally_spaced;
use crate::report::figure::{Figure, Legend, Panel, Place, SPEED, amplitude, caption, line};
use crate::report::theme::{THEORY, UNSTABLE};
use crate::theory::{B_SYMMETRY_BREAKING, SlowFlow, reading};

const POINTS: usize = 300;
const TOP: f64 = 1.4;

pub fn figure(found: &Comparison) -> Figure {
    let p = &found.parameters;
    let flow = SlowFlow::new(p.lambda, p.r);
    let manifold = flow.manifold;
    let right = (1.25 * found.lock.at.c).max(0.8);
    let between = |from: f64, to: f64| -> Vec<Place> {
        equally_spaced(from, to, POINTS + 1)
            .map(|b| (manifold.c(b) * reading(p, b, flow.free_detuning(b)), b))
            .filter(|(c, _)| *c <= right)
            .collect()
    };
    let mut panel = Panel::new(((0.0, right), amplitude(p)), ((0.0, TOP), SPEED))
        .heading(
            "Slow invariant manifold and the free decay on it",
            &caption(&found.parameters, found.lock.at.g),
        )
        .legend(Legend::UpperLeft);
    let stable = between(manifold.b_min(), B_SYMMETRY_BREAKING);
    panel.curve(stable, line(THEORY, 20), "manifold, 1:1 impacts stable");
    for unstable in [between(0.0, manifold.b_min()), between(B_SYMMETRY_BREAKING, TOP)] {
        panel.dashed(unstable, line(UNSTABLE, 20), "manifold, unstable");
    }
    let decay = found.decay.iter().map(|one| one.point).step_by(THINNED);
    let decay = decay.filter_map(|point| point.b.map(|b| (point.c, b)));
    decay_points(&mut panel, decay, DECAY_LABEL);
    if let Some(b) = found.lock.b {
        locked_point(&mut panel, (found.lock.at.c, b));
    }
    Figure::single(panel)
}
