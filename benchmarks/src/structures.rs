//! The default rig with the further modes of a cantilever or a plate: the plant and the closed form with Brent's method, in turns, and what other programs need
//! to follow the same motion.

use core::f64::consts::TAU;
use std::convert::Infallible;
use std::hint::black_box;
use std::time::Instant;

use lovines::{Drive, Excitation, Host, Mode, Parameters, Plant, StructureState};
use serde_json::{Value, json};

use crate::baseline::{Baseline, Oscillator, pair};
use crate::median;

/// Frequencies of a cantilever over its first.
pub const CANTILEVER: [f64; 8] = [1.0, 6.267, 17.55, 34.39, 56.84, 84.91, 118.6, 157.9];
/// Frequencies of a frame or a plate over its first.
pub const PLATE: [f64; 8] = [1.0, 2.2, 3.4, 4.7, 6.1, 7.4, 8.6, 9.9];
/// Frequency of the drive, and its amplitude.
const DRIVE: [f64; 2] = [0.990_417, 0.0084 * 1.1];
/// A start on the steady motion of the first mode: q1, q1', q2, q2'.
const LOCK: [f64; 4] = [-0.438_371_55, 0.007_696_65, -1.003_854_15, -0.878_123_25];
/// Periods that are followed, so few that a run is rarely interrupted, and tolerance of Brent's method.
const PERIODS: f64 = 4.0;
const TOLERANCE: f64 = 1e-12;

fn parameters() -> Parameters {
    Parameters::dimensionless(0.0084, 1.43, 0.65)
}

/// The modes at these frequencies: the first is the default rig; the others are as mobile, and move with the base as little as a cantilever's do.
pub fn modes(frequencies: &[f64]) -> Vec<Mode> {
    let mode = |(n, omega): (usize, &f64)| {
        let sign = if n % 2 == 0 { 1.0 } else { -1.0 };
        Mode {
            omega: *omega,
            zeta: 0.5 * parameters().damping,
            cavity: sign,
            drive: sign / (1 + n * n) as f64,
        }
    };
    frequencies.iter().enumerate().map(mode).collect()
}

/// Nanoseconds per impact of the plant and of Brent's method, the largest difference of their states at the end, and the problem itself.
fn measured<const N: usize>(frequencies: &[f64; 8], pairs: usize) -> anyhow::Result<Value> {
    let modes = modes(&frequencies[..N]);
    let [q1, dq1, q2, dq2] = LOCK;
    let first = |value: f64| (0..N).map(|n| if n == 0 { value } else { 0.0 }).collect::<Vec<_>>();
    let start = StructureState { displacements: first(q1), velocities: first(dq1), q2, dq2 };
    let host = Host::from_modes(Excitation::Base, &modes)?;
    let plant = Plant::with_host(host, parameters(), &start)?;
    let oscillator = |n: usize| Oscillator {
        mass: 1.0,
        stiffness: modes[n].omega.powi(2),
        damping: 2.0 * modes[n].zeta * modes[n].omega,
        shape: modes[n].cavity,
        participation: modes[n].drive,
        state: if n == 0 { [q1, dq1] } else { [0.0; 2] },
    };
    let brent = Baseline::of(
        std::array::from_fn::<_, N, _>(oscillator),
        [q2, dq2],
        parameters(),
        TOLERANCE,
    );
    let [omega, amplitude] = DRIVE;
    let (drive, duration) = (Drive::harmonic(amplitude, omega), PERIODS * TAU / omega);
    let [mut by_plant, mut by_brent] = [[f64::NAN; 4]; 2];
    let mut impacts = [0; 2];
    let mut run_plant = || {
        let mut plant = plant.clone();
        let began = Instant::now();
        plant.advance(black_box(drive), duration).expect("a valid step");
        let ns = began.elapsed().as_nanos() as f64;
        (by_plant, impacts[0]) = (plant.state().into(), plant.totals().impacts);
        Ok::<_, Infallible>((ns, impacts[0] as f64))
    };
    let mut brent_impacts = 0;
    let mut run_brent = || {
        let mut brent = brent;
        let began = Instant::now();
        brent.advance(black_box(drive), duration).expect("no chatter");
        let ns = began.elapsed().as_nanos() as f64;
        (by_brent, brent_impacts) = (brent.state().into(), brent.impacts);
        Ok((ns, brent_impacts as f64))
    };
    let mut times = [Vec::new(), Vec::new()];
    for n in 0..pairs {
        let Ok(both) = pair(n, &mut run_plant, &mut run_brent);
        times.iter_mut().zip(both).for_each(|(times, ns)| times.push(ns));
    }
    impacts[1] = brent_impacts;
    let off = (0..4).map(|n| (by_plant[n] - by_brent[n]).abs()).fold(0.0, f64::max);
    let rows: Vec<_> = modes
        .iter()
        .map(|one| [one.omega, one.zeta, one.cavity, one.drive])
        .collect();
    let Parameters { particle_mass, half_width, restitution, .. } = parameters();
    Ok(json!({
        "ns_per_impact": times.map(median),
        "impacts": impacts,
        "brent_off": off,
        "state": by_plant,
        "modes": rows,
        "particle": [particle_mass, half_width, restitution],
        "start": LOCK,
        "drive": DRIVE,
        "duration": duration,
    }))
}

/// The comparison for a number of modes of a family: `cantilever` or `plate`.
///
/// # Errors
/// Another number of modes, or another family.
pub fn compare(family: &str, count: usize, pairs: usize) -> anyhow::Result<Value> {
    let frequencies = match family {
        "cantilever" => &CANTILEVER,
        "plate" => &PLATE,
        _ => anyhow::bail!("{family}: there are cantilever and plate"),
    };
    match count {
        1 => measured::<1>(frequencies, pairs),
        2 => measured::<2>(frequencies, pairs),
        3 => measured::<3>(frequencies, pairs),
        5 => measured::<5>(frequencies, pairs),
        8 => measured::<8>(frequencies, pairs),
        _ => anyhow::bail!("{count} modes: there are 1, 2, 3, 5 and 8"),
    }
}
