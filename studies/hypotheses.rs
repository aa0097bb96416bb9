//! Do the ranges of a fit hold the rig, whatever its cavity, and is the true hypothesis possible?
//!
//! Random rigs: f0 2 to 80 Hz, epsilon 0.003 to 0.03, lambda 0.4 to 2.5, r 0.35 to 0.8, b 2 to 20 mm, with one effect; ten points of the plant's own
//! motions from 1.1 times the fold to 0.7 b, or 0.85 times the loss of symmetry of first-order theory, with the uncertainties of a level at an SNR (60 dB: 1e-4 of response and drive, 1e-6 of the frequency).
//! The scene is wrong by up to 1 % in f0, 25 % in zeta, 15 % in epsilon, 10 % in b and 0.15 in r. `known`: b and epsilon with 0.3 %.
//!
//! Of the rigs with a result: `rejected`, share of which no hypothesis is possible; of the others `covered`, share of f0, zeta, b and epsilon (and r,
//! where it does not depend on the speed) within 1.96 half-widths of the range, and the `worst` of them; `row`, the same share for the true
//! hypothesis alone; `possible`, share in which the true hypothesis is possible, and `named`, in which the ideal one is not.
//!
//! Arguments: points or records, RIGS, SEED. Writes validation/hypotheses.csv.

mod common;
mod recorder;

use common::*;
use lovines::{Cavity, Restitution};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use recorder::*;
use std::f64::consts::{FRAC_PI_2, TAU};
use vines_bench::fit::{Found, Hypothesis, MeasuredPoint, Measurements, Quantity, Recording, find};
use vines_bench::scene::{Parameters, Scene};
use vines_identify::IdealRig;
use vines_model::Definition;
use vines_model::numerics::Estimate;
use vines_model::orbit::resonant_motion;
use vines_model::theory::{B_SYMMETRY_BREAKING, Manifold};

/// A rig, what is known of it, and what is added to its motions: a cubic stiffness, and the gain of the reference.
#[derive(Clone, Copy)]
struct Rig {
    truth: Parameters,
    scene: Parameters,
    cubic: f64,
    gain: f64,
    hypothesis: Hypothesis,
}

/// A rig with an effect whose strength is drawn.
fn drawn(uniform: Uniform, hypothesis: Hypothesis) -> Rig {
    let mut logarithmic = |low: f64, high: f64| uniform(low.ln(), high.ln()).exp();
    let [f0, epsilon, b] = [[2.0, 80.0], [0.003, 0.03], [0.002, 0.02]].map(|[low, high]| logarithmic(low, high));
    let share = logarithmic(0.002, 0.03);
    let [zeta, r] = [0.5 * epsilon * uniform(0.4, 2.5), uniform(0.35, 0.8)];
    let acceleration = share * b * (TAU * f0).powi(2) / 9.806_65;
    let speed = b * TAU * f0;
    let law = |law| Cavity { restitution: [Some(law); 2], ..Cavity::IDEAL };
    let cavity = match hypothesis {
        Hypothesis::Friction => Cavity { kinetic_friction: acceleration, ..Cavity::IDEAL },
        Hypothesis::Tilt => Cavity { tilt: (2.0 * acceleration).min(0.3), ..Cavity::IDEAL },
        Hypothesis::Viscoelastic => law(Restitution::Viscoelastic((1.0 - r) / speed.powf(0.2))),
        Hypothesis::Plastic => law(Restitution::Plastic(speed * r.powi(4))),
        _ => Cavity::IDEAL,
    };
    let values = [f0, zeta, epsilon, r, b];
    let wrong = [0.01, 0.25, 0.15, 0.0, 0.1].map(|most| 1.0 + uniform(-most, most));
    let mut about: [f64; 5] = std::array::from_fn(|i| values[i] * wrong[i]);
    about[3] = (r + uniform(-0.15, 0.15)).clamp(0.2, 0.95);
    Rig {
        truth: parameters(values, cavity),
        scene: parameters(about, Cavity::IDEAL),
        cubic: if hypothesis == Hypothesis::Cubic {
            share * epsilon
        } else {
            0.0
        },
        gain: if hypothesis == Hypothesis::Reference {
            uniform(-0.02, 0.02)
        } else {
            0.0
        },
        hypothesis,
    }
}

/// Ten points of the rig; `None` where it has no such motion.
fn points(rig: &Rig, definition: Definition, snr: f64, seed: u64) -> Option<Vec<MeasuredPoint>> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut measured = |value: f64, relative: f64| {
        let normal: f64 = StandardNormal.sample(&mut random);
        Estimate {
            value: value * (1.0 + relative * normal),
            uncertainty: value * relative,
        }
    };
    let u = 0.1 * 10_f64.powf(-snr / 20.0);
    let manifold = Manifold::new(rig.truth.restitution);
    let high = f64::min(0.7, 0.85 * manifold.c(B_SYMMETRY_BREAKING));
    let low = 1.1 * manifold.c(manifold.b_min());
    let point = |n: u32| {
        let c = low + (high - low) * f64::from(n) / 9.0;
        let motion = resonant_motion(&rig.truth, definition, c * rig.truth.half_width, None).ok()?;
        let omega = motion.omega * (1.0 + 0.375 * rig.cubic * c * c);
        Some(MeasuredPoint {
            response: measured(motion.response.norm(), u),
            omega: measured(omega, 0.01 * u),
            drive: measured(motion.amplitude * (1.0 + rig.gain), u),
            phase: -FRAC_PI_2,
        })
    };
    (0..10).map(point).collect()
}

/// A record of the rig, of all kinds of motion; `None` where most of it is not 1:1.
fn record(rig: &Rig, snr: f64, seed: u64) -> Option<Recording> {
    let ideal = IdealRig::of_plant(&rig.truth);
    let levels = schedule("mix", &ideal).ok()?;
    let mut plant = plant(rig.truth, levels[0]).ok()?;
    let found = recorded(&mut plant, &ideal, &levels, [snr, seed as f64]).ok()?;
    let period = 1.0 / ideal.f0;
    let held = levels.iter().filter(|level| **level > 0.0).count();
    let is_one_to_one = (0..held).filter(|n| found.is_one_to_one(*n as f64 * period, period));
    (2 * is_one_to_one.count() > held).then(|| {
        let drive = found.base.iter().map(|value| value * (1.0 + rig.gain)).collect();
        recording(found.response, drive, found.sample_time)
    })
}

/// Errors over half-widths of the range and of the true row, whether anything, the true row and the ideal row are possible.
struct Judged {
    range: Vec<f64>,
    row: Vec<f64>,
    possible: [bool; 3],
}

fn judged(rig: &Rig, found: &Found) -> Judged {
    let depends = matches!(rig.hypothesis, Hypothesis::Viscoelastic | Hypothesis::Plastic);
    let quantities = Quantity::FITTED.iter().filter(|one| !(depends && **one == Quantity::R));
    let off = |one: Estimate, quantity: Quantity| (one.value - quantity.of_plant(&rig.truth)).abs() / one.uncertainty;
    let fits = &found.hypotheses.fits;
    let of = |hypothesis: Hypothesis| fits.iter().find(|fit| fit.hypothesis == hypothesis);
    let is_possible = |hypothesis| of(hypothesis).is_some_and(|fit| fit.excluded.is_none());
    let range = quantities
        .clone()
        .filter_map(|one| Some(off(found.hypotheses.range(*one)?, *one)));
    let row = quantities.filter_map(|one| Some(off(of(rig.hypothesis)?.estimate(*one)?, *one)));
    Judged {
        range: range.collect(),
        row: row.collect(),
        possible: [
            found.hypotheses.describes(),
            is_possible(rig.hypothesis),
            is_possible(Hypothesis::Ideal),
        ],
    }
}

/// What is found of a rig; `None` without a result.
fn found(rig: &Rig, is_known: bool, measured: Measurements, default: &Scene) -> Option<Judged> {
    let exact = |quantity: Quantity| {
        let value = quantity.of_plant(&rig.truth);
        format!("{}={value}±{}", quantity.symbol()[0], 0.003 * value)
            .parse()
            .ok()
    };
    let known = [Quantity::B, Quantity::Epsilon].into_iter().filter(|_| is_known);
    let measured = Measurements { known: known.filter_map(exact).collect(), ..measured };
    let scene = Scene { plant: rig.scene, ..default.clone() };
    Some(judged(rig, &find(&measured, &scene, |_| {}).ok()?))
}

fn main() -> Result<(), Failure> {
    let [data, rigs, seed] = &arguments(["points|records", "RIGS", "SEED"])?;
    let (rigs, seed): (usize, u64) = (rigs.parse()?, seed.parse()?);
    let default = scene("", &["resonance.sensor=q1"])?;
    let mut lines = Vec::new();
    for (number, hypothesis) in Hypothesis::ALL.into_iter().take(7).enumerate() {
        // A plant has no cubic stiffness.
        if data == "records" && hypothesis == Hypothesis::Cubic {
            continue;
        }
        for (snr, is_known) in [(60.0, false), (60.0, true), (40.0, false), (40.0, true)] {
            let one = |n: usize| {
                let own = seed * 1_000_000 + (number * 10_000 + n) as u64;
                let rig = drawn(&mut uniform(own), hypothesis);
                let measured = if data == "records" {
                    Measurements {
                        recordings: vec![record(&rig, snr, own)?],
                        ..Measurements::default()
                    }
                } else {
                    Measurements {
                        points: points(&rig, default.definition(), snr, own)?,
                        ..Measurements::default()
                    }
                };
                Some(found(&rig, is_known, measured, &default))
            };
            let drawn: Vec<Option<Judged>> = (0..rigs).into_par_iter().filter_map(one).collect();
            let (count, all) = (drawn.len(), drawn.into_iter().flatten().collect::<Vec<_>>());
            let share = |count: usize, of: usize| count as f64 / of.max(1) as f64;
            let kept: Vec<&Judged> = all.iter().filter(|one| one.possible[0]).collect();
            let within = |of: &[f64]| of.iter().filter(|off| **off <= 1.96).count();
            let covered = share(
                kept.iter().map(|one| within(&one.range)).sum(),
                kept.iter().map(|one| one.range.len()).sum(),
            );
            let row = share(
                all.iter().map(|one| within(&one.row)).sum(),
                all.iter().map(|one| one.row.len()).sum(),
            );
            let worst = kept
                .iter()
                .flat_map(|one| &one.range)
                .fold(0.0, |worst: f64, one| worst.max(*one));
            let possible = share(all.iter().filter(|one| one.possible[1]).count(), all.len());
            let named = share(
                all.iter().filter(|one| one.possible[1] && !one.possible[2]).count(),
                all.len(),
            );
            let known = if is_known { "b epsilon" } else { "nothing" };
            let line = format!(
                "{data},{},{snr},{known},{seed},{count},{},{:.3},{covered:.3},{worst:.2},{row:.3},{possible:.3},{named:.3}",
                hypothesis.names()[0],
                count - all.len(),
                share(all.len() - kept.len(), all.len()),
            );
            println!("{line}");
            lines.push(line);
        }
    }
    let header = "data,hypothesis,snr_dB,known,seed,rigs,without,rejected,covered,worst,row,possible,named";
    write("hypotheses", header, 5, &lines)
}
