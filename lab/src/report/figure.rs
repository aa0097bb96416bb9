//! Figures as data: panels with axes, series and labels, drawn as SVG. Colours are in [`super::theme`].

mod draw;

pub use plotters::chart::SeriesLabelPosition as Legend;
use plotters::style::ShapeStyle;
pub use plotters::style::{BLACK, Color, RGBColor, WHITE};
use thiserror::Error;

use crate::scene::{Dimensionless, Sensor};

/// A place in a panel, in the units of its axes.
pub type Place = (f64, f64);

/// A place, and whether the motion there is stable.
pub type Marked = (Place, bool);

/// Axis labels that several figures share.
pub const DETUNING: &str = "detuning σ = (ω/ω₀ − 1)/ε";
pub const AMPLITUDE_OF_V: &str = "amplitude C of v, over b";
pub const SPEED: &str = "particle speed B, over b ω₀";

/// Usual size of a figure, px.
pub const SIZE: (u32, u32) = (860, 600);
/// plotters rounds to whole units: drawn this many times larger, curves are smooth.
const FINE: u32 = 8;

/// Why a figure cannot be drawn.
#[derive(Debug, Error)]
#[error("the figure cannot be drawn: {0}")]
pub struct FigureError(String);

/// A line of that colour, `tenths` of a pixel wide.
pub fn line(colour: RGBColor, tenths: u32) -> ShapeStyle {
    colour.stroke_width(tenths * FINE / 10)
}

/// A figure: panels, and a key beside them if it has one.
pub struct Figure {
    size: (u32, u32),
    panels: Vec<Panel>,
    /// Names, and what they explain.
    key: Vec<(&'static str, Mark)>,
}

/// One panel with its axes.
pub struct Panel {
    /// Left, top, width and height, px.
    area: [u32; 4],
    /// Title and caption.
    heading: Option<(String, String)>,
    ranges: [(f64, f64); 2],
    labels: [String; 2],
    series: Vec<Series>,
    legend: Option<Legend>,
}

/// Range and label of an axis.
pub type Axis<'a> = ((f64, f64), &'a str);

/// Something drawn in a panel; the first of each label is in the legend.
struct Series {
    kind: Kind,
    style: ShapeStyle,
    label: Option<String>,
}

enum Kind {
    Curve(Vec<Place>),
    Dashed(Vec<Place>),
    /// Radius, px.
    Circles(Vec<Place>, u32),
    Crosses(Vec<Place>),
    Square(Place),
    Segments(Vec<[Place; 2]>),
    Rectangles(Vec<[Place; 2]>),
    /// Text, size in px, and whether its centre is at the place or its left upper corner.
    Text(String, Place, u32, bool),
}

/// What an entry of the key explains.
pub enum Mark {
    /// Colour, letter, and colour of the letter.
    Swatch((RGBColor, &'static str, RGBColor)),
    Line(RGBColor),
    Dot,
}

impl Figure {
    /// A figure of one panel of the usual size.
    pub fn single(panel: Panel) -> Self {
        Self::new(SIZE, vec![panel])
    }

    /// A figure of that size, px.
    pub fn new(size: (u32, u32), panels: Vec<Panel>) -> Self {
        Self { size, panels, key: Vec::new() }
    }

    /// With a key at the right of the panel.
    pub fn with_key(self, key: Vec<(&'static str, Mark)>) -> Self {
        Self { key, ..self }
    }
}

impl Panel {
    /// An empty panel over the whole of a figure of the usual size.
    pub fn new(x: Axis, y: Axis) -> Self {
        Self {
            area: [0, 0, SIZE.0, SIZE.1],
            heading: None,
            ranges: [x.0, y.0],
            labels: [x.1, y.1].map(String::from),
            series: Vec::new(),
            legend: None,
        }
    }

    /// At this place of the figure: left, top, width and height, px.
    pub fn at(self, area: [u32; 4]) -> Self {
        Self { area, ..self }
    }

    pub fn heading(mut self, title: &str, caption: &str) -> Self {
        self.heading = Some((title.into(), caption.into()));
        self
    }

    pub fn legend(mut self, position: Legend) -> Self {
        self.legend = Some(position);
        self
    }

    /// Adds a series, unless it has nothing to draw: the legend does not name what is not there.
    fn add(&mut self, kind: Kind, style: ShapeStyle, label: &str) {
        if let Kind::Curve(points) | Kind::Dashed(points) | Kind::Circles(points, _) | Kind::Crosses(points) = &kind
            && points.is_empty()
        {
            return;
        }
        let label = (!label.is_empty()).then(|| label.to_string());
        self.series.push(Series { kind, style, label });
    }

    pub fn curve(&mut self, points: Vec<Place>, style: ShapeStyle, label: &str) {
        self.add(Kind::Curve(points), style, label);
    }

    pub fn dashed(&mut self, points: Vec<Place>, style: ShapeStyle, label: &str) {
        self.add(Kind::Dashed(points), style, label);
    }

    /// Circles of a radius in px, filled or hollow as the style says.
    pub fn circles(&mut self, points: Vec<Place>, radius: u32, style: ShapeStyle, label: &str) {
        self.add(Kind::Circles(points, radius), style, label);
    }

    pub fn crosses(&mut self, points: Vec<Place>, style: ShapeStyle, label: &str) {
        self.add(Kind::Crosses(points), style, label);
    }

    pub fn square(&mut self, place: Place, colour: RGBColor, label: &str) {
        self.add(Kind::Square(place), colour.filled(), label);
    }

    pub fn segments(&mut self, pairs: Vec<[Place; 2]>, style: ShapeStyle) {
        self.add(Kind::Segments(pairs), style, "");
    }

    pub fn rectangles(&mut self, corners: Vec<[Place; 2]>, colour: RGBColor) {
        self.add(Kind::Rectangles(corners), colour.filled(), "");
    }

    /// Text of that size, px, with its left upper corner at the place.
    pub fn text(&mut self, text: String, place: Place, size: u32) {
        let black = RGBColor(0, 0, 0).filled();
        self.add(Kind::Text(text, place, size, false), black, "");
    }

    /// Text of that size, px, centred at the place.
    pub fn centred_text(&mut self, text: String, place: Place, size: u32, colour: RGBColor) {
        self.add(Kind::Text(text, place, size, true), colour.filled(), "");
    }

    /// A curve, dashed where it is unstable, with a style and a label for each of its two kinds of pieces.
    pub fn pieces(&mut self, points: &[Marked], styles: [ShapeStyle; 2], labels: [&str; 2]) {
        for run in runs(points, false) {
            self.dashed(run, styles[1], labels[1]);
        }
        for run in runs(points, true) {
            self.curve(run, styles[0], labels[0]);
        }
    }

    /// A curve as by [`Panel::pieces`], cut where it leaves the panel.
    pub fn clipped_pieces(&mut self, points: &[Marked], styles: [ShapeStyle; 2], labels: [&str; 2]) {
        let [x, y] = self.ranges;
        for piece in clipped(points, x, y) {
            self.pieces(&piece, styles, labels);
        }
    }

    /// A curve as by [`Panel::clipped_pieces`], with points far enough apart that dashes stay dashes.
    pub fn thinned_pieces(&mut self, points: &[Marked], styles: [ShapeStyle; 2], labels: [&str; 2]) {
        let [x, y] = self.ranges;
        for piece in clipped(points, x, y) {
            self.pieces(&thinned(&piece, x, y), styles, labels);
        }
    }
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

/// Runs of consecutive points that are stable, or unstable, as wanted; each with the point after it, so that the curve has no holes.
fn runs(points: &[Marked], wanted: bool) -> Vec<Vec<Place>> {
    let mut start = 0;
    points
        .chunk_by(|point, next| point.1 == next.1)
        .filter_map(|run| {
            let from = start;
            start += run.len();
            let to = (start + 1).min(points.len());
            (run[0].1 == wanted).then(|| points[from..to].iter().map(|point| point.0).collect())
        })
        .collect()
}

/// Points inside the ranges; where a curve leaves them it is cut into pieces.
pub fn clipped(points: &[Marked], x: (f64, f64), y: (f64, f64)) -> Vec<Vec<Marked>> {
    let inside = |((a, b), _): &Marked| (x.0..=x.1).contains(a) && (y.0..=y.1).contains(b);
    points
        .chunk_by(|point, next| inside(point) == inside(next))
        .filter(|run| inside(&run[0]))
        .map(<[Marked]>::to_vec)
        .collect()
}

/// Smallest distance of thinned points, as a fraction of the ranges: two pixels of a usual figure.
const APART: f64 = 0.004;

/// Points at least [`APART`] from each other, with the last and every change of stability.
pub fn thinned(points: &[Marked], x: (f64, f64), y: (f64, f64)) -> Vec<Marked> {
    let mut kept: Vec<Marked> = Vec::new();
    for (n, point) in points.iter().enumerate() {
        let far = kept.last().is_none_or(|last| {
            let dx = (point.0.0 - last.0.0) / (x.1 - x.0);
            let dy = (point.0.1 - last.0.1) / (y.1 - y.0);
            dx.hypot(dy) >= APART || point.1 != last.1
        });
        if far || n + 1 == points.len() {
            kept.push(*point);
        }
    }
    kept
}
