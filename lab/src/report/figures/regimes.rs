//! The regime map: coloured cells, bifurcations, and the theory's stable island.

use super::DETUNING;
use crate::cells::SIGMA;
use crate::numerics::bisection;
use crate::orbit::Periodic;
use crate::regime::Regime;
use crate::regime_map::{Axis, Map};
use crate::report::figure::{Figure, Panel, Place, Shape};
use crate::report::theme::BORDER;
use crate::scene::Dimensionless;

pub fn regimes(map: &Map) -> Figure {
    let Map { x, y, .. } = map;
    let range = |axis: &Axis| {
        let half = axis.step() / 2.0;
        (axis.from - half, axis.to + half)
    };
    let mut panel = Panel::new((range(x), label(x.name())), (range(y), label(y.name())));
    for regime in Regime::SIMULATED {
        // The number tells apart a regime of few cells, which a curve may hide.
        let name = match map.count(regime).0 {
            1 => format!("{}, 1 cell", regime.name()),
            cells => format!("{}, {cells} cells", regime.name()),
        };
        panel.add(Shape::Cells, stripes(map, regime), regime.name(), &name);
    }
    panel.add(Shape::Segments(2.2), outline(map), BORDER, "stable 1:1, theory");
    let place = place_on(map);
    for curve in &map.curves {
        // Solid where it bounds the stability of a motion.
        let motions = curve.branch.points.iter();
        let points = motions.map(|motion| (place(motion), motion.bounds_stability()));
        panel.branch(points, 2.2, curve.kind.name(), curve.kind.name());
    }
    let several = (0..).zip(&map.cells).filter(|(_, cell)| !cell.coexisting.is_empty());
    let dots = several.map(|(n, _)| (x.at(n % x.points), y.at(n / x.points)));
    panel.add(Shape::Dot(1.0), dots, BORDER, "several regimes");
    Figure::new("Regimes of the driven response", caption(map), vec![vec![panel]])
}

/// Where a motion lies on a map over sigma and G.
fn place_on(map: &Map) -> impl Fn(&Periodic) -> Place {
    let swapped = map.names()[1] == SIGMA;
    move |motion| match swapped {
        true => (motion.g, motion.sigma),
        false => (motion.sigma, motion.g),
    }
}

fn caption(map: &Map) -> String {
    let numbers = map.common.scene.dimensionless();
    let Dimensionless { epsilon, lambda, g, r, .. } = numbers;
    let sigma = map.common.sigma().map(|sigma| format!(", σ = {sigma:.4}"));
    let free = |name: &str| !map.names().contains(&name);
    let g = free("G").then(|| format!(", G = {g:.3}"));
    let r = free("r").then(|| format!(", r = {r}"));
    let held: String = [sigma, g, r].into_iter().flatten().collect();
    let dashed = match map.curves.is_empty() {
        true => "",
        false => "; dashed: of unstable motions",
    };
    format!(
        "ε = {epsilon:.5}, λ = {lambda:.3}{held}{dashed}\neach cell from the same start, followed until it repeats, at most {} periods",
        map.common.periods
    )
}

fn label(name: &str) -> &str {
    match name {
        SIGMA => DETUNING,
        "G" => "base amplitude G = E/(b ε)",
        "r" => "restitution coefficient r",
        key => key,
    }
}

/// The cells of a regime, with neighbours in a row merged.
fn stripes(map: &Map, regime: Regime) -> Vec<Place> {
    let Map { x, y, .. } = map;
    let mut corners = Vec::new();
    for (row, cells) in (0..).zip(map.cells.chunks(x.points as usize)) {
        let mut column = 0;
        for run in cells.chunk_by(|cell, next| cell.result.regime == next.result.regime) {
            if run[0].result.regime == regime {
                let left = x.at(column) - x.step() / 2.0;
                let right = x.at(column + run.len() as u64 - 1) + x.step() / 2.0;
                let low = y.at(row) - y.step() / 2.0;
                corners.extend([(left, low), (right, low + y.step())]);
            }
            column += run.len() as u64;
        }
    }
    corners
}

/// Parts of the map across, in each direction, in which the border of the theory's island is searched for.
const BORDER_PARTS: usize = 100;

/// The border of the region where first-order theory has a stable symmetric 1:1 motion, by marching squares: pairs of ends.
fn outline(map: &Map) -> Vec<Place> {
    let along = |axis: &Axis, n: usize| axis.from + (axis.to - axis.from) * n as f64 / BORDER_PARTS as f64;
    let place = |column: usize, row: usize| (along(&map.x, column), along(&map.y, row));
    let inside = |(x, y): Place| map.theory_stable(x, y);
    let corners: Vec<Vec<bool>> = (0..=BORDER_PARTS)
        .map(|row| (0..=BORDER_PARTS).map(|column| inside(place(column, row))).collect())
        .collect();
    let border = |(from, from_inside): (Place, bool), (to, _): (Place, bool)| {
        let at = |part: f64| (from.0 + part * (to.0 - from.0), from.1 + part * (to.1 - from.1));
        let (_, end) = bisection(0.0, 1.0, |part| inside(at(part)) == from_inside);
        at(end)
    };
    let mut segments = Vec::new();
    for (row, column) in (0..BORDER_PARTS).flat_map(|row| (0..BORDER_PARTS).map(move |column| (row, column))) {
        // The corners in turn, each with whether it is inside.
        let around = [(0, 0), (1, 0), (1, 1), (0, 1)]
            .map(|(dx, dy)| (place(column + dx, row + dy), corners[row + dy][column + dx]));
        let sides = (0..4).map(|n| (around[n], around[(n + 1) % 4]));
        let crossed = sides.filter(|(from, to)| from.1 != to.1);
        segments.extend(crossed.map(|(from, to)| border(from, to)));
    }
    segments
}
