//! Distance of measured points from the exact backbone.

use serde::Serialize;

use vines_model::Dimensionless;
use vines_model::numerics::golden_section;
use vines_model::orbit::{ContinuationLimits, backbone};

/// Largest step along the curve, which bounds the error of the polygon to 1e-5.
const STEP: f64 = 4e-3;
/// Largest particle speed of the curve: beyond symmetry breaking.
const SPEED_MAX: f64 = 1.35;

/// The exact backbone beyond the fold as a fine polygon, by increasing particle speed.
#[derive(Debug, Clone, PartialEq)]
pub struct ExactCurve {
    /// C, sigma and G.
    places: Vec<[f64; 3]>,
}

/// Difference of a point from the exact backbone.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Distance {
    /// Largest of the differences in C, sigma and G, at the place on the curve where it is smallest.
    pub nearest: f64,
    /// Difference in sigma at the same C; absent outside the curve.
    pub sigma: Option<f64>,
    /// Difference in G at the same C; absent as above.
    #[serde(rename = "G")]
    pub g: Option<f64>,
}

impl ExactCurve {
    /// The curve of a scene.
    pub fn of(scene: &Dimensionless) -> Self {
        let limits = ContinuationLimits { step: STEP, points: 20_000, ..ContinuationLimits::default() };
        let mut points = backbone(scene, &limits).map_or(Vec::new(), |branch| branch.points);
        if points
            .first()
            .zip(points.last())
            .is_some_and(|(first, last)| first.b > last.b)
        {
            points.reverse();
        }
        // From the fold on: C rises with B there.
        let fold = (0..points.len()).min_by(|&a, &b| points[a].c.total_cmp(&points[b].c));
        let rising = points.into_iter().skip(fold.unwrap_or(0));
        let places = rising
            .take_while(|one| one.b < SPEED_MAX)
            .map(|one| [one.c, one.sigma, one.g]);
        Self { places: places.collect() }
    }

    /// C, sigma and G of its orbits, from the fold on.
    pub fn places(&self) -> &[[f64; 3]] {
        &self.places
    }

    /// `[sigma, G]` at the amplitude `c`; `None` outside the curve.
    pub fn at(&self, c: f64) -> Option<[f64; 2]> {
        let pair = self
            .places
            .windows(2)
            .rfind(|pair| (pair[0][0] - c) * (pair[1][0] - c) <= 0.0 && pair[0][0] != pair[1][0])?;
        let x = (c - pair[0][0]) / (pair[1][0] - pair[0][0]);
        Some([1, 2].map(|i| pair[0][i] + x * (pair[1][i] - pair[0][i])))
    }

    /// How far `(C, sigma, G)` lies from the curve; `None` where there is no curve.
    pub fn distance(&self, c: f64, sigma: f64, g: f64) -> Option<Distance> {
        let segments = self
            .places
            .windows(2)
            .map(|pair| to_segment([c, sigma, g], pair[0], pair[1]));
        let nearest = segments.reduce(f64::min)?;
        let same = self.at(c);
        Some(Distance {
            nearest,
            sigma: same.map(|[exact, _]| sigma - exact),
            g: same.map(|[_, exact]| g - exact),
        })
    }
}

/// Smallest value, over a segment, of the largest difference; it is convex along the segment.
fn to_segment(point: [f64; 3], from: [f64; 3], to: [f64; 3]) -> f64 {
    let largest = |x: f64| {
        (0..3)
            .map(|i| (point[i] - from[i] - x * (to[i] - from[i])).abs())
            .fold(0.0, f64::max)
    };
    let nearest = golden_section(0.0, 1.0, largest);
    [nearest, 0.0, 1.0]
        .map(largest)
        .into_iter()
        .fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
#[path = "../../tests/unit/exact_curve.rs"]
mod tests;
