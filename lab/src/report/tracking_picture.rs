//! The tracked points with the exact backbone and theory: amplitude over detuning, and the drive over amplitude.

use plotters::chart::SeriesLabelPosition;
use plotters::coord::Shift;
use plotters::prelude::*;

use crate::comparison::TrackedComparison;
use crate::identification::Regime;
use crate::orbit::Orbit;
use crate::theory::{BackbonePoint, SlowFlow};

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Failed = Box<dyn std::error::Error>;

/// Size of the picture, px; drawn finer, since plotters rounds to whole units.
const SIZE: (u32, u32) = (1160, 560);
const FINE: u32 = 8;
const THEORY: RGBColor = RGBColor(120, 120, 120);
const EXACT: RGBColor = RGBColor(0, 114, 178);
const POINT: RGBColor = RGBColor(213, 94, 0);
const FONT: &str = "Helvetica, Arial, sans-serif";
/// Neighbouring orbits of the curve that are drawn lie this far apart, in C, sigma and G together.
const APART: f64 = 0.004;

const fn px(px: u32) -> u32 {
    px * FINE
}

/// One of the two planes: what is drawn over what.
struct Plane {
    x: &'static str,
    y: &'static str,
    of: fn([f64; 3]) -> (f64, f64),
    legend: Option<SeriesLabelPosition>,
}

const PLANES: [Plane; 2] = [
    Plane {
        x: "detuning σ = (ω/ω₀ − 1)/ε",
        y: "amplitude C of v, over b",
        of: |[c, sigma, _]| (sigma, c),
        legend: None,
    },
    Plane {
        x: "amplitude C of v, over b",
        y: "drive G, base amplitude over b ε",
        of: |[c, _, g]| (c, g),
        legend: Some(SeriesLabelPosition::UpperLeft),
    },
];

/// The picture as SVG; plotters reports its own errors.
pub(super) fn draw(report: &TrackedComparison) -> Result<String, String> {
    let mut text = String::new();
    {
        let area = SVGBackend::with_string(&mut text, (px(SIZE.0), px(SIZE.1))).into_drawing_area();
        draw_on(&area, report).map_err(|error| error.to_string())?;
        area.present().map_err(|error| error.to_string())?;
    }
    // The drawing keeps its units (the viewBox); the picture has its size.
    let drawn = format!("width=\"{}\" height=\"{}\"", px(SIZE.0), px(SIZE.1));
    let shown = format!("width=\"{}\" height=\"{}\"", SIZE.0, SIZE.1);
    Ok(text.replacen(&drawn, &shown, 1))
}

fn draw_on(area: &Area, report: &TrackedComparison) -> Result<(), Failed> {
    area.fill(&WHITE)?;
    let p = &report.parameters;
    let title = "Backbone, tracked with the response held";
    let at = |x: u32, y: u32| (px(x) as i32, px(y) as i32);
    area.draw_text(title, &(FONT, px(22)).into_text_style(area), at(70, 14))?;
    let caption = format!(
        "ε = {:.5}, λ = {:.3}, r = {}; {} points, {:.1} periods each",
        p.epsilon,
        p.lambda,
        p.r,
        report.points.len(),
        report.periods_per_point()
    );
    let grey = BLACK.mix(0.7);
    let small = (FONT, px(14)).into_text_style(area).color(&grey);
    area.draw_text(&caption, &small, at(70, 42))?;
    let (_, below) = area.split_vertically(px(60));
    let (left, right) = below.split_horizontally(px(SIZE.0 / 2));
    plane(&left, report, &PLANES[0])?;
    plane(&right, report, &PLANES[1])
}

fn plane(area: &Area, report: &TrackedComparison, plane: &Plane) -> Result<(), Failed> {
    let p = &report.parameters;
    let points: Vec<[f64; 3]> = report
        .points
        .iter()
        .map(|one| [one.point.c, one.point.sigma, one.point.g])
        .collect();
    let top = 1.1 * points.iter().map(|point| point[0]).fold(0.0, f64::max);
    let flow = SlowFlow::new(p.lambda, p.r);
    let theory: Vec<[f64; 3]> = flow
        .backbone(flow.manifold.b_min(), 1.3, 600)
        .iter()
        .map(|point: &BackbonePoint| [point.c, point.sigma, point.g])
        .filter(|point| point[0] <= top)
        .collect();
    let mut exact: Vec<[f64; 3]> = Vec::new();
    for orbit in report.exact.orbits() {
        let next = of(orbit);
        let apart = |last: &[f64; 3]| (0..3).map(|i| (next[i] - last[i]).abs()).sum::<f64>();
        if next[0] <= top && exact.last().is_none_or(|last| apart(last) >= APART) {
            exact.push(next);
        }
    }
    let everything = || {
        points
            .iter()
            .chain(&theory)
            .chain(&exact)
            .map(|at| (plane.of)(*at))
    };
    let range = |value: fn((f64, f64)) -> f64| {
        let (low, high) = everything()
            .map(value)
            .fold((f64::MAX, f64::MIN), |(low, high), x| {
                (low.min(x), high.max(x))
            });
        let margin = 0.05 * (high - low).max(1e-6);
        low - margin..high + margin
    };
    let mut chart = ChartBuilder::on(area)
        .margin(px(10))
        .margin_right(px(20))
        .x_label_area_size(px(50))
        .y_label_area_size(px(60))
        .build_cartesian_2d(range(|at| at.0), range(|at| at.1))?;
    chart
        .configure_mesh()
        .x_desc(plane.x)
        .y_desc(plane.y)
        .axis_desc_style((FONT, px(16)))
        .label_style((FONT, px(13)))
        .light_line_style(WHITE)
        .bold_line_style(BLACK.mix(0.10).stroke_width(px(1)))
        .axis_style(BLACK.stroke_width(px(1)))
        .set_all_tick_mark_size(px(4))
        .x_labels(7)
        .y_labels(8)
        .draw()?;
    let key = |style: ShapeStyle| {
        move |(x, y): (i32, i32)| PathElement::new(vec![(x, y), (x + px(31) as i32, y)], style)
    };
    let dashes = THEORY.stroke_width(px(2));
    chart
        .draw_series(DashedLineSeries::new(
            theory.into_iter().map(plane.of),
            px(7),
            px(5),
            dashes,
        ))?
        .label("first-order theory")
        .legend(move |place| {
            let piece = |from: u32| {
                let ends = [from, from + 7].map(|x| (px(x) as i32, 0));
                PathElement::new(ends.to_vec(), dashes)
            };
            EmptyElement::at(place) + piece(0) + piece(12) + piece(24)
        });
    let solid = EXACT.stroke_width(px(2));
    chart
        .draw_series(LineSeries::new(exact.into_iter().map(plane.of), solid))?
        .label("exact orbits")
        .legend(key(solid));
    // Filled where the response says symmetric 1:1 or cannot tell, hollow elsewhere.
    let mark = |filled: bool| {
        if filled {
            POINT.filled()
        } else {
            POINT.stroke_width(px(2))
        }
    };
    let marks = report.points.iter().zip(&points).map(|(one, at)| {
        let filled = matches!(one.point.regime, Regime::Symmetric | Regime::Unresolved);
        Circle::new((plane.of)(*at), px(4), mark(filled))
    });
    chart
        .draw_series(marks)?
        .label("tracked (hollow: another regime)")
        .legend(move |(x, y)| Circle::new((x + px(15) as i32, y), px(4), mark(true)));
    if let Some(position) = &plane.legend {
        chart
            .configure_series_labels()
            .position(position.clone())
            .margin(px(12))
            .legend_area_size(px(40))
            .label_font((FONT, px(14)))
            .background_style(WHITE.mix(0.9))
            .border_style(BLACK.mix(0.3).stroke_width(px(1)))
            .draw()?;
    }
    Ok(())
}

fn of(orbit: &Orbit) -> [f64; 3] {
    [orbit.c, orbit.sigma, orbit.g]
}
