//! The regime map: coloured cells, a letter on each region, and the theory's stable island.

use crate::map::{Axis, Map, Range, outline};
use crate::orbit::{BifurcationCurve, Periodic};
use crate::regime::Regime;
use crate::report::figure::{
    BLACK, Color, DETUNING, Figure, FigureError, Mark, Marked, Panel, Place, WHITE, clipped, line, thinned,
};
use crate::report::theme;

/// Size of the figure, px, and how much of its width belongs to the axes; the key stands beside them.
const SIZE: (u32, u32) = (980, 600);
const WIDTH: u32 = 770;
/// Regions in which no square of 2 n + 1 cells fits, with this n, get no letter.
const NARROW: usize = 1;

pub fn svg(map: &Map) -> Result<String, FigureError> {
    // Cells lie side by side without a seam.
    let text = figure(map).svg()?;
    Ok(text.replace("<rect ", "<rect shape-rendering=\"crispEdges\" "))
}

fn figure(map: &Map) -> Figure {
    let plan = &map.plan;
    let axis = |range: &Range| {
        let half = range.step() / 2.0;
        ((range.from - half, range.to + half), label(range.axis))
    };
    let mut panel = Panel::new(axis(&plan.x), axis(&plan.y))
        .at([0, 0, WIDTH, SIZE.1])
        .heading("Regimes of the driven response", &caption(map));
    for regime in Regime::SIMULATED {
        panel.rectangles(stripes(map, regime), theme::regime(regime).0);
    }
    let segments = outline(plan);
    panel.segments(segments.clone(), line(WHITE, 50));
    panel.segments(segments, line(BLACK, 22));
    for curve in &map.curves {
        draw_curve(&mut panel, map, curve);
    }
    let cells = map.cells.iter().enumerate();
    let several = cells.filter(|(_, cell)| !cell.coexisting.is_empty());
    let dots: Vec<Place> = several
        .map(|(n, _)| (plan.x.at(n % plan.x.points), plan.y.at(n / plan.x.points)))
        .collect();
    let dotted = !dots.is_empty();
    panel.circles(dots, 1, BLACK.filled(), "");
    for (regime, place) in letters(map) {
        let (_, letter, ink) = theme::regime(regime);
        panel.centred_text(letter.into(), place, 17, ink);
    }
    Figure::new(SIZE, vec![panel]).with_key(key(map, dotted))
}

fn key(map: &Map, dotted: bool) -> Vec<(&'static str, Mark)> {
    let shown = Regime::SIMULATED.into_iter().filter(|one| map.count(*one).0 > 0);
    let mut key: Vec<_> = shown
        .map(|one| (one.name(), Mark::Swatch(theme::regime(one))))
        .collect();
    key.push(("stable 1:1, theory", Mark::Line(BLACK)));
    let drawn = |kind| map.curves.iter().any(|curve| curve.kind == kind);
    let curves = theme::BIFURCATIONS.into_iter().filter(|(kind, _)| drawn(*kind));
    key.extend(curves.map(|(kind, colour)| (kind.name(), Mark::Line(colour))));
    if dotted {
        key.push(("several regimes", Mark::Dot));
    }
    key
}

/// Where a motion lies on a map over sigma and G.
fn place_on(map: &Map) -> impl Fn(&Periodic) -> Place {
    let swapped = map.plan.x.axis == Axis::G;
    move |one| {
        if swapped {
            (one.g, one.sigma)
        } else {
            (one.sigma, one.g)
        }
    }
}

/// A bifurcation curve, solid where it bounds the stability of a motion.
fn draw_curve(panel: &mut Panel, map: &Map, curve: &BifurcationCurve) {
    let place = place_on(map);
    let points: Vec<Marked> = curve
        .branch
        .points
        .iter()
        .map(|one| (place(one), one.bounds_stability()))
        .collect();
    let (x, y) = (map.plan.x, map.plan.y);
    let mut colours = theme::BIFURCATIONS.into_iter();
    let colour = colours
        .find(|(kind, _)| *kind == curve.kind)
        .map_or(BLACK, |(_, colour)| colour);
    for piece in clipped(&points, (x.from, x.to), (y.from, y.to)) {
        panel.curve(piece.iter().map(|one| one.0).collect(), line(WHITE, 36), "");
        panel.pieces(
            &thinned(&piece, (x.from, x.to), (y.from, y.to)),
            [line(colour, 22), line(colour, 12)],
            ["", ""],
        );
    }
}

fn caption(map: &Map) -> String {
    let plan = &map.plan;
    let held = [Axis::Sigma, Axis::G, Axis::R]
        .into_iter()
        .filter(|axis| plan.x.axis != *axis && plan.y.axis != *axis)
        .map(|axis| match axis {
            Axis::Sigma => format!(", σ = {:.4}", plan.sigma),
            Axis::G => format!(", G = {:.3}", plan.scene.g),
            Axis::R => format!(", r = {}", plan.scene.r),
        });
    let dashed = if map.curves.is_empty() {
        ""
    } else {
        "; dashed: of unstable motions"
    };
    format!(
        "ε = {:.5}, λ = {:.3}{}; each cell from the same start, followed until it repeats, at most {} periods{dashed}",
        plan.scene.epsilon,
        plan.scene.lambda,
        held.collect::<String>(),
        plan.limit
    )
}

fn label(axis: Axis) -> &'static str {
    match axis {
        Axis::Sigma => DETUNING,
        Axis::G => "base amplitude G = E/(b ε)",
        Axis::R => "restitution coefficient r",
    }
}

/// The cells of a regime, with neighbours in a row merged.
fn stripes(map: &Map, regime: Regime) -> Vec<[Place; 2]> {
    let (x, y) = (map.plan.x, map.plan.y);
    let mut found = Vec::new();
    for (row, cells) in map.cells.chunks(x.points).enumerate() {
        let mut column = 0;
        for run in cells.chunk_by(|one, other| one.point.regime == other.point.regime) {
            if run[0].point.regime == regime {
                let left = x.at(column) - x.step() / 2.0;
                let right = x.at(column + run.len() - 1) + x.step() / 2.0;
                let low = y.at(row) - y.step() / 2.0;
                found.push([(left, low), (right, low + y.step())]);
            }
            column += run.len();
        }
    }
    found
}

/// For each regime, the places farthest from its border and from the curves, far apart from each other.
fn letters(map: &Map) -> Vec<(Regime, Place)> {
    let (columns, rows) = (map.plan.x.points, map.plan.y.points);
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
    let mut found: Vec<(Regime, [usize; 2])> = Vec::new();
    for regime in Regime::SIMULATED {
        let own = (0..free.len()).filter(|n| free[*n] == Some(regime));
        let mut cells: Vec<(usize, [usize; 2])> = own
            .map(|n| [n % columns, n / columns])
            .map(|[column, row]| (depth(column, row), [column, row]))
            .collect();
        cells.sort_by_key(|one| std::cmp::Reverse(one.0));
        let enough = cells.first().map_or(0, |deepest| deepest.0 / 2).max(NARROW);
        for (_, place) in cells.into_iter().take_while(|one| one.0 >= enough) {
            let far = |(other, [x, y]): &(Regime, [usize; 2])| {
                *other != regime || x.abs_diff(place[0]) > columns / 3 || y.abs_diff(place[1]) > rows / 3
            };
            if found.iter().all(far) {
                found.push((regime, place));
            }
        }
    }
    let place = |[column, row]: [usize; 2]| (map.plan.x.at(column), map.plan.y.at(row));
    found.into_iter().map(|(regime, cell)| (regime, place(cell))).collect()
}

/// The regimes of the cells, except where a curve passes.
fn without_curves(map: &Map) -> Vec<Option<Regime>> {
    let mut free: Vec<Option<Regime>> = map.cells.iter().map(|cell| Some(cell.point.regime)).collect();
    let bifurcations = map.curves.iter().flat_map(|curve| {
        let place = place_on(map);
        curve.branch.points.iter().map(place)
    });
    let (x, y) = (map.plan.x, map.plan.y);
    let index = |range: Range, value: f64| {
        let n = ((value - range.from) / range.step()).round();
        (n >= 0.0 && n < range.points as f64).then_some(n as usize)
    };
    for place in bifurcations.chain(outline(&map.plan).into_iter().flatten()) {
        if let (Some(column), Some(row)) = (index(x, place.0), index(y, place.1)) {
            free[row * x.points + column] = None;
        }
    }
    free
}
