//! Measurements beside first-order theory and exact orbits at the same parameters.

use std::f64::consts::TAU;

use serde::Serialize;
use vines_model::numerics::{golden_section, mean_square};
use vines_model::orbit::{Orbit, OrbitCurve, backbone};
use vines_model::theory::{B_SYMMETRY_BREAKING, BackbonePoint, BranchSide, SlowFlow, free_sigma, resonant};

use crate::backbone::{LevelPoint, Tracked};
use crate::identification::{DecayEnd, FreeDecayPoint, Identification, Lock, Regime};
use crate::survey::{ExactOrbits, phase_resonant, structure_backbone};
use vines_scene::linear::MeasuredLinear;
use vines_scene::scene::{Dimensionless, Scene};

/// Amplitudes above which the decay is compared with theory, C.
///
/// Nearer to the fold (C = Cmin) the slow flow is no longer slow compared with a period.
pub const COMPARED_ABOVE: f64 = 0.2;

/// An identified system beside theory and exact orbits; dimensionless throughout.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// The numbers of the scene.
    pub parameters: Dimensionless,
    /// What theory and exact orbits leave out of the scene's cavity; absent if it is ideal.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub left_out: Option<String>,
    /// The linear response, if it was measured on the rig.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub linear: Option<MeasuredLinear>,
    /// The locked point as measured.
    pub lock: Lock,
    /// First-order theory at the same G and phase target: the stable solution nearest to the lock.
    pub theory: Option<BackbonePoint>,
    /// The exact orbit at the same phase target with the C of the lock; absent if there is none.
    pub exact: Option<Orbit>,
    /// All exact orbits at the same G and phase target, by rising C; the lock followed the nearest one.
    pub orbits: Vec<Orbit>,
    /// The decay, from the release on.
    pub decay: Vec<ComparedPoint>,
    /// What ended its points.
    pub decay_end: DecayEnd,
    /// Amplitude of the base after the release, m, where it is least, if the base never rests; with its standard uncertainty.
    #[serde(rename = "E_after_release_m", skip_serializing_if = "Option::is_none")]
    pub base_after_release: Option<[f64; 2]>,
    /// Of a structure that a force drives, its amplitude there, N.
    #[serde(rename = "F_after_release_N", skip_serializing_if = "Option::is_none")]
    pub force_after_release: Option<[f64; 2]>,
    /// The exact backbone that the decay is compared with: at phase resonance, whatever the phase target, because no drive acts.
    #[serde(skip)]
    pub curve: ExactCurve,
    /// RMS of the decay's sigma minus theory, over the points with C > 0.2.
    pub rms_sigma_error: Option<f64>,
    /// RMS of the decay's sigma minus the exact backbone's at the same C, over the same points.
    pub rms_sigma_exact: Option<f64>,
    /// RMS of the decay's sigma minus `sigma_slow_flow`, over the same points.
    pub rms_sigma_slow_flow: Option<f64>,
}

/// A point along the decay beside theory.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ComparedPoint {
    /// The point.
    #[serde(flatten)]
    pub point: FreeDecayPoint,
    /// Detuning of the backbone at this C, to first order; absent below the fold.
    pub sigma_theory: Option<f64>,
    /// Detuning of the exact backbone at this C; absent outside it.
    pub sigma_exact: Option<f64>,
    /// Detuning at this C of the decay that the slow flow predicts, to the first order in its rate; absent below the fold.
    pub sigma_slow_flow: Option<f64>,
}

impl Comparison {
    /// Compares what was identified on `scene`.
    pub fn of(found: &Identification, scene: &Scene) -> Self {
        let (knowledge, lock) = (found.knowledge, found.lock);
        let parameters = knowledge.numbers;
        let distance = |sigma: f64, c: f64| (sigma - lock.at.sigma).hypot(c - lock.at.c);
        // A base that is held from sample to sample moves a little less than was asked for.
        let omega = TAU * lock.at.f_hz;
        let moved = knowledge.target.base_per_sample(omega, knowledge.sample_time);
        let driven = Dimensionless { g: moved * parameters.g, ..parameters };
        let solutions = resonant(&driven).into_iter().filter(BackbonePoint::stable);
        let theory = solutions.min_by(|a, b| distance(a.sigma, a.c).total_cmp(&distance(b.sigma, b.c)));
        let as_driven = Scene { amplitude: moved * scene.amplitude, ..scene.clone() };
        let orbits = phase_resonant(&as_driven, &driven);
        let at_target = ExactCurve::of_scene(scene, &parameters, [lock.at.sigma, lock.at.c]);
        // The orbit that the lock followed, moved along the backbone to the measured C.
        let near = followed(&orbits, &lock)
            .map(|orbit| [orbit.sigma, orbit.b])
            .or_else(|| at_target.place(lock.at.c, lock.at.sigma, lock.at.g));
        let exact = near.and_then(|near| at_target.orbits.with_amplitude(lock.at.c, near));
        // Without a drive, the decay is at phase resonance.
        let curve = match knowledge.is_at_phase_resonance() {
            true => at_target,
            false => {
                let mut undriven = scene.clone();
                undriven.controller.phase_target = -90.0;
                let resonant = Dimensionless { definition: undriven.definition(), ..parameters };
                ExactCurve::of_scene(&undriven, &resonant, [lock.at.sigma, lock.at.c])
            }
        };
        let decay: Vec<ComparedPoint> = found
            .decay
            .points
            .iter()
            .map(|point| ComparedPoint {
                point: *point,
                sigma_theory: free_sigma(&parameters, point.c),
                sigma_exact: at(&curve.places, point.c).map(|place| place[1]),
                sigma_slow_flow: by_slow_flow(&parameters, point.c),
            })
            .collect();
        let reference = scene.units().reference;
        let after_release = found.base_after_release.map(|drive| {
            let in_unit = [drive.value, drive.uncertainty].map(|metres| reference.of_metres(metres));
            reference.base_or_force(in_unit)
        });
        let [base_after_release, force_after_release] = after_release.unwrap_or_default();
        Self {
            rms_sigma_error: rms(&decay, |row| Some(row.point.sigma - row.sigma_theory?)),
            rms_sigma_exact: rms(&decay, |row| Some(row.point.sigma - row.sigma_exact?)),
            rms_sigma_slow_flow: rms(&decay, |row| Some(row.point.sigma - row.sigma_slow_flow?)),
            parameters,
            left_out: scene.left_out_of_cavity(),
            linear: knowledge.measured_linear(),
            lock,
            theory,
            exact,
            orbits,
            decay,
            decay_end: found.decay.end,
            base_after_release,
            force_after_release,
            curve,
        }
    }

    /// The stable orbits at this G that the lock did not follow.
    pub fn others(&self) -> impl Iterator<Item = &Orbit> {
        let followed = followed(&self.orbits, &self.lock);
        self.orbits
            .iter()
            .filter(move |orbit| orbit.stable && followed != Some(*orbit))
    }
}

/// The orbit that a lock followed: the nearest one.
fn followed<'a>(orbits: &'a [Orbit], lock: &Lock) -> Option<&'a Orbit> {
    let distance = |orbit: &Orbit| (orbit.sigma - lock.at.sigma).hypot(orbit.c - lock.at.c);
    orbits.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))
}

/// RMS of an error over the points above [`COMPARED_ABOVE`]; `None` where there is none.
fn rms(points: &[ComparedPoint], error: impl Fn(&ComparedPoint) -> Option<f64>) -> Option<f64> {
    let errors = points
        .iter()
        .filter(|row| row.point.c > COMPARED_ABOVE)
        .filter_map(error);
    let mean_square = mean_square(errors);
    (!mean_square.is_nan()).then(|| mean_square.sqrt())
}

// Distance of measured points from the exact backbone.

/// Orbits of the curve of one oscillator: as a polygon it is off by less than 1e-5.
const OSCILLATOR_ORBITS: usize = 3000;

/// C, sigma, G and speed of the particle of an exact orbit.
type Place = [f64; 4];

/// The exact backbone beyond the fold as a fine polygon, by increasing particle speed.
#[derive(Debug, Clone, PartialEq)]
pub struct ExactCurve {
    /// The orbits of which it is the polygon.
    orbits: ExactOrbits,
    /// The curve nearest to the measurement, by increasing speed of the particle.
    places: Vec<Place>,
    /// The curves near which the orbits are that points are compared with: of one oscillator the one of `places`; of a structure all of them, in the
    /// order in which they were continued, because near another mode the speed of the particle rises and falls along a curve.
    compared: Vec<Vec<Place>>,
    /// All curves, to be drawn; of one oscillator beyond the fold.
    pub curves: Vec<Vec<Orbit>>,
    /// It has more modes than the theory beside it.
    pub is_of_structure: bool,
}

/// Difference of a point from the exact backbone, by exact orbits; `nearest` beyond the curve by its polygon.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Distance {
    /// Largest of the differences in C, sigma and G, at the place on the curve where it is smallest.
    pub nearest: f64,
    /// Difference in sigma from the exact orbit with the same C, the nearest of several; absent without one.
    pub sigma: Option<f64>,
    /// Difference in G from this orbit; absent without one.
    #[serde(rename = "G")]
    pub g: Option<f64>,
}

/// The place of an orbit.
fn place(orbit: &Orbit) -> Place {
    [orbit.c, orbit.sigma, orbit.g, orbit.b]
}

/// The places of a curve from its smallest response towards faster particles.
fn right_of_fold(curve: &[Orbit]) -> Vec<Place> {
    let mut orbits: Vec<&Orbit> = curve.iter().collect();
    orbits.sort_by(|one, other| one.b.total_cmp(&other.b));
    let fold = (0..orbits.len()).min_by(|&a, &b| orbits[a].c.total_cmp(&orbits[b].c));
    let rising = orbits.iter().skip(fold.unwrap_or(0));
    rising.map(|orbit| place(orbit)).collect()
}

impl ExactCurve {
    /// The curve of a scene, in the numbers of its oscillator or of the driven mode of its structure. There may be several curves; it is the nearest
    /// to `near`, sigma and C.
    pub fn of_scene(scene: &Scene, numbers: &Dimensionless, near: [f64; 2]) -> Self {
        match structure_backbone(scene, numbers) {
            Some(curves) => {
                let compared = curves.iter().map(|curve| curve.iter().map(place).collect()).collect();
                Self {
                    compared,
                    is_of_structure: true,
                    ..Self::nearest(ExactOrbits::of(scene, numbers), curves, near)
                }
            }
            None => Self::of(numbers),
        }
    }

    /// The curve of one oscillator.
    pub fn of(scene: &Dimensionless) -> Self {
        let flow = SlowFlow::new(scene.lambda, scene.r);
        let beyond_fold = |mut curve: OrbitCurve| {
            curve.points.retain(|orbit| orbit.b >= flow.manifold.b_min());
            curve.points
        };
        let curves = backbone(scene, None, OSCILLATOR_ORBITS).into_iter().map(beyond_fold);
        let middle = flow.backbone_at(0.5 * (flow.manifold.b_min() + B_SYMMETRY_BREAKING));
        Self::nearest(
            ExactOrbits::of_oscillator(scene),
            curves.collect(),
            [middle.sigma, middle.c],
        )
    }

    /// The one of some curves that is nearest to `near`.
    fn nearest(orbits: ExactOrbits, curves: Vec<Vec<Orbit>>, near: [f64; 2]) -> Self {
        let distance = |curve: &[Place]| {
            let distances = curve.iter().map(|[c, sigma, ..]| (sigma - near[0]).hypot(c - near[1]));
            distances.fold(f64::INFINITY, f64::min)
        };
        let rising = curves.iter().map(|curve| right_of_fold(curve));
        let nearest = rising.min_by(|one, other| distance(one).total_cmp(&distance(other)));
        let places = nearest.unwrap_or_default();
        Self {
            orbits,
            compared: vec![places.clone()],
            places,
            curves,
            is_of_structure: false,
        }
    }

    /// C, sigma, G and speed of the particle of its orbits, from the fold on.
    pub fn places(&self) -> &[Place] {
        &self.places
    }

    /// Sigma and speed of the place on the polygon with the same C as `(C, sigma, G)`, the nearest of several.
    fn place(&self, c: f64, sigma: f64, g: f64) -> Option<[f64; 2]> {
        let pairs = || self.compared.iter().flat_map(|places| places.windows(2));
        let away = |[_, exact, drive, _]: &Place| (sigma - exact).abs().max((g - drive).abs());
        let places = pairs().filter_map(|pair| at(pair, c));
        let [_, exact, _, speed] = places.min_by(|one, other| away(one).total_cmp(&away(other)))?;
        Some([exact, speed])
    }

    /// The distance of `(C, sigma, G)` from the polygon.
    fn to_polygon(&self, point: [f64; 3]) -> Option<f64> {
        let pairs = self.compared.iter().flat_map(|places| places.windows(2));
        let segments = pairs.map(|pair| {
            let [from, to] = [pair[0], pair[1]].map(|[c, sigma, g, _]| [c, sigma, g]);
            to_segment(point, from, to)
        });
        segments.reduce(f64::min)
    }

    /// How far `(C, sigma, G)` lies from the curve; `None` where there is no curve.
    pub fn distance(&self, c: f64, sigma: f64, g: f64) -> Option<Distance> {
        let polygon = self.to_polygon([c, sigma, g])?;
        let at = |c: f64, near: [f64; 2]| self.orbits.with_amplitude(c, near);
        let same = self.place(c, sigma, g).and_then(|near| at(c, near));
        let Some(same) = same else {
            return Some(Distance { nearest: polygon, sigma: None, g: None });
        };
        let differences = [sigma - same.sigma, g - same.g];
        // The curve there, as straight as it is over the difference; its direction from an orbit beside.
        let largest = differences[0].abs().max(differences[1].abs());
        let beside = at(c * (1.0 + 1e-5), [same.sigma, same.b]);
        let nearest = beside.map_or(polygon, |beside| {
            let from = [same.c, same.sigma, same.g];
            let tangent = [beside.c - same.c, beside.sigma - same.sigma, beside.g - same.g];
            let size = tangent.iter().fold(0.0_f64, |size, part| size.max(part.abs()));
            let end = |side: f64| [0, 1, 2].map(|n| from[n] + side * 2.0 * largest * tangent[n] / size);
            to_segment([c, sigma, g], end(-1.0), end(1.0))
        });
        Some(Distance {
            nearest,
            sigma: Some(differences[0]),
            g: Some(differences[1]),
        })
    }
}

/// The places, interpolated linearly at their first value `c`, in the last pair around it.
fn at<const N: usize>(places: &[[f64; N]], c: f64) -> Option<[f64; N]> {
    let pair = places
        .windows(2)
        .rfind(|pair| (pair[0][0] - c) * (pair[1][0] - c) <= 0.0 && pair[0][0] != pair[1][0])?;
    let x = (c - pair[0][0]) / (pair[1][0] - pair[0][0]);
    Some(std::array::from_fn(|i| pair[0][i] + x * (pair[1][i] - pair[0][i])))
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

// A tracked backbone beside the exact one.

/// A tracked backbone beside the exact one.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TrackedComparison {
    /// The numbers of the scene.
    pub parameters: Dimensionless,
    /// What exact orbits leave out of the scene's cavity; absent if it is ideal.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub left_out: Option<String>,
    /// Periods from the start to the closed loop.
    pub periods_to_lock: f64,
    /// All periods, from the start to the last point.
    pub periods: f64,
    /// Standard uncertainties of sigma and lambda, which all points and curves share, if the loop check has measured both.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub u_linear: Option<[f64; 2]>,
    /// The linear response, if it was measured on the rig.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub linear: Option<MeasuredLinear>,
    /// Where the curve ended before the last level, in words; absent if it did not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub end: Option<String>,
    /// The points, each beside the exact curve.
    pub points: Vec<TrackedPoint>,
    /// The exact backbone that the points are compared with.
    #[serde(skip)]
    pub exact: ExactCurve,
}

/// A point and its distance from the exact backbone; absent without an exact backbone.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TrackedPoint {
    /// The point.
    #[serde(flatten)]
    pub point: LevelPoint,
    /// Its distance.
    pub exact: Option<Distance>,
}

impl TrackedPoint {
    /// The regime, by the impacts where the rig reports them.
    pub fn regime(&self) -> Regime {
        self.point.regime_by_impacts.unwrap_or(self.point.regime)
    }

    /// Whether this is a settled point of a motion with impacts or, where none are reported, of a nonlinear one.
    pub fn is_of_backbone(&self) -> bool {
        self.point.settled && !matches!(self.regime(), Regime::NoImpacts | Regime::NotEstablished)
    }
}

impl TrackedComparison {
    /// Compares the points with the exact backbone of the scene at its phase target.
    pub fn of(tracked: &Tracked, scene: &Scene) -> Self {
        let knowledge = tracked.knowledge;
        let parameters = knowledge.numbers;
        let first = tracked
            .points
            .first()
            .map_or([0.0; 2], |point| [point.at.sigma, point.at.c]);
        let curve = ExactCurve::of_scene(scene, &parameters, first);
        let exact = |point: &LevelPoint| curve.distance(point.at.c, point.at.sigma, point.at.g);
        let compare = |point: &LevelPoint| TrackedPoint { point: *point, exact: exact(point) };
        Self {
            points: tracked.points.iter().map(compare).collect(),
            end: tracked.end.clone(),
            periods_to_lock: tracked.periods_to_lock,
            periods: tracked.periods,
            u_linear: knowledge.is_measured.then(|| {
                let u_sigma = knowledge.linear.uncertainty / (parameters.epsilon * parameters.omega0);
                [u_sigma, 2.0 * u_sigma]
            }),
            left_out: scene.left_out_of_cavity(),
            linear: knowledge.measured_linear(),
            parameters,
            exact: curve,
        }
    }

    /// All periods, the lock included, over the number of points.
    pub fn periods_per_point(&self) -> f64 {
        self.periods / self.points.len() as f64
    }

    /// Whether the rig reports its impacts. Otherwise nothing says that it contains a particle.
    pub fn reports_impacts(&self) -> bool {
        self.points.iter().any(|row| row.point.regime_by_impacts.is_some())
    }

    /// Largest error at equal C, in sigma or G, and largest distance from the exact backbone, of the settled points.
    pub fn worst(&self) -> Option<LargestErrors> {
        let errors = self.points.iter().filter(|row| row.point.settled).filter_map(|row| {
            let Distance { nearest, sigma, g } = row.exact?;
            let at_equal_c = sigma?.abs().max(g?.abs());
            Some(LargestErrors { at_equal_c, nearest })
        });
        errors.reduce(|largest, errors| LargestErrors {
            at_equal_c: largest.at_equal_c.max(errors.at_equal_c),
            nearest: largest.nearest.max(errors.nearest),
        })
    }
}

/// Largest errors of the points of a tracked backbone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LargestErrors {
    /// Largest difference in sigma or G from the exact backbone at the same C.
    pub at_equal_c: f64,
    /// Largest distance from the nearest place of the exact backbone: the largest of the differences in C, sigma and G there.
    pub nearest: f64,
}

/// sigma of the slow flow at the amplitude `c` along the free decay: the backbone's, corrected to the first order in the rate of the decay; `None`
/// where there is no 1:1 motion.
fn by_slow_flow(d: &Dimensionless, c: f64) -> Option<f64> {
    let flow = SlowFlow::new(d.lambda, d.r);
    let g = flow.backbone_at(flow.manifold.b(c, BranchSide::Right)?).g;
    Some(free_sigma(d, c)? - 0.5 * d.epsilon * g * flow.drift(c)?)
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
        let distance = |sigma: f64| curve.distance(orbit.c, sigma, orbit.g).unwrap();
        let on = distance(orbit.sigma);
        assert!(on.nearest < 1e-9, "{on:?}");
        assert!(on.sigma.unwrap().abs() < 1e-9 && on.g.unwrap().abs() < 1e-9, "{on:?}");
        let off = distance(orbit.sigma + 0.01);
        assert!((off.sigma.unwrap() - 0.01).abs() < 1e-9);
        assert!(off.nearest > 1e-3 && off.nearest < 0.01);
    }

    #[test]
    fn of_two_places_with_the_same_amplitude_the_nearer_one_is_compared() {
        let curve = ExactCurve {
            orbits: ExactOrbits::of_oscillator(&Dimensionless::new(0.0084, 1.43, 0.65, 1.1)),
            places: Vec::new(),
            compared: vec![vec![[0.6, -1.0, 1.2, 1.0], [0.4, -1.2, 0.8, 0.8], [0.6, 0.4, 2.0, 0.6]]],
            curves: Vec::new(),
            is_of_structure: true,
        };
        for (sigma, g, speed) in [(-1.1, 1.0, 0.9), (-0.4, 1.4, 0.7)] {
            let (nearest, near) = (
                curve.to_polygon([0.5, sigma, g]).unwrap(),
                curve.place(0.5, sigma, g).unwrap(),
            );
            assert!(nearest < 1e-12 && (near[0] - sigma).abs() < 1e-12 && (near[1] - speed).abs() < 1e-12);
        }
    }
}
