//! Drawing on plotters.

use std::error::Error;

use plotters::chart::{ChartBuilder, ChartContext, SeriesAnno};
use plotters::coord::{Shift, types::RangedCoordf64};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::{FINE, Figure, FigureError, Kind, Mark, Panel, Place, Series, line};

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;
type Drawn<T = ()> = Result<T, Box<dyn Error>>;

const FONT: &str = "Helvetica, Arial, sans-serif";
const CENTRE: Pos = Pos { h_pos: HPos::Center, v_pos: VPos::Center };

/// Units of the drawing for `px` pixels of the figure.
const fn px(px: u32) -> u32 {
    px * FINE
}

/// Units of the drawing, as a coordinate.
const fn at(px: i32) -> i32 {
    px * FINE as i32
}

impl Figure {
    /// The figure as SVG, for white paper.
    pub fn svg(&self) -> Result<String, FigureError> {
        let mut text = String::new();
        let drawn = self.draw(&mut text);
        drawn.map_err(|error| FigureError(error.to_string()))?;
        // The drawing keeps its units (the viewBox); the figure has its size.
        let (width, height) = self.size;
        let drawn = format!("width=\"{}\" height=\"{}\"", px(width), px(height));
        let shown = format!("width=\"{width}\" height=\"{height}\"");
        Ok(text.replacen(&drawn, &shown, 1))
    }

    fn draw(&self, text: &mut String) -> Drawn {
        let (width, height) = self.size;
        let area = SVGBackend::with_string(text, (px(width), px(height))).into_drawing_area();
        area.fill(&WHITE)?;
        for panel in &self.panels {
            let [left, top, width, height] = panel.area.map(px);
            panel.draw(&area.clone().shrink((left, top), (width, height)))?;
        }
        if let Some(panel) = self.panels.first().filter(|_| !self.key.is_empty()) {
            let left = panel.area[2];
            let beside = area.clone().shrink((px(left), 0), (px(width - left), px(height)));
            draw_key(&beside, &self.key)?;
        }
        area.present()?;
        Ok(())
    }
}

impl Panel {
    fn draw(&self, area: &Area) -> Drawn {
        if let Some((title, caption)) = &self.heading {
            let large = (FONT, px(22)).into_text_style(area);
            area.draw_text(title, &large, (at(70), at(14)))?;
            let grey = BLACK.mix(0.7);
            let small = (FONT, px(14)).into_text_style(area).color(&grey);
            area.draw_text(caption, &small, (at(70), at(42)))?;
        }
        let mut chart = self.axes(area)?;
        let mut labelled: Vec<&str> = Vec::new();
        for series in &self.series {
            let drawn = series.draw(&mut chart, area)?;
            let label = series.label.as_deref();
            if let Some(label) = label.filter(|label| !labelled.contains(label)) {
                labelled.push(label);
                series.name(drawn, label);
            }
        }
        if let Some(position) = &self.legend {
            chart
                .configure_series_labels()
                .position(position.clone())
                .margin(px(14))
                .legend_area_size(px(42))
                .label_font((FONT, px(15)))
                .background_style(WHITE.mix(0.9))
                .border_style(BLACK.mix(0.3).stroke_width(px(1)))
                .draw()?;
        }
        Ok(())
    }

    fn axes<'a, 'b>(&self, area: &'a Area<'b>) -> Drawn<Chart<'a, 'b>> {
        let [x, y] = self.ranges;
        let top = if self.heading.is_some() { 66 } else { 12 };
        let mut chart = ChartBuilder::on(area)
            .margin_top(px(top))
            .margin_right(px(24))
            .margin_bottom(px(10))
            .margin_left(px(10))
            .x_label_area_size(px(52))
            .y_label_area_size(px(62))
            .build_cartesian_2d(x.0..x.1, y.0..y.1)?;
        chart
            .configure_mesh()
            .x_desc(&self.labels[0])
            .y_desc(&self.labels[1])
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
}

/// A number at an axis, without trailing zeros.
fn tick(value: &f64) -> String {
    let rounded = (value * 1e6).round() / 1e6;
    format!("{}", rounded + 0.0).replace('-', "−")
}

fn square((x, y): (i32, i32), style: ShapeStyle) -> Rectangle<(i32, i32)> {
    Rectangle::new([(x - at(5), y - at(5)), (x + at(5), y + at(5))], style)
}

impl Series {
    fn draw<'a, 'b: 'a, 'c>(
        &self,
        chart: &'c mut Chart<'a, 'b>,
        area: &Area,
    ) -> Drawn<&'c mut SeriesAnno<'a, SVGBackend<'b>>> {
        let style = self.style;
        Ok(match &self.kind {
            Kind::Curve(points) => chart.draw_series(LineSeries::new(points.clone(), style))?,
            Kind::Dashed(points) => {
                let dashes = DashedLineSeries::new(points.clone(), px(7), px(5), style);
                chart.draw_series(dashes)?
            }
            Kind::Circles(points, radius) => {
                let circle = |place: &Place| Circle::new(*place, px(*radius), style);
                chart.draw_series(points.iter().map(circle))?
            }
            Kind::Crosses(points) => {
                let cross = |place: &Place| Cross::new(*place, px(6), style);
                chart.draw_series(points.iter().map(cross))?
            }
            Kind::Square(place) => {
                let mark = EmptyElement::at(*place) + square((0, 0), style);
                chart.draw_series(std::iter::once(mark))?
            }
            Kind::Segments(pairs) => {
                let path = |pair: &[Place; 2]| PathElement::new(pair.to_vec(), style);
                chart.draw_series(pairs.iter().map(path))?
            }
            Kind::Rectangles(corners) => {
                chart.draw_series(corners.iter().map(|corners| Rectangle::new(*corners, style)))?
            }
            Kind::Text(text, place, size, centred) => {
                let mut font = (FONT, px(*size)).into_text_style(area);
                if *centred {
                    font = font.color(&style.color).pos(CENTRE);
                }
                chart.draw_series(std::iter::once(Text::new(text.clone(), *place, font)))?
            }
        })
    }

    /// Puts the series into the legend.
    fn name<'a, 'b: 'a>(&self, drawn: &mut SeriesAnno<'a, SVGBackend<'b>>, label: &str) {
        let style = self.style;
        let drawn = drawn.label(label);
        match self.kind {
            Kind::Dashed(_) => drawn.legend(move |place| {
                let piece = |from| PathElement::new(vec![(at(from), 0), (at(from + 7), 0)], style);
                EmptyElement::at(place) + piece(0) + piece(12) + piece(24)
            }),
            Kind::Circles(_, radius) => {
                let radius = px(radius.min(5));
                drawn.legend(move |(x, y)| Circle::new((x + at(15), y), radius, style))
            }
            Kind::Crosses(_) => drawn.legend(move |(x, y)| Cross::new((x + at(15), y), px(6), style)),
            Kind::Square(_) => drawn.legend(move |(x, y)| square((x + at(15), y), style)),
            _ => drawn.legend(move |(x, y)| PathElement::new(vec![(x, y), (x + at(31), y)], style)),
        };
    }
}

/// Swatches with letters and names, one below the other.
fn draw_key(area: &Area, entries: &[(&str, Mark)]) -> Drawn {
    let mut y = at(80);
    let font = (FONT, px(15)).into_text_style(area);
    for (name, mark) in entries {
        match *mark {
            Mark::Swatch((colour, letter, ink)) => {
                let corners = [(at(6), y), (at(36), y + at(18))];
                area.draw(&Rectangle::new(corners, colour.filled()))?;
                area.draw(&Rectangle::new(corners, line(BLACK, 10)))?;
                let font = (FONT, px(14)).into_text_style(area).color(&ink).pos(CENTRE);
                area.draw_text(letter, &font, (at(21), y + at(9)))?;
            }
            Mark::Line(colour) => {
                let ends = vec![(at(6), y + at(9)), (at(36), y + at(9))];
                area.draw(&PathElement::new(ends, line(colour, 22)))?;
            }
            Mark::Dot => area.draw(&Circle::new((at(21), y + at(9)), px(2), BLACK.filled()))?,
        }
        area.draw_text(name, &font, (at(46), y + at(2)))?;
        y += at(27);
    }
    Ok(())
}
