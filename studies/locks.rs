//! Do random rigs lock from rest on the exact orbit of their drive, and do the uncertainties of the lock cover its error?
//!
//! epsilon 0.001 to 0.05, lambda 0.1 to 3 (uniform logarithms), r 0.2 to 0.97, and a drive at which a stable symmetric 1:1 orbit exists
//! within 20 % of omega0. A lock is correct within 2e-3 of that orbit in sigma and C, uncertain within four of its standard uncertainties
//! u, and wrong beyond; other runs are refused, with a reason. A response that is held by control may have an orbit that is unstable
//! under a constant drive. Errors and coverage count sigma and C.
//!
//! ```sh
//! cargo run --release -p vines-testbench --example locks -- RIGS SEED SNR    # SNR: dB, or none; writes validation/locks.csv
//! ```

mod common;

use common::{Failure, Found, STATISTICS, arguments, rig_with_stable_orbit, statistics, uniform, write};
use rayon::prelude::*;
use vines_model::orbit::phase_resonant;
use vines_testbench::experiment::run;
use vines_testbench::identification::identify;
use vines_testbench::rig::{BuiltIn, Simulated};
use vines_testbench::scene::Scene;

/// Locks a rig, and counts it as correct, uncertain or wrong.
fn lock(scene: &Scene) -> Result<Found, Failure> {
    let mut controller = BuiltIn::new(&scene.controller_config())?;
    let record = run(&mut *Simulated::of(scene)?, &mut controller, scene, |_, _, _| {})?;
    let at = identify(&record, scene)?.lock.at;
    let mut orbits = phase_resonant(&scene.dimensionless());
    orbits.retain(|orbit| orbit.stable || record.held);
    let largest = |[sigma, c]: [f64; 2]| sigma.max(c);
    let distances = orbits
        .iter()
        .map(|orbit| [(at.sigma - orbit.sigma).abs(), (at.c - orbit.c).abs()]);
    let nearest = distances.min_by(|one, other| largest(*one).total_cmp(&largest(*other)));
    let errors = nearest.ok_or("no orbit")?;
    let ratios = [errors[0] / at.u_sigma, errors[1] / at.u_c];
    let counts = match (largest(errors), largest(ratios)) {
        (..=2e-3, _) => [1, 0, 0, 0],
        (_, ..=4.0) => [0, 1, 0, 0],
        _ => [0, 0, 1, 0],
    };
    if counts[0] == 0 {
        println!("{:?}: errors {errors:?}, {ratios:.1?} u", scene.dimensionless());
    }
    let periods = Some(record.settled as f64 / scene.controller.samples_per_period);
    Ok(Found {
        errors: errors.into(),
        ratios: ratios.into(),
        periods,
        counts,
    })
}

fn main() -> Result<(), Failure> {
    let [count, seed, snr] = &arguments()[..] else {
        return Err("arguments: RIGS SEED SNR|none".into());
    };
    let (count, mut uniform) = (count.parse::<usize>()?, uniform(seed.parse()?));
    let scene = |n| {
        let chain = [format!("chain.snr={snr}"), format!("chain.seed={n}")];
        rig_with_stable_orbit(&mut uniform, &chain)
    };
    let scenes = (0..count).map(scene).collect::<Result<Vec<_>, _>>()?;
    let one = |scene: &Scene| {
        lock(scene).unwrap_or_else(|error| {
            println!("{:?}: {error}", scene.dimensionless());
            Found { counts: [0, 0, 0, 1], ..Found::default() }
        })
    };
    let (text, counts) = statistics(&scenes.par_iter().map(one).collect::<Vec<_>>());
    let counts = counts.map(|count| count.to_string()).join(",");
    let header = format!("rigs,seed,snr_dB,correct,uncertain,wrong,refused,{STATISTICS}");
    write("locks", &header, 3, &[format!("{count},{seed},{snr},{counts},{text}")])
}
