//! Continuation of periodic motions by pseudo-arclength: through folds, stable and unstable parts alike (docs/theory.md, eq. 27).
//!
//! The unknowns are the state after an impact, sigma and G; four equations close the motion and one more selects the curve:
//! fixed G for a frequency response, phase resonance for the backbone. The step follows the tangent and shrinks where the
//! curve bends. A branch ends where its pattern of impacts ends, at a graze.

use nalgebra::{Matrix4, Matrix6, SVector};

use super::branch::{Branch, Ended, Limits, Special};
use super::condition::{Bifurcation, Condition};
use super::crossings::Part;
use super::pattern::{Returned, Unknowns, follow};
use super::periodic::{Periodic, newton};
use crate::Dimensionless;
use crate::numerics::try_bisection;

/// Steps below this end a branch.
const SHORTEST: f64 = 1e-7;
/// Cosine of the largest turn of the tangent in a step.
const STRAIGHT: f64 = 0.98;
/// Part of the longest step with which a branch reaches the one that it joins: near there, the plane at the end of a step meets both.
const APPROACH: f64 = 1.0 / 256.0;
/// Fraction of a step to which the end of a branch is located.
const FINEST: f64 = 1e-12;
/// Largest distance from the joint at which a curve that cannot reach it ends.
const NEXT: f64 = 0.05;
/// Difference in sigma of a bifurcation that is located twice.
const SAME: f64 = 1e-9;

struct Curve<'a> {
    scene: &'a Dimensionless,
    start: &'a Periodic,
    condition: Condition,
    /// Longest step with which a branch joins another.
    reach: f64,
}

impl Curve<'_> {
    /// The direction of the curve, and the sign of its equations' determinant, which is the same all along the curve.
    fn tangent(&self, x: &Unknowns, towards: &Unknowns) -> Option<(Unknowns, f64)> {
        let returned = follow(self.scene, &self.start.pattern, x)?;
        let mut matrix = Matrix6::zeros();
        matrix.fixed_rows_mut::<4>(0).copy_from(&returned.by);
        matrix.set_row(
            4,
            &self.condition.value(self.scene, &self.start.pattern, x, &returned).1,
        );
        matrix.set_row(5, &towards.transpose());
        let mut right = SVector::<f64, 6>::zeros();
        right[5] = 1.0;
        let lu = matrix.lu();
        let tangent = lu.solve(&right)?;
        let length = tangent.norm();
        (length.is_finite() && length > 0.0).then(|| (tangent / length, lu.determinant().signum()))
    }

    /// The intersection of the curve with the plane at the end of a step along the tangent.
    fn correct(&self, x: &Unknowns, tangent: &Unknowns, step: f64) -> Option<Unknowns> {
        let ahead = x + tangent * step;
        let found = newton(self.scene, &self.start.pattern, ahead, |x, returned: &Returned| {
            let plane = (tangent.dot(&(x - ahead)), tangent.transpose());
            [
                self.condition.value(self.scene, &self.start.pattern, x, returned),
                plane,
            ]
        })?;
        ((found - ahead).norm() <= step.abs()).then_some(found)
    }

    /// The next point, its tangent and its motion after `last`; None where the step must shrink.
    fn advance(
        &self,
        last: &Periodic,
        (tangent, sign): (&Unknowns, f64),
        step: f64,
    ) -> Option<(Unknowns, Unknowns, Periodic)> {
        let next = self.correct(&last.unknowns(), tangent, step)?;
        let (turned, now) = self.tangent(&next, tangent)?;
        let motion = self.motion(&next)?;
        // Where two curves nearly meet, a long step leads from one to the other, on which the sign is the opposite one. Where a branch
        // passes the motion that it doubles, it changes as well.
        let same = if joins(last, &motion) {
            step <= self.reach
        } else {
            now == sign
        };
        (same && turned.dot(tangent) >= STRAIGHT).then_some((next, turned, motion))
    }

    fn motion(&self, x: &Unknowns) -> Option<Periodic> {
        Periodic::at(self.scene, &self.start.pattern, x)
    }

    /// Whether the branch ends within a step, before `motion`; the bifurcations in the step are added.
    fn ends(&self, branch: &mut Branch, tangent: &Unknowns, step: f64, motion: &Periodic) -> bool {
        let last = branch.points.last().unwrap_or(self.start);
        if joins(last, motion) {
            branch.points.extend(self.joint(last, tangent, step));
            branch.ended[1] = Ended::Joins;
            return true;
        }
        match self.condition {
            Condition::Bifurcation(Bifurcation::Torus) if !motion.on_circle_in_pairs() => {
                branch.ended[1] = Ended::Resonance;
                return true;
            }
            Condition::Bifurcation(_) => {}
            _ => {
                let found = self.part(last.unknowns(), tangent * step).crossings(last, motion);
                branch.special.extend(found);
                branch.special.extend(self.pairs(&branch.points, motion));
            }
        }
        false
    }

    /// The bifurcations that cancel between the point before the last one and `motion`.
    fn pairs(&self, points: &[Periodic], motion: &Periodic) -> Vec<Special> {
        let [.., before, last] = points else {
            return Vec::new();
        };
        let from = before.unknowns();
        self.part(from, motion.unknowns() - from).pairs([before, last, motion])
    }

    /// The part of the curve beside `chord`.
    fn part(&self, from: Unknowns, chord: Unknowns) -> Part<impl Fn(f64) -> Option<Periodic>> {
        let (step, tangent) = (chord.norm(), chord.normalize());
        Part(move |part: f64| self.motion(&self.correct(&from, &tangent, part * step)?))
    }

    /// Whether a motion lies in the ranges; that of G does not limit a curve at constant G.
    fn within(&self, limits: &Limits, sigma: f64, g: f64) -> bool {
        let free = !matches!(self.condition, Condition::Excitation(_));
        limits.contain(sigma, if free { g } else { limits.g[0] })
    }

    /// Whether the branch is back at its start after a step to `next`.
    fn closes(&self, branch: &mut Branch, next: &Unknowns, turned: &Unknowns, step: f64, first: &Unknowns) -> bool {
        // A phase difference of 2 pi is the same motion.
        let mut apart = next - self.start.unknowns();
        apart[0] = super::pattern::wrapped(apart[0]);
        if branch.points.len() <= 10 || apart.norm() >= step || turned.dot(first) <= 0.9 {
            return false;
        }
        if apart.dot(turned) < 0.0 {
            // A little beyond the start, which the plane at the end of the step may miss.
            let part = self.part(*next, turned * (1.1 * apart.norm()));
            let found = branch.points.last().map(|last| part.crossings(last, self.start));
            branch.special.extend(found.into_iter().flatten());
        } else if let [first, .., last] = &branch.special[..]
            && (first.motion.sigma - last.motion.sigma).abs() < SAME
        {
            // The last step passed the start, and what is beyond it was known.
            branch.special.pop();
        }
        branch.ended[1] = Ended::Closed;
        true
    }

    /// Whether a motion that is the double of a bifurcating one is next to `last`. The equations of bifurcations are singular there: rounding,
    /// over the square of the difference of both halves, ends the curve before it passes.
    fn stops_at_joint(&self, last: &Periodic) -> bool {
        let (Condition::Bifurcation(_), Some(half)) = (self.condition, last.pattern.halved()) else {
            return false;
        };
        let from = last.unknowns();
        let flip = Condition::Bifurcation(Bifurcation::flip(&half));
        let found = Periodic::find(self.scene, &half, &from, [flip, Condition::Sigma(last.sigma)]);
        found.is_some_and(|one| (one.unknowns() - from).norm() < NEXT)
    }

    /// The last motion within a step before the one that the branch doubles.
    fn joint(&self, from: &Periodic, tangent: &Unknowns, step: f64) -> Option<Periodic> {
        let x = from.unknowns();
        let at = |part: f64| self.motion(&self.correct(&x, tangent, part * step)?);
        let before = |part: f64| at(part).map(|one| !joins(from, &one)).ok_or(());
        let (end, _) = try_bisection(0.0, 1.0, FINEST, before).ok()?;
        at(end)
    }
}

/// Between two motions, their branch passes the motion that it doubles.
fn joins(from: &Periodic, to: &Periodic) -> bool {
    match (from.halves_apart(), to.halves_apart()) {
        (Some(one), Some(other)) => one.dot(&other) < 0.0,
        _ => false,
    }
}

/// Follows the curve of `condition` from `start` towards `towards`, a direction in the space of the unknowns.
pub fn continue_from(
    scene: &Dimensionless,
    start: &Periodic,
    condition: Condition,
    towards: &Unknowns,
    limits: &Limits,
) -> Branch {
    let reach = APPROACH * limits.step;
    let curve = Curve { scene, start, condition, reach };
    let mut branch = Branch {
        points: vec![start.clone()],
        special: Vec::new(),
        ended: [Ended::Graze; 2],
    };
    let Some((mut tangent, sign)) = curve.tangent(&start.unknowns(), towards) else {
        return branch;
    };
    let first_tangent = tangent;
    let mut step = limits.step / 8.0;
    while step >= SHORTEST {
        if branch.points.len() >= limits.points {
            branch.ended[1] = Ended::Points;
            return branch;
        }
        let last = branch.points.last().unwrap_or(start);
        let Some((next, turned, motion)) = curve.advance(last, (&tangent, sign), step) else {
            step /= 2.0;
            continue;
        };
        if curve.ends(&mut branch, &tangent, step, &motion) {
            return branch;
        }
        branch.points.push(motion);
        if curve.closes(&mut branch, &next, &turned, step, &first_tangent) {
            return branch;
        }
        if !curve.within(limits, next[4], next[5]) {
            let inside = |one: &Special| curve.within(limits, one.motion.sigma, one.motion.g);
            branch.special.retain(inside);
            branch.ended[1] = Ended::Range;
            return branch;
        }
        if branch.winds() {
            let stable = branch.points.iter().rposition(|one| one.stable);
            branch.points.truncate(stable.unwrap_or(0) + 2);
            branch.ended[1] = Ended::Unstable;
            return branch;
        }
        let straight = turned.dot(&tangent) > 0.5 * (1.0 + STRAIGHT);
        tangent = turned;
        if straight {
            step = (step * 1.5).min(limits.step);
        }
    }
    if curve.stops_at_joint(branch.points.last().unwrap_or(start)) {
        branch.ended[1] = Ended::Joins;
    }
    branch
}

/// Follows the curve of `condition` through `start` in both directions, from falling to rising sigma.
pub fn continue_both_ways(scene: &Dimensionless, start: &Periodic, condition: Condition, limits: &Limits) -> Branch {
    let mut towards = Unknowns::zeros();
    towards[4] = 1.0;
    let mut up = continue_from(scene, start, condition, &towards, limits);
    if up.ended[1] == Ended::Closed {
        up.ended[0] = Ended::Closed;
        return up;
    }
    let down = continue_from(scene, start, condition, &-towards, limits);
    let mut points: Vec<Periodic> = down.points.into_iter().skip(1).rev().collect();
    points.append(&mut up.points);
    let mut special: Vec<Special> = down.special.into_iter().rev().collect();
    special.append(&mut up.special);
    Branch { points, special, ended: [down.ended[1], up.ended[1]] }
}

/// Distance at which the motions of another branch are searched for.
const ASIDE: f64 = 1e-3;

/// The branch of motions that leaves a symmetry breaking or a period doubling, along the curve of `condition`. Its mirror image, or
/// itself one repetition later, leaves in the opposite direction and counts as the same branch.
pub fn branch_off(scene: &Dimensionless, at: &Special, condition: Condition, limits: &Limits) -> Option<Branch> {
    let from = &at.motion;
    let returned = follow(scene, &from.pattern, &from.unknowns())?;
    // The eigenvector of the map for the multiplier -1.
    let flipped = returned.monodromy + Matrix4::identity();
    let svd = flipped.svd(false, true);
    let aside = svd.v_t?.row(svd.singular_values.imin()).transpose();
    let mut towards = Unknowns::zeros();
    towards.fixed_rows_mut::<4>(0).copy_from(&aside);
    let doubled = Periodic { pattern: from.pattern.doubled(), ..from.clone() };
    let curve = Curve { scene, start: &doubled, condition, reach: 0.0 };
    let x = curve.correct(&from.unknowns(), &towards, ASIDE)?;
    let start = curve.motion(&x)?;
    let mut branch = continue_from(scene, &start, condition, &towards, limits);
    branch.ended[0] = Ended::Joins;
    Some(branch)
}
