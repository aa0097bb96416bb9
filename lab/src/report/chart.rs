//! What the pictures share: size, axes, caption, legend, lines and marks. Their colours are in [`super::theme`].

use plotters::chart::{ChartBuilder, ChartContext, SeriesLabelPosition};
use plotters::coord::{Shift, types::RangedCoordf64};
use plotters::prelude::*;

use super::theme::{DECAY, LOCK};
use crate::scene::Dimensionless;

pub type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
pub type Plane<'a, 'b> =
    ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

/// Size of the picture, px.
pub const SIZE: (u32, u32) = (860, 600);
/// plotters rounds to whole units: drawn this many times larger, curves are smooth.
const FINE: u32 = 8;
/// Of the points along the decay every so many-th is drawn.
pub const THINNED: usize = 4;
pub const DECAY_LABEL: &str = "free decay, identified";
pub const FONT: &str = "Helvetica, Arial, sans-serif";

/// Units of the drawing for `px` pixels of the picture.
pub const fn px(px: u32) -> u32 {
    px * FINE
}

/// The same, as a place.
pub const fn at(px: i32) -> i32 {
    px * FINE as i32
}

/// A line of that colour, `tenths` of a pixel wide.
pub fn line(colour: RGBColor, tenths: u32) -> ShapeStyle {
    colour.stroke_width(tenths * FINE / 10)
}

/// Draws into a string, a picture of the usual size; plotters reports its own errors.
pub fn svg(
    draw: impl FnOnce(&Area) -> Result<(), Box<dyn std::error::Error>>,
) -> Result<String, String> {
    svg_of(SIZE, draw)
}

/// The same at another size, px.
pub fn svg_of(
    size: (u32, u32),
    draw: impl FnOnce(&Area) -> Result<(), Box<dyn std::error::Error>>,
) -> Result<String, String> {
    let mut text = String::new();
    {
        let area = SVGBackend::with_string(&mut text, (px(size.0), px(size.1))).into_drawing_area();
        area.fill(&WHITE).map_err(|error| error.to_string())?;
        draw(&area).map_err(|error| error.to_string())?;
        area.present().map_err(|error| error.to_string())?;
    }
    // The drawing keeps its units (the viewBox); the picture has its size.
    let drawn = format!("width=\"{}\" height=\"{}\"", px(size.0), px(size.1));
    let shown = format!("width=\"{}\" height=\"{}\"", size.0, size.1);
    Ok(text.replacen(&drawn, &shown, 1))
}

/// The caption of a picture that belongs to a scene.
pub fn caption(p: &Dimensionless, g: f64) -> String {
    format!(
        "ε = {:.5}, λ = {:.3}, r = {}, G = {g:.3}; lengths over b, times over 1/ω₀",
        p.epsilon, p.lambda, p.r
    )
}

/// Title and caption where there are any, and labelled axes over the ranges given.
pub fn plane<'a, 'b>(
    area: &'a Area<'b>,
    heading: Option<(&str, &str)>,
    (x, x_label): ((f64, f64), &str),
    (y, y_label): ((f64, f64), &str),
) -> Result<Plane<'a, 'b>, Box<dyn std::error::Error>> {
    if let Some((title, caption)) = heading {
        area.draw_text(
            title,
            &(FONT, px(22)).into_text_style(area),
            (at(70), at(14)),
        )?;
        let grey = BLACK.mix(0.7);
        let small = (FONT, px(14)).into_text_style(area).color(&grey);
        area.draw_text(caption, &small, (at(70), at(42)))?;
    }
    let mut chart = ChartBuilder::on(area)
        .margin_top(px(if heading.is_some() { 66 } else { 12 }))
        .margin_right(px(24))
        .margin_bottom(px(10))
        .margin_left(px(10))
        .x_label_area_size(px(52))
        .y_label_area_size(px(62))
        .build_cartesian_2d(x.0..x.1, y.0..y.1)?;
    chart
        .configure_mesh()
        .x_desc(x_label)
        .y_desc(y_label)
        .axis_desc_style((FONT, px(17)))
        .label_style((FONT, px(14)))
        .light_line_style(WHITE)
        .bold_line_style(BLACK.mix(0.10).stroke_width(px(1)))
        .axis_style(BLACK.stroke_width(px(1)))
        .set_all_tick_mark_size(px(4))
        .x_labels(9)
        .y_labels(8)
        .x_label_formatter(&tick)
        .y_label_formatter(&tick)
        .draw()?;
    Ok(chart)
}

/// A number at an axis, without zeros that say nothing.
fn tick(value: &f64) -> String {
    let rounded = (value * 1e6).round() / 1e6;
    format!("{}", rounded + 0.0).replace('-', "−")
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
        let series = chart.draw_series(DashedLineSeries::new(points, px(7), px(5), style))?;
        if let Some(label) = label {
            series.label(label).legend(move |place| {
                let piece = |from| PathElement::new(vec![(at(from), 0), (at(from + 7), 0)], style);
                EmptyElement::at(place) + piece(0) + piece(12) + piece(24)
            });
        }
    } else {
        let series = chart.draw_series(LineSeries::new(points, style))?;
        if let Some(label) = label {
            series
                .label(label)
                .legend(move |(x, y)| PathElement::new(vec![(x, y), (x + at(31), y)], style));
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
    let style = line(DECAY, 16);
    chart
        .draw_series(
            points
                .into_iter()
                .map(|place| Circle::new(place, px(4), style)),
        )?
        .label(label)
        .legend(move |(x, y)| Circle::new((x + at(15), y), px(4), style));
    Ok(())
}

/// A filled square: the locked point.
pub fn locked_point<'a, 'b: 'a>(
    chart: &mut Plane<'a, 'b>,
    place: (f64, f64),
) -> Result<(), Box<dyn std::error::Error>> {
    let square = |(x, y): (i32, i32)| {
        Rectangle::new(
            [(x - at(5), y - at(5)), (x + at(5), y + at(5))],
            LOCK.filled(),
        )
    };
    chart
        .draw_series(std::iter::once(EmptyElement::at(place) + square((0, 0))))?
        .label("locked, measured")
        .legend(move |(x, y)| square((x + at(15), y)));
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
        .margin(px(14))
        .legend_area_size(px(42))
        .label_font((FONT, px(15)))
        .background_style(WHITE.mix(0.9))
        .border_style(BLACK.mix(0.3).stroke_width(px(1)))
        .draw()?;
    Ok(())
}
