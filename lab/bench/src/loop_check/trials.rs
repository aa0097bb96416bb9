//! The check on random rigs, healthy and with random faults.

use phase_lock::Gains;
use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};
use rand_distr::{Distribution, Uniform};
use serde::Serialize;

use super::{LoopCheck, Verdict, check, expected};
use crate::faults::{FaultyRig, Kind, Log, Sensor};
use crate::rig::{Chain, Rig, Simulated};
use crate::scene::{Parameters, Scene, SceneError};

/// Outcome of many checks.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Trials {
    /// Checks of healthy rigs, and how many passed.
    pub healthy: [usize; 2],
    /// Checks of rigs with a fault, and how many named it.
    pub faulty: [usize; 2],
    /// Relative errors of the integral gain of the loop and of the response gain of the healthy rigs, and the error of the damping rate
    /// in standard uncertainties: median and largest of each.
    pub linear: [[f64; 2]; 3],
    /// The wrong verdicts: expected and given.
    pub wrong: Vec<(Verdict, LoopCheck)>,
}

/// Steps of its converter in the response of a sensor with too small a gain.
const STEPS: f64 = 4.0;

/// A random number between two.
struct Random(ChaCha8Rng);

impl Random {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        // The limits are finite and in order.
        Uniform::new(low, high).map_or(low, |range| range.sample(&mut self.0))
    }

    fn log(&mut self, low: f64, high: f64) -> f64 {
        self.between(low.ln(), high.ln()).exp()
    }
}

/// The faults that a check of a scene can see, with one random severity each.
fn fault(scene: &Scene, random: &mut Random) -> (Verdict, Kind) {
    let period = 100.0;
    // A reading of less than some steps of its converter is that of a dead sensor.
    let steps = scene
        .chain
        .adc_bits
        .map_or(f64::INFINITY, |bits| 2_f64.powi(bits as i32 - 1));
    let range = scene.chain.response_range * scene.plant.half_width;
    let least = STEPS * range / (steps * expected(scene)[0].norm());
    let gain = if random.between(0.0, 1.0) < 0.5 || least > 0.25 {
        random.log(1.15, 1000.0)
    } else {
        random.log(least.max(0.04), 0.85)
    };
    let late = random.between(2.0, 0.33 * period) as usize;
    match random.between(0.0, 14.0) as usize {
        0 => (Verdict::NotANumber, Kind::Response(Sensor::Value(f64::NAN))),
        1 => (Verdict::NotANumber, Kind::Base(Sensor::Value(f64::INFINITY))),
        2 => (Verdict::ShakerOff, Kind::Shaker(0.0)),
        3 => (Verdict::ResponseDead, Kind::Response(Sensor::Dead)),
        4 => (Verdict::BaseDead, Kind::Base(Sensor::Dead)),
        5 => (Verdict::Swapped, Kind::Swapped),
        6 => (Verdict::ResponseReversed, Kind::Response(Sensor::Reversed)),
        7 => (Verdict::BaseReversed, Kind::Base(Sensor::Reversed)),
        8 => (Verdict::BothReversed, Kind::Both(Sensor::Reversed)),
        9 => (Verdict::ResponseGain, Kind::Response(Sensor::Gain(gain))),
        10 => (Verdict::BaseGain, Kind::Base(Sensor::Gain(gain))),
        11 => (Verdict::ResponseLate, Kind::Response(Sensor::Late(late))),
        12 => (Verdict::BaseLate, Kind::Base(Sensor::Late(late))),
        _ if random.between(0.0, 1.0) < 0.5 => (Verdict::ResponseNoisy, Kind::Response(Sensor::Noisy)),
        _ => (Verdict::BaseNoisy, Kind::Base(Sensor::Noisy)),
    }
}

fn random_scene(scene: &Scene, random: &mut Random) -> Scene {
    let mut scene = scene.clone();
    let (mass, stiffness) = (scene.plant.primary_mass, scene.plant.stiffness);
    let epsilon = random.log(0.001, 0.05);
    scene.plant.particle_mass = epsilon * mass;
    scene.plant.damping = epsilon * random.log(0.1, 3.0) * (mass * stiffness).sqrt();
    scene.plant.restitution = random.between(0.2, 0.97);
    scene.start = Default::default();
    scene.amplitude = epsilon * scene.plant.half_width * random.between(0.3, 3.0);
    scene.chain.snr = Some(random.between(30.0, 80.0));
    scene.chain.seed = random.between(0.0, 1e6) as u64;
    scene.chain.delay = random.between(0.0, 4.0) as u32;
    scene.chain.filter = Some(random.between(8.0, 40.0));
    scene.chain.adc_bits = Some(random.between(16.0, 25.0) as u32);
    scene
}

/// A rig of a scene, whose natural frequency and damping deviate from it by up to 0.5 % and 20 %.
fn rig(scene: &Scene, random: &mut Random, kind: Kind) -> Result<(Box<dyn Rig>, Parameters), SceneError> {
    let mut plant = scene.plant;
    plant.stiffness *= random.between(0.99, 1.01);
    plant.damping *= random.between(0.8, 1.2);
    let simulated = |plant| Simulated::new(plant, scene.start).map_err(SceneError::Plant);
    let log = Log::new(0, scene.sample_time());
    let [rig, changed] = [Box::new(simulated(plant)?), Box::new(simulated(plant)?)];
    let faulty = FaultyRig::new(rig, changed, kind, &log, scene.plant.half_width);
    Ok((Chain::around(Box::new(faulty), scene), plant))
}

/// Checks `count` healthy rigs, and as many with a random fault.
pub fn trials(scene: &Scene, count: usize, seed: u64) -> Result<Trials, SceneError> {
    let mut random = Random(ChaCha8Rng::seed_from_u64(seed));
    let mut trials = Trials::default();
    let mut errors = [const { Vec::new() }; 3];
    for n in 0..2 * count {
        let scene = random_scene(scene, &mut random);
        let (expected, kind) = if n % 2 == 0 {
            (Verdict::Healthy, Kind::None)
        } else {
            fault(&scene, &mut random)
        };
        let (mut rig, plant) = rig(&scene, &mut random, kind)?;
        let tally = if n % 2 == 0 {
            &mut trials.healthy
        } else {
            &mut trials.faulty
        };
        tally[0] += 1;
        match check(&mut *rig, &scene) {
            Ok(found) if found.verdict == expected => {
                tally[1] += 1;
                if let Some(linear) = found.linear {
                    let gain = 0.5 * (plant.stiffness / plant.primary_mass).sqrt();
                    let damping = 0.5 * plant.damping / plant.primary_mass;
                    let integral = Gains::from_bandwidth(linear.bandwidth, damping).integral;
                    errors[0].push((linear.gains[1] / integral - 1.0).abs());
                    errors[1].push((linear.response_gain / gain - 1.0).abs());
                    errors[2].push((linear.damping_rate - damping).abs() / linear.u_damping_rate);
                }
            }
            Ok(found) => trials.wrong.push((expected, found)),
            Err(_) => {}
        }
    }
    trials.linear = errors.map(|mut errors| {
        errors.sort_by(f64::total_cmp);
        [errors.len() / 2, errors.len().saturating_sub(1)].map(|n| errors.get(n).copied().unwrap_or(f64::NAN))
    });
    Ok(trials)
}
