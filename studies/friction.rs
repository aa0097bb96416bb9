//! Is a motion without impacts ever called a backbone, where the particle lies on a floor with friction?
//!
//! Horizontal rigs at rest, 9 levels after a loop check: epsilon 0.002 to 0.03, lambda 0.5 to 3, mu_k 0.005 to 0.3 (uniform logarithms), r 0.4 to
//! 0.85, of the default rig's b and natural frequency. The drawing is off as in `studies/tracking.rs`, with k within 0.2 %; every second one
//! has the friction. `false`: settled points of a backbone without an impact in their samples. `beyond_3u`: points farther than 3 u from
//! the symmetric motion of the rig at phase resonance at the same response, in sigma or G. `asymmetric`: points on another motion, with
//! asymmetric impacts that noise hides. `one_to_one`: rigs with settled points.
//!
//! Arguments: RIGS, SEED, SNR in dB or `none`. Writes validation/friction.csv.

mod common;

use common::*;

/// A rig, and the client's scene of it.
fn drawn(uniform: Uniform, n: usize, snr: &str) -> Result<[Scene; 2], Failure> {
    let mut logarithmic = |low: f64, high: f64| uniform(low.ln(), high.ln()).exp();
    let [epsilon, lambda, mu] = [[2e-3, 0.03], [0.5, 3.0], [0.005, 0.3]].map(|[low, high]| logarithmic(low, high));
    let r = uniform(0.4, 0.85);
    let text = format!(
        "[plant]\nepsilon = {epsilon:?}\nlambda = {lambda:?}\nr = {r:?}\n[start]\ndq2 = 0\n[excitation]\nG = 1.1\n[backbone]\npoints = 9\nC_from = 0.6\nC_to = 0.2\n"
    );
    let chain = [format!("chain.snr={snr}"), format!("chain.seed={n}")];
    let mut rig = scene(&text, &chain)?;
    // Gravity over b omega0² is 0.32 on the default rig.
    rig.plant.cavity.kinetic_friction = mu * 0.32 / GRAVITY;
    let mut client = rig.clone();
    let [k, c, m, b, r] = SCALES.map(|largest| 1.0 + uniform(-largest, largest));
    let plant = &mut client.plant;
    plant.stiffness *= 1.0 + 0.2 * (k - 1.0);
    plant.damping *= c;
    plant.particle_mass *= m;
    plant.half_width *= b;
    plant.restitution = (plant.restitution * r).min(0.95);
    plant.cavity.kinetic_friction *= (n % 2) as f64;
    Ok([rig, client])
}

/// Counts the rigs with settled points, these points, those without an impact, those with asymmetric impacts, and those beyond 3 u.
fn measure([rig, client]: &[Scene; 2]) -> Result<Found, Failure> {
    let mut bench = behind_chain(rig.plant, rig)?;
    let plan = client.plan();
    let checked = check(&mut *bench, &plan)?;
    let linear = checked.linear.ok_or_else(|| checked.verdict.to_string())?.response;
    let plan = client.plan_on(plan.knowledge.measured(linear));
    let tracked = tracked(&mut *bench, &plan, 20.0)?;
    let (own, epsilon) = (plan.knowledge.numbers, rig.plant.mass_ratio());
    let mut found = Found::default();
    for point in kept(&tracked) {
        found.counts[1] += 1;
        if point.regime_by_impacts == Some(Regime::NoImpacts) {
            found.counts[2] += 1;
            println!("without an impact: {:?} {linear:?} {point:?}", rig.plant);
            continue;
        }
        if point.regime_by_impacts == Some(Regime::Asymmetric) {
            found.counts[4] += 1;
            continue;
        }
        let truth = resonant_motion(&rig.plant, rig.resonance, point.at.a_m, None)?;
        let unit = epsilon * linear.omega0;
        let sigma = (own.omega(point.at.sigma) - truth.omega).abs() / unit;
        let u_sigma = own.omega_change(point.at.u_sigma) / unit;
        let drive = point.at.drive();
        let ratios = [
            sigma / u_sigma,
            (drive.value - truth.amplitude).abs() / drive.uncertainty,
        ];
        if ratios.iter().any(|ratio| *ratio > 3.0) {
            found.counts[5] += 1;
            println!("{ratios:.1?} u: {:?} {linear:?} {point:?}", rig.plant);
        }
        found.ratios.extend(ratios);
        found.errors.push(sigma);
    }
    found.counts[0] = usize::from(found.counts[1] > 0);
    Ok(found)
}

fn main() -> Result<(), Failure> {
    let [count, seed, snr] = &arguments(["RIGS", "SEED", "SNR|none"])?;
    let mut uniform = uniform(seed.parse()?);
    let found = survey(count, |n| drawn(&mut uniform, n, snr), measure)?;
    let ([rigs, points, wrong, failed, asymmetric, beyond], text) = (counts(&found), statistics(&found));
    let row = format!("{count},{seed},{snr},{failed},{rigs},{points},{wrong},{asymmetric},{beyond},{text}");
    let header = format!("rigs,seed,snr_dB,failed,one_to_one,settled,false,asymmetric,beyond_3u,{STATISTICS}");
    write("friction", &header, 3, &[row])
}
