//! The regime map as a picture: coloured cells, a letter on each region, and the theory's stable island.

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::chart::{Area, FONT, at, line, plane, px, svg_of};
use super::theme;
use crate::map::{Axis, Map, Range, outline};
use crate::regime::Regime;

/// Size of the picture, px, and how much of its width belongs to the axes; the legend stands beside them.
const SIZE: (u32, u32) = (980, 600);
const PLANE: u32 = 770;
/// Regions narrower than this many cells get no letter.
const NARROW: usize = 2;

/// Draws the map.
///
/// # Errors
/// What the drawing library refuses.
pub fn draw(map: &Map) -> Result<String, String> {
    let plan = &map.plan;
    let edges = |range: &Range| {
        let half = range.step() / 2.0;
        (range.from - half, range.to + half)
    };
    let held = [Axis::Sigma, Axis::G, Axis::R]
        .into_iter()
        .filter(|axis| plan.x.axis != *axis && plan.y.axis != *axis)
        .map(|axis| match axis {
            Axis::Sigma => format!(", σ = {:.4}", plan.sigma),
            Axis::G => format!(", G = {:.3}", plan.scene.g),
            Axis::R => format!(", r = {}", plan.scene.r),
        });
    let caption = format!(
        "ε = {:.5}, λ = {:.3}{}; each cell from the same start, {} periods after it",
        plan.scene.epsilon,
        plan.scene.lambda,
        held.collect::<String>(),
        plan.settle
    );
    let text = svg_of(SIZE, |area| {
        let (left, right) = area.split_horizontally(px(PLANE));
        let mut chart = plane(
            &left,
            Some(("Regimes of the driven response", &caption)),
            (edges(&plan.x), label(plan.x.axis)),
            (edges(&plan.y), label(plan.y.axis)),
        )?;
        for regime in Regime::SIMULATED {
            let colour = theme::regime(regime).filled();
            chart.draw_series(
                stripes(map, regime)
                    .into_iter()
                    .map(|corners| Rectangle::new(corners, colour)),
            )?;
        }
        let segments = outline(plan);
        for style in [line(WHITE, 50), line(BLACK, 22)] {
            chart.draw_series(
                segments
                    .iter()
                    .map(|pair| PathElement::new(pair.to_vec(), style)),
            )?;
        }
        let anchor = Pos::new(HPos::Center, VPos::Center);
        for (regime, place) in letters(map) {
            let ink = theme::on_regime(regime);
            let style = (FONT, px(17)).into_text_style(area).color(&ink).pos(anchor);
            chart.draw_series(std::iter::once(Text::new(letter(regime), place, style)))?;
        }
        legend(&right, map)
    })?;
    // Cells lie side by side without a seam.
    Ok(text.replace("<rect ", "<rect shape-rendering=\"crispEdges\" "))
}

/// Swatches, letters and names, from the top right.
fn legend(area: &Area, map: &Map) -> Result<(), Box<dyn std::error::Error>> {
    let mut y = at(80);
    let name = (FONT, px(15)).into_text_style(area);
    for regime in Regime::SIMULATED
        .into_iter()
        .filter(|one| map.count(*one).0 > 0)
    {
        let swatch = [(at(6), y), (at(36), y + at(18))];
        area.draw(&Rectangle::new(swatch, theme::regime(regime).filled()))?;
        area.draw(&Rectangle::new(swatch, line(BLACK, 10)))?;
        let anchor = Pos::new(HPos::Center, VPos::Center);
        let ink = theme::on_regime(regime);
        let style = (FONT, px(14)).into_text_style(area).color(&ink).pos(anchor);
        area.draw_text(letter(regime), &style, (at(21), y + at(9)))?;
        area.draw_text(regime.name(), &name, (at(46), y + at(2)))?;
        y += at(27);
    }
    area.draw(&PathElement::new(
        vec![(at(6), y + at(9)), (at(36), y + at(9))],
        line(BLACK, 22),
    ))?;
    area.draw_text("stable 1:1, theory", &name, (at(46), y + at(2)))?;
    Ok(())
}

fn label(axis: Axis) -> &'static str {
    match axis {
        Axis::Sigma => "detuning σ = (ω/ω₀ − 1)/ε",
        Axis::G => "base amplitude G = E/(b ε)",
        Axis::R => "restitution coefficient r",
    }
}

fn letter(regime: Regime) -> &'static str {
    match regime {
        Regime::NoImpacts => "O",
        Regime::Symmetric => "S",
        Regime::Asymmetric => "A",
        Regime::Several => "n",
        Regime::Modulated => "M",
        Regime::Chaotic => "C",
        Regime::Sticking => "K",
        Regime::Other | Regime::Unresolved | Regime::Unknown => "?",
    }
}

/// The cells of a regime, those side by side as one rectangle.
fn stripes(map: &Map, regime: Regime) -> Vec<[(f64, f64); 2]> {
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

/// For each regime the place deepest inside it.
fn letters(map: &Map) -> Vec<(Regime, (f64, f64))> {
    let (columns, rows) = (map.plan.x.points, map.plan.y.points);
    let at = |column: usize, row: usize| map.cells[row * columns + column].point.regime;
    // How far a square about the cell reaches before it meets another regime or the border.
    let depth = |column: usize, row: usize| {
        let most = column
            .min(row)
            .min(columns - 1 - column)
            .min(rows - 1 - row);
        let alike = |reach: usize| {
            (column - reach..=column + reach).all(|x| {
                at(x, row - reach) == at(column, row) && at(x, row + reach) == at(column, row)
            }) && (row - reach..=row + reach).all(|y| {
                at(column - reach, y) == at(column, row) && at(column + reach, y) == at(column, row)
            })
        };
        (1..=most).take_while(|reach| alike(*reach)).count()
    };
    Regime::SIMULATED
        .into_iter()
        .filter_map(|regime| {
            let cells = (0..rows).flat_map(|row| (0..columns).map(move |column| (column, row)));
            let (deepest, column, row) = cells
                .filter(|(column, row)| at(*column, *row) == regime)
                .map(|(column, row)| (depth(column, row), column, row))
                .max_by_key(|one| one.0)?;
            let place = (map.plan.x.at(column), map.plan.y.at(row));
            (deepest >= NARROW).then_some((regime, place))
        })
        .collect()
}
