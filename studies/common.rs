//! What the studies and the tests of the bench share: scenes, random rigs and faults, statistics, and the tables in validation/.

#![allow(dead_code, reason = "no study uses everything")]

use std::f64::consts::TAU;
use std::{fs, path::Path};

use lovines::Parameters;
use phase_lock::Config;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use vines_model::Dimensionless;
use vines_model::numerics::{bisection, mean_square};
use vines_model::orbit::{Orbit, exact_backbone, phase_resonant};
use vines_testbench::advice;
use vines_testbench::backbone::LevelPoint;
use vines_testbench::comparison::ExactCurve;
use vines_testbench::identification::Regime;
use vines_testbench::loop_check::Verdict;
use vines_testbench::record::Record;
use vines_testbench::rig::{BuiltIn, Controller, Rig, RigFault, SensorFault, Simulated};
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

/// Adds rows to validation/`name`.csv; a row replaces an earlier row with equal first `key` cells.
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

/// Configuration of the controller for a tracked backbone, with a drive up to G = 20: errors of the scene and noise need more than usual.
pub fn tracking_config(scene: &Scene) -> Config {
    let amplitude_max = Some(scene.dimensionless().amplitude(20.0));
    Config { amplitude_max, ..scene.backbone_config() }
}

/// A rig of these epsilon, lambda and r with M = k = b = 1, and the scene of a client who differs: relative errors of k, c, m, b and r.
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
    let stable = largest_stable(&d).ok_or("no stable orbit")?;
    let fold = curve.places().first().ok_or("no backbone")?[0];
    let (from, to) = (0.95 * stable.min(0.75), 1.05 * fold);
    // The rig with M = k = b = 1, and the scene of the client in SI units.
    let truth = rig([epsilon, lambda, r]);
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

/// Distance of the detunings at which [`advice::stable_range`] searches for stable orbits, and parts of it in which the end is located.
const STEP: f64 = 0.005;
const FINER: i32 = 20;

/// The largest response amplitude over b of the stable symmetric 1:1 orbits at phase resonance, at any drive.
pub fn largest_stable(d: &Dimensionless) -> Option<f64> {
    let largest = |orbits: Vec<Orbit>| {
        let stable = orbits.into_iter().filter(|orbit| orbit.stable);
        stable.max_by(|one, other| one.c.total_cmp(&other.c))
    };
    let first = largest(advice::stable_orbits(d))?;
    let steps = (1..FINER).map(|n| first.sigma + STEP * f64::from(n) / f64::from(FINER));
    let finer = steps.filter_map(|sigma| largest(exact_backbone(d, 1.0 + d.epsilon * sigma)));
    Some(finer.map(|orbit| orbit.c).fold(first.c, f64::max))
}

/// Whether a point counts as one of the backbone.
pub fn is_kept(point: &&LevelPoint) -> bool {
    point.settled && matches!(point.regime, Regime::Symmetric | Regime::Unresolved)
}

/// A record with noise after the release; `ratio`: of the held response to it, dB.
pub fn noisy(record: &Record, ratio: f64, seed: u64) -> Record {
    let mut noisy = record.clone();
    let power = mean_square(record.hold().iter().map(|sample| sample.sensors.response));
    let deviation = power.sqrt() * 10_f64.powf(-ratio / 20.0);
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    for sample in &mut noisy.samples[record.released..] {
        let normal: f64 = StandardNormal.sample(&mut random);
        sample.sensors.response += deviation * normal;
    }
    noisy
}

/// Time since the release, times omega0, and sigma in every period of a free decay between alternate zero crossings: without a model, exact on
/// clean data.
///
/// A crossing is located on the cubic through four samples; at a hundred samples per period its error is below 1e-7 of a sample.
/// A period spans two crossings, so that an offset and even harmonics have no effect to first order.
pub fn crossings(record: &Record, scene: &Scene) -> Vec<[f64; 2]> {
    let values: Vec<f64> = record.decay().iter().map(|sample| sample.sensors.response).collect();
    let zeros: Vec<f64> = (1..values.len().saturating_sub(2))
        .filter(|&n| (values[n] > 0.0) != (values[n + 1] > 0.0))
        .map(|n| n as f64 + zero([values[n - 1], values[n], values[n + 1], values[n + 2]]))
        .collect();
    let d = scene.dimensionless();
    let step = record.sample_time;
    zeros
        .windows(3)
        .map(|span| {
            let omega = TAU / ((span[2] - span[0]) * step);
            [0.5 * (span[0] + span[2]) * step * d.omega0, d.sigma(omega)]
        })
        .collect()
}

/// Sigma at a time, interpolated linearly; `None` outside the points.
pub fn at(points: &[[f64; 2]], tau: f64) -> Option<f64> {
    let after = points.partition_point(|point| point[0] < tau);
    let (from, to) = (points.get(after.checked_sub(1)?)?, points.get(after)?);
    Some(from[1] + (tau - from[0]) / (to[0] - from[0]) * (to[1] - from[1]))
}

/// Where the cubic through values at -1, 0, 1 and 2 is zero, between 0 and 1.
fn zero(y: [f64; 4]) -> f64 {
    let cubic = |x: f64| {
        -y[0] * x * (x - 1.0) * (x - 2.0) / 6.0 + y[1] * (x + 1.0) * (x - 1.0) * (x - 2.0) / 2.0
            - y[2] * (x + 1.0) * x * (x - 2.0) / 2.0
            + y[3] * (x + 1.0) * x * (x - 1.0) / 6.0
    };
    let (low, high) = bisection(0.0, 1.0, |x| (cubic(x) > 0.0) == (y[2] > y[1]));
    0.5 * (low + high)
}

/// A scene at rest with a drive at which a stable symmetric 1:1 orbit exists within 20 % of omega0: epsilon 0.001 to 0.05, lambda 0.1 to 3
/// (uniform logarithms), r 0.2 to 0.97.
pub fn rig_with_stable_orbit(
    uniform: &mut impl FnMut(f64, f64) -> f64,
    settings: &[impl AsRef<str>],
) -> Result<Scene, Failure> {
    loop {
        let epsilon = uniform(1e-3_f64.ln(), 0.05_f64.ln()).exp();
        let lambda = uniform(0.1_f64.ln(), 3_f64.ln()).exp();
        let (r, share) = (uniform(0.2, 0.97), uniform(0.0, 1.0));
        let d = Dimensionless::new(epsilon, lambda, r, 0.0);
        let Some([low, high]) = advice::stable_range(&d) else {
            continue;
        };
        let d = Dimensionless { g: low + share * (high - low), ..d };
        let orbits = phase_resonant(&d);
        if orbits.iter().any(|one| one.stable && (0.8..=1.2).contains(&one.omega)) {
            let plant = format!("[plant]\nepsilon = {epsilon:?}\nlambda = {lambda:?}\nr = {r:?}\n");
            let rest = "[controller]\nomega_min = 0.8\nomega_max = 1.2\n[record]\ndecay_periods = 3\n";
            return scene(&format!("{plant}[excitation]\nG = {:?}\n{rest}", d.g), settings);
        }
    }
}

/// Bandwidths of the detector, in units of omega0, and the periods that are published for this rule of gains on such a plant.
pub const LOCK_TIMES: [(f64, f64); 5] = [(0.02, 234.0), (0.05, 102.0), (0.1, 55.0), (0.2, 35.0), (0.5, 25.0)];

/// Only the phase is to settle; the largest bandwidth needs more than a hundred samples per period.
pub const LOCK_TIME_SETTINGS: [&str; 5] = [
    "phase_lock.lock.phase_tolerance=0.034906585",
    "phase_lock.lock.dwell=20",
    "phase_lock.lock.frequency_drift=9.949e-5",
    "phase_lock.lock.amplitude_drift=1.0177",
    "controller.samples_per_period=200",
];

/// Periods until a loop settles, if that ends the run, at most 800.
pub fn periods_to_settle(rig: &mut Simulated, scene: &Scene, ends: bool) -> Result<f64, Failure> {
    let mut controller = BuiltIn::new(&scene.controller_config())?;
    let (step, mut periods) = (scene.sample_time(), 0.0);
    while periods < 800.0 {
        let command = controller.sample(rig.sense()?, true)?;
        if ends && command.settled {
            break;
        }
        rig.advance(command.drive, step)?;
        periods += command.drive.omega * step / TAU;
    }
    Ok(periods)
}

/// A random scene for the loop check, and the scene of a rig that differs: mass ratio 0.001 to 0.05, lambda 0.1 to 3, r 0.2 to 0.97, a stiffness
/// up to 1 % and a damping up to 20 % away, 30 to 80 dB, 16 to 24 bits, up to 3 samples of delay.
pub fn checked_rig(between: &mut impl FnMut(f64, f64) -> f64) -> Result<[Scene; 2], Failure> {
    let mut scene = scene("", &["start.dq2=0"])?;
    let epsilon = between(0.001_f64.ln(), 0.05_f64.ln()).exp();
    let lambda = between(0.1_f64.ln(), 3_f64.ln()).exp();
    scene.plant.particle_mass = epsilon * scene.plant.primary_mass;
    scene.plant.damping = lambda * scene.plant.particle_mass * scene.plant.natural_frequency();
    scene.plant.restitution = between(0.2, 0.97);
    scene.amplitude = epsilon * scene.plant.half_width * between(0.3, 3.0);
    scene.chain.snr = Some(between(30.0, 80.0));
    scene.chain.seed = between(0.0, 1e6) as u64;
    scene.chain.delay = between(0.0, 4.0) as u32;
    scene.chain.filter = Some(between(8.0, 40.0));
    scene.chain.adc_bits = Some(between(16.0, 25.0) as u32);
    let mut rig = scene.clone();
    rig.plant.stiffness *= between(0.99, 1.01);
    rig.plant.damping *= between(0.8, 1.2);
    Ok([scene, rig])
}

/// Faults that the loop check names, with random sizes.
pub fn checked_faults(between: &mut impl FnMut(f64, f64) -> f64) -> [(Verdict, RigFault); 16] {
    use {RigFault::*, SensorFault::*};
    let strong = Gain(between(1.15_f64.ln(), 1000_f64.ln()).exp());
    let weak = Gain(between(0.25, 0.85));
    let late = Late(between(2.0, 33.0) as usize);
    [
        (Verdict::NotANumber, Response(Value(f64::NAN))),
        (Verdict::NotANumber, Base(Value(f64::INFINITY))),
        (Verdict::ShakerOff, Shaker(0.0)),
        (Verdict::ResponseDead, Response(Dead)),
        (Verdict::BaseDead, Base(Dead)),
        (Verdict::Swapped, Swapped),
        (Verdict::ResponseReversed, Response(Reversed)),
        (Verdict::BaseReversed, Base(Reversed)),
        (Verdict::BothReversed, Both(Reversed)),
        (Verdict::ResponseGain, Response(strong)),
        (Verdict::ResponseGain, Response(weak)),
        (Verdict::BaseGain, Base(strong)),
        (Verdict::ResponseLate, Response(late)),
        (Verdict::BaseLate, Base(late)),
        (Verdict::ResponseNoisy, Response(Noisy)),
        (Verdict::BaseNoisy, Base(Noisy)),
    ]
}

/// A rig with M = k = b = 1.
pub fn rig([epsilon, lambda, r]: [f64; 3]) -> Parameters {
    Parameters {
        primary_mass: 1.0,
        stiffness: 1.0,
        damping: epsilon * lambda,
        particle_mass: epsilon,
        half_width: 1.0,
        restitution: r,
        cavity: lovines::Cavity::IDEAL,
    }
}
