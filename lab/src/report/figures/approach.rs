//! The approach to the slow invariant manifold, and the motion along it: the modulation of first-order theory, impact by impact.

use crate::numerics::equally_spaced;
use crate::report::figure::{AMPLITUDE_OF_V, Color, Figure, Legend, Marked, Panel, Place, SPEED, caption, line};
use crate::report::theme::{DECAY, EXACT, LOCK, THEORY, UNSTABLE};
use crate::scene::Dimensionless;
use crate::theory::{BackbonePoint, SlowFlow, impacts_stable};

/// Starts off the manifold: C and B in parts of those at the locked point.
const STARTS: [(f64, f64); 4] = [(1.35, 0.93), (0.65, 1.07), (0.75, 0.8), (1.2, 1.14)];
/// Most impacts followed.
const IMPACTS: usize = 400;
const POINTS: usize = 300;

/// Impact sequences with the drive on, which end at the locked point, and one without it, from there down to the fold.
pub fn figure(p: &Dimensionless, lock: &BackbonePoint) -> Figure {
    let flow = SlowFlow::new(p.lambda, p.r);
    let lock = &flow.backbone_at(lock.b);
    let gamma = -std::f64::consts::FRAC_PI_2;
    let x = (0.0, 1.6 * lock.c);
    // The legend is above the manifold.
    let y = (0.0, 1.75 * lock.b);
    let inside = |place: &Place| place.0 <= x.1 && (y.0..=y.1).contains(&place.1);
    let sequence = |g: f64, (c, b): Place| -> Vec<Place> {
        let phases = (b, flow.psi(lock.b, gamma));
        let impacts = flow.modulation(p.epsilon, (g, lock.sigma), (c, gamma), phases);
        let places = impacts.take(IMPACTS).map(|one| (one.c, one.b));
        let all = std::iter::once((c, b)).chain(places);
        all.take_while(inside).collect()
    };
    let mut panel = Panel::new((x, AMPLITUDE_OF_V), (y, SPEED))
        .heading(
            "Approach to the slow invariant manifold, impact by impact",
            &caption(p, lock.g),
        )
        .legend(Legend::UpperLeft);
    let manifold: Vec<Marked> = equally_spaced(0.0, y.1, POINTS + 1)
        .map(|b| ((flow.manifold.c(b), b), impacts_stable(&flow.manifold, b)))
        .filter(|(place, _)| inside(place))
        .collect();
    panel.pieces(
        &manifold,
        [line(THEORY, 30), line(UNSTABLE, 20)],
        ["manifold, 1:1 impacts stable", "manifold, unstable"],
    );
    let driven = "driven at phase resonance, from off the manifold";
    for (c, b) in STARTS {
        let places = sequence(lock.g, (c * lock.c, b * lock.b));
        panel.curve(places.clone(), line(EXACT, 6), "");
        panel.circles(places, 3, EXACT.filled(), driven);
    }
    panel.circles(
        sequence(0.0, (lock.c, lock.b)),
        4,
        line(DECAY, 16),
        "without drive, until synchrony is lost",
    );
    panel.square((lock.c, lock.b), LOCK, "phase resonance");
    Figure::single(panel)
}
