//! Where the motion settles: impacts are followed until their pattern repeats, and the motion is polished.

use super::{
    impact_map::{Bounce, ImpactMap},
    periodic::{Condition, Periodic},
    shape::{Shape, Unknowns},
};
use crate::scene::Dimensionless;

/// Two states this close count as the same before polishing.
const SAME: f64 = 1e-6;
/// Longest pattern looked for, impacts.
const LONGEST: usize = 24;

/// The stable periodic motion that `start` leads to at the detuning `sigma` and the scene's G, within `impacts`
/// impacts; None where there is none, or where impacts cease or accumulate.
#[must_use]
pub fn settle(
    scene: &Dimensionless,
    sigma: f64,
    start: &Bounce,
    impacts: usize,
) -> Option<Periodic> {
    let map = ImpactMap::new(scene, 1.0 + scene.epsilon * sigma, scene.g);
    let mut recent = Vec::new();
    let mut at = *start;
    for n in 0..impacts + 2 * LONGEST {
        if n >= impacts {
            recent.push(at);
        }
        at = map.next(&at)?;
        // The phase is kept small: what it has turned by is no part of the state.
        if at.phase > 1e3 * std::f64::consts::TAU && n + 1 == impacts {
            at.phase = super::shape::wrapped(at.phase);
        }
    }
    let shape = pattern(&recent)?;
    let Bounce {
        phase,
        q1,
        dq1,
        dq2,
        ..
    } = recent[0];
    let guess = Unknowns::from([phase, q1, dq1, dq2, sigma, scene.g]);
    let conditions = [Condition::Sigma(sigma), Condition::Excitation(scene.g)];
    Periodic::find(scene, &shape, &guess, conditions)
}

/// The shortest pattern that the bounces repeat.
fn pattern(bounces: &[Bounce]) -> Option<Shape> {
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
        same.then(|| Shape {
            walls: bounces[..n].iter().map(|one| one.wall).collect(),
            half_periods: half_periods as u32,
            mirrored,
        })
    })
}
