//! How far are the parameters that a fit finds from the truth, from what they state, and from the best that the points allow?
//!
//! A rig is drawn (epsilon 0.002 to 0.03, lambda 0.4 to 2.5, r 0.4 to 0.9), and a client's scene that is wrong: r by 0.2, b by 10 %, m by 20 %, c by
//! 30 %, k by 1 %. The client fits f0, zeta, r, b and epsilon to the backbone that it tracks (`points`), also with the linear response that a loop
//! check of the rig at rest measures (`linear`), or to a recording, cut at both ends, which the plant follows: of the tracked backbone (`levels`),
//! also behind an anti-alias filter at 10 to 40 times the natural frequency (`filtered`) and by accelerometers on mass and base, beside the noiseless
//! sensors of the loop (`accelerations`), of a lock whose drive then changes slowly (`sweeps`), or of the search, the hold and the decay of `vines
//! identify` (`decays`). For each parameter, of the fits that are not rejected: the share within 1.96 of the stated standard uncertainty u, the
//! largest error over u, the root mean square of the error over u, and that over the Cramér–Rao bound, of the same points or of all symmetric 1:1
//! motion in a recording of levels or sweeps; the numbers of fits that are rejected, of recordings of which only the points were fitted, and of rigs
//! without a fit; and the probabilities by Kolmogorov and Smirnov that the p-values of each channel's chi-square are uniform: of response, frequency
//! and drive, or of the innovations of a record, in phase with the response and a quarter of a period beside it.
//!
//! `effects` gives each rig one hidden effect, in turn friction, tilt, two laws of restitution, and a cubic stiffness, which moves the measured
//! frequencies by harmonic balance; and as many rigs none. Half of the rigs with friction are at rest when a loop check measures them. A rig is drawn
//! again if the loop does not lock on it, if friction keeps the particle from the walls, or if the effect moves its points by less than 5 u. The
//! table has the numbers of rigs that were drawn, measured, flagged because the ideal cavity does not describe their points, explained by the right
//! effect alone, by wrong ones, and by the right one among others; and the coverage of the strength. `two effects` gives each rig two of them:
//! `named` counts the rigs for which both are possible, `among_others` those for which one is.
//!
//! Arguments: `points`, `linear`, `levels`, `filtered`, `accelerations`, `sweeps`, `decays`, `effects`, the name of one effect, `two effects` or `none`,
//! RIGS, SEED, SNR in dB or `none`. Writes validation/fit.csv or, for `effects`, validation/fit_effects.csv.

mod common;

use std::f64::consts::TAU;

use common::*;
use lovines::{Plant, State};
use nalgebra::{Matrix4, Matrix5, RowVector4, SMatrix, Vector4};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use vines_bench::fit::{
    Effect, Fit, Known, MeasuredPoint, Quantity, RecordFit, Recording, at, explain, fit, follow, linear_verdicts, parts,
};
use vines_bench::linear::MeasuredLinear;
use vines_bench::rig::{Drive, RigError, RigStage, Sensors};
use vines_bench::scene::{Measurand, Sensor};

/// Measured points, the scene of the client, and the rig.
type Points = (Vec<MeasuredPoint>, Scene, Parameters);

fn main() -> Result<(), Failure> {
    let [source, count, seed, snr] = &arguments([
        "points|linear|levels|filtered|accelerations|sweeps|decays|effects|EFFECT",
        "RIGS",
        "SEED",
        "SNR|none",
    ])?;
    let measure: fn(&Case, &str) -> Result<Found, Failure> = match &**source {
        "points" => |case, snr| fitted(&points(case, snr)?, &[]),
        "linear" => |case, snr| {
            let (measured @ (points, scene, _), linear) = (&points(case, snr)?, checked(case, snr)?);
            let verdicts = linear_verdicts(&[linear], points, scene.resonance, &scene.plant, &[])?;
            println!("{verdicts:?}");
            fitted(measured, &[Known::Linear(verdicts[0].linear)])
        },
        "levels" => |case, snr| follow_one(case, snr, |case, snr| levels(case, snr, Definition::default(), None)),
        "filtered" => |case, snr| {
            follow_one(case, snr, |case, snr| {
                let cut_off = 10.0 * 4_f64.powf((case.1 % 1000) as f64 / 1000.0);
                levels(case, snr, Definition::default(), Some(cut_off))
            })
        },
        "accelerations" => |case, snr| follow_one(case, snr, accelerations),
        "sweeps" => |case, snr| follow_one(case, snr, sweep),
        "decays" => |case, snr| follow_one(case, snr, lock_and_decay),
        other => return effects(other, count.parse()?, seed.parse()?, snr),
    };
    let mut uniform = uniform(seed.parse()?);
    let case = |_| {
        let ratios @ [_, _, r] = drawn(&mut uniform);
        let noise = uniform(0.0, 1e6) as u64;
        let mut scales = SCALES.map(|range| uniform(-range, range));
        scales[4] = (r + scales[4]).clamp(0.2, 0.98) / r - 1.0;
        Ok((ratios, noise, scales))
    };
    let found = survey(count, case, |case| measure(case, snr))?;
    let [kept, rejected, by_points, failed, ..] = counts(&found);
    let uniform = [0, 1, 2].map(|channel| {
        let p_values = found.iter().filter_map(|one| one.ratios.get(5 + channel).copied());
        format!(
            "{:.3}",
            uniformity(&p_values.filter(|p| p.is_finite()).collect::<Vec<f64>>())
        )
    });
    let uniform = uniform.join(",");
    let rows = Quantity::ALL[..5].iter().enumerate().map(|(n, quantity)| {
        // One value of each rig whose fit is kept.
        let gather = |values: fn(&Found) -> &[f64]| -> Vec<f64> {
            let values = found.iter().filter_map(|one| values(one).get(n));
            values.map(|value| value.abs()).filter(|value| value.is_finite()).collect()
        };
        let [symbol, _] = quantity.symbol();
        let (ratios, over_bound) = (gather(|one| &one.ratios), gather(|one| &one.errors));
        let rms = |values: &[f64]| mean_square(values.iter().copied()).sqrt();
        format!(
            "{source},{snr},{symbol},{count},{seed},{kept},{:.3},{:.1},{:.2},{:.2},{rejected},{by_points},{failed},{uniform}",
            share(&ratios, 1.96),
            ends(&ratios)[1],
            rms(&ratios),
            rms(&over_bound),
        )
    });
    let header = "source,snr_dB,parameter,rigs,seed,fitted,within_1.96u,largest_u,rms_u,rms_bound,rejected,by_points,without_fit,\
        uniform_1,uniform_2,uniform_3";
    write("fit", header, 3, &rows.collect::<Vec<_>>())
}

/// Epsilon, lambda and r.
fn drawn(uniform: Uniform) -> [f64; 3] {
    let epsilon = uniform(2e-3_f64.ln(), 0.03_f64.ln()).exp();
    [epsilon, uniform(0.4, 2.5), uniform(0.4, 0.9)]
}

/// Fits the parameters, and counts the fit as kept or rejected. Errors of the five parameters of a fit that is kept are over the Cramér–Rao bound.
fn fitted((points, scene, truth): &Points, known: &[Known]) -> Result<Found, Failure> {
    let fit = fit(points, scene.resonance, &scene.plant, known)?;
    let bound = at(points, scene.resonance, truth, known).ok_or("the rig has no such motion")?;
    let [ratios, errors] = [&fit, &bound].map(|u| {
        let over = |quantity: &Quantity| {
            let [value, u] = [&fit, u].map(|one| one.estimate(*quantity).expect("a fitted parameter"));
            (value.value - quantity.of_plant(truth)) / u.uncertainty
        };
        Quantity::ALL[..5].iter().map(over).collect::<Vec<f64>>()
    });
    println!(
        "{truth:.4?}: {ratios:.1?} u, {errors:.1?} bounds, chi-square {:.1} of {}, of the rig {:.1}, left out {:?}",
        fit.chi_square, fit.degrees, bound.chi_square, fit.left_out
    );
    Ok(match fit.is_rejected() {
        true => Found { counts: [0, 1, 0, 0, 0, 0], ..Found::default() },
        false => Found {
            errors,
            ratios: [ratios, p_values(&fit)].concat(),
            periods: None,
            counts: [1, 0, 0, 0, 0, 0],
        },
    })
}

/// The p-value of each channel's chi-square.
fn p_values(fit: &Fit) -> Vec<f64> {
    fit.channels.iter().map(|one| one.p_value.unwrap_or(f64::NAN)).collect()
}

fn effects(source: &str, count: usize, seed: u64, snr: &str) -> Result<(), Failure> {
    let header = "effect,snr_dB,seed,drawn,rigs,flagged,named,misnamed,among_others,strength_within_1.96u,largest_u";
    let names = [&Effect::ALL.map(|one| one.names()[0])[..], &["none", "two effects"]].concat();
    let chosen = names.iter().filter(|name| match source {
        "effects" => **name != "two effects",
        source => **name == source,
    });
    let chosen: Vec<&str> = chosen.copied().collect();
    if chosen.is_empty() {
        let names = names.join(", ");
        return Err(format!(
            "{source}: there are points, linear, levels, filtered, accelerations, sweeps, decays, effects, {names}"
        )
        .into());
    }
    for name in chosen {
        let hidden = |n: usize| -> Vec<Effect> {
            match name {
                "none" => Vec::new(),
                "two effects" => PAIRS[n % PAIRS.len()].map(|one| Effect::ALL[one]).into(),
                _ => vec![Effect::ALL[n % 5]],
            }
        };
        let is_its = |n: &usize| match name {
            "none" => *n >= count,
            "two effects" => *n < count,
            _ => *n < count && Effect::ALL[n % 5].names()[0] == name,
        };
        let rigs: Vec<usize> = (0..2 * count).filter(is_its).collect();
        // The rigs that the loop does not lock, and those that the effect hardly moves, are drawn again.
        let measure = |n: &usize| {
            let mut uniform = uniform(seed + 1000 * *n as u64);
            let mut rigs = (1..).map(|drawn| (drawn, named(&hidden(*n), &mut uniform, snr)));
            let measured = rigs.find_map(|(drawn, found)| Some((drawn, found.ok()??)));
            let (drawn, mut found) = measured.ok_or("no rig")?;
            found.counts[0] = drawn;
            Ok(found)
        };
        let found = survey(&rigs.len().to_string(), |n| Ok(rigs[n]), measure)?;
        let counts = counts(&found).map(|count| count.to_string());
        let ratios: Vec<f64> = found.into_iter().flat_map(|one| one.ratios).collect();
        let (within, largest) = (share(&ratios, 1.96), ends(&ratios)[1]);
        let row = format!("{name},{snr},{seed},{},{within:.3},{largest:.1}", counts.join(","));
        write("fit_effects", header, 3, &[row])?;
    }
    Ok(())
}

/// Pairs of effects that a rig can have.
const PAIRS: [[usize; 2]; 9] = [[0, 1], [0, 2], [0, 3], [0, 4], [1, 2], [1, 3], [1, 4], [2, 4], [3, 4]];

/// Largest friction and tilt, times g, over b omega0²: on the default rig a friction of 0.31, and 9 degrees. The first is the largest additional
/// stiffness over m omega0² as well.
const LARGEST: [f64; 2] = [0.1, 0.05];

/// Draws a rig with hidden effects, or with none, and counts whether it is flagged, named, misnamed, and named among others. The ratio is the
/// error of the strength over its standard uncertainty. `None` where the effects hardly move the points of the rig.
#[expect(clippy::too_many_lines, reason = "a study")]
fn named(hidden: &[Effect], uniform: Uniform, snr: &str) -> Result<Option<Found>, Failure> {
    let ratios @ [epsilon, _, r] = drawn(uniform);
    let mut scales = SCALES.map(|range| uniform(-range, range));
    scales[4] = scales[4].min(0.95 / r - 1.0);
    let noise = uniform(0.0, 1e6) as u64;
    let (ideal, scene, plan) = client(&(ratios, noise, scales), snr)?;
    // Laws of restitution have the value r at the speed of impacts of the middle of the stable motions, B = 0.85.
    let speed = 2.0 * 0.85 * (1.0 + epsilon) / (1.0 + r);
    let mut rig = ideal;
    let (mut strengths, mut h) = (Vec::new(), 0.0);
    for effect in hidden {
        let size = uniform(0.1, 1.0);
        let strength = match effect {
            Effect::Tilt => (LARGEST[1] * size / GRAVITY).powi(2),
            Effect::Hardening => LARGEST[0] * size * epsilon,
            _ => LARGEST[0] * size / GRAVITY,
        };
        strengths.push(effect.strength(strength, r, speed));
        let (cavity, of_effect) = (&mut rig.cavity, effect.cavity(strength, r, speed));
        match effect {
            Effect::Friction => cavity.kinetic_friction = of_effect.kinetic_friction,
            Effect::Tilt => cavity.tilt = of_effect.tilt,
            Effect::Viscoelastic | Effect::Plastic => cavity.restitution = of_effect.restitution,
            Effect::Hardening => h = strength,
        }
    }
    let tracked = if hidden.contains(&Effect::Friction) && noise.is_multiple_of(2) {
        let scene = scene.clone().at_rest();
        let mut bench = behind_chain(rig, &scene)?;
        let checked = check(&mut *bench, &plan)?;
        let linear = checked.linear.ok_or_else(|| checked.verdict.to_string())?.response;
        tracked(&mut *bench, &scene.plan_on(plan.knowledge.measured(linear)), 20.0)?
    } else {
        tracked(&mut *behind_chain(rig, &scene)?, &plan, 20.0)?
    };
    // Much friction keeps the particle from the walls.
    let regime = tracked.points[0].regime_by_impacts;
    if !matches!(regime, Some(Regime::Symmetric | Regime::Asymmetric)) {
        return Ok(None);
    }
    let points: Vec<MeasuredPoint> = measured(&tracked)
        .into_iter()
        .map(|point| {
            let factor = (1.0 + 0.75 * h * point.response.value.powi(2)).sqrt();
            MeasuredPoint { omega: point.omega.scaled(factor), ..point }
        })
        .collect();
    let moved = at(&points, scene.resonance, &ideal, &[]).ok_or("the ideal rig has no such motion")?;
    let (_, moved) = range((0.0, 0.0), moved.residuals.iter().flatten().map(|one| one.abs()));
    if points.len() < 6 || (!hidden.is_empty() && moved < 5.0) {
        return Ok(None);
    }
    // A ruler and a scale.
    let mut random = common::uniform(noise);
    let known = [("b", 1.0), ("epsilon", epsilon)].map(|(symbol, value)| {
        let (measured, u) = (value * (1.0 + 0.003 * random(-1.7, 1.7)), 0.003 * value);
        let known = format!("{symbol}={measured:?}±{u:?}").parse::<Known>();
        known.expect("a positive value")
    });
    let found = explain(&points, scene.resonance, &scene.plant, &known, |_| {})?;
    let possible: Vec<Effect> = found.possible().map(|one| one.effect).collect();
    let describes = |effect: &Effect| {
        found
            .candidates
            .iter()
            .find(|one| one.effect == *effect && !one.fit.is_rejected())
    };
    let errors = hidden.iter().zip(&strengths).filter_map(|(effect, truth)| {
        let strength = describes(effect)?.strength;
        Some((strength.value - truth).abs() / strength.uncertainty)
    });
    let errors: Vec<f64> = errors.collect();
    let verdict = found.candidates.iter().map(|one| {
        let Fit { chi_square, degrees, left_out, .. } = &one.fit;
        (one.effect, chi_square.round(), *degrees, left_out.len())
    });
    println!(
        "{ratios:.4?} {hidden:?} {strengths:.2?} moves by {moved:.0} u: ideal {:.0} of {}; {:?}; possible {possible:?}; strength {errors:.1?} u",
        found.ideal.chi_square,
        found.ideal.degrees,
        verdict.collect::<Vec<_>>()
    );
    let right = possible.iter().filter(|one| hidden.contains(one)).count();
    let named = !hidden.is_empty() && right == hidden.len() && (right == possible.len() || right > 1);
    let counts = [
        false,
        true,
        found.ideal.is_rejected(),
        named,
        right == 0 && !possible.is_empty(),
        right > 0 && !named,
    ];
    let counts = counts.map(usize::from);
    Ok(Some(Found { ratios: errors, counts, ..Found::default() }))
}

/// The points of a tracked backbone.
fn points(case: &Case, snr: &str) -> Result<Points, Failure> {
    let (truth, scene, plan) = client(case, snr)?;
    let tracked = tracked(&mut *behind_chain(truth, &scene)?, &plan, 20.0)?;
    Ok((measured(&tracked), scene, truth))
}

/// The linear response of the same rig at rest, by a loop check.
fn checked(case: &Case, snr: &str) -> Result<MeasuredLinear, Failure> {
    let (truth, scene, plan) = client(case, snr)?;
    let scene = scene.at_rest();
    let checked = check(&mut *behind_chain(truth, &scene)?, &plan)?;
    Ok(checked.linear.ok_or_else(|| checked.verdict.to_string())?.data)
}

fn measured(tracked: &Tracked) -> Vec<MeasuredPoint> {
    let units = tracked.knowledge.target.units;
    kept(tracked)
        .map(|point| MeasuredPoint::of(&point.at, &units))
        .collect()
}

/// Keeps what is read before each step, and changes the amplitude of the base by a factor that depends on the number of the sample.
struct Recorder<'a> {
    rig: Box<dyn Rig>,
    read: Vec<Sensors>,
    driven: Vec<Drive>,
    factor: &'a dyn Fn(usize) -> f64,
}

impl RigStage for Recorder<'_> {
    fn inner(&mut self) -> &mut dyn Rig {
        &mut *self.rig
    }

    fn sense(&mut self) -> Result<Sensors, RigError> {
        self.read.push(self.rig.sense()?);
        Ok(self.read[self.read.len() - 1])
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        let factor = (self.factor)(self.read.len());
        self.driven.push(Drive { amplitude: factor * drive.amplitude, ..drive });
        self.rig.advance(self.driven[self.driven.len() - 1], step)
    }
}

/// A recording of a rig, with the scene of the client and what drove the rig at each sample before its end.
struct Recorded {
    recording: Recording,
    scene: Scene,
    truth: Parameters,
    driven: Vec<Drive>,
}

/// Relative change of a parameter, and change of a state, for a derivative.
const BESIDE: f64 = 1e-8;
/// Periods around a sample that tell whether a motion is symmetric.
const PIECE: f64 = 16.0;
/// Largest deviation of a time between impacts from half a period, in periods.
const UNEVEN: f64 = 0.05;

impl Recorded {
    /// Whether each sample belongs to a symmetric 1:1 motion: half a period lies between any impact and the next one in the piece of [`PIECE`]
    /// periods around it, up to [`UNEVEN`].
    fn symmetric(&self) -> Option<Vec<bool>> {
        let mut rig = Plant::new(self.truth, self.scene.start).ok()?;
        let (mut turns, mut phase) = (Vec::new(), 0.0);
        let mut impacts = vec![0.0];
        for Drive { omega, amplitude, .. } in &self.driven {
            let before = rig.totals().impacts;
            let step = self.recording.sample_time;
            rig.advance(lovines::Drive::harmonic(*amplitude, *omega), step).ok()?;
            turns.push(phase);
            phase += omega * step / TAU;
            impacts.extend((before..rig.totals().impacts).map(|_| phase));
        }
        impacts.push(phase);
        let strange: Vec<[f64; 2]> = impacts
            .windows(2)
            .filter(|pair| ((pair[1] - pair[0]) - 0.5).abs() > UNEVEN)
            .map(|pair| [pair[0], pair[1]])
            .collect();
        // Of those that begin at the latest half a piece after a sample, the last one ends last.
        let is_far = |turn: &f64| {
            let begun = strange.partition_point(|[from, _]| from - 0.5 * PIECE <= *turn);
            begun == 0 || strange[begun - 1][1] + 0.5 * PIECE <= *turn
        };
        Some(turns.iter().map(is_far).collect())
    }

    /// Standard uncertainties of the five parameters by the Cramér–Rao bound of all symmetric 1:1 motion in the recording of displacements: an information
    /// filter at the true parameters. It follows the rig sample by sample; the noise of the base is that of the process, and the state at the start of
    /// each such part is unknown.
    fn bound(&self) -> Option<[f64; 5]> {
        let symmetric = self.symmetric()?;
        let [of_response, of_base] = self.scene.noise().map(|deviation| deviation * deviation);
        if of_response == 0.0 {
            return None;
        }
        let values: [f64; 5] = std::array::from_fn(|n| Quantity::ALL[n].of_plant(&self.truth));
        let beside = |changed: Option<usize>| {
            let factor = |n: usize| if changed == Some(n) { 1.0 + BESIDE } else { 1.0 };
            let [f0, zeta, restitution, half_width, epsilon] = std::array::from_fn(|n| values[n] * factor(n));
            let Parameters { primary_mass, .. } = self.truth;
            let (omega0, particle_mass) = (TAU * f0, epsilon * primary_mass);
            let (stiffness, damping) = (primary_mass * omega0 * omega0, 2.0 * zeta * omega0 * primary_mass);
            Parameters {
                stiffness,
                damping,
                particle_mass,
                half_width,
                restitution,
                ..self.truth
            }
        };
        let plant = |changed| Plant::new(beside(changed), self.scene.start).ok();
        let plants = [None, Some(0), Some(1), Some(2), Some(3), Some(4)].map(plant);
        let share = match self.scene.resonance.sensor {
            Sensor::V => self.truth.mass_ratio(),
            Sensor::Q1 => 0.0,
        };
        let step = self.recording.sample_time;
        // A new plant has no base yet that could jump.
        let next = |n: usize, x: &Vector4<f64>, signal: [f64; 4]| -> Option<Vector4<f64>> {
            let [q1, dq1, q2, dq2] = <[f64; 4]>::from(*x);
            let mut plant = plants[n]?;
            plant.set_state(State { q1, dq1, q2, dq2 }).ok()?;
            plant
                .advance(lovines::Drive { signal, ..Default::default() }, step)
                .ok()?;
            let State { q1, dq1, q2, dq2 } = plant.state();
            Some(Vector4::new(q1, dq1, q2, dq2))
        };
        let mut rig = Plant::new(self.truth, self.scene.start).ok()?;
        let (mut covariance, mut by_parameters) = (Matrix4::identity(), SMatrix::<f64, 4, 5>::zeros());
        let (mut information, mut phase) = (Matrix5::zeros(), 0.0_f64);
        // As the recording is cut.
        let cut = self.driven.len() / 40;
        for (n, Drive { omega, amplitude, .. }) in self.driven[..self.driven.len() - cut].iter().enumerate() {
            let (sin, cos) = phase.sin_cos();
            phase = (phase + omega * step) % TAU;
            let turn = |power: i32, factor: f64| amplitude * omega.powi(power) * factor;
            let signal = [turn(0, sin), turn(1, cos), turn(2, -sin / 2.0), turn(3, -cos / 6.0)];
            let State { q1, dq1, q2, dq2 } = rig.state();
            let x = Vector4::new(q1, dq1, q2, dq2);
            // Held levels may be unstable: only the rig's own steps stay on them.
            rig.advance(lovines::Drive::harmonic(*amplitude, *omega), step).ok()?;
            let row = RowVector4::new(1.0, 0.0, share, 0.0);
            if n < cut || !symmetric[n] {
                (covariance, by_parameters) = (Matrix4::identity(), SMatrix::zeros());
                continue;
            }
            let there = next(0, &x, signal)?;
            let variance = (row * covariance * row.transpose())[0] + of_response;
            let mut by_innovation = row * by_parameters;
            by_innovation[4] += share * x[2];
            information += by_innovation.transpose() * by_innovation / variance;
            let gain = covariance * row.transpose() / variance;
            by_parameters -= gain * by_innovation;
            covariance -= gain * row * covariance;
            let slope = |other: Option<Vector4<f64>>| other.map_or(Vector4::zeros(), |other| (other - there) / BESIDE);
            let mut transition = Matrix4::zeros();
            for i in 0..4 {
                transition.set_column(i, &slope(next(0, &(x + Vector4::ith(i, BESIDE)), signal)));
            }
            let [e, rest @ ..] = signal;
            let by_base = slope(next(0, &x, [e + BESIDE, rest[0], rest[1], rest[2]]));
            by_parameters = transition * by_parameters;
            for i in 0..5 {
                let column = by_parameters.column(i) + slope(next(i + 1, &x, signal));
                by_parameters.set_column(i, &column);
            }
            covariance = transition * covariance * transition.transpose() + by_base * by_base.transpose() * of_base;
            covariance = 0.5 * (covariance + covariance.transpose());
        }
        let relative = information.try_inverse()?.diagonal();
        Some(std::array::from_fn(|n| values[n] * relative[n].sqrt()))
    }
}

/// A recording, cut at both ends.
fn recording(read: &[Sensors], sample_time: f64) -> Recording {
    let read = &read[read.len() / 40..read.len() - read.len() / 40];
    Recording {
        origin: "the recording".into(),
        channels: ["response".into(), "reference".into()],
        start: 0.0,
        measurands: Default::default(),
        of_force: false,
        notes: Vec::new(),
        sample_time,
        response: read.iter().map(|one| one.response).collect(),
        drive: read.iter().filter_map(|one| one.reference).collect(),
    }
}

/// A recording of a tracked backbone by accelerometers, each with noise of its own: second differences of the displacements of mass and base.
fn accelerations(case: &Case, snr: &str) -> Result<Recorded, Failure> {
    let of_mass = Definition { sensor: Sensor::Q1, ..Definition::default() };
    let mut recorded = levels(case, "none", of_mass, None)?;
    // The natural frequency is 1: the noise of accelerations is that of displacements.
    let (_, noisy, _) = client(case, snr)?;
    let deviations = noisy.noise();
    let recording = &mut recorded.recording;
    let step = recording.sample_time;
    let mut random = ChaCha8Rng::seed_from_u64(case.1);
    for (values, deviation) in [&mut recording.response, &mut recording.drive]
        .into_iter()
        .zip(deviations)
    {
        // Exact for a sine of the natural frequency 1.
        let second = |three: &[f64]| (three[0] - 2.0 * three[1] + three[2]) / (2.0 * (0.5 * step).sin()).powi(2);
        let accelerations: Vec<f64> = values.windows(3).map(second).collect();
        *values = accelerations;
        for value in values {
            let normal: f64 = StandardNormal.sample(&mut random);
            *value += deviation * normal;
        }
    }
    recording.measurands = [Measurand::Acceleration; 2];
    Ok(recorded)
}

/// A recording of a tracked backbone.
fn levels(case: &Case, snr: &str, resonance: Definition, filter: Option<f64>) -> Result<Recorded, Failure> {
    let (truth, scene, plan) = client(case, snr)?;
    let mut scene = Scene { resonance, ..scene };
    scene.chain.filter = filter;
    let plan = scene.plan_on(scene.knowledge().measured(plan.knowledge.linear));
    let mut rig = Recorder {
        rig: behind_chain(truth, &scene)?,
        read: Vec::new(),
        driven: Vec::new(),
        factor: &|_| 1.0,
    };
    let sample_time = plan.knowledge.sample_time;
    tracked(&mut rig, &plan, 20.0)?;
    Ok(Recorded {
        recording: recording(&rig.read, sample_time),
        scene,
        truth,
        driven: rig.driven,
    })
}

/// A recording of a lock whose drive then changes slowly, down and up.
fn sweep(case: &Case, snr: &str) -> Result<Recorded, Failure> {
    let (truth, scene, mut plan) = client(case, snr)?;
    let d = Dimensionless::of(&truth, 0.0);
    let (low, high) = range((f64::INFINITY, 0.0), stable_orbits(&d).iter().map(|orbit| orbit.g));
    let at_lock = plan.amplitude / d.epsilon;
    let (least, most) = (1.08 * low / at_lock, 0.95 * high / at_lock);
    // The same run as far as the lock.
    let begin = record(&mut *behind_chain(truth, &scene)?, &plan)?.settled;
    let turn = plan
        .knowledge
        .samples(10.0 * plan.knowledge.linear.relaxation_periods().max(30.0));
    let factor = move |n: usize| {
        let share = n.saturating_sub(begin) as f64 / turn as f64;
        let down = 1.0 + (least - 1.0) * share.min(1.0);
        let up = (most - least) * (share - 1.0).clamp(0.0, 1.0);
        down + up
    };
    plan.hold = begin + 2 * turn;
    plan.decay = plan.knowledge.samples(5.0);
    let mut rig = Recorder {
        rig: behind_chain(truth, &scene)?,
        read: Vec::new(),
        driven: Vec::new(),
        factor: &factor,
    };
    let found = record(&mut rig, &plan)?;
    rig.driven.truncate(found.released);
    Ok(Recorded {
        recording: recording(&rig.read[..found.released], found.sample_time),
        scene,
        truth,
        driven: rig.driven,
    })
}

/// A recording of the search, the hold and the decay of `vines identify`.
fn lock_and_decay(case: &Case, snr: &str) -> Result<Recorded, Failure> {
    let (truth, scene, plan) = client(case, snr)?;
    let scene = scene.at_rest();
    let record = record(&mut SensorsOnly::around(behind_chain(truth, &scene)?), &plan)?;
    let read: Vec<Sensors> = record.samples.iter().map(|one| one.sensors).collect();
    Ok(Recorded {
        recording: recording(&read, record.sample_time),
        scene,
        truth,
        driven: Vec::new(),
    })
}

/// Fits a record as a record.
fn follow_one(case: &Case, snr: &str, record: fn(&Case, &str) -> Result<Recorded, Failure>) -> Result<Found, Failure> {
    let recorded = record(case, snr)?;
    let Recorded { recording, scene, truth, .. } = &recorded;
    let parts = parts(std::slice::from_ref(recording), scene)?;
    let prepared = [recording.prepared(&scene.knowledge())?];
    let found = follow(&prepared, &parts, &[], scene.resonance, &scene.plant, &[]);
    let by_points = usize::from(found.is_none());
    let RecordFit { fit, periods, left_out, colour } = match found {
        Some(found) => found,
        None => {
            let points: Vec<MeasuredPoint> = parts.iter().flatten().filter_map(|part| part.point).collect();
            let fit = fit(&points, scene.resonance, &scene.plant, &[])?;
            RecordFit { fit, periods: 0, left_out: Vec::new(), colour: f64::NAN }
        }
    };
    let over = |quantity: &Quantity| {
        let Estimate { value, uncertainty } = fit.estimate(*quantity).expect("a fitted parameter");
        (value - quantity.of_plant(truth)) / uncertainty
    };
    let ratios: Vec<f64> = Quantity::ALL[..5].iter().map(over).collect();
    let spans: Vec<[f64; 2]> = left_out.iter().map(|one| one.seconds).collect();
    let is_known = recording.measurands == [Measurand::Displacement; 2] && !recorded.driven.is_empty() && periods > 0;
    let bound = Some(&recorded).filter(|_| is_known).and_then(Recorded::bound);
    let of_bound = |n: usize| {
        let uncertainty = fit.estimate(Quantity::ALL[n]).map_or(f64::NAN, |one| one.uncertainty);
        bound.map_or(f64::NAN, |bound| uncertainty / bound[n])
    };
    let of_bound = [0, 1, 2, 3, 4].map(of_bound);
    let errors = ratios.iter().zip(of_bound).map(|(ratio, u)| ratio * u).collect();
    let p_values = if by_points == 1 { Vec::new() } else { p_values(&fit) };
    println!(
        "{:.4?}: {ratios:.1?} u, u {of_bound:.2?} bounds, {periods} periods, chi-square {:.1} of {}; p of channels {p_values:.3?}, colour {colour:.2}; \
         left out {spans:.0?}",
        case.0, fit.chi_square, fit.degrees
    );
    Ok(match fit.is_rejected() {
        true => Found { counts: [0, 1, by_points, 0, 0, 0], ..Found::default() },
        false => Found {
            ratios: [ratios, p_values].concat(),
            errors,
            periods: None,
            counts: [1, 0, by_points, 0, 0, 0],
        },
    })
}
