//! Distance of measured points from the exact backbone.

use serde::Serialize;

use vines_model::Dimensionless;
use vines_model::numerics::{equally_spaced, golden_section, range};
use vines_model::orbit::{Orbit, exact_backbone};
use vines_model::theory::SlowFlow;

/// Frequencies at which the curve is computed over its whole range, ...
const FREQUENCIES: usize = 3000;
/// ... and about its lowest frequency, where it turns back: number of frequencies, and range of the detuning.
const TURN: (usize, f64) = (1200, 0.02);
/// Largest difference in C between neighbours.
const JUMP: f64 = 0.03;
/// Largest particle speed of the curve: beyond symmetry breaking.
const SPEED_MAX: f64 = 1.35;

/// The exact backbone beyond the fold as a fine polygon, by increasing particle speed.
#[derive(Debug, Clone, PartialEq)]
pub struct ExactCurve {
    orbits: Vec<Orbit>,
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
    #[must_use]
    pub fn of(scene: &Dimensionless) -> Self {
        let flow = SlowFlow::new(scene.lambda, scene.r);
        let theory = flow.backbone(flow.manifold.b_min(), SPEED_MAX, 400);
        let sigmas = theory.iter().map(|point| point.sigma);
        let (low, high) = range((f64::MAX, f64::MIN), sigmas);
        let (low, high) = (low - 0.5, high + 0.5);
        let between = |low: f64, high: f64, steps: usize| {
            equally_spaced(low, high, steps + 1)
                .flat_map(|sigma| exact_backbone(scene, 1.0 + scene.epsilon * sigma))
                .filter(|orbit| orbit.b < SPEED_MAX)
        };
        let mut orbits: Vec<Orbit> = between(low, high, FREQUENCIES).collect();
        let lowest = orbits.iter().map(|orbit| orbit.sigma).fold(f64::MAX, f64::min);
        let (steps, width) = TURN;
        orbits.extend(between(lowest - 0.1 * width, lowest + width, steps));
        orbits.sort_by(|a, b| a.b.total_cmp(&b.b));
        // Another family of orbits can have the same particle speeds: the curve is followed from its largest speed.
        let mut last = orbits.last().map_or(0.0, |orbit| orbit.c);
        let mut orbits: Vec<Orbit> = orbits
            .into_iter()
            .rev()
            .filter(|orbit| {
                let next = (orbit.c - last).abs() < JUMP;
                last = if next { orbit.c } else { last };
                next
            })
            .collect();
        orbits.reverse();
        // From the fold on: C rises with B there.
        let fold = (0..orbits.len())
            .min_by(|&a, &b| orbits[a].c.total_cmp(&orbits[b].c))
            .unwrap_or(0);
        orbits.drain(..fold);
        Self { orbits }
    }

    /// Its orbits, from the fold on.
    #[must_use]
    pub fn orbits(&self) -> &[Orbit] {
        &self.orbits
    }

    /// `[sigma, G]` at the amplitude `c`; `None` outside the curve.
    #[must_use]
    pub fn at(&self, c: f64) -> Option<[f64; 2]> {
        let pair = self
            .orbits
            .windows(2)
            .rfind(|pair| (pair[0].c - c) * (pair[1].c - c) <= 0.0 && pair[0].c != pair[1].c)?;
        let x = (c - pair[0].c) / (pair[1].c - pair[0].c);
        let between = |from: f64, to: f64| from + x * (to - from);
        Some([between(pair[0].sigma, pair[1].sigma), between(pair[0].g, pair[1].g)])
    }

    /// How far `(C, sigma, G)` lies from the curve; `None` where there is no curve.
    #[must_use]
    pub fn distance(&self, c: f64, sigma: f64, g: f64) -> Option<Distance> {
        let at = |orbit: &Orbit| [orbit.c, orbit.sigma, orbit.g];
        let segments = self
            .orbits
            .windows(2)
            .map(|pair| to_segment([c, sigma, g], at(&pair[0]), at(&pair[1])));
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
mod tests {
    use super::*;

    #[test]
    fn an_exact_orbit_lies_on_the_curve() {
        let scene = Dimensionless::new(0.0084, 1.43, 0.65, 1.1);
        let curve = ExactCurve::of(&scene);
        let orbits = vines_model::orbit::phase_resonant(&scene);
        let orbit = orbits.iter().find(|orbit| orbit.stable).unwrap();
        let distance = curve.distance(orbit.c, orbit.sigma, orbit.g).unwrap();
        assert!(distance.nearest < 1e-5, "{distance:?}");
        assert!(distance.sigma.unwrap().abs() < 1e-5 && distance.g.unwrap().abs() < 1e-5);
        let off = curve.distance(orbit.c, orbit.sigma + 0.01, orbit.g).unwrap();
        assert!((off.sigma.unwrap() - 0.01).abs() < 1e-5);
        assert!(off.nearest > 1e-3 && off.nearest < 0.01);
    }
}
