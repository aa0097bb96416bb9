//! The tracked backbone: the points held with the loop closed, on the exact curve and that of theory.

use plotters::chart::SeriesLabelPosition;
use plotters::prelude::*;

use super::backbone::backbones;
use super::chart::{at, caption, decay_points, legend, line, plane, px, svg};
use super::theme::DECAY;
use crate::backbone::Point;
use crate::comparison::TrackedComparison;

/// Draws it; points that are not settled are crossed.
pub fn draw(tracked: &TrackedComparison) -> Result<String, String> {
    let p = &tracked.parameters;
    let points = || tracked.points.iter().map(|one| one.point);
    let top = points().fold(0.5, |most: f64, one| most.max(1.15 * one.c));
    let (low, high) = points().fold((-1.6f64, 0.6f64), |(low, high), one| {
        (low.min(one.sigma), high.max(one.sigma))
    });
    let x = (low - 0.1 * (high - low), high + 0.1 * (high - low));
    let g = points().map(|one| one.g);
    let (least, most) = g.fold((f64::MAX, f64::MIN), |(least, most), g| {
        (least.min(g), most.max(g))
    });
    let text = caption(p, most);
    let text = text.replace(
        &format!("G = {most:.3}"),
        &format!("G from {least:.3} to {most:.3}"),
    );
    svg(|area| {
        let mut chart = plane(
            area,
            Some(("Backbone, tracked with the loop closed", &text)),
            (x, "detuning σ = (ω/ω₀ − 1)/ε"),
            ((0.0, top), "amplitude C of v, over b"),
        )?;
        backbones(&mut chart, p, x, (0.0, top))?;
        let place = |one: Point| (one.sigma, one.c);
        decay_points(&mut chart, points().map(place).collect(), "tracked")?;
        let rough: Vec<(f64, f64)> = points().filter(|one| !one.settled).map(place).collect();
        if !rough.is_empty() {
            let style = line(DECAY, 20);
            chart
                .draw_series(
                    rough
                        .into_iter()
                        .map(|place| Cross::new(place, px(6), style)),
                )?
                .label("not settled in time")
                .legend(move |(x, y)| Cross::new((x + at(15), y), px(6), style));
        }
        legend(&mut chart, SeriesLabelPosition::UpperRight)
    })
}
