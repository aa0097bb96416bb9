//! Do random rigs lock from rest on the exact orbit of their drive, and do the uncertainties of the lock cover its error?
//!
//! epsilon 0.001 to 0.05, lambda 0.1 to 3 (uniform logarithms), r 0.2 to 0.97, and a drive at which a stable symmetric 1:1 orbit exists
//! within 20 % of omega0. A lock is correct within 2e-3 of that orbit in sigma and C, uncertain within four of its standard uncertainties
//! u, and wrong beyond; other runs are refused, with a reason. A response that is held by control is compared with the exact backbone at its C, in
//! sigma and G. `unseen` counts those near an unstable orbit that grows by less than the result says it would show.
//!
//! Arguments: RIGS, SEED, SNR in dB or `none`. Writes validation/locks.csv.

mod common;

use common::*;

/// Locks a rig, and counts it as correct, uncertain or wrong.
fn lock(scene: &Scene) -> Result<Found, Failure> {
    let record = record(&mut *Simulated::of(scene)?, &scene.plan())?;
    let lock = identify(&record, &scene.plan())?.lock;
    let at = lock.at;
    let d = scene.dimensionless();
    let mut orbits = phase_resonant(&d);
    // A multiplier is that of half a period.
    let growth = |orbit: &Orbit| orbit.multipliers[3].powi(2) - 1.0;
    orbits.retain(|orbit| orbit.stable || growth(orbit) <= lock.unseen_growth);
    let largest = |[one, other]: [f64; 2]| one.max(other);
    let by_orbit = |orbit: &Orbit| ([(at.sigma - orbit.sigma).abs(), (at.c - orbit.c).abs()], !orbit.stable);
    // Under control the response is kept, and its drive is measured.
    let by_response = || {
        let there = ExactCurve::of(&d).distance(at.c, at.sigma, at.g)?;
        Some(([there.sigma?.abs(), there.g?.abs()], false))
    };
    let nearest = match record.held {
        true => by_response(),
        false => (orbits.iter().map(by_orbit)).min_by(|one, other| largest(one.0).total_cmp(&largest(other.0))),
    };
    let (errors, unseen) = nearest.unwrap_or(([f64::INFINITY; 2], false));
    let ratios = [
        errors[0] / at.u_sigma,
        errors[1] / if record.held { at.u_g } else { at.u_c },
    ];
    let mut counts = [0; 6];
    counts[match (largest(errors), largest(ratios)) {
        (..=2e-3, _) => 0,
        (_, ..=4.0) => 1,
        _ => 2,
    }] = 1;
    counts[4] = usize::from(unseen);
    if counts[0] == 0 {
        let (is, held) = (lock.regime, if record.held { ", held" } else { "" });
        println!(
            "{d:?}: errors {errors:?}, {ratios:.1?} u, {is}{held}, unseen growth {:.2e}",
            lock.unseen_growth
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
