//! Figures as data: rows of panels with axes and series, and one legend below them. [`Figure::svg`] draws all of them, with the colours of
//! [`super::theme`]. The same input gives the same bytes.

use super::theme::{CAPTION, GRID, HALO, INK, PAPER, colour, unstable};

/// A place in a panel, in the units of its axes.
pub type Place = (f64, f64);

/// A place, and whether the motion there is stable.
pub type Marked = (Place, bool);

/// Range and label of an axis.
pub type Axis<'a> = ((f64, f64), &'a str);

/// Width of a figure, px.
const WIDTH: f64 = 760.0;
const FONT: &str = "Helvetica, Arial, sans-serif";
/// Font sizes, px: title, labels of axes, and ticks, captions and legend.
const TITLE: f64 = 19.0;
const LABEL: f64 = 15.0;
const SMALL: f64 = 13.0;
/// Room around the axes of a panel, px: left and below for ticks and label, right, and above.
const MARGINS: [f64; 4] = [66.0, 54.0, 16.0, 10.0];
/// Height of a line of the legend, and width of its sample, px.
const ENTRY: (f64, f64) = (21.0, 32.0);
/// Points of a curve that are closer than this, px, are drawn as one.
const NEIGHBOUR_DISTANCE: f64 = 0.4;

/// Rows of panels under a title and lines of a caption.
pub struct Figure {
    title: String,
    caption: String,
    rows: Vec<Vec<Panel>>,
}

/// One panel with its axes.
pub struct Panel {
    ranges: [(f64, f64); 2],
    labels: [String; 2],
    series: Vec<Series>,
}

/// Something drawn in a panel; the first of each label is in the legend.
struct Series {
    shape: Shape,
    places: Vec<Place>,
    /// The name of the colour, in the table of styles.
    colour: &'static str,
    label: String,
}

/// How a series is drawn; widths and radii in px.
#[derive(Clone, Copy)]
pub enum Shape {
    /// A solid line through the places: measured values, and stable motions.
    Line(f64),
    Dashed(f64),
    /// Separate lines, such as error bars: two places each.
    Segments(f64),
    /// Cells of a map: two opposite corners each.
    Cells,
    Circle(f64),
    Dot(f64),
    Square,
    Cross,
}

impl Figure {
    pub fn new(title: impl Into<String>, caption: String, rows: Vec<Vec<Panel>>) -> Self {
        Self { title: title.into(), caption, rows }
    }

    /// Height of a row, px.
    fn row_height(&self) -> f64 {
        match &self.rows[..] {
            [panels] if panels.iter().any(Panel::is_map) => 460.0,
            [_] => 420.0,
            _ => 300.0,
        }
    }

    /// The figure as SVG, for white paper.
    pub fn svg(&self) -> String {
        let (entries, row_height) = (self.entries(), self.row_height());
        let longest = entries.iter().map(|entry| text_width(&entry.label)).fold(0.0, f64::max);
        let column = ENTRY.1 + 26.0 + longest;
        let columns = ((WIDTH - MARGINS[0]) / column).floor().max(1.0) as usize;
        let head = 40.0 + 18.0 * self.caption.lines().count() as f64;
        let bottom = head + row_height * self.rows.len() as f64;
        let height = bottom + ENTRY.0 * entries.len().div_ceil(columns) as f64 + 10.0;
        let mut svg = Svg(format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{WIDTH}\" height=\"{height}\" viewBox=\"0 0 {WIDTH} {height}\" \
             font-family=\"{FONT}\">\n"
        ));
        svg.rectangle([0.0, 0.0, WIDTH, height], PAPER, "");
        svg.text(&self.title, [MARGINS[0], 28.0], TITLE, INK, "start");
        for (n, line) in (0..).zip(self.caption.lines()) {
            svg.text(line, [MARGINS[0], 48.0 + 18.0 * f64::from(n)], SMALL, CAPTION, "start");
        }
        for (row, panels) in (0..).zip(&self.rows) {
            let width = WIDTH / panels.len() as f64;
            let top = head + row_height * f64::from(row);
            for (n, panel) in (0..).zip(panels) {
                panel.draw(&mut svg, [width * f64::from(n), top, width, row_height]);
            }
        }
        for (n, entry) in entries.iter().enumerate() {
            let x = MARGINS[0] + column * (n % columns) as f64;
            let y = bottom + ENTRY.0 * ((n / columns) as f64 + 0.5);
            entry.sample(&mut svg, [x, y]);
            svg.text(&entry.label, [x + ENTRY.1 + 8.0, y + 4.5], SMALL, INK, "start");
        }
        svg.0 + "</svg>\n"
    }

    /// The series of the legend.
    fn entries(&self) -> Vec<&Series> {
        let mut entries: Vec<&Series> = Vec::new();
        for series in self.rows.iter().flatten().flat_map(|panel| &panel.series) {
            if !series.label.is_empty() && entries.iter().all(|entry| entry.label != series.label) {
                entries.push(series);
            }
        }
        entries
    }
}

impl Panel {
    pub fn new(x: Axis, y: Axis) -> Self {
        Self {
            ranges: [x.0, y.0],
            labels: [x.1, y.1].map(String::from),
            series: Vec::new(),
        }
    }

    /// Adds a series, unless it has nothing to draw: the legend does not name what is not there.
    pub fn add(&mut self, shape: Shape, places: impl IntoIterator<Item = Place>, colour: &'static str, label: &str) {
        let (places, label) = (Vec::from_iter(places), label.into());
        if !places.is_empty() {
            self.series.push(Series { shape, places, colour, label });
        }
    }

    /// A curve of motions, solid where they are stable, and dashed and paler where they are not.
    pub fn curve(&mut self, points: impl IntoIterator<Item = Marked>, width: f64, colour: &'static str, name: &str) {
        let names = [name, &format!("{name}, unstable")];
        self.pieces(points, width, [colour, unstable(colour)], names);
    }

    /// The same in one colour, with one entry of the legend.
    pub fn branch(&mut self, points: impl IntoIterator<Item = Marked>, width: f64, colour: &'static str, name: &str) {
        self.pieces(points, width, [colour; 2], [name; 2]);
    }

    /// The stable pieces first, and so in the legend.
    fn pieces(
        &mut self,
        points: impl IntoIterator<Item = Marked>,
        width: f64,
        colours: [&'static str; 2],
        labels: [&str; 2],
    ) {
        let points = Vec::from_iter(points);
        for run in runs(&points, true) {
            self.add(Shape::Line(width), run, colours[0], labels[0]);
        }
        for run in runs(&points, false) {
            self.add(Shape::Dashed(width), run, colours[1], labels[1]);
        }
    }

    fn is_map(&self) -> bool {
        self.series.iter().any(|series| matches!(series.shape, Shape::Cells))
    }

    /// Draws the panel in an area: left, top, width and height, px.
    fn draw(&self, svg: &mut Svg, [left, top, width, height]: [f64; 4]) {
        let frame = Frame {
            place: [left + MARGINS[0], top + MARGINS[3]],
            size: [width - MARGINS[0] - MARGINS[2], height - MARGINS[1] - MARGINS[3]],
            ranges: self.ranges,
        };
        frame.draw(svg, &self.labels);
        // Curves end at the axes; marks are whole. On a map, curves have a halo.
        let ([x, y], [w, h]) = (frame.place, frame.size);
        svg.0 += &format!(
            "<svg x=\"{x:.2}\" y=\"{y:.2}\" width=\"{w:.2}\" height=\"{h:.2}\" viewBox=\"{x:.2} {y:.2} {w:.2} {h:.2}\">\n"
        );
        let is_map = self.is_map();
        let (marks, curves): (Vec<_>, Vec<_>) = self.series.iter().partition(|series| series.is_mark());
        curves.iter().for_each(|series| series.draw(svg, &frame, is_map));
        svg.0 += "</svg>\n";
        marks.iter().for_each(|series| series.draw(svg, &frame, is_map));
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
        for (value, label) in ticks(self.ranges[0], width / 50.0) {
            let [at, _] = self.at((value, y));
            svg.line(&[[at, top], [at, bottom]], 1.0, GRID, "");
            svg.text(&label, [at, bottom + 18.0], SMALL, INK, "middle");
        }
        for (value, label) in ticks(self.ranges[1], height / 40.0) {
            let [_, at] = self.at((x, value));
            svg.line(&[[left, at], [right, at]], 1.0, GRID, "");
            svg.text(&label, [left - 7.0, at + 4.5], SMALL, INK, "end");
        }
        svg.line(&[[left, top], [left, bottom], [right, bottom]], 1.0, INK, "");
        svg.text(&labels[0], [left + width / 2.0, bottom + 42.0], LABEL, INK, "middle");
        let [x, y] = [left - 46.0, top + height / 2.0];
        svg.0 += &format!("<g transform=\"rotate(-90 {x:.2} {y:.2})\">");
        svg.text(&labels[1], [x, y], LABEL, INK, "middle");
        svg.0 += "</g>\n";
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
    /// Whether it is a mark, which may extend beyond the axes.
    fn is_mark(&self) -> bool {
        use Shape::*;
        matches!(self.shape, Circle(_) | Dot(_) | Square | Cross)
    }

    fn draw(&self, svg: &mut Svg, frame: &Frame, is_map: bool) {
        let places: Vec<[f64; 2]> = self.places.iter().map(|place| frame.at(*place)).collect();
        match self.shape {
            Shape::Line(_) | Shape::Dashed(_) => {
                let mut points: Vec<[f64; 2]> = Vec::new();
                for (n, [x, y]) in places.iter().copied().enumerate() {
                    let far = points
                        .last()
                        .is_none_or(|[a, b]| (x - a).hypot(y - b) >= NEIGHBOUR_DISTANCE);
                    if far || n + 1 == places.len() {
                        points.push([x, y]);
                    }
                }
                self.stroke(svg, &[&points], is_map);
            }
            Shape::Segments(_) => self.stroke(svg, &places.chunks_exact(2).collect::<Vec<_>>(), is_map),
            Shape::Cells => {
                for pair in places.chunks_exact(2) {
                    let [[a, b], [c, d]] = [pair[0], pair[1]];
                    let area = [a.min(c), b.min(d), (a - c).abs(), (b - d).abs()];
                    // Cells lie side by side without a seam.
                    svg.rectangle(area, self.colour, " shape-rendering=\"crispEdges\"");
                }
            }
            _ => {
                for place in self.places.iter().filter(|place| frame.contains(**place)) {
                    self.mark(svg, frame.at(*place));
                }
            }
        }
    }

    /// The sample in the legend.
    fn sample(&self, svg: &mut Svg, [x, y]: [f64; 2]) {
        match self.shape {
            _ if self.is_mark() => self.mark(svg, [x + ENTRY.1 / 2.0, y]),
            Shape::Cells => {
                let edge = format!(" stroke=\"{}\"", colour(INK));
                svg.rectangle([x, y - 7.5, ENTRY.1, 15.0], self.colour, &edge);
            }
            _ => self.stroke(svg, &[&[[x, y], [x + ENTRY.1, y]]], false),
        }
    }

    /// Lines. The halo of one must not hide its neighbour.
    fn stroke(&self, svg: &mut Svg, lines: &[&[[f64; 2]]], halo: bool) {
        let (Shape::Line(width) | Shape::Dashed(width) | Shape::Segments(width)) = self.shape else {
            return;
        };
        let dashes = match self.shape {
            Shape::Dashed(_) => " stroke-dasharray=\"7 5\"",
            _ => "",
        };
        if halo {
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
                svg.0 += &circle(r, &format!("fill=\"none\" stroke=\"{shade}\" stroke-width=\"1.5\""));
            }
            Shape::Dot(r) => svg.0 += &circle(r, &format!("fill=\"{shade}\"")),
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
struct Svg(String);

impl Svg {
    fn line(&mut self, points: &[[f64; 2]], width: f64, name: &str, more: &str) {
        let points: Vec<String> = points.iter().map(|[x, y]| format!("{x:.2},{y:.2}")).collect();
        let (points, colour) = (points.join(" "), colour(name));
        self.0 += &format!(
            "<polyline points=\"{points}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"{width}\"{more}/>\n"
        );
    }

    fn rectangle(&mut self, [x, y, width, height]: [f64; 4], name: &str, more: &str) {
        let (place, colour) = (format!("x=\"{x:.2}\" y=\"{y:.2}\""), colour(name));
        self.0 += &format!("<rect {place} width=\"{width:.2}\" height=\"{height:.2}\" fill=\"{colour}\"{more}/>\n");
    }

    fn text(&mut self, words: &str, [x, y]: [f64; 2], size: f64, name: &str, anchor: &str) {
        let (words, colour) = (maud::html! { (words) }.into_string(), colour(name));
        let place = format!("x=\"{x:.2}\" y=\"{y:.2}\" text-anchor=\"{anchor}\"");
        self.0 += &format!("<text {place} font-size=\"{size}\" fill=\"{colour}\">{words}</text>\n");
    }
}

/// Width of a text of the legend in a usual font, px.
fn text_width(text: &str) -> f64 {
    0.56 * SMALL * text.chars().count() as f64
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
        let mut panel = Panel::new(((0.0, 4.0), ""), ((0.0, 1.0), ""));
        let points = [true, true, false, true].into_iter().enumerate();
        let points: Vec<Marked> = points.map(|(n, stable)| ((n as f64, 0.5), stable)).collect();
        panel.curve(points, 2.0, EXACT, "orbits");
        let spans: Vec<(f64, f64, &str)> = panel
            .series
            .iter()
            .map(|one| (one.places[0].0, one.places.last().unwrap().0, one.label.as_str()))
            .collect();
        assert_eq!(spans[..2], [(0.0, 2.0, "orbits"), (3.0, 3.0, "orbits")]);
        assert_eq!(spans[2..], [(2.0, 3.0, "orbits, unstable")]);
        let svg = Figure::new("a < b", String::new(), vec![vec![panel]]).svg();
        // The piece and its sample in the legend.
        assert_eq!(svg.matches("stroke-dasharray").count(), 2);
        assert_eq!(svg.matches("orbits, unstable</text>").count(), 1);
        assert!(svg.contains(">a &lt; b</text>"));
    }
}
