//! How far are the parameters that a fit finds from the truth, from what they state, and from the best that the points allow?
//!
//! A rig is drawn (epsilon 0.002 to 0.03, lambda 0.4 to 2.5, r 0.4 to 0.9), and a client's scene that is wrong: r by 0.2, b by 10 %, m by 20 %,
//! c by 30 %, k by 1 %. The client fits f0, zeta, r, b and epsilon to the backbone that it tracks (`points`), or to a recording of the search, the
//! hold and the decay of `vines identify`, cut at both ends (`recordings`). For each parameter, of the fits that are not rejected:
//! the share within 1.96 of the stated standard uncertainty u, the largest error over u, the root mean square of the error over u, and that over the
//! Cramér–Rao bound of the same points; and the numbers of fits that are rejected, and of rigs without a fit.
//!
//! `effects` gives each rig one hidden effect of its cavity, in turn friction, tilt, and two laws of restitution, and as many rigs none. A rig is drawn again if
//! the loop does not lock on it, if friction keeps the particle from the walls, or if the effect moves its points by less than 5 u. The table has the
//! numbers of rigs that were drawn, measured, flagged because the ideal cavity does not describe their points, explained by the right effect, by a wrong one
//! alone, and by the right one only among others; and the coverage of the strength.
//!
//! ```sh
//! cargo run --release -p vines-testbench --example fit -- points|recordings RIGS SEED SNR    # SNR: dB, or none; writes validation/fit.csv
//! cargo run --release -p vines-testbench --example fit -- effects RIGS SEED SNR              # writes validation/fit_effects.csv
//! ```

mod common;

use std::time::Instant;

use common::{Failure, arguments, client, is_kept, quantile, rig, share, tracking_config, uniform, write};
use lovines::{Cavity, Restitution};
use rayon::prelude::*;
use vines_model::numerics::{Estimate, mean_square};
use vines_testbench::backbone::{Tracked, track};
use vines_testbench::experiment::run;
use vines_testbench::fit::{Effect, Fit, Known, MeasuredPoint, Quantity, Recording, at, explain, fit, parts};
use vines_testbench::identification::Regime;
use vines_testbench::rig::{BuiltIn, Chain, SensorsOnly, Simulated};
use vines_testbench::scene::{Parameters, Scene};

/// A rig (epsilon, lambda, r), the seed of its noise, and the relative errors of the client's k, c, m, b and r.
type Case = ([f64; 3], u64, [f64; 5]);
/// Measured points, and the scene of the client.
type Points = (Vec<MeasuredPoint>, Scene);

fn main() -> Result<(), Failure> {
    let [source, count, seed, snr] = &arguments()[..] else {
        return Err("arguments: points|recordings|effects RIGS SEED SNR|none".into());
    };
    let measure: fn(&Case, &str) -> Result<Points, Failure> = match &**source {
        "points" => points,
        "recordings" => recorded,
        "effects" => return effects(count.parse()?, seed, snr),
        other => return Err(format!("{other}: there are points, recordings and effects").into()),
    };
    let mut uniform = uniform(seed.parse()?);
    let mut cases: Vec<Case> = Vec::new();
    for _ in 0..count.parse::<usize>()? {
        let epsilon = uniform(2e-3_f64.ln(), 0.03_f64.ln()).exp();
        let (lambda, r) = (uniform(0.4, 2.5), uniform(0.4, 0.9));
        let noise = uniform(0.0, 1e6);
        let [k, c, m, b] = [0.01, 0.3, 0.2, 0.1].map(|range| uniform(-range, range));
        let wrong_r = (r + uniform(-0.2, 0.2)).clamp(0.2, 0.98);
        cases.push(([epsilon, lambda, r], noise as u64, [k, c, m, b, wrong_r / r - 1.0]));
    }
    let fits: Vec<_> = cases
        .par_iter()
        .map(|case| {
            let result = measure(case, snr).and_then(|(points, scene)| fitted(case, &points, &scene));
            result.inspect_err(|error| println!("{:.4?}: {error}", case.0)).ok()
        })
        .collect();
    let found: Vec<&Fitted> = fits.iter().flatten().collect();
    let kept: Vec<&&Fitted> = found.iter().filter(|one| !one.fit.is_rejected()).collect();
    times("a fit", found.iter().map(|one| one.seconds));
    let mut rows = Vec::new();
    for (n, quantity) in Quantity::ALL[..5].iter().enumerate() {
        let gather =
            |values: fn(&Fitted) -> &[f64; 5]| kept.iter().map(|one| values(one)[n].abs()).collect::<Vec<f64>>();
        let (ratios, over_bound) = (gather(|one| &one.over_u), gather(|one| &one.over_bound));
        let rms = |values: &[f64]| mean_square(values.iter().copied()).sqrt();
        rows.push(format!(
            "{source},{snr},{quantity},{count},{seed},{},{:.3},{:.1},{:.2},{:.2},{},{}",
            kept.len(),
            share(&ratios, 1.96),
            quantile(&ratios, 1.0),
            rms(&ratios),
            rms(&over_bound),
            found.len() - kept.len(),
            fits.len() - found.len()
        ));
    }
    write(
        "fit",
        "source,snr_dB,parameter,rigs,seed,fitted,within_1.96u,largest_u,rms_u,rms_bound,rejected,without_fit",
        3,
        &rows,
    )
}

/// Prints median and largest of some times, in seconds.
fn times(what: &str, seconds: impl Iterator<Item = f64>) {
    let seconds: Vec<f64> = seconds.collect();
    let [median, longest] = [0.5, 1.0].map(|share| quantile(&seconds, share));
    println!("{what} takes {median:.2} s in the median, {longest:.2} s at most");
}

/// A fit, and the errors of its five parameters over their standard uncertainties and over the Cramér–Rao bound.
struct Fitted {
    fit: Fit,
    over_u: [f64; 5],
    over_bound: [f64; 5],
    /// What the fit took.
    seconds: f64,
}

fn fitted((ratios, ..): &Case, points: &[MeasuredPoint], scene: &Scene) -> Result<Fitted, Failure> {
    let begin = Instant::now();
    let fit = fit(points, scene.resonance, &scene.plant, &[])?;
    let seconds = begin.elapsed().as_secs_f64();
    let truth = rig(*ratios);
    let bound = at(points, scene.resonance, &truth, &[]).ok_or("the rig has no such motion")?;
    let over = |u: &Fit| {
        [0, 1, 2, 3, 4].map(|n| {
            let quantity = Quantity::ALL[n];
            let [value, u] = [&fit, u].map(|one| one.estimate(quantity).expect("a fitted parameter"));
            (value.value - quantity.of_plant(&truth)) / u.uncertainty
        })
    };
    let (over_u, over_bound) = (over(&fit), over(&bound));
    println!(
        "{:.4?} {} of {} points: {over_u:.1?} u, chi-square {:.1} of {}, of the rig {:.1}, {over_bound:.1?} bounds, {seconds:.3} s",
        ratios,
        fit.residuals.len(),
        points.len(),
        fit.chi_square,
        fit.degrees,
        bound.chi_square
    );
    Ok(Fitted { fit, over_u, over_bound, seconds })
}

/// What a fit says of a rig with a hidden effect, or with none.
struct Named {
    effect: Option<Effect>,
    flagged: bool,
    /// Whether the best explanation is right, whether there is one, and whether the right one is possible.
    right: bool,
    explained: bool,
    possible: bool,
    /// Error of the strength over its standard uncertainty.
    over_u: Option<f64>,
    /// What the fit took, with its candidates if they were tried.
    seconds: f64,
}

fn effects(count: usize, seed: &str, snr: &str) -> Result<(), Failure> {
    let kinds: Vec<Option<Effect>> = (0..2 * count)
        .map(|n| (n < count).then(|| Effect::ALL[n % 4]))
        .collect();
    let first: u64 = seed.parse()?;
    let named: Vec<(Named, usize)> = kinds
        .par_iter()
        .enumerate()
        .map(|(n, effect)| {
            let mut uniform = uniform(first + 1000 * n as u64);
            // The rigs that the loop does not lock, and those that the effect hardly moves, are drawn again.
            for drawn in 1.. {
                let ratios = [
                    uniform(2e-3_f64.ln(), 0.03_f64.ln()).exp(),
                    uniform(0.4, 2.5),
                    uniform(0.4, 0.9),
                ];
                let scales = [0.01, 0.3, 0.2, 0.1, 0.2].map(|range| uniform(-range, range));
                let [k, c, m, b, r] = scales;
                let hidden = Hidden {
                    ratios,
                    noise: uniform(0.0, 1e6) as u64,
                    scales: [k, c, m, b, r.min(0.95 / ratios[2] - 1.0)],
                    effect: *effect,
                    size: uniform(0.1, 1.0),
                };
                match hidden.named(snr) {
                    Ok(Some(named)) => return (named, drawn),
                    Ok(None) => {}
                    Err(error) => println!("{:.4?} {effect:?} {:.2}: {error}", hidden.ratios, hidden.size),
                }
            }
            unreachable!()
        })
        .collect();
    let flagged = named.iter().filter(|(one, _)| one.flagged);
    times("a fit with its candidates", flagged.map(|(one, _)| one.seconds));
    let mut rows = Vec::new();
    for effect in Effect::ALL.map(Some).into_iter().chain([None]) {
        let of: Vec<&(Named, usize)> = named.iter().filter(|(one, _)| one.effect == effect).collect();
        let number = |is: fn(&Named) -> bool| of.iter().filter(|(one, _)| is(one)).count();
        let pulls: Vec<f64> = of.iter().filter_map(|(one, _)| one.over_u.map(f64::abs)).collect();
        let name = effect.map_or_else(|| "none".into(), |effect| effect.to_string());
        rows.push(format!(
            "{name},{snr},{seed},{},{},{},{},{},{},{:.3},{:.1}",
            of.iter().map(|(_, drawn)| drawn).sum::<usize>(),
            of.len(),
            number(|one| one.flagged),
            number(|one| one.right),
            number(|one| one.explained && !one.right),
            number(|one| one.possible && !one.right),
            share(&pulls, 1.96),
            quantile(&pulls, 1.0)
        ));
    }
    write(
        "fit_effects",
        "effect,snr_dB,seed,drawn,rigs,flagged,named,misnamed,among_others,strength_within_1.96u,largest_u",
        2,
        &rows,
    )
}

/// A rig with a hidden effect, the seed of its noise, and the client's errors.
struct Hidden {
    ratios: [f64; 3],
    noise: u64,
    scales: [f64; 5],
    effect: Option<Effect>,
    /// Size of friction or tilt, up to 1.
    size: f64,
}

/// Largest friction and tilt, times g, over b omega0²: on the default rig a friction of 0.31, and 9 degrees.
const LARGEST: [f64; 2] = [0.1, 0.05];

impl Hidden {
    /// The cavity. Laws of restitution have the value r at the speed of impacts of the middle of the stable motions, B = 0.85.
    fn cavity(&self) -> Cavity {
        let (g, [epsilon, _, r]) = (lovines::cavity::GRAVITY, self.ratios);
        let speed = 2.0 * 0.85 * (1.0 + epsilon) / (1.0 + r);
        let both = |law| Cavity { restitution: [Some(law); 2], ..Cavity::IDEAL };
        match self.effect {
            None => Cavity::IDEAL,
            Some(Effect::Friction) => Cavity {
                kinetic_friction: LARGEST[0] * self.size / g,
                ..Cavity::IDEAL
            },
            Some(Effect::Tilt) => Cavity { tilt: LARGEST[1] * self.size / g, ..Cavity::IDEAL },
            Some(Effect::Viscoelastic) => both(Restitution::Viscoelastic((1.0 - r) / speed.powf(0.2))),
            Some(Effect::Plastic) => both(Restitution::Plastic(speed * r.powi(4))),
        }
    }

    /// What is said of the rig; `None` where the effect hardly moves its points.
    fn named(&self, snr: &str) -> Result<Option<Named>, Failure> {
        let Self { ratios, noise, effect, size, .. } = *self;
        let (ideal, scene) = client(ratios, noise, snr, self.scales)?;
        let truth = Parameters { cavity: self.cavity(), ..ideal };
        let tracked = tracked(truth, &scene)?;
        // Much friction keeps the particle from the walls.
        if !matches!(
            tracked.points[0].regime_by_impacts,
            Some(Regime::Symmetric | Regime::Asymmetric)
        ) {
            return Ok(None);
        }
        let points = kept(&tracked);
        let moved = at(&points, scene.resonance, &ideal, &[]).ok_or("the ideal rig has no such motion")?;
        let moved = moved
            .residuals
            .iter()
            .flatten()
            .fold(0.0, |most: f64, one| most.max(one.abs()));
        if points.len() < 6 || (effect.is_some() && moved < 5.0) {
            return Ok(None);
        }
        let begin = Instant::now();
        // A ruler and a scale.
        let mut random = uniform(noise);
        let known = [(Quantity::B, 1.0), (Quantity::Epsilon, ratios[0])].map(|(quantity, value)| {
            let relative = 0.003;
            let estimate = Estimate {
                value: value * (1.0 + relative * random(-1.7, 1.7)),
                uncertainty: relative * value,
            };
            Known { quantity, estimate }
        });
        let found = explain(&points, scene.resonance, &scene.plant, &known, |_| {})?;
        let seconds = begin.elapsed().as_secs_f64();
        let flagged = found.ideal.is_rejected();
        let best = found.explains();
        let right = found.candidates.iter().find(|one| Some(one.effect) == effect);
        let over_u = right.filter(|one| !one.fit.is_rejected()).map(|one| {
            let truth = one.effect.strength_of(&truth.cavity);
            (one.strength.value - truth) / one.strength.uncertainty
        });
        println!(
            "{ratios:.4?} {effect:?} {size:.2} moves by {moved:.0} u: {} points, {}; strength {over_u:.1?} u, {seconds:.2} s",
            points.len(),
            if flagged {
                found.verdict()
            } else {
                format!("ideal, {:.1} for {}", found.ideal.chi_square, found.ideal.degrees)
            },
        );
        Ok(Some(Named {
            effect,
            flagged,
            right: best.is_some_and(|one| Some(one.effect) == effect),
            explained: best.is_some(),
            possible: right.is_some_and(|one| !one.fit.is_rejected()),
            over_u,
            seconds,
        }))
    }
}

/// The backbone of a rig that a client tracks.
fn tracked(truth: Parameters, scene: &Scene) -> Result<Tracked, Failure> {
    let rig = Simulated::new(truth, scene.start)?;
    let mut rig = Chain::around(Box::new(rig), scene);
    let mut controller = BuiltIn::new(&tracking_config(scene))?;
    Ok(track(&mut *rig, &mut controller, scene, |_, _| {})?)
}

fn kept(tracked: &Tracked) -> Vec<MeasuredPoint> {
    tracked
        .points
        .iter()
        .filter(is_kept)
        .map(|point| (&point.at).into())
        .collect()
}

/// The points of a tracked backbone.
fn points((rig, noise, scales): &Case, snr: &str) -> Result<Points, Failure> {
    let (truth, scene) = client(*rig, *noise, snr, *scales)?;
    Ok((kept(&tracked(truth, &scene)?), scene))
}

/// The points of a recording.
fn recorded((rig, noise, scales): &Case, snr: &str) -> Result<Points, Failure> {
    let (truth, mut scene) = client(*rig, *noise, snr, *scales)?;
    scene.start = lovines::State::default();
    let rig = Simulated::new(truth, scene.start)?;
    let mut rig = SensorsOnly::around(Chain::around(Box::new(rig), &scene));
    let mut controller = BuiltIn::new(&scene.controller_config())?;
    let record = run(&mut rig, &mut controller, &scene, |_, _, _| {})?;
    let count = record.samples.len();
    let samples = &record.samples[count / 40..count - count / 40];
    let recording = Recording {
        origin: "the recording".into(),
        channels: ["response".into(), "reference".into()],
        sample_time: record.sample_time,
        response: samples.iter().map(|one| one.sensors.response).collect(),
        drive: samples.iter().filter_map(|one| one.sensors.reference).collect(),
    };
    // The client knows the linear response from its scene only.
    scene.measured = None;
    let parts = parts(&[recording], &scene, &[])?.concat();
    Ok((parts.into_iter().filter_map(|part| part.point).collect(), scene))
}
