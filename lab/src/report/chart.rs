//! What both pictures share: size, colours, axes, caption, legend.
//!
//! The colours are told apart in grey as well, and every kind of line and mark differs in shape too.

use plotters::chart::{ChartContext, ChartBuilder, SeriesLabelPosition};
use plotters::coord::{Shift, types::RangedCoordf64};
use plotters::prelude::*;

use crate::identification::Identification;

pub type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
pub type Plane<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

pub const SIZE: (u32, u32) = (860, 600);
pub const THEORY: RGBColor = RGBColor(40, 40, 40);
pub const UNSTABLE: RGBColor = RGBColor(150, 150, 150);
pub const EXACT: RGBColor = RGBColor(0, 114, 178);
pub const DECAY: RGBColor = RGBColor(213, 94, 0);
pub const LOCK: RGBColor = RGBColor(0, 0, 0);
pub const DECAY_LABEL: &str = "free decay, identified";
const FONT: &str = "Helvetica, Arial, sans-serif";

/// Draws into a string; plotters reports its own errors.
pub fn svg(
    draw: impl FnOnce(&Area) -> Result<(), Box<dyn std::error::Error>>,
) -> Result<String, String> {
    let mut text = String::new();
    {
        let area = SVGBackend::with_string(&mut text, SIZE).into_drawing_area();
        area.fill(&WHITE).map_err(|error| error.to_string())?;
        draw(&area).map_err(|error| error.to_string())?;
        area.present().map_err(|error| error.to_string())?;
    }
    Ok(text)
}

/// Title, caption with the parameters, and labelled axes over the ranges given.
pub fn plane<'a, 'b>(
    area: &'a Area<'b>,
    title: &str,
    found: &Identification,
    (x, x_label): ((f64, f64), &str),
    (y, y_label): ((f64, f64), &str),
) -> Result<Plane<'a, 'b>, Box<dyn std::error::Error>> {
    let p = &found.parameters;
    let caption = format!(
        "epsilon = {:.5}, lambda = {:.3}, r = {}, G = {:.3}; lengths over b, time over 1/omega0",
        p.epsilon, p.lambda, p.r, found.lock.g
    );
    area.draw_text(title, &(FONT, 22).into_text_style(area), (70, 14))?;
    let grey = BLACK.mix(0.7);
    let small = (FONT, 14).into_text_style(area).color(&grey);
    area.draw_text(&caption, &small, (70, 42))?;
    let mut chart = ChartBuilder::on(area)
        .margin_top(66)
        .margin_right(24)
        .margin_bottom(10)
        .margin_left(10)
        .x_label_area_size(52)
        .y_label_area_size(62)
        .build_cartesian_2d(x.0..x.1, y.0..y.1)?;
    chart
        .configure_mesh()
        .x_desc(x_label)
        .y_desc(y_label)
        .axis_desc_style((FONT, 17))
        .label_style((FONT, 14))
        .light_line_style(WHITE)
        .bold_line_style(BLACK.mix(0.10))
        .x_labels(9)
        .y_labels(8)
        .draw()?;
    Ok(chart)
}

/// A curve, dashed where it is unstable.
pub fn curve<'a, 'b: 'a>(
    chart: &mut Plane<'a, 'b>,
    points: Vec<(f64, f64)>,
    style: ShapeStyle,
    dashed: bool,
    label: Option<&str>,
) -> Result<(), Box<dyn std::error::Error>> {
    if dashed {
        let series = chart.draw_series(DashedLineSeries::new(points, 7, 5, style))?;
        if let Some(label) = label {
            series.label(label).legend(move |at| {
                let piece = |from| PathElement::new(vec![(from, 0), (from + 7, 0)], style);
                EmptyElement::at(at) + piece(0) + piece(12) + piece(24)
            });
        }
    } else {
        let series = chart.draw_series(LineSeries::new(points, style))?;
        if let Some(label) = label {
            series
                .label(label)
                .legend(move |(x, y)| PathElement::new(vec![(x, y), (x + 31, y)], style));
        }
    }
    Ok(())
}

/// Hollow circles: points along the decay.
pub fn decay_points<'a, 'b: 'a>(
    chart: &mut Plane<'a, 'b>,
    points: Vec<(f64, f64)>,
    label: &str,
) -> Result<(), Box<dyn std::error::Error>> {
    let style = DECAY.stroke_width(2);
    chart
        .draw_series(points.into_iter().map(|at| Circle::new(at, 4, style)))?
        .label(label)
        .legend(move |(x, y)| Circle::new((x + 15, y), 4, style));
    Ok(())
}

/// A filled square: the locked point.
pub fn locked_point<'a, 'b: 'a>(
    chart: &mut Plane<'a, 'b>,
    at: (f64, f64),
) -> Result<(), Box<dyn std::error::Error>> {
    let square = |(x, y): (i32, i32)| Rectangle::new([(x - 5, y - 5), (x + 5, y + 5)], LOCK.filled());
    chart
        .draw_series(std::iter::once(
            EmptyElement::at(at) + square((0, 0)),
        ))?
        .label("locked, measured")
        .legend(move |(x, y)| square((x + 15, y)));
    Ok(())
}

/// The legend, where the picture is empty.
pub fn legend<'a, 'b: 'a>(
    chart: &mut Plane<'a, 'b>,
    position: SeriesLabelPosition,
) -> Result<(), Box<dyn std::error::Error>> {
    chart
        .configure_series_labels()
        .position(position)
        .margin(14)
        .legend_area_size(42)
        .label_font((FONT, 15))
        .background_style(WHITE.mix(0.9))
        .border_style(BLACK.mix(0.3))
        .draw()?;
    Ok(())
}
