//! Guards the regimes of random cells of three maps, decided as `vines map` does, compared with two other motions: the same one further on, and that
//! of a plant which follows other steps from the start, so that chaos is another one after some hundred periods.
//!
//! The comparison has its own rules: the pattern of the impacts instead of the state, and a disturbed second plant instead of the
//! linearised disturbance. `CELLS` sets the number of cells per map, `LIMIT` the periods of the map, `PERIODS` those of the other plant and
//! `CONFIRMATIONS` the number of motions that must agree, `MAP` (1 to 3) selects one map (`scripts/stress --map`).

use std::f64::consts::{PI, TAU};

use lovines::{Drive, Event, Plant};
use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};
use rayon::prelude::*;
use vines_model::{
    Dimensionless,
    map::{CONFIRMATIONS, LIMIT, RegimeResult, observe_confirmed},
    regime::{Impact, Regime, synchrony},
};

mod common;
use common::{setting, within};

/// A map: epsilon, lambda and r; its start; its ranges of sigma and G.
type Case = ([f64; 3], [f64; 4], [[f64; 2]; 2]);

const CASES: [Case; 3] = [
    ([0.0084, 1.43, 0.65], [0.0, 0.0, 0.0, 0.9], [[-5.0, 5.0], [0.1, 3.0]]),
    ([0.03, 0.4, 0.8], [0.3, 0.0, 0.0, -0.5], [[-4.0, 4.0], [0.1, 2.0]]),
    ([0.02, 0.8, 0.4], [0.0, 0.7, 0.4, 0.3], [[-3.0, 3.0], [0.2, 4.0]]),
];

/// Impacts of the half periods from `from` to `to`.
fn impacts(plant: &mut Plant, drive: Drive, from: usize, to: usize) -> Vec<Impact> {
    let mut found = Vec::new();
    for n in from..to {
        let record = |event| {
            if let Event::Impact { t, velocity, .. } = event {
                found.push(Impact { time: PI * n as f64 + drive.omega * t, velocity });
            }
        };
        plant.advance_with(drive, PI / drive.omega, record).unwrap();
    }
    found
}

/// The regime of impacts that repeat themselves, compared one by one from the last back; chatter is left out.
fn periodic(impacts: &[Impact]) -> Option<Regime> {
    let strong: Vec<&Impact> = impacts.iter().filter(|one| one.velocity.abs() > 1e-3).collect();
    let (end, last) = (strong.len(), strong.last()?);
    (1..=400.min(end / 3)).find_map(|count| {
        let turns = (last.time - strong[end - 1 - count].time) / TAU;
        let close = |a: f64, b: f64| (a - b).abs() < 1e-4;
        let whole = turns.round() >= 1.0 && close(turns, turns.round());
        let repeats = whole
            && (end / 2..end).all(|n| {
                let (now, then) = (strong[n], strong[n - count]);
                close(now.time - then.time, TAU * turns.round()) && close(now.velocity, then.velocity)
            });
        let [one, two, three] = [3, 2, 1].map(|n| strong[end - n]);
        let even = close(two.time - one.time, three.time - two.time) && close(two.velocity, -one.velocity);
        repeats.then_some(match (count, turns.round() as i64) {
            (2, 1) if even => Regime::Symmetric,
            (2, 1) if one.velocity * two.velocity < 0.0 => Regime::Asymmetric,
            _ => Regime::Several,
        })
    })
}

/// Mean growth per period of the distance of a second plant, which is moved close again after every period.
fn growth(scene: &Dimensionless, drive: Drive, from: [f64; 4], periods: usize) -> f64 {
    let size = |difference: &[f64; 4]| difference.iter().map(|one| one * one).sum::<f64>().sqrt();
    let (mut here, mut apart, mut sum) = (from, [5e-9; 4], 0.0);
    for _ in 0..periods {
        let shifted = |sign: f64| scene.plant(std::array::from_fn(|n| here[n] + sign * apart[n]));
        let mut plants = [scene.plant(here), shifted(1.0).or_else(|_| shifted(-1.0))].map(Result::unwrap);
        let difference = |[one, other]: &[Plant; 2]| {
            let [one, other] = [one, other].map(|plant| scene.state(&plant.state()));
            std::array::from_fn(|n| other[n] - one[n])
        };
        let before = size(&difference(&plants));
        for plant in &mut plants {
            plant.advance(drive, TAU / drive.omega).unwrap();
        }
        here = scene.state(&plants[0].state());
        apart = difference(&plants);
        let after = size(&apart).max(1e-14);
        sum += (after / before).ln();
        apart = apart.map(|one| one * (1e-8 / after));
    }
    sum / periods as f64
}

/// Half periods that the map's own motion is followed further, for the comparison.
const FURTHER: usize = 8000;

/// The regime of the motion from `start`, in the last `observed` of so many half periods, and the growth of disturbances after them.
fn regime_of(scene: &Dimensionless, sigma: f64, start: [f64; 4], halves: usize, observed: usize) -> (Regime, f64) {
    let drive = scene.drive(sigma);
    let mut plant = scene.plant(start).unwrap();
    impacts(&mut plant, drive, 0, halves - observed);
    let last = impacts(&mut plant, drive, halves - observed, halves);
    if last.is_empty() {
        let rests = plant.state().dq2 == 0.0;
        return (if rests { Regime::NoImpacts } else { Regime::Undecided }, 0.0);
    }
    let late = last.iter().position(|one| one.time > PI * (halves - 4000) as f64);
    if let Some(regime) = periodic(&last[late.unwrap_or(0)..]) {
        return (regime, 0.0);
    }
    let growth = growth(scene, drive, scene.state(&plant.state()), 4000);
    let regime = match (growth > 2e-3, synchrony(&last) < 0.2) {
        (false, _) => Regime::QuasiPeriodic,
        (true, false) => Regime::Modulated,
        (true, true) => Regime::Chaotic,
    };
    (regime, growth)
}

/// A random cell: its regime by the map, that of its motion further on, and that of another plant after a number of periods.
fn cell(case: &Case, seed: u64, [limit, periods, others]: [usize; 3]) -> (RegimeResult, [Regime; 2], String) {
    let ([epsilon, lambda, r], start, ranges) = *case;
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let [sigma, g] = ranges.map(|range| within(&mut random, range));
    let scene = Dimensionless::new(epsilon, lambda, r, g);
    let (mut point, different) = observe_confirmed(&scene, sigma, start, limit, others).unwrap();
    if different.is_some() {
        point.regime = Regime::Undecided;
    }
    let (further, _) = regime_of(&scene, sigma, point.state, FURTHER, FURTHER);
    let (other, growth) = regime_of(&scene, sigma, start, 2 * periods, periods);
    let RegimeResult { regime, followed, transient, exponent, synchrony, .. } = point;
    let text = format!(
        "sigma = {sigma:.4}, G = {g:.4}: {regime} after {followed} (transient {transient}, exponent {exponent:.3?}, synchrony {synchrony:.3}), \
         further on {further:?}, other plant {other:?} after {periods} (growth {growth:.4})"
    );
    (point, [further, other], text)
}

#[test]
fn regimes_agree_with_those_further_on_and_of_another_plant() {
    let (cells, first) = (setting("CELLS", 8), setting("SEED", 1));
    let periods = setting("PERIODS", LIMIT as u64) as usize;
    let limit = setting("LIMIT", LIMIT as u64) as usize;
    let others = setting("CONFIRMATIONS", CONFIRMATIONS as u64) as usize;
    let only = setting("MAP", 0) as usize;
    for (n, case) in CASES.iter().enumerate().filter(|(n, _)| only == 0 || n + 1 == only) {
        let one = |seed| cell(case, (first << 32) + seed, [limit, periods, others]);
        let mut found: Vec<_> = (0..cells).into_par_iter().map(one).collect();
        let count = |regime: Regime| found.iter().filter(|one| one.0.regime == regime).count();
        let regimes = Regime::SIMULATED.map(|one| format!("{} {}", count(one), one.name()));
        found.retain(|one| one.0.regime != Regime::Undecided);
        let decided = found.len();
        found.retain(|(point, others, _)| others.iter().any(|one| *one != point.regime));
        found.iter().for_each(|one| println!("  {}", one.2));
        let irregular = |one: Regime| matches!(one, Regime::Modulated | Regime::Chaotic | Regime::QuasiPeriodic);
        let differ = |n: usize| found.iter().filter(|one| one.0.regime != one.1[n]).count();
        // One of both motions is a chaos that has not ended yet.
        let ends = |one: &&(RegimeResult, [Regime; 2], String)| irregular(one.0.regime) != irregular(one.1[1]);
        let ended = found.iter().filter(ends).count();
        let share = |count: usize| 100.0 * (decided - count) as f64 / decided as f64;
        println!(
            "map {}: {case:?}: of {decided} decided cells {:.2} % agree with their motion further on, {:.2} % with another plant after \
             {periods} periods; in {ended} of the {} others chaos has ended for one of both; {}",
            n + 1,
            share(differ(0)),
            share(differ(1)),
            differ(1),
            regimes.join(", ")
        );
        // The long run shows the shares.
        let allowed = [1.max(cells / 100), 1.max(cells / 25)];
        assert!((0..2).all(|n| differ(n) as u64 <= allowed[n]), "{found:?}");
    }
}
