//! What the studies and the tests of the bench share: scenes, random rigs and faults, statistics, and the tables in validation/.

#![allow(dead_code, unused_imports, reason = "no study uses everything")]

use std::f64::consts::{PI, TAU};
use std::{fmt::Debug, fs, path::Path};

pub use lovines::{Cavity, Parameters, Restitution, cavity::GRAVITY};
use num_complex::Complex64;
use phase_lock::Config;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
pub use rayon::prelude::*;
pub use vines_bench::backbone::{LevelPoint, Tracked, track};
pub use vines_bench::comparison::{COMPARED_ABOVE, ExactCurve};
use vines_bench::experiment::{ExperimentError, run};
pub use vines_bench::identification::{Regime, ResonancePoint, decay_points, identify};
pub use vines_bench::linear::LinearResponse;
pub use vines_bench::loop_check::{Verdict, check};
pub use vines_bench::plan::Plan;
pub use vines_bench::record::Record;
pub use vines_bench::rig::{
    BuiltIn, Chain, ControllerError, Rig, RigFault, SensorFault, SensorsOnly, Simulated, faulty,
};
pub use vines_bench::scene::{Override, Scene};
pub use vines_bench::survey::structure_backbone;
pub use vines_model::numerics::{Estimate, mean, mean_square, range};
pub use vines_model::orbit::{Orbit, exact_backbone, phase_resonant, resonant_motion};
pub use vines_model::{Definition, Dimensionless};

/// Any error of a study.
pub type Failure = Box<dyn std::error::Error + Send + Sync>;

/// The arguments of the program, if they are as many as `names`.
pub fn arguments<const N: usize>(names: [&str; N]) -> Result<[String; N], Failure> {
    let given: Result<_, Vec<String>> = std::env::args().skip(1).collect::<Vec<_>>().try_into();
    given.map_err(|_| format!("arguments: {}", names.join(" ")).into())
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
pub type Uniform<'a> = &'a mut dyn FnMut(f64, f64) -> f64;

/// Random numbers that begin with a seed.
pub fn uniform(seed: u64) -> impl FnMut(f64, f64) -> f64 {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    move |low, high| low + (high - low) * (random.next_u64() as f64 / u64::MAX as f64)
}

/// Median and largest of some values; NaN of none.
pub fn ends(values: &[f64]) -> [f64; 2] {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len().saturating_sub(1);
    let at = |share: f64| sorted.get((share * last as f64).round() as usize);
    [0.5, 1.0].map(|share| at(share).copied().unwrap_or(f64::NAN))
}

/// Share of the values up to a limit.
pub fn share(values: &[f64], limit: f64) -> f64 {
    values.iter().filter(|value| **value <= limit).count() as f64 / values.len() as f64
}

/// Probability that uniform values are distributed as unequally as these (the test of Kolmogorov and Smirnov); NaN of fewer than five.
pub fn uniformity(values: &[f64]) -> f64 {
    if values.len() < 5 {
        return f64::NAN;
    }
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len() as f64;
    let apart = |(i, p): (usize, &f64)| f64::max((i + 1) as f64 / n - p, p - i as f64 / n);
    let distance = sorted.iter().enumerate().map(apart).fold(0.0, f64::max);
    // Numerical Recipes, section 14.3.
    let scaled = (n.sqrt() + 0.12 + 0.11 / n.sqrt()) * distance;
    let term = |k: f64| 2.0 * (-2.0 * (k * scaled).powi(2)).exp();
    let sum: f64 = (1..100)
        .map(|k| term(f64::from(2 * k - 1)) - term(f64::from(2 * k)))
        .sum();
    if scaled < 0.2 { 1.0 } else { sum.clamp(0.0, 1.0) }
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
    /// What else is counted; the fourth is what fails.
    pub counts: [usize; 6],
}

/// Draws `count` rigs one after the other, and measures them in parallel. Failures are printed.
pub fn survey<T: Debug + Sync + Send>(
    count: &str,
    draw: impl FnMut(usize) -> Result<T, Failure>,
    measure: impl Fn(&T) -> Result<Found, Failure> + Sync,
) -> Result<Vec<Found>, Failure> {
    let rigs = (0..count.parse()?).map(draw).collect::<Result<Vec<T>, _>>()?;
    let one = |rig: &T| {
        measure(rig).unwrap_or_else(|error| {
            println!("{rig:.4?}: {error}");
            Found { counts: [0, 0, 0, 1, 0, 0], ..Found::default() }
        })
    };
    Ok(rigs.par_iter().map(one).collect())
}

/// The columns of [`statistics`].
pub const STATISTICS: &str = "within_1.96u,within_2u,worst_u,median_error,worst_error,median_periods,worst_periods";

/// The sums of the counts.
pub fn counts(found: &[Found]) -> [usize; 6] {
    [0, 1, 2, 3, 4, 5].map(|n| found.iter().map(|one| one.counts[n]).sum())
}

/// Statistics of all rigs.
pub fn statistics(found: &[Found]) -> String {
    let gather = |values: fn(&Found) -> &[f64]| found.iter().flat_map(values).copied().collect::<Vec<f64>>();
    let (ratios, errors) = (gather(|one| &one.ratios), gather(|one| &one.errors));
    let periods = gather(|one| one.periods.as_slice());
    let ([error, worst], [median, longest], [_, most]) = (ends(&errors), ends(&periods), ends(&ratios));
    let [within, within_2] = [1.96, 2.0].map(|limit| share(&ratios, limit));
    format!("{within:.4},{within_2:.4},{most:.1},{error:.1e},{worst:.1e},{median:.1},{longest:.1}")
}

/// Adds rows to validation/`name`.csv; a row replaces an earlier row with equal first `key` cells.
pub fn write(name: &str, header: &str, key: usize, rows: &[String]) -> Result<(), Failure> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../validation");
    let path = folder.join(format!("{name}.csv"));
    let text = fs::read_to_string(&path).unwrap_or_default();
    let begins_alike = |one: &str, other: &str| one.split(',').take(key).eq(other.split(',').take(key));
    let is_kept = |line: &&str| !rows.iter().any(|row| begins_alike(row, line));
    let mut lines = vec![header];
    lines.extend(text.lines().skip(1).filter(is_kept));
    lines.extend(rows.iter().map(String::as_str));
    println!("{header}\n{}", rows.join("\n"));
    Ok(fs::write(path, lines.join("\n") + "\n")?)
}

/// A drive, a start and 8 levels on stable orbits of a structure's backbone, as text of a scene; `None` where these span less than a factor of 1.2.
pub fn levels(scene: &Scene) -> Option<String> {
    let curves = structure_backbone(scene, &scene.dimensionless())?;
    let all: Vec<Orbit> = curves.into_iter().flatten().collect();
    let is_level = |orbit: &&Orbit| orbit.stable && (0.85..=1.15).contains(&orbit.omega) && orbit.b < 1.35;
    let (low, high) = range((f64::INFINITY, 0.0), all.iter().filter(is_level).map(|orbit| orbit.c));
    let [from, to] = [0.95 * high.min(1.0), 1.1 * low];
    let on = all
        .iter()
        .filter(is_level)
        .filter(|orbit| (to..=from).contains(&orbit.c));
    let (least, largest) = range((f64::INFINITY, 0.0), on.map(|orbit| orbit.g));
    let text = format!(
        "[excitation]\nG = {:?}\n[start]\ndq2 = 5\n[backbone]\nC_from = {from:?}\nC_to = {to:?}\npoints = 8\n",
        0.5 * (least + largest)
    );
    (from >= 1.2 * to && (least..=3.0).contains(&largest)).then_some(text)
}

/// Distance of a point from the exact orbit at the same response, on the nearest of these curves, in sigma or G, and over the standard uncertainties,
/// whichever is larger; `shared`: standard uncertainty that all detunings share. Infinite beside the curves.
pub fn off_backbone(curves: &[Vec<Orbit>], at: &ResonancePoint, shared: f64) -> [f64; 2] {
    let distances = curves.iter().flat_map(|curve| curve.windows(2)).filter_map(|pair| {
        let x = (at.c - pair[0].c) / (pair[1].c - pair[0].c);
        let between = |one: f64, other: f64| one + x * (other - one);
        (0.0..=1.0).contains(&x).then(|| {
            let sigma = (at.sigma - between(pair[0].sigma, pair[1].sigma)).abs();
            let g = (at.g - between(pair[0].g, pair[1].g)).abs();
            [sigma.max(g), (sigma / at.u_sigma.hypot(shared)).max(g / at.u_g)]
        })
    });
    let nearest = distances.min_by(|one, other| one[1].total_cmp(&other[1]));
    nearest.unwrap_or([f64::INFINITY; 2])
}

/// The record of an experiment.
pub fn record(rig: &mut dyn Rig, plan: &Plan) -> Result<Record, ExperimentError> {
    let mut controller = BuiltIn::new(&plan.lock).map_err(ControllerError::from)?;
    run(&mut Vec::new(), rig, &mut controller, plan, |_, _| {})
}

/// The tracked backbone, with a drive up to G = `largest`.
pub fn tracked(rig: &mut dyn Rig, plan: &Plan, largest: f64) -> Result<Tracked, ExperimentError> {
    let mut plan = plan.clone();
    plan.tracking.amplitude_max = Some(plan.knowledge.numbers.amplitude(largest));
    let mut controller = BuiltIn::new(&plan.tracking).map_err(ControllerError::from)?;
    track(&mut Vec::new(), rig, &mut controller, &plan, |_| {})
}

/// A plant behind the chain of a scene.
pub fn behind_chain(plant: Parameters, scene: &Scene) -> Result<Box<dyn Rig>, Failure> {
    let rig = Simulated::new(plant, scene.start)?.with_sensors(scene.resonance);
    Ok(Chain::around(Box::new(rig), scene))
}

/// A rig with M = k = b = 1 and a client: epsilon, lambda and r, the seed of the noise, and the relative errors of k, c, m, b and r in the client's
/// scene.
pub type Case = ([f64; 3], u64, [f64; 5]);

/// Largest relative errors of k, c, m, b and r.
pub const SCALES: [f64; 5] = [0.01, 0.3, 0.2, 0.1, 0.2];

/// The stable symmetric 1:1 orbits at phase resonance, at any drive, on a grid of detunings.
pub fn stable_orbits(d: &Dimensionless) -> Vec<Orbit> {
    let omega = |n: i32| 1.0 + d.epsilon * (-6.0 + 0.005 * f64::from(n));
    let orbits = (0..=1800).flat_map(|n| exact_backbone(d, omega(n)));
    orbits.filter(|orbit| orbit.stable).collect()
}

/// The rig, and the scene of the client, who knows the linear response.
pub fn client(&([epsilon, lambda, r], noise, scales): &Case, snr: &str) -> Result<(Parameters, Scene, Plan), Failure> {
    let [k, c, m, width, dr] = scales.map(|error| 1.0 + error);
    let d = Dimensionless::new(epsilon, lambda, r, 0.0);
    let orbits = stable_orbits(&d);
    let first = orbits.iter().max_by(|one, other| one.c.total_cmp(&other.c));
    let first = first.ok_or("no stable orbit")?;
    let (low, high) = range((f64::INFINITY, 0.0), orbits.iter().map(|orbit| orbit.g));
    // The middle may lie in a gap of the stable drives.
    let from_middle = |g: f64| (g - 0.5 * (low + high)).abs();
    let drives = orbits.iter().map(|orbit| orbit.g);
    let nearest = drives.min_by(|one, other| from_middle(*one).total_cmp(&from_middle(*other)));
    // The largest stable response over b, to a twentieth of the distance at which the orbits were searched.
    let finer = (1..20).flat_map(|n| exact_backbone(&d, 1.0 + epsilon * (first.sigma + 0.005 * f64::from(n) / 20.0)));
    let stable = finer.filter(|orbit| orbit.stable);
    let largest = stable.map(|orbit| orbit.c).fold(first.c, f64::max);
    let curve = ExactCurve::of(&d);
    let fold = curve.places().first().ok_or("no backbone")?[0];
    let text = format!(
        "[plant]\nM = 1.0\nk = {k:?}\nc = {:?}\nm = {:?}\nb = {width:?}\nr = {:?}\n[start]\ndq2 = 0.9\n[excitation]\nE = {:?}\n\
         [controller]\nomega_min = 0.8\nomega_max = 1.2\n[backbone]\nC_from = {:?}\nC_to = {:?}\n",
        epsilon * lambda * c,
        epsilon * m,
        r * dr,
        nearest.unwrap_or(low) * epsilon,
        0.95 * largest.min(0.75) / width,
        1.05 * fold / width,
    );
    let scene = scene(&text, &[format!("chain.snr={snr}"), format!("chain.seed={noise}")])?;
    let linear = LinearResponse {
        omega0: 1.0,
        damping_rate: 0.5 * epsilon * lambda,
        ..LinearResponse::of(&scene.plant, scene.definition().reference)
    };
    let plan = scene.plan_on(scene.knowledge().measured(linear));
    Ok((Parameters::dimensionless(epsilon, lambda, r), scene, plan))
}

/// The points that count as points of the backbone.
pub fn kept(tracked: &Tracked) -> impl Iterator<Item = &LevelPoint> {
    let is_kept = |point: &&LevelPoint| matches!(point.regime, Regime::Symmetric | Regime::Unresolved);
    tracked.points.iter().filter(|point| point.settled).filter(is_kept)
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
/// A crossing is located on the inverse cubic through four samples; at a hundred samples per period its error is below 1e-6 of a sample.
/// A period spans two crossings, so that an offset and even harmonics have no effect to first order.
pub fn crossings(record: &Record, scene: &Scene) -> Vec<[f64; 2]> {
    let values: Vec<f64> = record.decay().iter().map(|sample| sample.sensors.response).collect();
    let mut zeros = Vec::new();
    for (n, y) in values
        .windows(4)
        .enumerate()
        .filter(|(_, y)| (y[1] > 0.0) != (y[2] > 0.0))
    {
        let others = |i: usize| (0..4).filter(move |j| *j != i);
        let weight = |i: usize| others(i).map(|j| y[j] / (y[j] - y[i])).product::<f64>();
        zeros.push((n + 1) as f64 + weight(2) + 2.0 * weight(3) - weight(0));
    }
    let (d, step) = (scene.dimensionless(), record.sample_time);
    let point = |span: &[f64]| {
        let omega = TAU / ((span[2] - span[0]) * step);
        [0.5 * (span[0] + span[2]) * step * d.omega0, d.sigma(omega)]
    };
    zeros.windows(3).map(point).collect()
}

/// Time since the release, times omega0, and sigma of the fundamental in a free decay: the change over a period of the phase of the mean over two periods
/// with the weights of Hann. Where impacts are seen, zero crossings turn against the fundamental as the amplitude falls, by up to 0.01 in sigma.
pub fn demodulated(record: &Record, scene: &Scene) -> Vec<[f64; 2]> {
    let values: Vec<f64> = record.decay().iter().map(|sample| sample.sensors.response).collect();
    let (d, step) = (scene.dimensionless(), record.sample_time);
    let omega = record
        .hold()
        .last()
        .map_or(d.omega0, |sample| sample.command.drive.omega);
    let half = (TAU / omega / step).round() as usize;
    let fundamental = |middle: usize| -> Complex64 {
        let term = |n: usize| {
            let from = n as f64 - middle as f64;
            let weight = (0.5 * PI * from / half as f64).cos().powi(2);
            weight * values[n] * Complex64::cis(-omega * step * n as f64)
        };
        (middle - half..=middle + half).map(term).sum()
    };
    let places = (half + half / 2..values.len().saturating_sub(half + half / 2 + 1)).step_by(4);
    let point = |n: usize| {
        let turn = (fundamental(n + half / 2) * fundamental(n - half / 2).conj()).arg();
        [
            n as f64 * step * d.omega0,
            d.sigma(omega + turn / (2 * (half / 2)) as f64 / step),
        ]
    };
    places.map(point).collect()
}

/// Sigma at a time, interpolated linearly; `None` outside the points.
pub fn at(points: &[[f64; 2]], tau: f64) -> Option<f64> {
    let after = points.partition_point(|point| point[0] < tau);
    let (from, to) = (points.get(after.checked_sub(1)?)?, points.get(after)?);
    Some(from[1] + (tau - from[0]) / (to[0] - from[0]) * (to[1] - from[1]))
}

/// A scene at rest with a drive at which a stable symmetric 1:1 orbit exists within 20 % of omega0: epsilon 0.001 to 0.05, lambda 0.1 to 3
/// (uniform logarithms), r 0.2 to 0.97.
pub fn rig_with_stable_orbit(uniform: Uniform, settings: &[impl AsRef<str>]) -> Result<Scene, Failure> {
    loop {
        let epsilon = uniform(1e-3_f64.ln(), 0.05_f64.ln()).exp();
        let lambda = uniform(0.1_f64.ln(), 3_f64.ln()).exp();
        let (r, share) = (uniform(0.2, 0.97), uniform(0.0, 1.0));
        let d = Dimensionless::new(epsilon, lambda, r, 0.0);
        let drives = stable_orbits(&d).into_iter().map(|orbit| orbit.g);
        let (low, high) = range((f64::INFINITY, 0.0), drives);
        if low > high {
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

/// A random scene for the loop check, and the scene of a rig that differs: mass ratio 0.001 to 0.05, lambda 0.1 to 3, r 0.2 to 0.97, a stiffness
/// up to 1 % and a damping up to 20 % away, 60 to 80 dB, 16 to 24 bits, up to 3 samples of delay.
pub fn checked_rig(between: Uniform) -> Result<[Scene; 2], Failure> {
    let mut scene = scene("", &["start.dq2=0"])?;
    let epsilon = between(0.001_f64.ln(), 0.05_f64.ln()).exp();
    let lambda = between(0.1_f64.ln(), 3_f64.ln()).exp();
    scene.plant.particle_mass = epsilon * scene.plant.primary_mass;
    scene.plant.damping = lambda * scene.plant.particle_mass * scene.plant.natural_frequency();
    scene.plant.restitution = between(0.2, 0.97);
    scene.amplitude = epsilon * scene.plant.half_width * between(0.3, 3.0);
    scene.chain.snr = Some(between(60.0, 80.0));
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
pub fn checked_faults(between: Uniform) -> [(Verdict, RigFault); 16] {
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
