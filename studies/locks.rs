//! Do random rigs lock from rest on the exact backbone, and do the uncertainties of the lock cover its error?
//!
//! epsilon 0.001 to 0.05, lambda 0.1 to 3 (uniform logarithms), r 0.2 to 0.97, and a drive at which a stable symmetric 1:1 orbit exists
//! within 20 % of omega0. A lock is compared with the nearest place of the exact backbone. As in `vines fit`, this is where the differences in C,
//! sigma and G, each over its standard uncertainty u, have the smallest sum of squares. Its root is the distance in u, scaled so that 95 % of such
//! distances, with two degrees of freedom, are below 1.96. A lock is correct within 2e-3 in all three, uncertain within four u, and wrong beyond;
//! other runs are refused, with a reason. `other_drive` counts locks whose measured drive is another than the requested one, by more than 1 % of it
//! and three u: a response that has not come to rest. The result tells them.
//!
//! Arguments: RIGS, SEED, SNR in dB or `none`. Writes validation/locks.csv.

mod common;

use common::*;
use vines_model::orbit::backbone;

/// Orbits of the exact backbone: the error of the polygon is about 2e-7.
const POINTS: usize = 20_000;
/// Squares that 95 % of chi-squares with one and with two degrees of freedom are below.
const LIMITS: [f64; 2] = [3.8415, 5.9915];

/// Locks a rig, and counts it as correct, uncertain or wrong.
fn lock(scene: &Scene) -> Result<Found, Failure> {
    let record = record(&mut *Simulated::of(scene)?, &scene.plan())?;
    let lock = identify(&record, &scene.plan())?.lock;
    let (at, d) = (lock.at, scene.dimensionless());
    let units = [at.u_c, at.u_sigma, at.u_g];
    let off = |orbit: &Orbit| [orbit.c - at.c, orbit.sigma - at.sigma, orbit.g - at.g];
    let product =
        |one: [f64; 3], other: [f64; 3]| -> f64 { (0..3).map(|i| one[i] * other[i] / (units[i] * units[i])).sum() };
    let curves = backbone(&d, None, POINTS);
    let places = curves.iter().flat_map(|curve| curve.points.windows(2)).map(|pair| {
        let (from, to) = (off(&pair[0]), off(&pair[1]));
        let along = [0, 1, 2].map(|i| to[i] - from[i]);
        let share = (-product(from, along) / product(along, along)).clamp(0.0, 1.0);
        let differences = [0, 1, 2].map(|i| from[i] + share * along[i]);
        let distance = (LIMITS[0] / LIMITS[1] * product(differences, differences)).sqrt();
        (distance, differences)
    });
    let nearest = places.min_by(|one, other| one.0.total_cmp(&other.0));
    let (distance, differences) = nearest.ok_or("no exact backbone")?;
    let error = differences.into_iter().map(f64::abs).fold(0.0, f64::max);
    let mut counts = [0; 6];
    counts[match (error, distance) {
        (..=2e-3, _) => 0,
        (_, ..=4.0) => 1,
        _ => 2,
    }] = 1;
    let is_other = (at.g - d.g).abs() > f64::max(0.01 * d.g, 3.0 * at.u_g);
    counts[4] = usize::from(is_other);
    if counts[0] == 0 || is_other {
        println!(
            "{d:?}: C {:.5} G {:.5} ± {:.5}, {}: errors {differences:?}, {distance:.1} u",
            at.c, at.g, at.u_g, lock.regime
        );
    }
    let periods = Some(record.settled as f64 / scene.controller.samples_per_period);
    Ok(Found { errors: vec![error], ratios: vec![distance], periods, counts })
}

fn main() -> Result<(), Failure> {
    let [count, seed, snr] = &arguments(["RIGS", "SEED", "SNR|none"])?;
    let mut uniform = uniform(seed.parse()?);
    let scene = |n| {
        let chain = [format!("chain.snr={snr}"), format!("chain.seed={n}")];
        rig_with_stable_orbit(&mut uniform, &chain)
    };
    let found = survey(count, scene, lock)?;
    let ([correct, uncertain, wrong, refused, other, _], text) = (counts(&found), statistics(&found));
    let header = format!("rigs,seed,snr_dB,correct,uncertain,wrong,refused,other_drive,{STATISTICS}");
    let row = format!("{count},{seed},{snr},{correct},{uncertain},{wrong},{refused},{other},{text}");
    write("locks", &header, 3, &[row])
}
