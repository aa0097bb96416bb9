//! The stable motion that a start leads to: the plant is driven past its transient, the shortest repeating pattern of its impacts is
//! found, and Newton's method refines the motion.

use std::f64::consts::TAU;

use lovines::{InvalidValue, State};

use super::pattern::{ImpactPattern, Unknowns};
use super::{bounce::Bounce, condition::Condition, impact_map::ImpactMap, periodic::Periodic};
use crate::Dimensionless;

/// States after one repetition that are closer than this belong to a motion that settles, if there is a stable one near.
const NEAR: f64 = 1e-2;
/// The same for an exact motion.
const EXACT: f64 = 1e-8;
/// Patterns that are tried, from the shortest: after a period doubling, only the second is stable.
const MULTIPLES: usize = 3;
/// Longest pattern in the search, impacts.
pub(super) const LONGEST: usize = 48;

/// The stable periodic motion that `start` = (q1, q1', q2, q2') leads to after `periods` at the detuning `sigma` and
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
    Ok(periodic_near(scene, sigma, 0.0, [q1, dq1, q2, dq2]).filter(|motion| motion.stable))
}

/// The periodic motion of the shortest pattern close to the motion from `state` = (q1, q1', q2, q2') at a phase of the base, rad; a
/// stable one rather than an unstable one.
pub fn periodic_near(scene: &Dimensionless, sigma: f64, phase: f64, state: [f64; 4]) -> Option<Periodic> {
    let map = ImpactMap::new(scene, 1.0 + scene.epsilon * sigma, scene.g);
    let first = map.first(phase, state)?;
    let Bounce { phase, q1, dq1, dq2, .. } = first;
    let guess = Unknowns::from([phase, q1, dq1, dq2, sigma, scene.g]);
    let conditions = [Condition::Sigma(sigma), Condition::Excitation(scene.g)];
    let mut unstable = None;
    let found = patterns(&map, first, NEAR).take(MULTIPLES).find_map(|pattern| {
        let found = Periodic::find(scene, &pattern, &guess, conditions)?;
        let close = (found.unknowns() - guess).norm() < 10.0 * NEAR;
        if close && !found.stable {
            unstable.get_or_insert(found);
            return None;
        }
        close.then_some(found)
    });
    let Some(found) = found else {
        return unstable;
    };
    // The pattern may be a multiple of that of the motion: near a period doubling the motion settles slowly, in alternation.
    let shortest = patterns(&map, found.bounces[0], EXACT)
        .take_while(|one| one.walls.len() < found.bounces.len())
        .next();
    match shortest {
        Some(pattern) => Periodic::find(scene, &pattern, &found.unknowns(), conditions),
        None => Some(found),
    }
}

/// The patterns that the bounces from `first` on repeat, from the shortest.
fn patterns(map: &ImpactMap, first: Bounce, tolerance: f64) -> impl Iterator<Item = ImpactPattern> {
    let half = std::f64::consts::PI;
    let mut walls = vec![first.wall];
    let following = std::iter::successors(map.next(&first), |from| map.next(from));
    following.take(LONGEST).filter_map(move |then| {
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
