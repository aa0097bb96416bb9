//! The regime map: coloured cells, a letter on each region, and the theory's stable island.

use super::WIDE;
use crate::numerics::bisection;
use crate::orbit::Periodic;
use crate::regime::Regime;
use crate::report::figure::{DETUNING, Figure, Legend, Panel, Place, SIZE, Shape};
use crate::report::theme::{BORDER, letter};
use crate::scene::Dimensionless;
use crate::sweep::{Grid, Map, SIGMA};

pub fn regimes(map: &Map) -> Figure {
    let (Map { x, y, .. }, [x_name, y_name]) = (map, map.names());
    let axis = |grid: &Grid, name| {
        let half = grid.step() / 2.0;
        ((grid.from - half, grid.to + half), label(name))
    };
    let mut panel = Panel::new(axis(x, x_name), axis(y, y_name))
        .at([0.0, 0.0, WIDE, SIZE.1])
        .heading("Regimes of the driven response", &caption(map))
        .legend(Legend::Beside(205.0));
    for regime in Regime::SIMULATED {
        let (letter, ink) = letter(regime);
        let shape = Shape::Cells(letter, ink);
        panel.add(shape, stripes(map, regime), regime.name(), regime.name());
    }
    panel.add(Shape::Border(2.2), outline(map), BORDER, "stable 1:1, theory");
    let place = place_on(map);
    for curve in &map.curves {
        // Solid where it bounds the stability of a motion.
        let motions = curve.branch.points.iter();
        let points = motions.map(|motion| (place(motion), motion.bounds_stability()));
        let name = curve.kind.name();
        panel.labelled_curve(points, 2.2, name, [name, name].map(String::from));
    }
    let several = (0..).zip(&map.cells).filter(|(_, cell)| !cell.coexisting.is_empty());
    let dots = several.map(|(n, _)| (x.at(n % x.points), y.at(n / x.points)));
    panel.add(Shape::Dot(1.0), dots, BORDER, "several regimes");
    for (regime, place) in letters(map) {
        let (letter, ink) = letter(regime);
        panel.add(Shape::Text(16.0), [place], ink, letter);
    }
    Figure(vec![panel])
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
    let numbers = map.sweep.scene().dimensionless();
    let Dimensionless { epsilon, lambda, g, r, .. } = numbers;
    let sigma = map.sweep.sigma().map(|sigma| format!(", σ = {sigma:.4}"));
    let free = |name: &str| !map.names().contains(&name);
    let g = free("G").then(|| format!(", G = {g:.3}"));
    let r = free("r").then(|| format!(", r = {r}"));
    let held: String = [sigma, g, r].into_iter().flatten().collect();
    let dashed = match map.curves.is_empty() {
        true => "",
        false => "; dashed: of unstable motions",
    };
    format!(
        "ε = {epsilon:.5}, λ = {lambda:.3}{held}\neach cell from the same start, followed until it repeats, at most {} periods{dashed}",
        map.sweep.settings().periods
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
    let (x, y) = (map.x, map.y);
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

/// For each regime, the places farthest from its border and from the curves, far apart from each other.
fn letters(map: &Map) -> Vec<(Regime, Place)> {
    let (columns, rows) = (map.x.points as usize, map.y.points as usize);
    let free = without_curves(map);
    // Largest half-width of a square around the cell that contains no other regime and no curve.
    let depth = |column: usize, row: usize| {
        let most = column.min(row).min(columns - 1 - column).min(rows - 1 - row);
        let own = free[row * columns + column];
        let alike = |reach: usize| {
            let lines = [row - reach, row + reach];
            (column - reach..=column + reach).all(|x| lines.iter().all(|y| free[y * columns + x] == own))
                && (row - reach..=row + reach)
                    .all(|y| free[y * columns + column - reach] == own && free[y * columns + column + reach] == own)
        };
        (1..=most).take_while(|reach| alike(*reach)).count()
    };
    let mut letters: Vec<(Regime, [usize; 2])> = Vec::new();
    for regime in Regime::SIMULATED {
        let own = (0..free.len()).filter(|n| free[*n] == Some(regime));
        let mut cells: Vec<(usize, [usize; 2])> = own
            .map(|n| [n % columns, n / columns])
            .map(|[column, row]| (depth(column, row), [column, row]))
            .collect();
        cells.sort_by_key(|cell| std::cmp::Reverse(cell.0));
        // A region in which no square of three by three cells fits gets no letter.
        let enough = cells.first().map_or(0, |deepest| deepest.0 / 2).max(1);
        for (_, place) in cells.into_iter().take_while(|cell| cell.0 >= enough) {
            let far = |(occupied, [x, y]): &(Regime, [usize; 2])| {
                *occupied != regime || x.abs_diff(place[0]) > columns / 3 || y.abs_diff(place[1]) > rows / 3
            };
            if letters.iter().all(far) {
                letters.push((regime, place));
            }
        }
    }
    let place = |[column, row]: [usize; 2]| (map.x.at(column as u64), map.y.at(row as u64));
    let letters = letters.into_iter().map(|(regime, cell)| (regime, place(cell)));
    letters.collect()
}

/// The regimes of the cells, except where a curve passes.
fn without_curves(map: &Map) -> Vec<Option<Regime>> {
    let mut free: Vec<Option<Regime>> = map.cells.iter().map(|cell| Some(cell.result.regime)).collect();
    let motions = map.curves.iter().flat_map(|curve| &curve.branch.points);
    let bifurcations = motions.map(place_on(map));
    let (x, y) = (map.x, map.y);
    let index = |grid: Grid, value: f64| {
        let n = ((value - grid.from) / grid.step()).round();
        (n >= 0.0 && n < grid.points as f64).then_some(n as usize)
    };
    for place in bifurcations.chain(outline(map)) {
        if let (Some(column), Some(row)) = (index(x, place.0), index(y, place.1)) {
            free[row * x.points as usize + column] = None;
        }
    }
    free
}

/// Parts of the map across, in each direction, in which the border of the theory's island is searched for.
const PARTS: usize = 100;

/// The border of the region where first-order theory has a stable symmetric 1:1 motion, by marching squares: pairs of ends.
fn outline(map: &Map) -> Vec<Place> {
    let along = |grid: Grid, n: usize| grid.from + (grid.to - grid.from) * n as f64 / PARTS as f64;
    let place = |column: usize, row: usize| (along(map.x, column), along(map.y, row));
    let inside = |(x, y): Place| map.theory_stable(x, y);
    let corners: Vec<Vec<bool>> = (0..=PARTS)
        .map(|row| (0..=PARTS).map(|column| inside(place(column, row))).collect())
        .collect();
    let border = |(from, from_inside): (Place, bool), (to, _): (Place, bool)| {
        let at = |part: f64| (from.0 + part * (to.0 - from.0), from.1 + part * (to.1 - from.1));
        let (_, end) = bisection(0.0, 1.0, |part| inside(at(part)) == from_inside);
        at(end)
    };
    let mut segments = Vec::new();
    for (row, column) in (0..PARTS).flat_map(|row| (0..PARTS).map(move |column| (row, column))) {
        // The corners in turn, each with whether it is inside.
        let around = [(0, 0), (1, 0), (1, 1), (0, 1)]
            .map(|(dx, dy)| (place(column + dx, row + dy), corners[row + dy][column + dx]));
        let sides = (0..4).map(|n| (around[n], around[(n + 1) % 4]));
        let crossed = sides.filter(|(from, to)| from.1 != to.1);
        segments.extend(crossed.map(|(from, to)| border(from, to)));
    }
    segments
}
