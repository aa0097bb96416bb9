//! Figures as data: panels with axes and series. [`Figure::svg`] draws all of them, with the colours of [`super::theme`]. The same input
//! gives the same bytes.

use super::theme::{CAPTION, GRID, HALO, INK, PAPER, colour, unstable};
use crate::scene::{Dimensionless, Sensor};

/// A place in a panel, in the units of its axes.
pub type Place = (f64, f64);

/// A place, and whether the motion there is stable.
pub type Marked = (Place, bool);

/// Range and label of an axis.
pub type Axis<'a> = ((f64, f64), &'a str);

/// Axis labels that several figures share.
pub const DETUNING: &str = "detuning σ = (ω/ω₀ − 1)/ε";
pub const AMPLITUDE_OF_V: &str = "amplitude C of v, over b";
pub const SPEED: &str = "particle speed B, over b ω₀";

/// Usual size of a figure, px: at a width of 390 px, its labels are 8 px high.
pub const SIZE: (f64, f64) = (720.0, 500.0);

const FONT: &str = "Helvetica, Arial, sans-serif";
/// Font sizes, px: titles, labels of axes and legends, ticks and captions.
const TITLE: f64 = 19.0;
const LABEL: f64 = 15.0;
const SMALL: f64 = 13.0;
/// Room around the axes, px: left for ticks and label, below likewise, and right.
const MARGINS: [f64; 3] = [66.0, 54.0, 16.0];
/// An entry of a legend, px: height, and width of the sample.
const ENTRY: (f64, f64) = (21.0, 32.0);
/// Points of a curve that are closer than this, px, are drawn as one.
const APART: f64 = 0.4;

/// A figure: panels side by side or one above the other.
pub struct Figure(pub Vec<Panel>);

/// Place of a legend.
#[derive(Clone, Copy, PartialEq)]
pub enum Legend {
    None,
    UpperRight,
    LowerRight,
    /// Right of the axes, with a width in px.
    Beside(f64),
}

/// One panel with its axes.
pub struct Panel {
    /// Left, top, width and height, px.
    area: [f64; 4],
    title: String,
    /// Lines below the title.
    captions: Vec<String>,
    ranges: [(f64, f64); 2],
    labels: [String; 2],
    series: Vec<Series>,
    legend: Legend,
}

/// Something drawn in a panel; the first of each label is in the legend.
struct Series {
    shape: Shape,
    places: Vec<Place>,
    /// The name of the colour, in the table of styles.
    colour: &'static str,
    label: String,
}

/// How a series is drawn; widths, radii and sizes in px.
#[derive(Clone, Copy)]
pub enum Shape {
    /// A solid line through the places: measured values, and stable motions.
    Line(f64),
    Dashed(f64),
    /// Segments, such as error bars: two places each.
    Bars(f64),
    /// The border of an area of a map: two places each.
    Border(f64),
    /// Cells of a map: two opposite corners each. Letter in the legend, and the name of its colour.
    Cells(&'static str, &'static str),
    Circle(f64),
    Dot(f64),
    Square,
    Cross,
    /// Text with its middle at the place.
    Text(f64),
    /// Text that interrupts a curve.
    TextOnCurve(f64),
}

impl Figure {
    /// The figure as SVG, for white paper.
    pub fn svg(&self) -> String {
        let corners = self.0.iter().map(|Panel { area: [x, y, w, h], .. }| [x + w, y + h]);
        let [width, height] = corners.fold([0.0, 0.0], |[w, h], [x, y]| [f64::max(w, x), f64::max(h, y)]);
        let drawing = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" \
             font-family=\"{FONT}\">\n"
        );
        let mut svg = Svg { drawing, halo: false };
        svg.rectangle([0.0, 0.0, width, height], PAPER, "");
        for panel in &self.0 {
            panel.draw(&mut svg);
        }
        svg.drawing + "</svg>\n"
    }
}

impl Panel {
    /// An empty panel over the whole of a figure of the usual size.
    pub fn new(x: Axis, y: Axis) -> Self {
        Self {
            area: [0.0, 0.0, SIZE.0, SIZE.1],
            title: String::new(),
            captions: Vec::new(),
            ranges: [x.0, y.0],
            labels: [x.1, y.1].map(String::from),
            series: Vec::new(),
            legend: Legend::None,
        }
    }

    /// At this place of the figure: left, top, width and height, px.
    pub fn at(self, area: [f64; 4]) -> Self {
        Self { area, ..self }
    }

    pub fn heading(mut self, title: &str, caption: &str) -> Self {
        self.title = title.into();
        self.captions = caption.lines().map(String::from).collect();
        self
    }

    pub fn legend(self, legend: Legend) -> Self {
        Self { legend, ..self }
    }

    /// Adds a series, unless it has nothing to draw: the legend does not name what is not there.
    pub fn add(&mut self, shape: Shape, places: impl IntoIterator<Item = Place>, colour: &'static str, label: &str) {
        let (places, label) = (Vec::from_iter(places), label.into());
        if !places.is_empty() {
            self.series.push(Series { shape, places, colour, label });
        }
    }

    /// A curve of motions, solid where they are stable and dashed where they are not.
    pub fn curve(&mut self, points: impl IntoIterator<Item = Marked>, width: f64, colour: &'static str, name: &str) {
        let labels = ["stable", "unstable"].map(|kind| format!("{name}, {kind}"));
        self.labelled_curve(points, width, colour, labels);
    }

    /// A curve of motions with the labels of its stable and unstable pieces.
    pub fn labelled_curve(
        &mut self,
        points: impl IntoIterator<Item = Marked>,
        width: f64,
        colour: &'static str,
        [stable, dashed]: [String; 2],
    ) {
        let points = Vec::from_iter(points);
        // The stable pieces first, and so in the legend.
        for run in runs(&points, true) {
            self.add(Shape::Line(width), run, colour, &stable);
        }
        for run in runs(&points, false) {
            self.add(Shape::Dashed(width), run, unstable(colour), &dashed);
        }
    }

    /// The series of the legend.
    fn entries(&self) -> Vec<&Series> {
        let mut entries: Vec<&Series> = Vec::new();
        for series in &self.series {
            let named = !series.label.is_empty() && !matches!(series.shape, Shape::Text(_) | Shape::TextOnCurve(_));
            if named && entries.iter().all(|entry| entry.label != series.label) {
                entries.push(series);
            }
        }
        entries
    }

    fn draw(&self, svg: &mut Svg) {
        let [left, top, width, height] = self.area;
        let entries = self.entries();
        let longest = entries.iter().map(|entry| text_width(&entry.label, SMALL + 1.0));
        let longest = longest.fold(0.0, f64::max);
        let key = [ENTRY.1 + 26.0 + longest, ENTRY.0 * entries.len() as f64 + 10.0];
        let beside = match self.legend {
            Legend::Beside(width) => width,
            _ => 0.0,
        };
        let head = match self.title.is_empty() {
            true => 14.0,
            false => 42.0 + 18.0 * self.captions.len() as f64,
        };
        svg.halo = self
            .series
            .iter()
            .any(|series| matches!(series.shape, Shape::Cells(..)));
        let frame = Frame {
            place: [left + MARGINS[0], top + head],
            size: [width - MARGINS[0] - MARGINS[2] - beside, height - head - MARGINS[1]],
            ranges: self.ranges,
        };
        let ([x, y], [w, h]) = (frame.place, frame.size);
        if !self.title.is_empty() {
            svg.text(&self.title, [x, top + 28.0], TITLE, INK, "start");
        }
        for (n, line) in (0..).zip(&self.captions) {
            svg.text(line, [x, top + 48.0 + 18.0 * f64::from(n)], SMALL, CAPTION, "start");
        }
        frame.draw(svg, &self.labels);
        // Curves end at the axes; marks are whole.
        svg.drawing += &format!(
            "<svg x=\"{x:.2}\" y=\"{y:.2}\" width=\"{w:.2}\" height=\"{h:.2}\" viewBox=\"{x:.2} {y:.2} {w:.2} {h:.2}\">\n"
        );
        let (marks, curves): (Vec<&Series>, Vec<&Series>) = self.series.iter().partition(|series| series.is_mark());
        curves.iter().for_each(|series| series.draw(svg, &frame));
        svg.drawing += "</svg>\n";
        marks.iter().for_each(|series| series.draw(svg, &frame));
        if entries.is_empty() || self.legend == Legend::None {
            return;
        }
        let right = x + w - key[0] - 8.0;
        let [x, y] = match self.legend {
            Legend::LowerRight => [right, y + h - key[1] - 8.0],
            Legend::Beside(_) => [x + w + 10.0, y],
            _ => [right, y + 8.0],
        };
        if beside == 0.0 {
            svg.rectangle([x, y, key[0], key[1]], PAPER, " fill-opacity=\"0.9\"");
        }
        for (n, entry) in (0..).zip(entries) {
            let line = y + 5.0 + ENTRY.0 * (f64::from(n) + 0.5);
            entry.sample(svg, [x + 8.0, line]);
            let place = [x + ENTRY.1 + 16.0, line + 4.5];
            svg.text(&entry.label, place, SMALL + 1.0, INK, "start");
        }
    }
}

/// The rectangle between the axes of a panel: left upper corner and size, px, and ranges.
struct Frame {
    place: [f64; 2],
    size: [f64; 2],
    ranges: [(f64, f64); 2],
}

impl Frame {
    /// Where a place of the panel is drawn, px.
    fn at(&self, (a, b): Place) -> [f64; 2] {
        let part = |value: f64, (from, to): (f64, f64)| (value - from) / (to - from);
        let [x, y] = self.ranges;
        [
            self.place[0] + self.size[0] * part(a, x),
            self.place[1] + self.size[1] * (1.0 - part(b, y)),
        ]
    }

    fn contains(&self, (a, b): Place) -> bool {
        let [x, y] = self.ranges;
        (x.0..=x.1).contains(&a) && (y.0..=y.1).contains(&b)
    }

    /// Grid, ticks, axes and their labels.
    fn draw(&self, svg: &mut Svg, labels: &[String; 2]) {
        let ([left, top], [width, height]) = (self.place, self.size);
        let (right, bottom) = (left + width, top + height);
        let [(x, _), (y, _)] = self.ranges;
        for (value, label) in ticks(self.ranges[0], width / 75.0) {
            let [at, _] = self.at((value, y));
            svg.line(&[[at, top], [at, bottom]], 1.0, GRID, "");
            svg.text(&label, [at, bottom + 18.0], SMALL, INK, "middle");
        }
        for (value, label) in ticks(self.ranges[1], height / 45.0) {
            let [_, at] = self.at((x, value));
            svg.line(&[[left, at], [right, at]], 1.0, GRID, "");
            svg.text(&label, [left - 7.0, at + 4.5], SMALL, INK, "end");
        }
        svg.line(&[[left, top], [left, bottom], [right, bottom]], 1.0, INK, "");
        let [middle, below] = [left + width / 2.0, bottom + 42.0];
        svg.text(&labels[0], [middle, below], LABEL, INK, "middle");
        let [x, y] = [left - 46.0, top + height / 2.0];
        svg.drawing += &format!("<g transform=\"rotate(-90 {x:.2} {y:.2})\">");
        svg.text(&labels[1], [x, y], LABEL, INK, "middle");
        svg.drawing += "</g>\n";
    }
}

/// At most this many round numbers of a range, with their labels.
fn ticks((from, to): (f64, f64), most: f64) -> Vec<(f64, String)> {
    let least = (to - from) / most.max(1.0);
    let power = 10f64.powf(least.log10().floor());
    let factor = [1.0, 2.0, 5.0].into_iter().find(|factor| factor * power >= least);
    let step = factor.unwrap_or(10.0) * power;
    let decimals = (-step.log10().floor()).max(0.0) as usize;
    let (first, last) = ((from / step - 1e-9).ceil() as i64, (to / step + 1e-9).floor() as i64);
    let label = |value: f64| format!("{:.decimals$}", value + 0.0).replace('-', "−");
    (first..=last)
        .map(|n| (n as f64 * step, label(n as f64 * step)))
        .collect()
}

impl Series {
    /// Whether it is a mark or a text, which may extend beyond the axes.
    fn is_mark(&self) -> bool {
        use Shape::*;
        matches!(
            self.shape,
            Circle(_) | Dot(_) | Square | Cross | Text(_) | TextOnCurve(_)
        )
    }

    fn draw(&self, svg: &mut Svg, frame: &Frame) {
        let places: Vec<[f64; 2]> = self.places.iter().map(|place| frame.at(*place)).collect();
        match self.shape {
            Shape::Line(_) | Shape::Dashed(_) => {
                let mut points: Vec<[f64; 2]> = Vec::new();
                for (n, [x, y]) in places.iter().copied().enumerate() {
                    let far = points.last().is_none_or(|[a, b]| (x - a).hypot(y - b) >= APART);
                    if far || n + 1 == places.len() {
                        points.push([x, y]);
                    }
                }
                self.stroke(svg, &[&points]);
            }
            Shape::Bars(_) | Shape::Border(_) => self.stroke(svg, &places.chunks_exact(2).collect::<Vec<_>>()),
            Shape::Cells(..) => {
                for pair in places.chunks_exact(2) {
                    let [[a, b], [c, d]] = [pair[0], pair[1]];
                    let area = [a.min(c), b.min(d), (a - c).abs(), (b - d).abs()];
                    // Cells lie side by side without a seam.
                    svg.rectangle(area, self.colour, " shape-rendering=\"crispEdges\"");
                }
            }
            Shape::Text(size) | Shape::TextOnCurve(size) => {
                for [x, y] in places {
                    let width = text_width(&self.label, size);
                    if matches!(self.shape, Shape::TextOnCurve(_)) {
                        let area = [x - width / 2.0, y - 0.6 * size, width, 1.2 * size];
                        svg.rectangle(area, PAPER, " fill-opacity=\"0.85\"");
                    }
                    svg.text(&self.label, [x, y + 0.35 * size], size, self.colour, "middle");
                }
            }
            _ => {
                for place in self.places.iter().filter(|place| frame.contains(**place)) {
                    self.mark(svg, frame.at(*place));
                }
            }
        }
    }

    /// The sample in a legend.
    fn sample(&self, svg: &mut Svg, [x, y]: [f64; 2]) {
        let middle = [x + ENTRY.1 / 2.0, y];
        match self.shape {
            _ if self.is_mark() => self.mark(svg, middle),
            Shape::Cells(letter, ink) => {
                let edge = format!(" stroke=\"{}\"", colour(INK));
                svg.rectangle([x, y - 8.5, ENTRY.1, 17.0], self.colour, &edge);
                svg.text(letter, [middle[0], y + 4.5], SMALL, ink, "middle");
            }
            _ => self.stroke(svg, &[&[[x, y], [x + ENTRY.1, y]]]),
        }
    }

    /// Lines. The halo of one must not hide its neighbour.
    fn stroke(&self, svg: &mut Svg, lines: &[&[[f64; 2]]]) {
        let (Shape::Line(width) | Shape::Dashed(width) | Shape::Bars(width) | Shape::Border(width)) = self.shape else {
            return;
        };
        let dashes = match self.shape {
            Shape::Dashed(_) => " stroke-dasharray=\"7 5\"",
            _ => "",
        };
        if svg.halo {
            lines.iter().for_each(|line| svg.line(line, width + 2.8, HALO, ""));
        }
        for line in lines {
            svg.line(line, width, self.colour, dashes);
        }
    }

    fn mark(&self, svg: &mut Svg, [x, y]: [f64; 2]) {
        let shade = colour(self.colour);
        let circle = |radius, style: &str| format!("<circle cx=\"{x:.2}\" cy=\"{y:.2}\" r=\"{radius}\" {style}/>\n");
        match self.shape {
            Shape::Circle(r) => {
                svg.drawing += &circle(r, &format!("fill=\"none\" stroke=\"{shade}\" stroke-width=\"1.5\""));
            }
            Shape::Dot(r) => svg.drawing += &circle(r, &format!("fill=\"{shade}\"")),
            Shape::Square => svg.rectangle([x - 4.5, y - 4.5, 9.0, 9.0], self.colour, ""),
            _ => {
                for d in [4.0, -4.0] {
                    svg.line(&[[x - 4.0, y - d], [x + 4.0, y + d]], 1.2, self.colour, "");
                }
            }
        }
    }
}

/// Runs of consecutive motions that are stable, or unstable, as wanted; each with the point after it, so that the curve has no holes.
fn runs(points: &[Marked], wanted: bool) -> Vec<Vec<Place>> {
    let mut start = 0;
    let runs = points.chunk_by(|point, next| point.1 == next.1);
    let runs = runs.filter_map(|run| {
        let from = start;
        start += run.len();
        let to = (start + 1).min(points.len());
        (run[0].1 == wanted).then(|| points[from..to].iter().map(|point| point.0).collect())
    });
    runs.collect()
}

/// The drawing so far. Colours are names of the table of styles.
struct Svg {
    drawing: String,
    /// Whether curves have a halo: they are on a map.
    halo: bool,
}

impl Svg {
    fn line(&mut self, points: &[[f64; 2]], width: f64, name: &str, more: &str) {
        let points: Vec<String> = points.iter().map(|[x, y]| format!("{x:.2},{y:.2}")).collect();
        let (points, colour) = (points.join(" "), colour(name));
        self.drawing += &format!(
            "<polyline points=\"{points}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"{width}\"{more}/>\n"
        );
    }

    fn rectangle(&mut self, [x, y, width, height]: [f64; 4], name: &str, more: &str) {
        let (place, colour) = (format!("x=\"{x:.2}\" y=\"{y:.2}\""), colour(name));
        self.drawing +=
            &format!("<rect {place} width=\"{width:.2}\" height=\"{height:.2}\" fill=\"{colour}\"{more}/>\n");
    }

    fn text(&mut self, words: &str, [x, y]: [f64; 2], size: f64, name: &str, anchor: &str) {
        let (words, colour) = (maud::html! { (words) }.into_string(), colour(name));
        let place = format!("x=\"{x:.2}\" y=\"{y:.2}\" text-anchor=\"{anchor}\"");
        self.drawing += &format!("<text {place} font-size=\"{size}\" fill=\"{colour}\">{words}</text>\n");
    }
}

/// Width of a text in a usual font, px.
fn text_width(text: &str, size: f64) -> f64 {
    0.56 * size * text.chars().count() as f64
}

/// The label of an axis of amplitudes as the scene's sensor reads them.
pub fn amplitude(p: &Dimensionless) -> &'static str {
    match p.definition.sensor {
        Sensor::V => AMPLITUDE_OF_V,
        Sensor::Q1 => "amplitude C of q₁, over b",
        Sensor::Acceleration => "amplitude C of −q₁″, over b ω₀²",
    }
}

/// The caption of a figure that belongs to a scene.
pub fn caption(p: &Dimensionless, g: f64) -> String {
    format!("{}, G = {g:.3}; lengths over b, times over 1/ω₀", rig(p))
}

/// The numbers of a rig, for captions.
pub fn rig(p: &Dimensionless) -> String {
    format!("ε = {:.5}, λ = {:.3}, r = {}", p.epsilon, p.lambda, p.r)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::theme::EXACT;

    #[test]
    fn ticks_are_round_numbers_inside_the_range() {
        let labels = |range, most| ticks(range, most).into_iter().map(|tick| tick.1).collect::<Vec<_>>();
        assert_eq!(labels((-1.6, 0.6), 5.0), ["−1.5", "−1.0", "−0.5", "0.0", "0.5"]);
        assert_eq!(labels((0.0, 140.0), 4.0), ["0", "50", "100"]);
        assert_eq!(labels((0.3, 0.31), 2.5), ["0.300", "0.305", "0.310"]);
    }

    #[test]
    fn a_curve_is_dashed_exactly_where_it_is_unstable_and_has_no_holes() {
        let mut panel = Panel::new(((0.0, 4.0), ""), ((0.0, 1.0), "")).legend(Legend::UpperRight);
        let points = [true, true, false, true].into_iter().enumerate();
        let points: Vec<Marked> = points.map(|(n, stable)| ((n as f64, 0.5), stable)).collect();
        panel.curve(points, 2.0, EXACT, "orbits");
        let spans: Vec<(f64, f64, &str)> = panel
            .series
            .iter()
            .map(|shape| (shape.places[0].0, shape.places.last().unwrap().0, shape.label.as_str()))
            .collect();
        let stable = [(0.0, 2.0, "orbits, stable"), (3.0, 3.0, "orbits, stable")];
        assert_eq!(spans[..2], stable);
        assert_eq!(spans[2..], [(2.0, 3.0, "orbits, unstable")]);
        let svg = Figure(vec![panel]).svg();
        // The piece and its sample in the legend.
        assert_eq!(svg.matches("stroke-dasharray").count(), 2);
        assert_eq!(svg.matches("orbits, unstable</text>").count(), 1);
    }
}
