//! How far are tracked points from the truth, and from what they state, on rigs that are not the scene of the client?
//!
//! A rig is drawn (epsilon 0.001 to 0.02, lambda 0.7 to 2.5, r 0.5 to 0.8). Its backbone is tracked from sensor readings alone, with the linear
//! response that a loop check measures, by a client whose scene differs by nothing, in its parameters (k by 1 %, c 30 %, m 20 %, b 10 %, r 20 %),
//! or by an effect of the cavity that the rig has. The truth is the periodic motion of the rig's plant at phase resonance, with the amplitude of
//! the point. Errors of sigma and G of the settled points, over their standard uncertainties u, and periods a point.
//!
//! ```sh
//! cargo run --release -p vines-testbench --example tracking -- RIGS SEED SNR DIFFERENCE    # SNR: dB, or none; writes validation/tracking.csv
//! ```

mod common;

use common::{
    Failure, Found, STATISTICS, arguments, client, is_kept, quantile, statistics, tracking_config, uniform, write,
};
use lovines::{Cavity, Restitution, cavity::GRAVITY};
use rayon::prelude::*;
use vines_model::orbit::resonant_motion;
use vines_testbench::backbone::track;
use vines_testbench::rig::{BuiltIn, Chain, SensorsOnly, Simulated};

/// Differences of rig and scene. The effects of the cavity come after "parameters", all of them together last.
const DIFFERENCES: [&str; 7] = [
    "none",
    "parameters",
    "friction",
    "unequal gaps",
    "tilt",
    "r of the speed",
    "real cavity",
];
/// Largest relative errors of k, c, m, b and r.
const SCALES: [f64; 5] = [0.01, 0.3, 0.2, 0.1, 0.2];
/// Smallest and largest effects: friction and weight along the axis over `b omega0²` (0.05 and 3 degrees on the default rig), half of the
/// difference of the gaps over b, and whether r is 1 - k |v|^(1/5), with the r of the scene at the relative speed 2, the usual one.
const EFFECTS: [(f64, f64); 4] = [(0.0, 0.015), (-0.05, 0.05), (-0.015, 0.015), (1.0, 1.0)];

/// A rig: epsilon, lambda and r, the seed of its noise, errors of the scene, and effects of its cavity, 0 where there is none.
type Drawn = ([f64; 3], u64, [f64; 5], [f64; 4]);

fn drawn(difference: usize, uniform: &mut impl FnMut(f64, f64) -> f64) -> Drawn {
    let epsilon = uniform(1e-3_f64.ln(), 0.02_f64.ln()).exp();
    let (lambda, r) = (uniform(0.7, 2.5), uniform(0.5, 0.8));
    let noise = uniform(0.0, 1e6) as u64;
    let mut scales = SCALES.map(|range| uniform(-range, range));
    let mut effects = EFFECTS.map(|(low, high)| uniform(low, high));
    if difference != 1 {
        scales = [0.0; 5];
    }
    for (n, effect) in (2..).zip(&mut effects) {
        if n != difference && DIFFERENCES[difference] != "real cavity" {
            *effect = 0.0;
        }
    }
    ([epsilon, lambda, r], noise, scales, effects)
}

/// Counts the points, the settled ones, those whose truth was not found, and whether tracking ended early.
fn run(([epsilon, lambda, r], noise, scales, effects): Drawn, snr: &str) -> Result<Found, Failure> {
    let (mut rig, scene) = client([epsilon, lambda, r], noise, snr, scales)?;
    let [friction, gaps, tilt, speed] = effects;
    let viscoelastic = Restitution::Viscoelastic((1.0 - r) / 2_f64.powf(0.2));
    rig.cavity = Cavity {
        b_plus: Some(1.0 + gaps),
        b_minus: Some(1.0 - gaps),
        // Gravity is 9.8 b omega0² here.
        tilt: (tilt / GRAVITY).asin(),
        kinetic_friction: friction / GRAVITY,
        restitution: [(speed != 0.0).then_some(viscoelastic); 2],
        ..Cavity::IDEAL
    };
    let plant = Box::new(Simulated::new(rig, scene.start)?);
    let mut chain = SensorsOnly::around(Chain::around(plant, &scene));
    let mut controller = BuiltIn::new(&tracking_config(&scene))?;
    let tracked = track(&mut chain, &mut controller, &scene, |_, _| {})?;
    let own = scene.dimensionless();
    let (mut found, mut settled, mut without) = (Found::default(), 0, 0);
    for point in tracked.points.iter().filter(is_kept) {
        settled += 1;
        let Ok(truth) = resonant_motion(&rig, scene.resonance, point.at.c * own.b, None) else {
            without += 1;
            continue;
        };
        // In units of the rig.
        let sigma = (own.omega(point.at.sigma) - truth.omega).abs() / epsilon;
        let g = (own.amplitude(point.at.g) - truth.amplitude).abs() / epsilon;
        let u_sigma = own.omega_change(point.at.u_sigma) / epsilon;
        let u_g = own.amplitude(point.at.u_g) / epsilon;
        found.ratios.extend([sigma / u_sigma, g / u_g]);
        found.errors.push(sigma.max(g));
    }
    let why = tracked.ended.as_ref().map_or_else(String::new, ToString::to_string);
    let worst = quantile(&found.ratios, 1.0);
    println!("epsilon {epsilon:.4} lambda {lambda:.2} r {r:.2}: worst {worst:.1} u {why}");
    let count = tracked.points.len();
    found.periods = (count > 0).then(|| tracked.periods / count as f64);
    found.counts = [count, settled, without, usize::from(tracked.ended.is_some())];
    Ok(found)
}

fn main() -> Result<(), Failure> {
    let [count, seed, snr, name] = &arguments()[..] else {
        return Err("arguments: RIGS SEED SNR|none DIFFERENCE".into());
    };
    let difference = DIFFERENCES.iter().position(|difference| difference == name);
    let difference = difference.ok_or_else(|| format!("DIFFERENCE is one of {}", DIFFERENCES.join(", ")))?;
    let mut uniform = uniform(seed.parse()?);
    let rigs: Vec<Drawn> = (0..count.parse::<usize>()?)
        .map(|_| drawn(difference, &mut uniform))
        .collect();
    let one = |rig: &Drawn| {
        run(*rig, snr).unwrap_or_else(|error| {
            println!("{rig:.4?}: {error}");
            Found { counts: [0, 0, 0, 1], ..Found::default() }
        })
    };
    let (text, counts) = statistics(&rigs.par_iter().map(one).collect::<Vec<_>>());
    let [points, settled, without, ended] = counts;
    let row = format!("{count},{seed},{snr},{name},{points},{settled},{without},{text},{ended}");
    let header = format!("rigs,seed,snr_dB,difference,points,settled,without_truth,{STATISTICS},ended_early");
    write("tracking", &header, 4, &[row])
}
