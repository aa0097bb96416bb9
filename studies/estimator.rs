//! Do the curve of phase resonance and the parameters that are estimated from a record cover the truth?
//!
//! Records of random rigs: f0 2 to 80 Hz, epsilon 0.003 to 0.03, lambda 0.4 to 2.5, r 0.35 to 0.85, b 2 to 20 mm; a phase loop of the study, a base
//! whose amplitude is continuous, 100 samples a period, noise with a constant floor on both sensors, below a response of 0.4 b and the drive of the
//! largest level. The scene is wrong by up to 1 % in f0, 25 % in zeta, 15 % in epsilon, 10 % in b and 0.15 in r. Kinds: `levels`, `sweep`, `decay`
//! and their mixture `mix`.
//!
//! Errors over standard uncertainties, pooled over 25 amplitudes from 1.07 times the fold, or over the five parameters: root mean square, the bias
//! that is largest (of drive and frequency, or of a parameter), and the largest. `without`: records without a result. `rejected`: with p < 0.01.
//! `not_1to1`: share of the used periods in which the impacts of the rig do not alternate, one in each half of the period. `u_drive` over `b
//! epsilon`, `u_sigma`, and `u_r` over r: medians.
//!
//! Arguments: KIND, RIGS, SEED, SNR in dB. Writes validation/estimator.csv.

mod common;

use std::time::Instant;

use common::*;
use lovines::{Drive, Event, Plant, State};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use vines_estimate::CubicSpline;
use vines_identify::{IdealRig, Identified, Samples, Signals, identify};
use vines_model::Sensor;

/// Samples of a period.
const SAMPLES: f64 = 100.0;

/// A rig, what is known of it, and the seed of its noise.
#[derive(Debug, Clone, Copy)]
struct Rig {
    truth: IdealRig,
    scene: IdealRig,
    seed: u64,
}

/// A record, and when the particle hit which wall.
struct Recorded {
    response: Vec<f64>,
    base: Vec<f64>,
    sample_time: f64,
    impacts: Vec<(f64, bool)>,
}

fn drawn(uniform: Uniform, n: usize) -> Rig {
    let mut logarithmic = |low: f64, high: f64| uniform(low.ln(), high.ln()).exp();
    let [f0, epsilon, b] = [[2.0, 80.0], [0.003, 0.03], [0.002, 0.02]].map(|[low, high]| logarithmic(low, high));
    let truth = IdealRig {
        f0,
        zeta: 0.5 * epsilon * uniform(0.4, 2.5),
        r: uniform(0.35, 0.85),
        b,
        epsilon,
    };
    let scene = IdealRig {
        f0: f0 * (1.0 + uniform(-0.01, 0.01)),
        zeta: truth.zeta * (1.0 + uniform(-0.25, 0.25)),
        r: (truth.r + uniform(-0.15, 0.15)).clamp(0.2, 0.95),
        b: b * (1.0 + uniform(-0.1, 0.1)),
        epsilon: epsilon * (1.0 + uniform(-0.15, 0.15)),
    };
    Rig { truth, scene, seed: uniform(0.0, 1e9) as u64 + n as u64 }
}

/// Responses that are asked for, over b, period by period; 0: the base is at rest.
fn schedule(kind: &str, rig: &IdealRig) -> Result<Vec<f64>, Failure> {
    let ratio = (1.0 - rig.r) / (1.0 + rig.r);
    let fold = ratio / ratio.hypot(FRAC_PI_2);
    // Below the loss of symmetry at B = 1.07.
    let speed = 1.03;
    let top = (ratio * speed).hypot(1.0 - FRAC_PI_2 * speed).min(0.75);
    let [high, low] = [0.97 * top, (1.12 * fold).max(0.05)];
    let level = |n: usize| high + (low - high) * n as f64 / 7.0;
    let ramp =
        |from: f64, to: f64, count: usize| (0..count).map(move |n| from + (to - from) * n as f64 / (count - 1) as f64);
    let hold = |at: f64, count: usize| std::iter::repeat_n(at, count);
    let mut all: Vec<f64> = hold(high, 60).collect();
    match kind {
        "levels" => (0..7).for_each(|n| all.extend(ramp(level(n), level(n + 1), 12).chain(hold(level(n + 1), 45)))),
        "sweep" => all.extend(ramp(high, low, 500)),
        "decay" => all.extend(hold(high, 30).chain(hold(0.0, (3.0 / (TAU * rig.zeta)).min(250.0) as usize))),
        "mix" => {
            all.extend(
                ramp(high, level(4), 200)
                    .chain(hold(level(4), 50))
                    .chain(ramp(level(4), level(7), 40)),
            );
            all.extend(
                hold(level(7), 60)
                    .chain(ramp(level(7), level(1), 60))
                    .chain(hold(level(1), 50)),
            );
            all.extend(hold(0.0, 60));
        }
        other => return Err(format!("kinds: levels, sweep, decay, mix; not {other}").into()),
    }
    Ok(all)
}

/// Gains of the loops: proportional and integral, of the phase (per period) and of the response (over the rate at which the base moves it).
const PHASE: [f64; 2] = [0.3, 0.02];
const RESPONSE: [f64; 2] = [0.25, 0.012];

/// The motion of a base whose amplitude changes evenly over a sample: displacement and velocity.
fn base([amplitude, growth]: [f64; 2], [phase, omega]: [f64; 2], t: f64) -> [f64; 2] {
    let (sine, cosine) = (phase + omega * t).sin_cos();
    let now = amplitude + growth * t;
    [now * sine, growth * sine + now * omega * cosine]
}

/// The cubic through displacements and velocities at both ends of a sample.
fn cubic([[x0, v0], [x1, v1]]: [[f64; 2]; 2], h: f64) -> Drive {
    let rise = (x1 - x0) / h;
    let signal = [
        x0,
        v0,
        (3.0 * rise - 2.0 * v0 - v1) / h,
        (v0 + v1 - 2.0 * rise) / (h * h),
    ];
    Drive { signal, ..Drive::default() }
}

/// Records a rig: once in a period the loops change frequency and amplitude of the base.
fn recorded(rig: &Rig, kind: &str, snr: f64) -> Result<Recorded, Failure> {
    let IdealRig { f0, zeta, r, b, epsilon } = rig.truth;
    let (omega0, h) = (TAU * f0, 1.0 / (f0 * SAMPLES));
    let parameters = Parameters {
        primary_mass: 1.0,
        stiffness: omega0 * omega0,
        damping: 2.0 * zeta * omega0,
        particle_mass: epsilon,
        half_width: b,
        restitution: r,
        cavity: Cavity::IDEAL,
    };
    let levels = schedule(kind, &rig.truth)?;
    let start = State {
        dq1: 0.95 * levels[0] * b * omega0,
        dq2: 0.9 * b * omega0,
        ..State::default()
    };
    let mut plant = Plant::new(parameters, start)?;
    let unit = b * epsilon * (2.0 * zeta / epsilon).max(1.0);
    let mut random = ChaCha8Rng::seed_from_u64(rig.seed);
    let mut normal = move || -> f64 { StandardNormal.sample(&mut random) };
    let floor = 0.5f64.sqrt() * 10f64.powf(-snr / 20.0);
    let mut found = Recorded {
        response: vec![],
        base: vec![],
        sample_time: h,
        impacts: vec![],
    };
    let (mut phase, mut amplitude, mut asked) = (0.0, unit, unit);
    let (mut omega, mut slow_omega, mut slow_drive) = (omega0, omega0, unit);
    for level in levels {
        let end = phase + TAU;
        let (mut sine, mut cosine, mut count) = (0.0, 0.0, 0.0);
        while phase < end - 1e-9 {
            let q1 = plant.state().q1;
            let motion = [amplitude, (asked - amplitude) / h];
            let ends = [0.0, h].map(|t| base(motion, [phase, omega], t));
            found.response.push(q1 + 0.4 * b * floor * normal());
            found.base.push(ends[0][0] + unit * floor * normal());
            sine += q1 * phase.sin();
            cosine += q1 * phase.cos();
            count += 0.5;
            let now = found.response.len() as f64 * h - h;
            plant.advance_with(cubic(ends, h), h, |event| {
                if let Event::Impact { t, wall, .. } = event {
                    found.impacts.push((now + t, wall == lovines::Wall::Plus));
                }
            })?;
            (phase, amplitude) = (phase + omega * h, asked);
        }
        if level == 0.0 {
            asked = 0.0;
            continue;
        }
        let response = f64::hypot(sine, cosine) / count;
        let ahead = (f64::atan2(cosine, sine) + FRAC_PI_2 + PI).rem_euclid(TAU) - PI;
        slow_omega = (slow_omega + PHASE[1] * ahead * f0).clamp(0.85 * omega0, 1.15 * omega0);
        omega = (slow_omega + PHASE[0] * ahead * f0).clamp(0.8 * omega0, 1.2 * omega0);
        let missing = (level * b - response) * 2.0 * f0 / omega0;
        slow_drive = (slow_drive + RESPONSE[1] * missing).clamp(0.0, 6.0 * unit);
        asked = (slow_drive + RESPONSE[0] * missing).clamp(0.0, 6.0 * unit);
    }
    Ok(found)
}

impl Recorded {
    /// Whether the impacts around a time alternate between the walls, about half a period apart.
    fn is_one_to_one(&self, t: f64, period: f64) -> bool {
        let near = |side: f64| self.impacts.partition_point(|impact| impact.0 < t + side * period);
        let around = &self.impacts[near(-0.75)..near(0.75)];
        let follows =
            |pair: &[(f64, bool)]| (0.25..0.75).contains(&((pair[1].0 - pair[0].0) / period)) && pair[0].1 != pair[1].1;
        around.len() >= 2 && around.windows(2).all(follows)
    }
}

/// Errors over uncertainties of the curve, drive then frequency, and median uncertainties over `b epsilon` and epsilon.
fn of_curve(truth: &IdealRig, found: &Identified) -> Option<([Vec<f64>; 2], [f64; 2])> {
    let exact = truth.backbone(Sensor::Q1)?;
    let logarithms: Vec<f64> = exact.iter().map(|point| point[0].ln()).collect();
    let [low, high] = found.curve.basis.ends;
    let low = low.max(logarithms[0] + 1.07f64.ln());
    let high = high.min(logarithms[logarithms.len() - 1]);
    let amplitudes: Vec<f64> = (0..25)
        .map(|n| (low + (high - low) * f64::from(n) / 24.0).exp())
        .collect();
    let values = exact
        .iter()
        .map(|point| num_complex::Complex64::new(point[1], point[2]))
        .collect();
    let exact = CubicSpline::new(logarithms, values);
    let measured = found.curve.at(&amplitudes);
    let u = |n: usize| measured.covariance[(n, n)].sqrt();
    let at = |n: usize| exact.at(amplitudes[n].ln())[0];
    let drive = (0..25).map(|n| (measured.drive[n] - at(n).re) / u(n)).collect();
    let omega = (0..25).map(|n| (measured.omega[n] - at(n).im) / u(25 + n)).collect();
    let unit = truth.epsilon * truth.b;
    let [u_drive, u_omega] = [0, 25].map(|from| ends(&(from..from + 25).map(u).collect::<Vec<f64>>())[0]);
    (low < high).then_some((
        [drive, omega],
        [u_drive / unit, u_omega / (TAU * truth.f0 * truth.epsilon)],
    ))
}

/// What is found of a record.
struct Judged {
    curve: [Vec<f64>; 2],
    parameters: [f64; 5],
    /// Of drive, sigma and r.
    u: [f64; 3],
    rejected: bool,
    periods: [usize; 2],
}

fn judged(rig: &Rig, recorded: &Recorded) -> Option<Judged> {
    let signals = Signals::of_displacements([&recorded.response, &recorded.base], recorded.sample_time);
    let samples = Samples { signals, sensor: Sensor::Q1 };
    let found = identify(&samples, &rig.scene).ok()?;
    let (curve, [u_drive, u_sigma]) = of_curve(&rig.truth, &found)?;
    let (values, truth) = (found.scene.values(), rig.truth.values());
    let parameters = std::array::from_fn(|i| (values[i] - truth[i]) / found.uncertainty[i]);
    let used = found.time.iter().zip(&found.used).filter(|(_, used)| **used);
    let wrong = used
        .clone()
        .filter(|(t, _)| !recorded.is_one_to_one(**t, 1.0 / rig.truth.f0));
    let periods = [used.count(), wrong.count()];
    println!(
        "{:.3e} p {:.4} curve {:.2} {:.1} parameters {parameters:.1?} periods {periods:?} of {} passes {}{} lag {:.2}",
        rig.seed as f64,
        found.p(),
        mean_square(curve.concat()).sqrt(),
        curve.concat().iter().fold(0.0, |most: f64, one| most.max(one.abs())),
        found.used.len(),
        found.passes,
        if found.converged { "" } else { " (not converged)" },
        found.lag,
    );
    let u = [u_drive, u_sigma, found.uncertainty[2] / found.scene.r];
    Some(Judged { curve, parameters, u, rejected: found.p() < 0.01, periods })
}

/// Root mean square, largest bias of a group, and largest size.
fn pooled(groups: &[Vec<f64>]) -> String {
    let all = groups.concat();
    let bias = groups
        .iter()
        .map(|group| mean(group.iter().copied()).abs())
        .fold(0.0, f64::max);
    let worst = all.iter().fold(0.0, |most: f64, one| most.max(one.abs()));
    format!("{:.2},{bias:.2},{worst:.1}", mean_square(all.iter().copied()).sqrt())
}

fn main() -> Result<(), Failure> {
    let [kind, count, seed, snr] = &arguments(["levels|sweep|decay|mix", "RIGS", "SEED", "SNR"])?;
    let mut uniform = uniform(seed.parse()?);
    let rigs: Vec<Rig> = (0..count.parse()?).map(|n| drawn(&mut uniform, n)).collect();
    let noise: f64 = snr.parse()?;
    let one = |rig: &Rig| -> Result<_, Failure> {
        let recorded = recorded(rig, kind, noise)?;
        let begin = Instant::now();
        let judged = judged(rig, &recorded);
        if judged.is_none() {
            println!("no result: {rig:.4?}");
        }
        Ok((judged, begin.elapsed().as_secs_f64()))
    };
    let all = rigs.par_iter().map(one).collect::<Result<Vec<_>, _>>()?;
    let seconds: Vec<f64> = all.iter().map(|one| one.1).collect();
    let found: Vec<&Judged> = all.iter().filter_map(|one| one.0.as_ref()).collect();
    let curve = [0, 1].map(|n| found.iter().flat_map(|one| one.curve[n].clone()).collect::<Vec<f64>>());
    let parameters = [0, 1, 2, 3, 4].map(|n| found.iter().map(|one| one.parameters[n]).collect::<Vec<f64>>());
    let [u_drive, u_sigma, u_r] = [0, 1, 2].map(|n| ends(&found.iter().map(|one| one.u[n]).collect::<Vec<f64>>())[0]);
    let [used, wrong] = [0, 1].map(|n| found.iter().map(|one| one.periods[n]).sum::<usize>());
    let row = format!(
        "{kind},{snr},{seed},{count},{},{},{},{},{:.4},{u_drive:.1e},{u_sigma:.1e},{u_r:.1e},{:.1}",
        all.len() - found.len(),
        found.iter().filter(|one| one.rejected).count(),
        pooled(&curve),
        pooled(&parameters),
        wrong as f64 / used as f64,
        ends(&seconds)[0],
    );
    let header = "kind,snr_dB,seed,rigs,without,rejected,curve_rms,curve_bias,curve_worst,parameters_rms,parameters_bias,parameters_worst,\
        not_1to1,u_drive,u_sigma,u_r,median_s";
    write("estimator", header, 3, &[row])
}
