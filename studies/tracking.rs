//! How far are tracked points from the truth, and from what they state, on rigs that are not the scene of the client?
//!
//! A rig is drawn (epsilon 0.001 to 0.02, or 0.001 to 0.002 with "small epsilon"; lambda 0.7 to 2.5, r 0.5 to 0.8). Its backbone is tracked from sensor readings alone, with the linear
//! response that a loop check measures, by a client whose scene differs by nothing, in its parameters (k by 1 %, c 30 %, m 20 %, b 10 %, r 20 %),
//! or by an effect of the cavity that the rig has. The truth is the periodic motion of the rig's plant at phase resonance, with the amplitude of
//! the point. Errors of sigma and G of the settled points, over their standard uncertainties u, and periods a point.
//!
//! Arguments: RIGS, SEED, SNR in dB or `none`, DIFFERENCE. Writes validation/tracking.csv.

mod common;

use common::*;

/// Differences of rig and scene; the last is all effects of the cavity together.
const DIFFERENCES: &str = "none, small epsilon, parameters, friction, unequal gaps, tilt, r of the speed, real cavity";
fn drawn(difference: &str, uniform: Uniform) -> (Case, Cavity) {
    let largest: f64 = if difference == "small epsilon" { 0.002 } else { 0.02 };
    let epsilon = uniform(1e-3_f64.ln(), largest.ln()).exp();
    let (lambda, r) = (uniform(0.7, 2.5), uniform(0.5, 0.8));
    let noise = uniform(0.0, 1e6) as u64;
    let scales = SCALES.map(|range| uniform(-range, range));
    let mut effect = |name: &str, low, high| {
        let size = uniform(low, high);
        let acts = [name, "real cavity"].contains(&difference);
        if acts { size } else { 0.0 }
    };
    // Friction and weight along the axis over b omega0², gravity being 9.8 b omega0²: up to 0.05 and 3 degrees on the default rig.
    let kinetic_friction = effect("friction", 0.0, 0.015) / GRAVITY;
    // Half of the difference of the gaps over b.
    let gaps = effect("unequal gaps", -0.05, 0.05);
    let tilt = (effect("tilt", -0.015, 0.015) / GRAVITY).asin();
    // The law r = 1 - k |v|^(1/5), with the r of the scene at the relative speed 2, the usual one.
    let viscoelastic = Restitution::Viscoelastic((1.0 - r) / 2_f64.powf(0.2));
    let restitution = [(effect("r of the speed", 1.0, 1.0) > 0.0).then_some(viscoelastic); 2];
    let (b_plus, b_minus) = (Some(1.0 + gaps), Some(1.0 - gaps));
    let cavity = Cavity {
        b_plus,
        b_minus,
        tilt,
        kinetic_friction,
        restitution,
        ..Cavity::IDEAL
    };
    let scales = if difference == "parameters" { scales } else { [0.0; 5] };
    (([epsilon, lambda, r], noise, scales), cavity)
}

/// Counts the points, the settled ones, those whose truth was not found, and whether tracking ended early.
fn run((case, cavity): &(Case, Cavity), snr: &str) -> Result<Found, Failure> {
    let (ideal, scene, plan) = client(case, snr)?;
    let (rig, epsilon) = (Parameters { cavity: *cavity, ..ideal }, case.0[0]);
    let tracked = tracked(&mut SensorsOnly(behind_chain(rig, &scene)?), &plan, 20.0)?;
    // Sigma counts from the natural frequency that the client has measured.
    let own = plan.knowledge.numbers;
    let (mut found, mut settled, mut without) = (Found::default(), 0, 0);
    for point in kept(&tracked) {
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
    let [_, worst] = ends(&found.ratios);
    println!("{:.4?}: worst {worst:.1} u {why}", case.0);
    let count = tracked.points.len();
    found.periods = (count > 0).then(|| tracked.periods / count as f64);
    found.counts = [count, settled, without, usize::from(tracked.ended.is_some()), 0, 0];
    Ok(found)
}

fn main() -> Result<(), Failure> {
    let [count, seed, snr, name] = &arguments(["RIGS", "SEED", "SNR|none", "DIFFERENCE"])?;
    if !DIFFERENCES.split(", ").any(|one| one == name) {
        return Err(format!("DIFFERENCE is one of {DIFFERENCES}").into());
    }
    let mut uniform = uniform(seed.parse()?);
    let found = survey(count, |_| Ok(drawn(name, &mut uniform)), |rig| run(rig, snr))?;
    let ([points, settled, without, ended, ..], text) = (counts(&found), statistics(&found));
    let row = format!("{count},{seed},{snr},{name},{points},{settled},{without},{text},{ended}");
    let header = format!("rigs,seed,snr_dB,difference,points,settled,without_truth,{STATISTICS},ended_early");
    write("tracking", &header, 4, &[row])
}
