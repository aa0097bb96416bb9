//! A tracked backbone beside the exact one.

use serde::Serialize;
use vines_model::Dimensionless;

use super::exact_curve::{Distance, ExactCurve};
use crate::backbone::{Point, Tracked};
use crate::identification::Regime;
use crate::scene::Scene;

/// A tracked backbone beside the exact one.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TrackedComparison {
    /// The numbers all of this belongs to.
    pub parameters: Dimensionless,
    /// Periods from the start to the closed loop.
    pub periods_to_lock: f64,
    /// All periods, from the start to the last point.
    pub periods: f64,
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
    pub point: Point,
    /// Its distance.
    pub exact: Option<Distance>,
}

impl TrackedComparison {
    /// Compares the points with the exact backbone of the scene; not where the loop holds another phase than that of resonance.
    pub fn of(tracked: &Tracked, scene: &Scene) -> Self {
        let parameters = scene.dimensionless();
        let curve = ExactCurve::of(&parameters);
        let exact = |point: &Point| curve.distance(point.at.c, point.at.sigma, point.at.g);
        let compare = |point: &Point| TrackedPoint {
            point: *point,
            exact: Some(point)
                .filter(|_| scene.controller.is_at_phase_resonance())
                .and_then(exact),
        };
        Self {
            points: tracked.points.iter().map(compare).collect(),
            periods_to_lock: tracked.periods_to_lock,
            periods: tracked.periods,
            parameters,
            exact: curve,
        }
    }

    /// All periods, the lock included, over the number of points.
    pub fn periods_per_point(&self) -> f64 {
        self.periods / self.points.len() as f64
    }

    /// Why these points are no backbone of a motion with impacts: a settled point, or all points, without evidence of impacts.
    pub fn doubt(&self) -> Option<String> {
        let regime = |one: &TrackedPoint| one.point.regime_by_impacts.unwrap_or(one.point.regime);
        let count = |wanted: Regime| self.points.iter().filter(|one| regime(one) == wanted).count();
        let [linear, doubtful] = [Regime::NoImpacts, Regime::NotEstablished].map(count);
        let of = self.points.len();
        let is_settled = |one: &TrackedPoint| one.point.settled && regime(one) == Regime::NotEstablished;
        if linear == of {
            return Some(format!(
                "all {of} points are without impacts (the linear mode): the particle does not reach the walls. Check that it moves freely; give \
                 it a velocity in [start]"
            ));
        }
        (linear + doubtful == of || self.points.iter().any(is_settled)).then(|| {
            format!(
                "the regime of {doubtful} of {of} points is not established: neither their third harmonic nor a distance from the linear response \
                 that the loop check measures is evidence of impacts. Check that the particle moves freely; do not skip the loop check; reduce \
                 noise that hides the harmonic"
            )
        })
    }

    /// Largest error at equal C, in sigma or G, and largest distance from the exact backbone, of the settled points.
    pub fn worst(&self) -> Option<Worst> {
        let errors = self.points.iter().filter(|one| one.point.settled).filter_map(|one| {
            let Distance { nearest, sigma, g } = one.exact?;
            let at_equal_c = sigma?.abs().max(g?.abs());
            Some(Worst { at_equal_c, nearest })
        });
        errors.reduce(|one, other| Worst {
            at_equal_c: one.at_equal_c.max(other.at_equal_c),
            nearest: one.nearest.max(other.nearest),
        })
    }
}

/// Largest errors of the points of a tracked backbone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Worst {
    /// Largest difference in sigma or G from the exact backbone at the same C.
    pub at_equal_c: f64,
    /// Largest distance from the nearest place of the exact backbone: the largest of the differences in C, sigma and G there.
    pub nearest: f64,
}
