//! Are the settled points of random structures on their exact backbone, where another mode rings near a harmonic of the motion?
//!
//! Two or three modes; the driven one as in `structures.rs`, the second at 2.4 to 3.2 or 4.6 to 5.4 times its frequency, near the third or fifth
//! harmonic of the motion, and the third at up to 20 times. Base or force, the sensor at the drive or at the cavity. Tracked in 8 levels over the
//! range of responses in which the exact backbone has stable orbits, at least a factor of 1.2, with the linear response that a loop check measures.
//! A point is right within 3 u of the exact backbone in sigma and G.
//!
//! Arguments: STRUCTURES, SEED, SNR in dB or `none`, and the number of the only STRUCTURE to run, whose points are printed. Writes
//! validation/beats.csv.

mod common;

use common::*;

/// A structure.
fn text(uniform: Uniform) -> String {
    let mut log = |low: f64, high: f64| uniform(low.ln(), high.ln()).exp();
    let (epsilon, lambda, r) = (log(0.002, 0.02), log(0.3, 3.0), log(0.4, 0.85));
    let near = if log(1.0, 4.0) < 2.0 {
        log(2.4, 3.2)
    } else {
        log(4.6, 5.4)
    };
    let ratios = [1.0, near, log(1.2 * near, 20.0)];
    let (count, is_base) = (log(2.0, 4.0) as usize, log(1.0, 4.0) < 2.0);
    let mode = |(n, ratio): (usize, &f64)| {
        let (zeta, sign) = (log(0.001, 0.03), (log(1.0, 4.0) - 2.0).signum());
        let [zeta, cavity, other] = match n {
            0 => [0.5 * epsilon * lambda, 1.0, log(0.5, 1.5)],
            _ => [zeta, log(0.1, 1.5), sign * log(0.1, 1.5)],
        };
        let participation = if is_base {
            format!("participation = {other:?}, ")
        } else {
            String::new()
        };
        format!(
            "{{ frequency = {ratio:?}, damping = {zeta:?}, {participation}shape = {{ cavity = {cavity:?}, drive = {other:?} }} }}"
        )
    };
    let modes: Vec<String> = ratios[..count].iter().enumerate().map(mode).collect();
    let (drive, sensor) = match (is_base, log(1.0, 4.0) < 2.0) {
        (true, _) => ("excitation = \"base\"", "cavity"),
        (false, true) => ("excitation = \"force\"\ndrive = \"drive\"", "drive"),
        (false, false) => ("excitation = \"force\"\ndrive = \"drive\"", "cavity"),
    };
    format!(
        "[plant]\nm = {epsilon:?}\nb = 1\nr = {r:?}\n[controller]\nomega_min = 0.8\nomega_max = 1.2\n[structure]\ncavity = \"cavity\"\n{drive}\n\
         sensor = \"{sensor}\"\nmodes = [{}]\n",
        modes.join(", ")
    )
}

/// A scene with levels on stable orbits.
fn drawn(uniform: Uniform, settings: &[String]) -> Result<Scene, Failure> {
    loop {
        let text = text(uniform);
        let plain = scene(&format!("{text}[excitation]\nG = 1\n"), &[""; 0])?;
        if let Some(levels) = levels(&plain) {
            return scene(&format!("{text}{levels}"), settings);
        }
    }
}

/// Tracks a backbone: points, settled ones, those beyond 3 u, and why it ended early.
fn run(scene: &Scene, prints: bool) -> Result<Found, Failure> {
    let stated = scene.plan();
    let checked = check(&mut *Simulated::of(&scene.clone().at_rest())?, &stated)?;
    let linear = checked
        .linear
        .ok_or_else(|| format!("refused by the check, {}", checked.verdict))?;
    let plan = scene.plan_on(stated.knowledge.measured(linear.response));
    let tracked = tracked(&mut *Simulated::of(scene)?, &plan, 20.0)?;
    let curves = structure_backbone(scene, &scene.dimensionless()).unwrap_or_default();
    // All detunings share the uncertainty of the natural frequency.
    let shared = plan.knowledge.linear.uncertainty / plan.knowledge.numbers.omega_change(1.0);
    let mut found = Found::default();
    for point in kept(&tracked) {
        let [error, ratio] = off_backbone(&curves, &point.at, shared);
        found.errors.push(error);
        found.ratios.push(ratio);
        if prints || ratio > 3.0 {
            let (LevelPoint { at, periods, averaged, regime, .. }, pole) = (point, plan.knowledge.nearest_pole);
            println!(
                "C {:.4} sigma {:.5} +- {:.5} G {:.5} +- {:.5} {regime} {periods:.0} periods, averaged {averaged}: {error:.1e}, {ratio:.1} u; nearest pole {pole:.2}",
                at.c, at.sigma, at.u_sigma, at.g, at.u_g
            );
        }
    }
    let beyond = found.ratios.iter().filter(|ratio| **ratio > 3.0).count();
    let why = tracked.ended.as_ref().map_or_else(String::new, ToString::to_string);
    if prints || beyond > 0 {
        println!(
            "  structure {}: {beyond} beyond 3 u of {}; {why} {:?}",
            scene.chain.seed,
            tracked.points.len(),
            scene.structure.as_ref().map(|structure| &structure.modes)
        );
    }
    found.counts = [
        tracked.points.len(),
        found.ratios.len(),
        beyond,
        0,
        usize::from(tracked.ended.is_some()),
        0,
    ];
    found.periods = (found.counts[0] > 0).then(|| tracked.periods / found.counts[0] as f64);
    Ok(found)
}

fn main() -> Result<(), Failure> {
    let given: Vec<String> = std::env::args().skip(1).collect();
    let [count, seed, snr, only @ ..] = &given[..] else {
        return Err("arguments: STRUCTURES SEED SNR|none [STRUCTURE]".into());
    };
    let mut uniform = uniform(seed.parse()?);
    let draw = |n| drawn(&mut uniform, &[format!("chain.snr={snr}"), format!("chain.seed={n}")]);
    if let [only] = only {
        let scenes = (0..=only.parse()?).map(draw).collect::<Result<Vec<Scene>, _>>()?;
        return run(&scenes[scenes.len() - 1], true).map(|_| ());
    }
    let found = survey(count, draw, |scene| run(scene, false))?;
    let ([points, settled, beyond, failed, ended, _], text) = (counts(&found), statistics(&found));
    let header = format!("structures,seed,snr_dB,points,settled,beyond_3u,failed,ended_early,{STATISTICS}");
    let row = format!("{count},{seed},{snr},{points},{settled},{beyond},{failed},{ended},{text}");
    write("beats", &header, 3, &[row])
}
