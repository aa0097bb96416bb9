//! How far are tracked points from the truth, and from what they state, on rigs that are not the scene of the client?
//!
//! A rig is drawn (epsilon 0.001 to 0.02, lambda 0.7 to 2.5, r 0.5 to 0.8), and a scene that may differ from it. The backbone is tracked from
//! sensor readings alone, with the linear response that a loop check measures; the truth is the exact backbone of the rig. One line
//! per rig: share of the settled values within 2 u, largest error in u, median and largest error of sigma or G at equal C, periods a point.
//!
//! ```sh
//! cargo run --release --example off_scene -- RIGS SEED SNR SHIFT    # SNR: dB, or none; SHIFT: none, or a random combination
//! ```

use std::sync::Mutex;

use lovines::Parameters;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use rayon::prelude::*;
use vines_model::Dimensionless;
use vines_testbench::{
    advice,
    backbone::track,
    comparison::ExactCurve,
    identification::Regime,
    rig::{BuiltIn, Chain, SensorsOnly, Simulated},
    scene::{LinearResponse, Override, Scene},
};

type Failure = Box<dyn std::error::Error + Send + Sync>;

/// Errors over their uncertainties and errors at equal C of the settled points, points, and periods.
struct Found {
    name: String,
    ratios: Vec<f64>,
    errors: Vec<f64>,
    points: usize,
    settled: usize,
    periods: f64,
    message: Option<String>,
}

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [count, seed, snr, shift] = &arguments[..] else {
        return Err("arguments: RIGS SEED SNR|none none|random".into());
    };
    let mut random = ChaCha8Rng::seed_from_u64(seed.parse()?);
    let mut uniform = move |low: f64, high: f64| low + (high - low) * (random.next_u64() as f64 / u64::MAX as f64);
    let mut rigs = Vec::new();
    for _ in 0..count.parse::<usize>()? {
        let epsilon = uniform(1e-3_f64.ln(), 0.02_f64.ln()).exp();
        let (lambda, r) = (uniform(0.7, 2.5), uniform(0.5, 0.8));
        let noise = uniform(0.0, 1e6);
        let scales = [0.01, 0.3, 0.2, 0.1, 0.2].map(|range| uniform(-range, range));
        rigs.push(([epsilon, lambda, r], noise as u64, scales));
    }
    let lines = Mutex::new(());
    let found: Vec<Found> = rigs
        .par_iter()
        .map(|(rig, noise, scales)| {
            let scales = if shift == "none" { [0.0; 5] } else { *scales };
            let found = run(*rig, *noise, snr, scales).unwrap_or_else(|error| failed(*rig, &error));
            let _lock = lines.lock();
            println!("{}", line(&found));
            found
        })
        .collect();
    let gather = |values: fn(&Found) -> &Vec<f64>| {
        found
            .iter()
            .flat_map(|one| values(one).iter().copied())
            .collect::<Vec<f64>>()
    };
    let (ratios, errors) = (gather(|one| &one.ratios), gather(|one| &one.errors));
    let share = |limit: f64| ratios.iter().filter(|ratio| **ratio <= limit).count() as f64 / ratios.len() as f64;
    let periods: Vec<f64> = found
        .iter()
        .filter(|one| one.points > 0)
        .map(|one| one.periods / one.points as f64)
        .collect();
    let count = |value: fn(&Found) -> usize| found.iter().map(value).sum::<usize>();
    let failures = found.iter().filter(|one| one.message.is_some()).count();
    println!(
        "rigs,seed,snr_dB,scene,points,settled,within_1.96u,within_2u,worst_u,median_error,worst_error,median_periods,worst_periods,ended_early"
    );
    println!(
        "{},{seed},{snr},{},{},{},{:.4},{:.4},{:.1},{:.1e},{:.1e},{:.1},{:.1},{failures}",
        found.len(),
        if shift == "none" { "the rig" } else { "another" },
        count(|one| one.points),
        count(|one| one.settled),
        share(1.96),
        share(2.0),
        largest(&ratios),
        median(&errors),
        largest(&errors),
        median(&periods),
        largest(&periods),
    );
    Ok(())
}

fn failed(rig: [f64; 3], error: &Failure) -> Found {
    Found {
        name: format!("{rig:.4?}"),
        ratios: vec![],
        errors: vec![],
        points: 0,
        settled: 0,
        periods: 0.0,
        message: Some(error.to_string()),
    }
}

fn line(one: &Found) -> String {
    let within = one.ratios.iter().filter(|ratio| **ratio <= 2.0).count() as f64 / one.ratios.len() as f64;
    format!(
        "{}: {:.2} within 2 u, worst {:.1} u; median {:.1e}, worst {:.1e}; {:.1} periods a point; {} of {} settled {}",
        one.name,
        within,
        largest(&one.ratios),
        median(&one.errors),
        largest(&one.errors),
        one.periods / one.points as f64,
        one.settled,
        one.points,
        one.message.as_deref().unwrap_or(""),
    )
}

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
    let mut settings: Vec<String> = settings.into();
    if snr != "none" {
        settings.extend([format!("chain.snr={snr}"), format!("chain.seed={noise}")]);
    }
    let overrides = settings
        .iter()
        .map(|one| one.parse())
        .collect::<Result<Vec<Override>, _>>()?;
    let mut scene = Scene::parse("off scene", "[plant]\n[start]\n[excitation]\n", &overrides)?;
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
    for point in tracked
        .points
        .iter()
        .filter(|point| point.settled && is_backbone(point.regime))
    {
        settled += 1;
        // In units of the rig.
        let (c, omega, e) = (point.at.c * width, own.omega(point.at.sigma), own.amplitude(point.at.g));
        let [sigma, g] = [(omega - 1.0) / epsilon, e / epsilon];
        let [u_sigma, u_g] = [
            own.omega_change(point.at.u_sigma) / epsilon,
            own.amplitude(point.at.u_g) / epsilon,
        ];
        let Some([exact_sigma, exact_g]) = curve.at(c) else {
            continue;
        };
        if std::env::var_os("POINTS").is_some() {
            println!(
                "C {c:.3}: sigma {:+.1e} ({:.1e}), G {:+.1e} ({:.1e}), {:.0} periods, {} averaged, {:?}",
                sigma - exact_sigma,
                u_sigma,
                g - exact_g,
                u_g,
                point.periods,
                point.averaged,
                point.regime
            );
        }
        ratios.extend([(sigma - exact_sigma).abs() / u_sigma, (g - exact_g).abs() / u_g]);
        errors.push((sigma - exact_sigma).abs().max((g - exact_g).abs()));
    }
    Ok(Found {
        name: format!("epsilon {epsilon:.4} lambda {lambda:.2} r {r:.2} G {g:.2} C {from:.2} to {to:.2}"),
        ratios,
        errors,
        points: tracked.points.len(),
        settled,
        periods: tracked.periods,
        message: tracked.ended.map(|error| error.to_string()),
    })
}

fn largest(values: &[f64]) -> f64 {
    values.iter().copied().fold(0.0, f64::max)
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(f64::NAN)
}
