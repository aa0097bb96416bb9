//! Where multipliers cross the unit circle along a branch.
//!
//! Each kind of bifurcation has a test function of the multipliers that is zero there, and smooth also where multipliers meet
//! (docs/theory.md, eq. 27). A change of its sign shows one bifurcation; two of a kind between two points of the branch cancel, and are
//! found where the function is closest to zero.

use super::{branch::Special, condition::Bifurcation, periodic::Periodic};
use crate::numerics::{golden_section, try_bisection};

/// Test functions below this are rounding: in conservative motions, some are zero everywhere.
const ROUNDING: f64 = 1e-9;
/// The same for folds where both halves of a motion differ by less than [`HALVES`], because the function is small there.
const ROUNDING_OF_FOLDS: f64 = 1e-12;
const HALVES: f64 = 0.1;
/// Difference of the halves below which a fold cannot be told from rounding, which grows with its inverse.
const EQUAL_HALVES: f64 = 5e-4;
/// Largest distance of a multiplier from the circle where a crossing is located.
const LOCATED: f64 = 1e-4;
/// Fraction of a step to which a bifurcation is located.
const FINEST: f64 = 1e-12;

/// A part of a branch, from 0 to 1.
pub(super) struct Part<F: Fn(f64) -> Option<Periodic>>(pub F);

impl<F: Fn(f64) -> Option<Periodic>> Part<F> {
    /// The bifurcations between two neighbouring points, in order.
    pub(super) fn crossings(&self, from: &Periodic, to: &Periodic) -> Vec<Special> {
        let found = kinds(from)
            .into_iter()
            .filter_map(|kind| self.crossing(kind, [(0.0, from), (1.0, to)]));
        let mut found: Vec<_> = found.collect();
        found.sort_by(|one, other| one.0.total_cmp(&other.0));
        found.into_iter().map(|one| one.1).collect()
    }

    /// The bifurcations that cancel around the second of three neighbouring points.
    pub(super) fn pairs(&self, points: [&Periodic; 3]) -> Vec<Special> {
        kinds(points[0])
            .into_iter()
            .flat_map(|kind| self.pair(kind, points))
            .collect()
    }

    fn pair(&self, kind: Bifurcation, points: [&Periodic; 3]) -> Vec<Special> {
        let sign = kind.test(&points[1].monodromy).signum();
        let [before, at, after] = points.map(|one| sign * kind.test(&one.monodromy));
        // A smooth function does not come nearer to zero than at the points by more than it changes between them.
        if at >= before || at > after || at >= before.max(after) - at {
            return Vec::new();
        }
        let value = |part: f64| (self.0)(part).map_or(f64::INFINITY, |one| sign * kind.test(&one.monodromy));
        let nearest = golden_section(0.0, 1.0, value);
        let Some(motion) = (self.0)(nearest) else {
            return Vec::new();
        };
        let both = [
            [(0.0, points[0]), (nearest, &motion)],
            [(nearest, &motion), (1.0, points[2])],
        ];
        both.into_iter()
            .filter_map(|ends| Some(self.crossing(kind, ends)?.1))
            .collect()
    }

    /// The part at which a test function passes zero between two motions, and the motion there; None if it does not, or if only a
    /// saddle is neutral.
    fn crossing(&self, kind: Bifurcation, [from, to]: [(f64, &Periodic); 2]) -> Option<(f64, Special)> {
        let [first, last] = [from, to].map(|one| kind.test(&one.1.monodromy));
        if first * last >= 0.0 || is_rounding(kind, [from.1, to.1], first.abs().max(last.abs())) {
            return None;
        }
        let like_first = |part: f64| {
            (self.0)(part)
                .map(|one| kind.test(&one.monodromy) * first > 0.0)
                .ok_or(())
        };
        let (_, beyond) = try_bisection(from.0, to.0, FINEST, like_first).ok()?;
        let motion = (self.0)(beyond)?;
        let of_stable = motion.bounds_stability();
        on_circle(kind, &motion).then_some((beyond, Special { kind, of_stable, motion }))
    }
}

fn kinds(motion: &Periodic) -> [Bifurcation; 3] {
    [
        Bifurcation::Fold,
        Bifurcation::flip(&motion.pattern),
        Bifurcation::Torus,
    ]
}

/// Whether a change of sign between two motions is rounding; `largest` is the larger of the two values.
fn is_rounding(kind: Bifurcation, motions: [&Periodic; 2], largest: f64) -> bool {
    let apart = motions.map(|one| one.halves_apart().map_or(f64::INFINITY, |apart| apart.norm()));
    let apart = apart[0].min(apart[1]);
    if kind == Bifurcation::Fold && apart < HALVES {
        largest < ROUNDING_OF_FOLDS || apart < EQUAL_HALVES
    } else {
        largest < ROUNDING
    }
}

/// Two real multipliers whose product is one are a neutral saddle, not a bifurcation.
fn on_circle(kind: Bifurcation, motion: &Periodic) -> bool {
    let complex = kind == Bifurcation::Torus;
    let mut of_kind = motion
        .multipliers
        .iter()
        .filter(|[_, im]| !complex || im.abs() > LOCATED);
    of_kind.any(|[re, im]| (re.hypot(*im) - 1.0).abs() < LOCATED)
}
