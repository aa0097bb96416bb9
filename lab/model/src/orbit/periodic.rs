//! Periodic motions of any pattern of impacts, and the motion near a simulated state.

use std::f64::consts::TAU;

use lovines::{InvalidValue, State};
use nalgebra::{SVector, Vector4};
use serde::Serialize;

use super::impacts::{Bounce, ImpactPattern, ImpactSection, Impacts};
use super::return_map::{Closing, Condition, Return, Stability, Unknowns};
use crate::Dimensionless;
use crate::numerics::newton;

/// A phase in (-pi, pi].
pub(super) fn wrapped(phase: f64) -> f64 {
    phase - TAU * (phase / TAU).round()
}

/// An exact periodic motion.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Periodic {
    /// Base amplitude over `b epsilon`.
    #[serde(rename = "G")]
    pub g: f64,
    /// Detuning `(Omega - 1)/epsilon`.
    pub sigma: f64,
    /// Amplitude of the response's harmonic at the base's frequency.
    #[serde(rename = "C")]
    pub c: f64,
    /// Phase of that harmonic relative to the reference, rad, in (-pi, pi].
    pub gamma: f64,
    /// Speed of the particle over `b omega0`, averaged over time.
    #[serde(rename = "B")]
    pub b: f64,
    /// Its pattern.
    #[serde(rename = "shape")]
    pub pattern: ImpactPattern,
    /// The states just after the impacts of the map.
    pub bounces: Vec<Bounce>,
    /// Of the map; a mirrored pattern has a map of half of its period.
    #[serde(flatten)]
    pub stability: Stability,
    /// The map with its derivatives.
    #[serde(skip)]
    pub(super) map: Return,
}

impl Periodic {
    /// The motion with the pattern `pattern` near the unknowns `guess` that satisfies both conditions, by Newton's method with
    /// analytic derivatives; None if the iteration leaves the pattern or does not converge.
    pub fn find(
        scene: &Dimensionless,
        pattern: &ImpactPattern,
        guess: &Unknowns,
        conditions: [Condition; 2],
    ) -> Option<Self> {
        let map = &mut ImpactSection { scene, pattern };
        let x = newton(&mut Closing { map, conditions }, *guess)?;
        Self::at(scene, pattern, &x)
    }

    /// The motion at unknowns that satisfy the closing equations.
    fn at(scene: &Dimensionless, pattern: &ImpactPattern, x: &Unknowns) -> Option<Self> {
        let (mut bounces, mut duration, mut travelled) = (Vec::new(), 0.0, 0.0);
        let map = ImpactSection { scene, pattern }.follow(x, |bounce, time| {
            bounces.push(bounce);
            duration += time;
            travelled += bounce.dq2.abs() * time;
        })?;
        Some(Self {
            g: x[5],
            sigma: x[4],
            c: map.response.norm(),
            gamma: wrapped(map.response.arg()),
            b: travelled / duration,
            pattern: pattern.clone(),
            bounces,
            stability: map.stability(),
            map,
        })
    }

    /// The unknowns of this motion: (phase, q1, q1', q2') after its first impact, sigma, G.
    pub fn unknowns(&self) -> Unknowns {
        let Bounce { phase, q1, dq1, dq2, .. } = self.bounces[0];
        Unknowns::from([phase, q1, dq1, dq2, self.sigma, self.g])
    }

    /// How far the second half of the motion is from repeating the first one or its mirror image; None for a pattern that is not
    /// the double of another. It changes sign where a branch passes the motion that it doubles.
    pub(super) fn halves_apart(&self) -> Option<Vector4<f64>> {
        let ImpactPattern { walls, half_periods, mirrored } = &self.pattern;
        let (first, second) = walls.split_at(walls.len() / 2);
        let sign = if half_periods.is_multiple_of(4) { 1.0 } else { -1.0 };
        let doubles = !mirrored && first.len() == second.len() && first.iter().zip(second).all(|(a, b)| sign * a == *b);
        let middle = self.bounces.get(first.len()).filter(|_| doubles && !first.is_empty())?;
        Some(self.bounces[0].apart(middle, 0.5 * self.pattern.turn(), sign))
    }

    /// Numbers that a motion shares with its mirror image and with itself one period later.
    pub(super) fn invariants(&self) -> SVector<f64, 5> {
        let (sine, cosine) = self.gamma.sin_cos();
        [self.sigma, self.c * cosine, self.c * sine, self.b, self.g].into()
    }

    /// Distance in these numbers.
    pub(super) fn distance(&self, other: &Self) -> f64 {
        (self.invariants() - other.invariants()).norm()
    }

    /// No multiplier is outside the unit circle, except for those that a bifurcation places on it.
    pub fn bounds_stability(&self) -> bool {
        self.stability.growth() < 1.0 + 1e-5
    }

    /// Largest Lyapunov exponent per period of the base.
    pub(crate) fn exponent(&self) -> f64 {
        2.0 * self.stability.growth().ln() / f64::from(self.pattern.half_periods)
    }
}

/// Largest distance of a settling motion from itself one repetition later, over b and b omega0, from which Newton's method starts.
pub(crate) const SETTLING_DISTANCE: f64 = 1e-2;
/// Largest distance of an exact motion from itself one repetition later. A slow impact is that ill-defined in time.
pub(super) const ORBIT_ERROR: f64 = 1e-8;
/// Largest [distance](Periodic::distance) of two motions that are the same.
pub(super) const SAME_MOTION: f64 = 1e-6;
/// Patterns that are tried, from the shortest: after a period doubling, only the second is stable.
const MULTIPLES: usize = 3;
/// Longest pattern in the search, impacts.
pub(super) const LONGEST_PATTERN: usize = 48;

/// The periodic motion, stable or neutral, that `start` = (q1, q1', q2, q2') leads to after `periods` at the detuning `sigma` and
/// the scene's G; None without a repeating pattern, without impacts, or if the particle sticks.
pub fn settle(
    scene: &Dimensionless,
    sigma: f64,
    start: [f64; 4],
    periods: usize,
) -> Result<Option<Periodic>, InvalidValue> {
    let mut plant = scene.plant(start)?;
    let drive = scene.drive(sigma);
    for _ in 0..periods {
        plant.advance(drive, TAU / drive.omega)?;
    }
    let State { q1, dq1, q2, dq2 } = plant.state();
    Ok(periodic_near(scene, sigma, [q1, dq1, q2, dq2]).filter(|motion| !motion.stability.is_unstable()))
}

/// The periodic motion of the shortest pattern close to the motion from `state` = (q1, q1', q2, q2') at phase 0 of the base; one
/// that is not unstable rather than an unstable one.
pub(crate) fn periodic_near(scene: &Dimensionless, sigma: f64, state: [f64; 4]) -> Option<Periodic> {
    let mut impacts = Impacts::new(scene, sigma, 0.0, state)?;
    let (_, first) = impacts.next()?;
    let Bounce { phase, q1, dq1, dq2, .. } = first;
    let guess = Unknowns::from([phase, q1, dq1, dq2, sigma, scene.g]);
    let conditions = [Condition::Sigma(sigma), Condition::Excitation(scene.g)];
    let mut unstable = None;
    let found = patterns(impacts, first, SETTLING_DISTANCE)
        .take(MULTIPLES)
        .find_map(|pattern| {
            let found = Periodic::find(scene, &pattern, &guess, conditions)?;
            let close = (found.unknowns() - guess).norm() < 10.0 * SETTLING_DISTANCE;
            if close && found.stability.is_unstable() {
                unstable.get_or_insert(found);
                return None;
            }
            close.then_some(found)
        });
    let Some(found) = found else {
        return unstable;
    };
    // The pattern may be a multiple of the motion's own pattern: near a period doubling the motion settles slowly, in alternation.
    let impacts = Impacts::after(scene, sigma, &found.bounces[0])?;
    let shortest = patterns(impacts, found.bounces[0], ORBIT_ERROR)
        .take_while(|pattern| pattern.walls.len() < found.bounces.len())
        .next();
    match shortest {
        Some(pattern) => Periodic::find(scene, &pattern, &found.unknowns(), conditions),
        None => Some(found),
    }
}

/// The patterns that `impacts`, which follow `first`, repeat, from the shortest.
fn patterns(impacts: Impacts, first: Bounce, tolerance: f64) -> impl Iterator<Item = ImpactPattern> {
    let half = std::f64::consts::PI;
    let mut walls = vec![first.wall];
    impacts.take(LONGEST_PATTERN).filter_map(move |(_, then)| {
        let half_periods = ((then.phase - first.phase) / half).round();
        let mirrored = half_periods % 2.0 == 1.0;
        let sign = if mirrored { -1.0 } else { 1.0 };
        let apart = first.apart(&then, half_periods * half, sign);
        let same = half_periods > 0.0 && sign * then.wall == first.wall && apart.amax() < tolerance;
        let pattern = same.then(|| ImpactPattern {
            walls: walls.clone(),
            half_periods: half_periods as u32,
            mirrored,
        });
        walls.push(then.wall);
        pattern
    })
}
