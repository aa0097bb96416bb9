//! The stable motion that a start leads to: the plant is driven past its transient, the shortest repeating pattern of its impacts is
//! found, and Newton's method refines the motion.

use std::f64::consts::TAU;

use lovines::{InvalidValue, State};

use super::{
    bounce::Bounce,
    condition::Condition,
    impact_map::ImpactMap,
    pattern::{ImpactPattern, Unknowns},
    periodic::Periodic,
};
use crate::Dimensionless;

/// States after one repetition that are closer than this belong to a motion that settles, if there is a stable one near.
const NEAR: f64 = 1e-3;
/// The same for an exact motion.
const EXACT: f64 = 1e-8;
/// Longest pattern in the search, impacts.
const LONGEST: usize = 48;

/// The stable periodic motion that `start` = (q1, q1', q2, q2') leads to after `periods` at the detuning `sigma` and
/// the scene's G; None without a repeating pattern, without impacts, or if the particle sticks.
///
/// # Errors
/// Invalid parameters or an invalid start.
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
    Ok(stable_near(scene, sigma, 0.0, [q1, dq1, q2, dq2]))
}

/// The stable periodic motion of the shortest pattern close to the motion from `state` = (q1, q1', q2, q2') at a phase of the base, rad.
#[must_use]
pub fn stable_near(scene: &Dimensionless, sigma: f64, phase: f64, state: [f64; 4]) -> Option<Periodic> {
    let map = ImpactMap::new(scene, 1.0 + scene.epsilon * sigma, scene.g);
    let first = map.first(phase, state)?;
    let bounces: Vec<Bounce> = std::iter::successors(Some(first), |from| map.next(from))
        .take(2 * LONGEST)
        .collect();
    let Bounce { phase, q1, dq1, dq2, .. } = first;
    let guess = Unknowns::from([phase, q1, dq1, dq2, sigma, scene.g]);
    let conditions = [Condition::Sigma(sigma), Condition::Excitation(scene.g)];
    let found = patterns(&bounces, NEAR).find_map(|pattern| {
        let found = Periodic::find(scene, &pattern, &guess, conditions)?;
        let close = (found.unknowns() - guess).norm() < 100.0 * NEAR;
        (found.stable && close).then_some(found)
    })?;
    // The pattern may be a multiple of that of the motion: near a period doubling the motion settles slowly, in alternation.
    let exact: Vec<Bounce> = std::iter::successors(Some(found.bounces[0]), |from| map.next(from))
        .take(1 + found.bounces.len())
        .collect();
    let shortest = patterns(&exact, EXACT).next()?;
    Periodic::find(scene, &shortest, &found.unknowns(), conditions)
}

/// The patterns that the bounces repeat, from the shortest.
fn patterns(bounces: &[Bounce], tolerance: f64) -> impl Iterator<Item = ImpactPattern> {
    let first = bounces[0];
    let half = std::f64::consts::PI;
    (1..=LONGEST.min(bounces.len() - 1)).filter_map(move |n| {
        let then = &bounces[n];
        let half_periods = ((then.phase - first.phase) / half).round();
        let mirrored = half_periods % 2.0 == 1.0;
        let sign = if mirrored { -1.0 } else { 1.0 };
        let apart = [
            then.phase - first.phase - half_periods * half,
            sign * then.q1 - first.q1,
            sign * then.dq1 - first.dq1,
            sign * then.dq2 - first.dq2,
            sign * then.wall - first.wall,
        ];
        let same = half_periods > 0.0 && apart.iter().all(|one| one.abs() < tolerance);
        same.then(|| ImpactPattern {
            walls: bounces[..n].iter().map(|one| one.wall).collect(),
            half_periods: half_periods as u32,
            mirrored,
        })
    })
}
