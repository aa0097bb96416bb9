//! How far are tracked points from the truth, and from what they state, on rigs that are not the scene of the client?
//!
//! A rig is drawn (epsilon 0.001 to 0.02, lambda 0.7 to 2.5, r 0.5 to 0.8), and a scene that may differ from it. The backbone is tracked from
//! sensor readings alone, with the linear response that a loop check measures; the truth is the exact backbone of the rig: errors of sigma
//! and G at equal C of the settled points, over their standard uncertainties u, and periods a point.
//!
//! ```sh
//! cargo run --release -p vines-testbench --example off_scene -- RIGS SEED SNR SHIFT
//! ```
//!
//! SNR: dB, or none. SHIFT of the scene: none, or random. It writes validation/tracking.csv.

mod common;

use common::{Failure, Found, STATISTICS, arguments, quantile, scene, statistics, uniform, write};
use lovines::Parameters;
use rayon::prelude::*;
use vines_model::Dimensionless;
use vines_testbench::{
    advice,
    backbone::{Point, track},
    comparison::ExactCurve,
    identification::Regime,
    rig::{BuiltIn, Chain, SensorsOnly, Simulated},
    scene::LinearResponse,
};

fn main() -> Result<(), Failure> {
    let [count, seed, snr, shift] = &arguments()[..] else {
        return Err("arguments: RIGS SEED SNR|none none|random".into());
    };
    let mut uniform = uniform(seed.parse()?);
    let mut rigs = Vec::new();
    for _ in 0..count.parse::<usize>()? {
        let epsilon = uniform(1e-3_f64.ln(), 0.02_f64.ln()).exp();
        let (lambda, r) = (uniform(0.7, 2.5), uniform(0.5, 0.8));
        let noise = uniform(0.0, 1e6);
        let scales = [0.01, 0.3, 0.2, 0.1, 0.2].map(|range| uniform(-range, range));
        let scales = if shift == "none" { [0.0; 5] } else { scales };
        rigs.push(([epsilon, lambda, r], noise as u64, scales));
    }
    let one = |(rig, noise, scales): &([f64; 3], u64, [f64; 5])| {
        run(*rig, *noise, snr, *scales).unwrap_or_else(|error| {
            println!("{rig:.4?}: {error}");
            Found { counts: [0, 0, 1, 0], ..Found::default() }
        })
    };
    let (text, [points, settled, ended, _]) = statistics(&rigs.par_iter().map(one).collect::<Vec<_>>());
    let which = if shift == "none" { "the rig" } else { "another" };
    let row = format!("{count},{seed},{snr},{which},{points},{settled},{text},{ended}");
    let header = format!("rigs,seed,snr_dB,scene,points,settled,{STATISTICS},ended_early");
    write("tracking", &header, 4, &[row])
}

/// Counts the points, the settled ones, and whether tracking ended early.
fn run([epsilon, lambda, r]: [f64; 3], noise: u64, snr: &str, [k, c, m, b, dr]: [f64; 5]) -> Result<Found, Failure> {
    let d = Dimensionless::new(epsilon, lambda, r, 0.0);
    let [low, high] = advice::stable_range(&d).ok_or("no stable orbit")?;
    let g = 0.5 * (low + high);
    let curve = ExactCurve::of(&d);
    let stable = advice::largest_stable(&d).ok_or("no stable orbit")?;
    let fold = curve.places().first().ok_or("no backbone")?[0];
    let (from, to) = (0.95 * stable.min(0.75), 1.05 * fold);
    // The rig with M = k = b = 1, and the scene of the client in SI units.
    let truth = Parameters {
        primary_mass: 1.0,
        stiffness: 1.0,
        damping: epsilon * lambda,
        particle_mass: epsilon,
        half_width: 1.0,
        restitution: r,
        cavity: lovines::Cavity::IDEAL,
    };
    let width = 1.0 + b;
    let settings = [
        format!("plant.M={:?}", 1.0),
        format!("plant.k={:?}", 1.0 + k),
        format!("plant.c={:?}", epsilon * lambda * (1.0 + c)),
        format!("plant.m={:?}", epsilon * (1.0 + m)),
        format!("plant.b={width:?}"),
        format!("plant.r={:?}", r * (1.0 + dr)),
        format!("excitation.E={:?}", g * epsilon),
        "start.dq2=0.9".into(),
        "controller.omega_min=0.8".into(),
        "controller.omega_max=1.2".into(),
        format!("backbone.C_from={:?}", from / width),
        format!("backbone.C_to={:?}", to / width),
        "backbone.G_max=20".into(),
    ];
    let chain = [format!("chain.snr={snr}"), format!("chain.seed={noise}")];
    let mut scene = scene("[plant]\n[start]\n[excitation]\n", &[&settings[..], &chain].concat())?;
    scene.measured = Some(LinearResponse {
        omega0: 1.0,
        damping_rate: 0.5 * epsilon * lambda,
        uncertainty: 0.0,
        gain: LinearResponse::of(&scene).gain,
    });
    let rig = Simulated::new(truth, scene.start)?;
    let mut rig = SensorsOnly::around(Chain::around(Box::new(rig), &scene));
    let mut controller = BuiltIn::new(&scene.backbone_config())?;
    let tracked = track(&mut rig, &mut controller, &scene, |_, _| {})?;
    let own = scene.dimensionless();
    let (mut ratios, mut errors, mut settled) = (vec![], vec![], 0);
    let is_backbone = |regime| matches!(regime, Regime::Symmetric | Regime::Unresolved);
    let is_kept = |point: &&Point| point.settled && is_backbone(point.regime);
    for point in tracked.points.iter().filter(is_kept) {
        settled += 1;
        // In units of the rig.
        let (c, omega, e) = (point.at.c * width, own.omega(point.at.sigma), own.amplitude(point.at.g));
        let [sigma, g] = [(omega - 1.0) / epsilon, e / epsilon];
        let u_sigma = own.omega_change(point.at.u_sigma) / epsilon;
        let u_g = own.amplitude(point.at.u_g) / epsilon;
        if let Some([exact_sigma, exact_g]) = curve.at(c) {
            let [off_sigma, off_g] = [(sigma - exact_sigma).abs(), (g - exact_g).abs()];
            ratios.extend([off_sigma / u_sigma, off_g / u_g]);
            errors.push(off_sigma.max(off_g));
        }
    }
    let count = tracked.points.len();
    let why = tracked.ended.as_ref().map_or_else(String::new, ToString::to_string);
    let worst = quantile(&ratios, 1.0);
    println!("epsilon {epsilon:.4} lambda {lambda:.2} r {r:.2}: worst {worst:.1} u {why}");
    Ok(Found {
        ratios,
        errors,
        periods: (count > 0).then(|| tracked.periods / count as f64),
        counts: [count, settled, usize::from(tracked.ended.is_some()), 0],
    })
}
