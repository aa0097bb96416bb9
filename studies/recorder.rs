//! Records of systems near resonance: a phase loop of the studies, a base whose amplitude is continuous, 100 samples a period, and noise with a constant
//! floor on both sensors, below a response of 0.4 b and the drive of the largest level.

#![allow(dead_code, reason = "no study uses everything")]

use super::common::Failure;
use lovines::{Cavity, Drive, Event, Parameters, Plant, State, Wall};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use vines_bench::fit::Recording;
use vines_identify::IdealRig;
use vines_model::Measurand;
use vines_model::theory::B_SYMMETRY_BREAKING;

/// Samples of a period.
const SAMPLES: f64 = 100.0;

/// What is recorded.
pub trait System {
    /// Displacement of the mass, m.
    fn response(&self) -> f64;

    /// Moves for `h` seconds with the base; impacts, and whether each is on the positive wall, are told with their times.
    fn advance(&mut self, base: Drive, h: f64, impacts: &mut Vec<(f64, bool)>) -> Result<(), Failure>;
}

impl System for Plant {
    fn response(&self) -> f64 {
        self.state().q1
    }

    fn advance(&mut self, base: Drive, h: f64, impacts: &mut Vec<(f64, bool)>) -> Result<(), Failure> {
        self.advance_with(base, h, |event| {
            if let Event::Impact { t, wall, .. } = event {
                impacts.push((t, wall == Wall::Plus));
            }
        })?;
        Ok(())
    }
}

/// A record, and when the particle hit which wall.
pub struct Recorded {
    pub response: Vec<f64>,
    pub base: Vec<f64>,
    pub sample_time: f64,
    pub impacts: Vec<(f64, bool)>,
}

/// Responses that are asked for, over b, period by period; 0: the base is at rest.
pub fn schedule(kind: &str, rig: &IdealRig) -> Result<Vec<f64>, Failure> {
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
        "asymmetric" => {
            let loss = (ratio * B_SYMMETRY_BREAKING).hypot(1.0 - FRAC_PI_2 * B_SYMMETRY_BREAKING);
            let at = |n: usize| loss * (1.1 - 0.04 * n as f64);
            all = (0..10).fold(hold(at(0), 40).collect(), |mut all: Vec<f64>, n| {
                all.extend(ramp(at(n), at(n + 1), 12).chain(hold(at(n + 1), 30)));
                all
            });
        }
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
        other => return Err(format!("kinds: levels, asymmetric, sweep, decay, mix; not {other}").into()),
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

/// The parameters of a plant whose mass is 1 kg.
pub fn parameters([f0, zeta, epsilon, r, b]: [f64; 5], cavity: Cavity) -> Parameters {
    let omega0 = TAU * f0;
    Parameters {
        primary_mass: 1.0,
        stiffness: omega0 * omega0,
        damping: 2.0 * zeta * omega0,
        particle_mass: epsilon,
        half_width: b,
        restitution: r,
        cavity,
    }
}

/// The plant of a rig at the beginning of a record: the mass moves about as it is asked to, and the particle hits the walls in turn.
pub fn plant(parameters: Parameters, first: f64) -> Result<Plant, Failure> {
    let speed = parameters.half_width * parameters.natural_frequency();
    let start = State {
        dq1: 0.95 * first * speed,
        dq2: 0.9 * speed,
        ..State::default()
    };
    Ok(Plant::new(parameters, start)?)
}

/// Records a system that is nearly this rig while it goes through these responses, over b: once in a period the loops change frequency and amplitude of
/// the base. `seed`: of the noise.
pub fn recorded(
    system: &mut impl System,
    rig: &IdealRig,
    levels: &[f64],
    [snr, seed]: [f64; 2],
) -> Result<Recorded, Failure> {
    let IdealRig { f0, zeta, b, epsilon, .. } = *rig;
    let (omega0, h) = (TAU * f0, 1.0 / (f0 * SAMPLES));
    let unit = b * epsilon * (2.0 * zeta / epsilon).max(1.0);
    let mut random = ChaCha8Rng::seed_from_u64(seed as u64);
    let mut normal = move || -> f64 { StandardNormal.sample(&mut random) };
    let floor = 0.5f64.sqrt() * 10f64.powf(-snr / 20.0);
    let mut found = Recorded {
        response: vec![],
        base: vec![],
        sample_time: h,
        impacts: vec![],
    };
    let (mut phase, mut amplitude, mut asked, mut hits) = (0.0, unit, unit, Vec::new());
    let (mut omega, mut slow_omega, mut slow_drive) = (omega0, omega0, unit);
    for &level in levels {
        let end = phase + TAU;
        let (mut sine, mut cosine, mut count) = (0.0, 0.0, 0.0);
        while phase < end - 1e-9 {
            let q1 = system.response();
            let motion = [amplitude, (asked - amplitude) / h];
            let ends = [0.0, h].map(|t| base(motion, [phase, omega], t));
            found.response.push(q1 + 0.4 * b * floor * normal());
            found.base.push(ends[0][0] + unit * floor * normal());
            sine += q1 * phase.sin();
            cosine += q1 * phase.cos();
            count += 0.5;
            let now = found.response.len() as f64 * h - h;
            system.advance(cubic(ends, h), h, &mut hits)?;
            found.impacts.extend(hits.drain(..).map(|(t, wall)| (now + t, wall)));
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

/// Displacements as a recording.
pub fn recording(response: Vec<f64>, drive: Vec<f64>, sample_time: f64) -> Recording {
    Recording {
        origin: "a record of a study".into(),
        channels: ["response", "base"].map(String::from),
        start: 0.0,
        sample_time,
        measurands: [Measurand::Displacement; 2],
        of_force: false,
        is_own: true,
        response,
        drive,
        notes: Vec::new(),
    }
}

impl Recorded {
    /// Whether the impacts around a time alternate between the walls, about half a period apart.
    pub fn is_one_to_one(&self, t: f64, period: f64) -> bool {
        let near = |side: f64| self.impacts.partition_point(|impact| impact.0 < t + side * period);
        let around = &self.impacts[near(-0.75)..near(0.75)];
        let follows =
            |pair: &[(f64, bool)]| (0.25..0.75).contains(&((pair[1].0 - pair[0].0) / period)) && pair[0].1 != pair[1].1;
        around.len() >= 2 && around.windows(2).all(follows)
    }
}
