//! Continuation of periodic motions by pseudo-arclength: through folds, stable and unstable parts alike (docs/regimes.md, eq. 27).
//!
//! The unknowns are the state after an impact, sigma and G; four equations close the motion and one more selects the curve: fixed G for a frequency
//! response, a multiplier on the unit circle for a curve of bifurcations. The step follows the tangent and shrinks where the curve bends. A branch
//! ends where its pattern of impacts ends, at a graze.
//!
//! Each kind of bifurcation has a test function of the multipliers that is zero there, and smooth also where multipliers meet. A change of
//! its sign shows a bifurcation; two of a kind within one step are missed.

use nalgebra::{DMatrix, Matrix4, Matrix6};
use serde::{Serialize, Serializer, ser::SerializeStruct};

use super::impacts::{Bounce, ImpactPattern, ImpactSection};
use super::periodic::{Periodic, SAME_MOTION, wrapped};
use super::return_map::{Bifurcation, Condition, Stability, Unknowns};
use crate::Dimensionless;
use crate::numerics::{CONVERGED, singular_values, try_bisection};

/// Ranges, number of points and step of a continuation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContinuationLimits {
    /// Range of sigma.
    pub sigma: [f64; 2],
    /// Range of G.
    pub g: [f64; 2],
    /// Most points.
    pub points: usize,
    /// Longest step in the space of the unknowns.
    pub step: f64,
}

impl Default for ContinuationLimits {
    /// Detunings from -6 to 6, G up to 10, 2000 points at most 0.05 apart.
    fn default() -> Self {
        Self {
            sigma: [-6.0, 6.0],
            g: [-1e-6, 10.0],
            points: 2000,
            step: 0.05,
        }
    }
}

words! {
    /// Why a branch ended.
    BranchEnd::name {
        /// It left the range of sigma or G.
        Range = "left the range",
        /// It came back to its start.
        Closed = "closed",
        /// The largest number of points was reached.
        Points = "number of points",
        /// Its motions, which are not 1:1, are unstable for a hundred points from there on: such a branch winds on within chaos.
        Unstable = "unstable from there on",
        /// It joins the branch whose symmetry it breaks or whose period it doubles; beyond that it is its own mirror image.
        Joins = "joins a shorter pattern",
        /// The complex pair of multipliers on the unit circle becomes real.
        Resonance = "strong resonance",
        /// The pattern of impacts ends here: a graze, or impacts that accumulate.
        Graze = "graze",
    }
}

/// A point where stability changes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BranchBifurcation {
    /// What happens.
    pub kind: Bifurcation,
    /// The motion there.
    pub motion: Periodic,
}

/// A continued curve. It is serialised with its pattern once, and with the points that a drawing needs.
#[derive(Debug, Clone, PartialEq)]
pub struct Branch {
    /// Its motions in order.
    pub points: Vec<Periodic>,
    /// Where stability changes, in order.
    pub special: Vec<BranchBifurcation>,
    /// Why it ended, before its first and after its last motion.
    pub ended: [BranchEnd; 2],
}

/// Points without a stable motion after which a branch that is not 1:1 ends.
const UNSTABLE: usize = 100;
/// Largest distance of a motion of a branch from the lines between those that are serialised, in sigma, G, B and both parts of C.
const DRAWN: f64 = 1e-4;

/// A motion of a branch as it is serialised; the impacts follow from the first one.
#[derive(Serialize)]
struct DrawnMotion<'a> {
    #[serde(rename = "G")]
    g: f64,
    sigma: f64,
    #[serde(rename = "C")]
    c: f64,
    gamma: f64,
    #[serde(rename = "B")]
    b: f64,
    #[serde(flatten)]
    stability: &'a Stability,
    start: Bounce,
}

impl Serialize for Branch {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        fn drawn(motion: &Periodic) -> DrawnMotion<'_> {
            let Periodic { g, sigma, c, gamma, b, .. } = *motion;
            let (stability, start) = (&motion.stability, motion.bounces[0]);
            DrawnMotion { g, sigma, c, gamma, b, stability, start }
        }
        let points: Vec<DrawnMotion> = self.drawn().into_iter().map(drawn).collect();
        let mut fields = serializer.serialize_struct("Branch", 4)?;
        fields.serialize_field("shape", self.pattern())?;
        fields.serialize_field("points", &points)?;
        fields.serialize_field("special", &self.special)?;
        fields.serialize_field("ended", &self.ended)?;
        fields.end()
    }
}

impl Branch {
    /// The motions that a drawing needs: the ends, both sides of a change of stability, and those without which a line is too far off.
    pub fn drawn(&self) -> Vec<&Periodic> {
        let points = &self.points;
        let (mut drawn, mut from) = (vec![&points[0]], 0);
        for to in 1..points.len() {
            let kind = |n: usize| [points[n].stability.stable, points[n].stability.neutral];
            let changes = |n: usize| kind(n) != kind(n - 1);
            let is_off = |n: usize| off(&points[n], [&points[from], &points[to]]) > DRAWN;
            let ends = changes(to) || to > 1 && changes(to - 1);
            if from + 1 < to && (ends || (from + 1..to).any(is_off)) {
                from = to - 1;
                drawn.push(&points[from]);
            }
        }
        drawn.extend(points[1..].last());
        drawn
    }

    /// Its motions are not 1:1, and the last ones are unstable.
    fn winds(&self) -> bool {
        let last = self.points.len().checked_sub(UNSTABLE).map(|from| &self.points[from..]);
        !self.pattern().is_one_to_one()
            && last.is_some_and(|last| last.iter().all(|motion| motion.stability.is_unstable()))
    }
}

/// Distance of a motion from the line between two others.
fn off(motion: &Periodic, [from, to]: [&Periodic; 2]) -> f64 {
    let [chord, beside] = [to, motion].map(|end| end.invariants() - from.invariants());
    let part = (beside.dot(&chord) / chord.norm_squared()).clamp(0.0, 1.0);
    (beside - chord * part).norm()
}

impl ContinuationLimits {
    fn contain(&self, sigma: f64, g: f64) -> bool {
        let inside = |value: f64, [low, high]: [f64; 2]| (low..=high).contains(&value);
        inside(sigma, self.sigma) && inside(g, self.g)
    }
}

/// Steps below this end a branch.
const SHORTEST_STEP: f64 = 1e-7;
/// Cosine of the largest turn of the tangent in a step.
const STRAIGHT: f64 = 0.98;
/// Part of the longest step with which a branch reaches the one that it joins: near there, the plane at the end of a step meets both.
const APPROACH: f64 = 1.0 / 256.0;
/// Largest rounding error of a test function: in conservative motions, some of these functions are zero everywhere.
const TEST_FUNCTION_ROUNDING: f64 = 1e-9;
/// Largest distance of a multiplier from the circle where a crossing is located.
const CROSSING_DISTANCE: f64 = 1e-4;

/// The curve of the motions of one pattern that satisfy a condition.
struct Curve<'a> {
    scene: &'a Dimensionless,
    pattern: &'a ImpactPattern,
    condition: Condition,
    /// Longest step with which a branch joins another.
    reach: f64,
}

impl Curve<'_> {
    /// The direction of the curve, and the sign of its equations' determinant, which is the same all along the curve.
    fn tangent(&self, at: &Periodic, towards: &Unknowns) -> Option<(Unknowns, f64)> {
        let mut matrix = Matrix6::zeros();
        matrix.fixed_rows_mut::<4>(0).copy_from(&at.map.closing());
        let map = &mut ImpactSection { scene: self.scene, pattern: self.pattern };
        let (_, by) = self.condition.value(map, &at.unknowns(), &at.map);
        matrix.set_row(4, &by);
        matrix.set_row(5, &towards.transpose());
        let mut right = Unknowns::zeros();
        right[5] = 1.0;
        let lu = matrix.lu();
        let tangent = lu.solve(&right)?;
        let length = tangent.norm();
        (length.is_finite() && length > 0.0).then(|| (tangent / length, lu.determinant().signum()))
    }

    /// The intersection of the curve with the plane at the end of a step along the tangent.
    fn correct(&self, from: &Periodic, tangent: &Unknowns, step: f64) -> Option<Periodic> {
        let through = from.unknowns() + tangent * step;
        let plane = Condition::Plane { through, normal: *tangent };
        Periodic::find(self.scene, self.pattern, &through, [self.condition, plane])
            .filter(|found| (found.unknowns() - through).norm() <= step.abs())
    }

    /// The next motion after `last` and the tangent there; None where the step must shrink.
    fn advance(&self, last: &Periodic, (tangent, sign): (&Unknowns, f64), step: f64) -> Option<(Periodic, Unknowns)> {
        let next = self.correct(last, tangent, step)?;
        let (turned, now) = self.tangent(&next, tangent)?;
        // Where two curves nearly meet, a long step leads from one to the other, on which the sign is the opposite one. Where a branch
        // passes the motion that it doubles, it changes as well.
        let same = if joins(last, &next) {
            step <= self.reach
        } else {
            now == sign
        };
        (same && turned.dot(tangent) >= STRAIGHT).then_some((next, turned))
    }

    /// Adds the motion `next`, a step after the last one, and the bifurcations between them to the branch, if it does not end before. The reason,
    /// if the branch ends. `tangents` are those at its first, its last and the next motion.
    fn add(
        &self,
        branch: &mut Branch,
        next: Periodic,
        [first, tangent, turned]: [&Unknowns; 3],
        step: f64,
        limits: &ContinuationLimits,
    ) -> Option<BranchEnd> {
        let last = branch.points.last()?;
        if joins(last, &next) {
            branch.points.extend(self.joint(last, tangent, step));
            return Some(BranchEnd::Joins);
        }
        match self.condition {
            Condition::Bifurcation(Bifurcation::NeimarkSacker) if !next.stability.on_circle(1e-3, 1e-6) => {
                return Some(BranchEnd::Resonance);
            }
            Condition::Bifurcation(_) => {}
            _ => branch.special.extend(self.crossings(tangent * step, [last, &next])),
        }
        branch.points.push(next);
        let [start, .., next] = &branch.points[..] else {
            return None;
        };
        // A phase difference of 2 pi is the same motion.
        let mut apart = next.unknowns() - start.unknowns();
        apart[0] = wrapped(apart[0]);
        if branch.points.len() > 10 && apart.norm() < step && turned.dot(first) > 0.9 {
            if apart.dot(turned) < 0.0 {
                // A little beyond the start, which the plane at the end of the step may miss.
                let beyond = turned * (1.1 * apart.norm());
                branch.special.extend(self.crossings(beyond, [next, start]));
            } else if let [first, .., last] = &branch.special[..]
                && first.motion.distance(&last.motion) < SAME_MOTION
            {
                // The last step passed the start, and what is beyond it was known.
                branch.special.pop();
            }
            return Some(BranchEnd::Closed);
        }
        // The range of G does not limit a curve at constant G.
        let free = !matches!(self.condition, Condition::Excitation(_));
        let inside = |motion: &Periodic| limits.contain(motion.sigma, if free { motion.g } else { limits.g[0] });
        if !inside(next) {
            branch.special.retain(|bifurcation| inside(&bifurcation.motion));
            return Some(BranchEnd::Range);
        }
        if branch.winds() {
            let stable = branch.points.iter().rposition(|motion| !motion.stability.is_unstable());
            branch.points.truncate(stable.unwrap_or(0) + 2);
            return Some(BranchEnd::Unstable);
        }
        None
    }

    /// The motions of the curve beside `chord`, over the part of its length.
    fn beside(&self, from: &Periodic, chord: Unknowns) -> impl Fn(f64) -> Option<Periodic> {
        let (step, tangent) = (chord.norm(), chord.normalize());
        move |part| self.correct(from, &tangent, part * step)
    }

    /// The last motion within a step before the one that the branch doubles.
    fn joint(&self, from: &Periodic, tangent: &Unknowns, step: f64) -> Option<Periodic> {
        let at = self.beside(from, tangent * step);
        let before = |part: f64| at(part).map(|end| !joins(from, &end));
        let (end, _) = try_bisection(0.0, 1.0, CONVERGED, before)?;
        at(end)
    }

    /// The bifurcations between two neighbouring motions, in order: on the curve beside `chord`, which begins at the first.
    fn crossings(&self, chord: Unknowns, [from, to]: [&Periodic; 2]) -> Vec<BranchBifurcation> {
        let at = self.beside(from, chord);
        let crossing = |kind: Bifurcation| {
            let [first, last] = [from, to].map(|motion| kind.test(&motion.map.monodromy()));
            if first * last >= 0.0 || first.abs().max(last.abs()) < TEST_FUNCTION_ROUNDING {
                return None;
            }
            let like_first = |part: f64| Some(kind.test(&at(part)?.map.monodromy()) * first > 0.0);
            let (_, beyond) = try_bisection(0.0, 1.0, CONVERGED, like_first)?;
            let motion = at(beyond)?;
            // Two real multipliers whose product is one are a neutral saddle, not a bifurcation.
            let imaginary = if kind == Bifurcation::NeimarkSacker {
                CROSSING_DISTANCE
            } else {
                0.0
            };
            let is_on_circle = motion.stability.on_circle(imaginary, CROSSING_DISTANCE);
            is_on_circle.then_some((beyond, BranchBifurcation { kind, motion }))
        };
        let flip = if self.pattern.mirrored {
            Bifurcation::SymmetryBreaking
        } else {
            Bifurcation::PeriodDoubling
        };
        let kinds = [Bifurcation::Fold, flip, Bifurcation::NeimarkSacker];
        let mut found: Vec<_> = kinds.into_iter().filter_map(crossing).collect();
        found.sort_by(|first, second| first.0.total_cmp(&second.0));
        found.into_iter().map(|found| found.1).collect()
    }
}

/// Between two motions, their branch passes the motion that it doubles.
fn joins(from: &Periodic, to: &Periodic) -> bool {
    match (from.halves_apart(), to.halves_apart()) {
        (Some(first), Some(second)) => first.dot(&second) < 0.0,
        _ => false,
    }
}

/// Follows the curve of `condition` from `start` towards `towards`, a direction in the space of the unknowns.
fn continue_from(
    scene: &Dimensionless,
    start: &Periodic,
    condition: Condition,
    towards: &Unknowns,
    limits: &ContinuationLimits,
) -> Branch {
    let (pattern, reach) = (&start.pattern, APPROACH * limits.step);
    let curve = Curve { scene, pattern, condition, reach };
    let mut branch = Branch {
        points: vec![start.clone()],
        special: Vec::new(),
        ended: [BranchEnd::Graze; 2],
    };
    let Some((first, sign)) = curve.tangent(start, towards) else {
        return branch;
    };
    let (mut tangent, mut step) = (first, limits.step / 8.0);
    while step >= SHORTEST_STEP {
        if branch.points.len() >= limits.points {
            branch.ended[1] = BranchEnd::Points;
            break;
        }
        let last = branch.points.last().unwrap_or(start);
        let Some((next, turned)) = curve.advance(last, (&tangent, sign), step) else {
            step /= 2.0;
            continue;
        };
        if let Some(end) = curve.add(&mut branch, next, [&first, &tangent, &turned], step, limits) {
            branch.ended[1] = end;
            break;
        }
        if turned.dot(&tangent) > 0.5 * (1.0 + STRAIGHT) {
            step = (step * 1.5).min(limits.step);
        }
        tangent = turned;
    }
    branch
}

/// Follows the curve of `condition` through `start` in both directions, from falling to rising sigma.
pub fn continue_both_ways(
    scene: &Dimensionless,
    start: &Periodic,
    condition: Condition,
    limits: &ContinuationLimits,
) -> Branch {
    let mut towards = Unknowns::zeros();
    towards[4] = 1.0;
    let mut up = continue_from(scene, start, condition, &towards, limits);
    if up.ended[1] == BranchEnd::Closed {
        up.ended[0] = BranchEnd::Closed;
        return up;
    }
    let down = continue_from(scene, start, condition, &-towards, limits);
    let mut points: Vec<Periodic> = down.points.into_iter().skip(1).rev().collect();
    points.append(&mut up.points);
    let mut special: Vec<BranchBifurcation> = down.special.into_iter().rev().collect();
    special.append(&mut up.special);
    Branch { points, special, ended: [down.ended[1], up.ended[1]] }
}

/// Distance from a bifurcation at which a motion of the other branch is searched for.
const ASIDE: f64 = 1e-3;

/// The branch of motions that leaves a symmetry breaking or a period doubling, along the curve of `condition`. Its mirror image, or
/// itself one repetition later, leaves in the opposite direction and counts as the same branch.
pub(super) fn branch_off(
    scene: &Dimensionless,
    at: &BranchBifurcation,
    condition: Condition,
    limits: &ContinuationLimits,
) -> Option<Branch> {
    let from = &at.motion;
    // The eigenvector of the map for the multiplier -1.
    let turned = from.map.monodromy() + Matrix4::identity();
    let svd = singular_values(DMatrix::from_column_slice(4, 4, turned.as_slice()))?;
    let aside = svd.v_t?.row(svd.singular_values.imin()).transpose();
    let mut towards = Unknowns::zeros();
    towards.fixed_rows_mut::<4>(0).copy_from(&aside);
    let pattern = &from.pattern.doubled();
    let start = Curve { scene, pattern, condition, reach: 0.0 }.correct(from, &towards, ASIDE)?;
    let mut branch = continue_from(scene, &start, condition, &towards, limits);
    branch.ended[0] = BranchEnd::Joins;
    Some(branch)
}
