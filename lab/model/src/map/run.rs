//! One point of the map: a plant is driven, and its impacts are recorded and classified.

use std::f64::consts::TAU;

use lovines::{Drive, Event, InvalidValue, Plant, State};
use serde::Serialize;

use crate::Dimensionless;
use crate::regime::{Impact, Pattern, Regime, pattern, synchrony};

/// Result at one point.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Point {
    /// Regime of the response.
    pub regime: Regime,
    /// Impacts per period of the base.
    pub impacts_per_period: f64,
    /// Impacts of the pattern that repeats; 0 without a pattern.
    pub impacts: usize,
    /// Periods of the base that it takes; 0 likewise.
    pub periods: u32,
    /// Share of the impacts that belong to captures into 1:1 resonance: at least eight in a row on alternating walls, half a
    /// period apart within 15 %.
    pub synchrony: f64,
    /// Growth of a small disturbance per period, as a natural logarithm; absent with a pattern, or if the particle sticks.
    pub growth: Option<f64>,
}

/// Growth per period, as a natural logarithm, above which a motion is chaotic: a disturbance grows e-fold within 20 periods.
/// Over the periods that it is measured for, a growth that is only linear in time stays below.
const CHAOS: f64 = 0.05;
/// A motion without growth and without a pattern may not have settled yet: largest number of repetitions.
const ROUNDS: usize = 6;
/// If disturbances still shrink this fast after them, the motion repeats with a pattern longer than those in the search.
const SHRINKING: f64 = -0.005;
/// Largest number of periods per stick in the sticking regime; a chaotic motion also sticks occasionally.
const STICKING: usize = 10;
/// From this share of captured impacts on a motion is modulated, whether or not disturbances grow. On the default map, irregular
/// cells have either less than a tenth or, in one connected region below and beside the island, mostly a third and more.
const CAPTURES: f64 = 0.2;
/// Size of the disturbance that is followed, dimensionless.
const DISTURBANCE: f64 = 1e-8;
/// Periods over which it is followed.
const FOLLOWED: usize = 150;

/// Drives the dimensionless plant of `scene` at the detuning `sigma` from `start` = (q1, q1', q2, q2'), lets `settle`
/// periods pass, and classifies the impacts of the next `record` periods. While they have no pattern and disturbances shrink, the
/// observation is repeated.
///
/// # Errors
/// Invalid parameters or an invalid start.
pub fn observe(
    scene: &Dimensionless,
    sigma: f64,
    start: [f64; 4],
    (settle, record): (usize, usize),
) -> Result<Point, InvalidValue> {
    let drive = scene.drive(sigma);
    let mut plant = scene.plant(start)?;
    let mut round = 0;
    loop {
        for _ in 0..settle {
            plant.advance(drive, TAU / drive.omega)?;
        }
        let (impacts, rests) = recorded(&mut plant, drive, record)?;
        let found = |regime, pattern: Option<Pattern>, growth| Point {
            regime,
            impacts_per_period: impacts.len() as f64 / record as f64,
            impacts: pattern.map_or(0, |one| one.impacts),
            periods: pattern.map_or(0, |one| one.periods),
            synchrony: synchrony(&impacts),
            growth,
        };
        if rests * STICKING >= record {
            return Ok(found(Regime::Sticking, None, None));
        }
        if impacts.is_empty() {
            return Ok(found(Regime::NoImpacts, None, None));
        }
        if let Some(one) = pattern(&impacts) {
            return Ok(found(one.regime, Some(one), None));
        }
        let growth = growth(scene, drive, &plant)?;
        round += 1;
        let regime = if growth > CHAOS && synchrony(&impacts) < CAPTURES {
            Regime::Chaotic
        } else if growth > CHAOS {
            Regime::Modulated
        } else if round < ROUNDS {
            continue;
        } else if growth < SHRINKING {
            Regime::Several
        } else {
            Regime::Modulated
        };
        return Ok(found(regime, None, Some(growth)));
    }
}

/// The impacts of a number of periods, and how often the particle stuck to a wall, including at the beginning.
fn recorded(plant: &mut Plant, drive: Drive, periods: usize) -> Result<(Vec<Impact>, usize), InvalidValue> {
    let mut impacts = Vec::new();
    let mut rests = usize::from(plant.contact().is_some());
    for n in 0..periods {
        plant.advance_with(drive, TAU / drive.omega, |event| match event {
            Event::Impact { t, velocity, .. } => {
                impacts.push(Impact { time: TAU * n as f64 + drive.omega * t, velocity })
            }
            Event::Stuck { .. } => rests += 1,
            Event::Released { .. } => {}
        })?;
    }
    Ok((impacts, rests))
}

fn numbers(plant: &Plant) -> [f64; 4] {
    let State { q1, dq1, q2, dq2 } = plant.state();
    [q1, dq1, q2, dq2]
}

/// Mean growth per period of the distance between the plant and a twin, which is rescaled after every period
/// (Benettin et al., Meccanica 15, 1980). Both start anew at every passage of the base through zero.
fn growth(scene: &Dimensionless, drive: Drive, plant: &Plant) -> Result<f64, InvalidValue> {
    let period = TAU / drive.omega;
    let mut here = numbers(plant);
    let mut apart = [DISTURBANCE / 2.0; 4];
    let (mut sum, mut counted) = (0.0, 0);
    for _ in 0..FOLLOWED {
        let there: [f64; 4] = std::array::from_fn(|n| here[n] + apart[n]);
        let there_mirrored: [f64; 4] = std::array::from_fn(|n| here[n] - apart[n]);
        // A twin outside its cavity is mirrored.
        let (Ok(mut one), Ok(mut other)) = (
            scene.plant(here),
            scene.plant(there).or_else(|_| scene.plant(there_mirrored)),
        ) else {
            break;
        };
        let before = distance(&numbers(&other), &here);
        one.advance(drive, period)?;
        other.advance(drive, period)?;
        here = numbers(&one);
        let then = numbers(&other);
        let after = distance(&then, &here);
        if after == 0.0 || before == 0.0 {
            break;
        }
        sum += (after / before).ln();
        counted += 1;
        apart = std::array::from_fn(|n| (then[n] - here[n]) * (DISTURBANCE / after));
    }
    Ok(if counted == 0 { 0.0 } else { sum / f64::from(counted) })
}

fn distance(one: &[f64; 4], other: &[f64; 4]) -> f64 {
    one.iter().zip(other).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}
