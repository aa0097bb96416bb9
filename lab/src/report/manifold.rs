//! The slow invariant manifold with the decay on it: particle speed over amplitude.

use plotters::chart::SeriesLabelPosition;

use super::chart::{
    DECAY_LABEL, THINNED, caption, curve, decay_points, legend, line, locked_point, plane, svg,
};
use super::theme::{THEORY, UNSTABLE};
use crate::comparison::Comparison;
use crate::theory::{B_SYMMETRY_BREAKING, Manifold};

const POINTS: usize = 300;

pub(super) fn draw(found: &Comparison) -> Result<String, String> {
    let manifold = Manifold::new(found.parameters.r);
    let right = (1.25 * found.lock.c).max(0.8);
    let at = |b: f64| (manifold.c(b), b);
    let between = |from: f64, to: f64| {
        (0..=POINTS)
            .map(|n| at(from + (to - from) * n as f64 / POINTS as f64))
            .filter(|(c, _)| *c <= right)
            .collect::<Vec<_>>()
    };
    let top = 1.4;
    svg(|area| {
        let mut chart = plane(
            area,
            Some((
                "Slow invariant manifold and the free decay on it",
                &caption(&found.parameters, found.lock.g),
            )),
            ((0.0, right), "amplitude C of v, over b"),
            ((0.0, top), "particle speed B, over b ω₀"),
        )?;
        let stable = between(manifold.b_min(), B_SYMMETRY_BREAKING);
        let label = "manifold, 1:1 impacts stable";
        curve(&mut chart, stable, line(THEORY, 20), false, Some(label))?;
        let grey = line(UNSTABLE, 20);
        let label = "manifold, unstable";
        curve(
            &mut chart,
            between(0.0, manifold.b_min()),
            grey,
            true,
            Some(label),
        )?;
        curve(
            &mut chart,
            between(B_SYMMETRY_BREAKING, top),
            grey,
            true,
            None,
        )?;
        let decay = found
            .decay
            .iter()
            .map(|one| one.point)
            .step_by(THINNED)
            .filter_map(|point| point.b.map(|b| (point.c, b)));
        decay_points(&mut chart, decay.collect(), DECAY_LABEL)?;
        if let Some(b) = found.lock.b {
            locked_point(&mut chart, (found.lock.c, b))?;
        }
        legend(&mut chart, SeriesLabelPosition::UpperLeft)
    })
}
