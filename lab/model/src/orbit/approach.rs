//! The approach to the stable symmetric 1:1 orbit, seen at the impacts. It is certain once the impacts follow the linearised return
//! map: what is left, of second order, shrinks faster than the distance to the orbit.

use std::f64::consts::PI;

use nalgebra::{Matrix4, Vector4};

use super::pattern::{ImpactPattern, follow};
use super::{Orbit, bounce::Bounce, driven::Moment, search::stable_symmetric};
use crate::Dimensionless;

/// Impacts over which the motion is compared with the linearised map.
const COMPARED: usize = 24;
/// Largest difference between both, over the part of the distance that the map takes away in so many impacts.
const NONLINEAR: f64 = 0.25;
/// Longest approach that is followed, half periods.
const LONGEST: i64 = 100_000;

/// A stable symmetric orbit and the derivative of its return map over half a period, with the mirror image.
#[derive(Debug, Clone, Copy)]
pub struct Symmetric {
    /// The orbit.
    pub orbit: Orbit,
    map: Matrix4<f64>,
}

/// A motion that approaches a symmetric orbit.
#[derive(Debug, Clone, Copy)]
pub struct Approach {
    /// Its distance from the orbit after the last impact.
    pub distance: f64,
    /// Largest difference between states after the last impacts, half a period apart.
    pub recurrence: f64,
    /// Half periods from the last impact on until that falls below the tolerance; negative if it already has.
    pub left: i64,
}

/// Whether the last impacts alternate between the walls, so that a symmetric orbit may be close by.
pub fn alternates(moments: &[Moment]) -> bool {
    let mut last = moments.iter().rev().filter_map(Moment::bounce).take(COMPARED + 1);
    let Some(mut one) = last.next() else { return false };
    last.all(|before| {
        let alternates = before.wall != one.wall && (one.phase - before.phase - PI).abs() < 0.5;
        one = before;
        alternates
    })
}

impl Symmetric {
    /// The stable symmetric orbit at the detuning `sigma`, if there is one.
    pub fn stable(scene: &Dimensionless, sigma: f64) -> Option<Self> {
        let orbit = stable_symmetric(scene, sigma)?;
        let map = follow(scene, &ImpactPattern::symmetric(), &orbit.unknowns())?.monodromy;
        Some(Self { orbit, map })
    }

    /// How a motion approaches the orbit, if it certainly does; `tolerance` bounds its recurrence at the end.
    pub fn approach(&self, moments: &[Moment], tolerance: f64) -> Option<Approach> {
        let bounces = moments.iter().rev().filter_map(Moment::bounce);
        let apart = bounces.map(|one| self.apart(&one));
        let mut last = [Vector4::zeros(); COMPARED + 1];
        for (one, found) in last.iter_mut().rev().zip(apart.clone()) {
            *one = found;
        }
        let (before, now) = (last[0], last[COMPARED]);
        let taken = 1.0 - self.orbit.multipliers[3].powi(COMPARED as i32);
        let mut predicted = before;
        let linear = last[1..].iter().all(|one| {
            predicted = self.map * predicted;
            (predicted - one).norm() <= NONLINEAR * taken * before.norm()
        });
        let differences = last.windows(2).map(|pair| (pair[1] - pair[0]).amax());
        linear.then(|| Approach {
            distance: now.norm(),
            recurrence: differences.fold(0.0, f64::max),
            left: self.left(now, apart, tolerance),
        })
    }

    /// Half periods until the recurrence falls below the tolerance.
    fn left(&self, mut now: Vector4<f64>, before: impl Iterator<Item = Vector4<f64>>, tolerance: f64) -> i64 {
        let mut later = now;
        let same = before.skip(1).take_while(|one| {
            let same = (later - one).amax() <= tolerance;
            later = *one;
            same
        });
        let settled = same.count() as i64;
        let mut left = 0;
        while settled == 0 && (self.map * now - now).amax() > tolerance && left < LONGEST {
            now = self.map * now;
            left += 1;
        }
        left - settled
    }

    /// Distance of a state after an impact from that of the orbit.
    fn apart(&self, bounce: &Bounce) -> Vector4<f64> {
        let start = &self.orbit.start;
        let turns = ((bounce.phase - start.phase) / PI).round();
        let mut apart = bounce.vector() * bounce.wall - Vector4::new(0.0, start.q1, start.dq1, start.dq2);
        apart[0] = bounce.phase - start.phase - PI * turns;
        apart
    }
}
