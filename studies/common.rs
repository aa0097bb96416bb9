//! What the studies share: scenes, random numbers, statistics, and the tables in validation/.

#![allow(dead_code, reason = "no study uses everything")]

use std::{fs, path::Path};

use lovines::Parameters;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use vines_model::Dimensionless;
use vines_testbench::advice;
use vines_testbench::backbone::{Point, Tracked, track};
use vines_testbench::comparison::ExactCurve;
use vines_testbench::identification::Regime;
use vines_testbench::rig::{BuiltIn, Chain, SensorsOnly, Simulated};
use vines_testbench::scene::{LinearResponse, Override, Scene};

/// Any error of a study.
pub type Failure = Box<dyn std::error::Error + Send + Sync>;

/// The arguments of the program.
pub fn arguments() -> Vec<String> {
    std::env::args().skip(1).collect()
}

/// A scene with replaced values; an empty text is the default scene.
pub fn scene(text: &str, settings: &[impl AsRef<str>]) -> Result<Scene, Failure> {
    let overrides = settings.iter().map(|one| one.as_ref().parse());
    let overrides = overrides.collect::<Result<Vec<Override>, _>>()?;
    if text.is_empty() {
        return Ok(Scene::load(None, &overrides)?);
    }
    Ok(Scene::parse("scene of a study", text, &overrides)?)
}

/// Random numbers between two limits.
pub fn uniform(seed: u64) -> impl FnMut(f64, f64) -> f64 {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    move |low, high| low + (high - low) * (random.next_u64() as f64 / u64::MAX as f64)
}

/// The value below which this share of the values lies; NaN of none.
pub fn quantile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len().saturating_sub(1);
    let at = (share * last as f64).round() as usize;
    sorted.get(at).copied().unwrap_or(f64::NAN)
}

/// Share of the values up to a limit.
pub fn share(values: &[f64], limit: f64) -> f64 {
    values.iter().filter(|value| **value <= limit).count() as f64 / values.len() as f64
}

/// What was measured on one random rig.
#[derive(Default)]
pub struct Found {
    /// Errors.
    pub errors: Vec<f64>,
    /// Errors over their standard uncertainties u.
    pub ratios: Vec<f64>,
    /// Periods that it took, if it succeeded.
    pub periods: Option<f64>,
    /// What else is counted.
    pub counts: [usize; 4],
}

/// The columns of [`statistics`].
pub const STATISTICS: &str = "within_1.96u,within_2u,worst_u,median_error,worst_error,median_periods,worst_periods";

/// Statistics of all rigs, and the sums of their counts.
pub fn statistics(found: &[Found]) -> (String, [usize; 4]) {
    let gather = |values: fn(&Found) -> &[f64]| found.iter().flat_map(|one| values(one).to_vec()).collect::<Vec<f64>>();
    let (ratios, errors) = (gather(|one| &one.ratios), gather(|one| &one.errors));
    let periods = gather(|one| one.periods.as_slice());
    let ends = |values: &[f64]| [quantile(values, 0.5), quantile(values, 1.0)];
    let ([error, worst], [median, longest]) = (ends(&errors), ends(&periods));
    let ([within, within_2], most) = ([1.96, 2.0].map(|limit| share(&ratios, limit)), quantile(&ratios, 1.0));
    let text = format!("{within:.4},{within_2:.4},{most:.1},{error:.1e},{worst:.1e},{median:.1},{longest:.1}");
    (text, [0, 1, 2, 3].map(|n| found.iter().map(|one| one.counts[n]).sum()))
}

/// Adds rows to validation/`name`.csv; a row replaces the one that begins with the same `key` cells.
pub fn write(name: &str, header: &str, key: usize, rows: &[String]) -> Result<(), Failure> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../validation");
    let path = folder.join(format!("{name}.csv"));
    let text = fs::read_to_string(&path).unwrap_or_default();
    let begins_alike = |one: &str, other: &str| one.split(',').take(key).eq(other.split(',').take(key));
    let is_kept = |line: &&str| !rows.iter().any(|row| begins_alike(row, line));
    let kept = text.lines().skip(1).filter(is_kept).map(String::from);
    let lines: Vec<String> = [header.into()]
        .into_iter()
        .chain(kept)
        .chain(rows.iter().cloned())
        .collect();
    println!("{header}\n{}", rows.join("\n"));
    Ok(fs::write(path, lines.join("\n") + "\n")?)
}

/// The backbone of a rig of these epsilon, lambda and r with M = k = b = 1, tracked from sensor readings alone by a client whose scene differs:
/// `scales` are its relative errors of k, c, m, b and r. Returns that scene as well.
pub fn tracked(rig: [f64; 3], noise: u64, snr: &str, scales: [f64; 5]) -> Result<(Tracked, Scene), Failure> {
    let (truth, scene) = client(rig, noise, snr, scales)?;
    let rig = Simulated::new(truth, scene.start)?;
    let mut rig = SensorsOnly::around(Chain::around(Box::new(rig), &scene));
    let mut controller = BuiltIn::new(&scene.backbone_config())?;
    let tracked = track(&mut rig, &mut controller, &scene, |_, _| {})?;
    Ok((tracked, scene))
}

/// The rig, and the scene of the client, of [`tracked`].
pub fn client(
    [epsilon, lambda, r]: [f64; 3],
    noise: u64,
    snr: &str,
    [k, c, m, b, dr]: [f64; 5],
) -> Result<(Parameters, Scene), Failure> {
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
    Ok((truth, scene))
}

/// Whether a point counts as one of the backbone.
pub fn is_kept(point: &&Point) -> bool {
    point.settled && matches!(point.regime, Regime::Symmetric | Regime::Unresolved)
}
