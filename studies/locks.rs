//! Do random rigs lock from rest on the exact orbit of their drive, and do the uncertainties of the lock cover its error?
//!
//! epsilon 0.001 to 0.05, lambda 0.1 to 3 (uniform logarithms), r 0.2 to 0.97, and a drive at which a stable symmetric 1:1 orbit exists
//! within 20 % of omega0. A lock is correct within 2e-3 of that orbit in sigma and C, uncertain within four of its standard uncertainties
//! u, and wrong beyond; other runs are refused, with a reason. A response that is held by control may have an orbit that is unstable
//! under a constant drive, and `unseen` counts those near an unstable orbit that grows by less than the result says it would show.
//! Errors and coverage count sigma and C.
//!
//! Arguments: RIGS, SEED, SNR in dB or `none`. Writes validation/locks.csv.

mod common;

use common::*;
use vines_model::orbit::Orbit;

/// Locks a rig, and counts it as correct, uncertain or wrong.
fn lock(scene: &Scene) -> Result<Found, Failure> {
    let record = record(&mut *Simulated::of(scene)?, &scene.plan())?;
    let lock = identify(&record, &scene.plan())?.lock;
    let at = lock.at;
    // Under control the response is kept, and its drive is measured.
    let asked = scene.dimensionless();
    let drive = if record.held { at.g } else { asked.g };
    let mut orbits = phase_resonant(&Dimensionless { g: drive, ..asked });
    // A multiplier is that of half a period.
    let is_unseen = |orbit: &Orbit| orbit.multipliers[3].powi(2) - 1.0 <= lock.unseen_growth;
    orbits.retain(|orbit| orbit.stable || record.held || is_unseen(orbit));
    let largest = |[sigma, c]: [f64; 2]| sigma.max(c);
    let errors = |orbit: &Orbit| [(at.sigma - orbit.sigma).abs(), (at.c - orbit.c).abs()];
    let distance = |orbit: &Orbit| largest(errors(orbit));
    let nearest = orbits
        .iter()
        .min_by(|one, other| distance(one).total_cmp(&distance(other)));
    let nearest = nearest.ok_or("no orbit")?;
    let errors = errors(nearest);
    let ratios = [errors[0] / at.u_sigma, errors[1] / at.u_c];
    let mut counts = [0; 6];
    counts[match (largest(errors), largest(ratios)) {
        (..=2e-3, _) => 0,
        (_, ..=4.0) => 1,
        _ => 2,
    }] = 1;
    counts[4] = usize::from(!nearest.stable && !record.held);
    if counts[0] == 0 {
        let (is, held) = (lock.regime, if record.held { ", held" } else { "" });
        println!(
            "{:?}: errors {errors:?}, {ratios:.1?} u, {is}{held}, unseen growth {:.2e}, orbit grows {:.2e}",
            scene.dimensionless(),
            lock.unseen_growth,
            nearest.multipliers[3].powi(2) - 1.0
        );
    }
    let periods = Some(record.settled as f64 / scene.controller.samples_per_period);
    let (errors, ratios) = (errors.into(), ratios.into());
    Ok(Found { errors, ratios, periods, counts })
}

fn main() -> Result<(), Failure> {
    let [count, seed, snr] = &arguments(["RIGS", "SEED", "SNR|none"])?;
    let mut uniform = uniform(seed.parse()?);
    let scene = |n| {
        let chain = [format!("chain.snr={snr}"), format!("chain.seed={n}")];
        rig_with_stable_orbit(&mut uniform, &chain)
    };
    let found = survey(count, scene, lock)?;
    let ([correct, uncertain, wrong, refused, unseen, _], text) = (counts(&found), statistics(&found));
    let header = format!("rigs,seed,snr_dB,correct,uncertain,wrong,refused,unseen,{STATISTICS}");
    let row = format!("{count},{seed},{snr},{correct},{uncertain},{wrong},{refused},{unseen},{text}");
    write("locks", &header, 3, &[row])
}
