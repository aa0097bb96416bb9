//! The stable motion that a start leads to: the plant is driven past its transient, the shortest repeating pattern of its impacts is
//! found, and Newton's method refines the motion.

use std::f64::consts::TAU;

use lovines::{InvalidValue, State};

use super::{
    bounce::Bounce,
    impact_map::ImpactMap,
    pattern::{ImpactPattern, Unknowns},
    periodic::{Condition, Periodic},
};
use crate::Dimensionless;

/// States closer than this count as equal before the refinement.
const SAME: f64 = 1e-6;
/// Longest pattern in the search, impacts.
const LONGEST: usize = 32;

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
    Ok(settled(scene, sigma, [q1, dq1, q2, dq2]))
}

fn settled(scene: &Dimensionless, sigma: f64, state: [f64; 4]) -> Option<Periodic> {
    let map = ImpactMap::new(scene, 1.0 + scene.epsilon * sigma, scene.g);
    let first = map.first(0.0, state)?;
    let bounces: Vec<Bounce> = std::iter::successors(Some(first), |from| map.next(from))
        .take(2 * LONGEST)
        .collect();
    let pattern = pattern(&bounces)?;
    let Bounce { phase, q1, dq1, dq2, .. } = first;
    let guess = Unknowns::from([phase, q1, dq1, dq2, sigma, scene.g]);
    let conditions = [Condition::Sigma(sigma), Condition::Excitation(scene.g)];
    Periodic::find(scene, &pattern, &guess, conditions)
}

/// The shortest pattern that the bounces repeat.
fn pattern(bounces: &[Bounce]) -> Option<ImpactPattern> {
    let first = bounces.first()?;
    let half = std::f64::consts::PI;
    (1..=LONGEST.min(bounces.len() - 1)).find_map(|n| {
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
        let same = half_periods > 0.0 && apart.iter().all(|one| one.abs() < SAME);
        same.then(|| ImpactPattern {
            walls: bounces[..n].iter().map(|one| one.wall).collect(),
            half_periods: half_periods as u32,
            mirrored,
        })
    })
}
