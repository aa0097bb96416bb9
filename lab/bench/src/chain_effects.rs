//! The effect of each stage of the measurement chain on the locked point, and its run time.

use std::time::{Duration, Instant};

use lovines::InvalidValue;
use phase_lock::ConfigError;
use serde::Serialize;
use thiserror::Error;
use vines_model::numerics::{mean, standard_deviation};

use crate::experiment::Sample;
use crate::identification::Cycle;
use crate::rig::{BuiltIn, Chain, Controller, ControllerError, Fault, Rig, RigError, Simulated};
use crate::scene::{Override, Scene, SceneError, SyntaxError};

/// The stages and combinations under study: a name, and settings of `[chain]`.
pub const STAGES: [(&str, &[&str]); 18] = [
    ("ideal", &[]),
    ("ADC 16 bits", &["adc_bits=16"]),
    ("ADC 12 bits", &["adc_bits=12"]),
    ("ADC 8 bits", &["adc_bits=8"]),
    ("held output, base not measured", &["hold=true", "reference=false"]),
    (
        "the same, not compensated",
        &["hold=true", "reference=false", "compensate=false"],
    ),
    ("held output, base measured", &["hold=true"]),
    (
        "held output of 16 bits",
        &["hold=true", "reference=false", "dac_bits=16"],
    ),
    ("one sample late, base not measured", &["delay=1", "reference=false"]),
    (
        "the same, not compensated",
        &["delay=1", "reference=false", "compensate=false"],
    ),
    ("one sample late, base measured", &["delay=1"]),
    ("five samples late, base not measured", &["delay=5", "reference=false"]),
    ("anti-alias filter at 10 omega0", &["filter=10.0"]),
    ("the same, base not measured", &["filter=10.0", "reference=false"]),
    ("noise at 60 dB", &["snr=60"]),
    ("noise at 40 dB", &["snr=40"]),
    ("jitter of 1 % of a sample", &["jitter=0.01"]),
    (
        "16 bits, held, one sample late",
        &["adc_bits=16", "dac_bits=16", "hold=true", "delay=1", "reference=false"],
    ),
];

/// A stage and its effect; dimensionless.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Effect {
    /// Name of the stage.
    pub name: &'static str,
    /// Detuning at the lock.
    pub sigma: f64,
    /// Amplitude there.
    #[serde(rename = "C")]
    pub c: f64,
    /// Standard deviation of the drive's frequency from period to period, in units of sigma.
    pub wander: f64,
    /// Time of one sample, plant, chain and controller together, s: the fastest of several runs.
    pub sample_seconds: f64,
    /// Why the controller switched the drive off; the other values then are those of no motion.
    pub fault: Option<&'static str>,
}

/// Why the effect of a stage could not be determined.
#[derive(Debug, Error)]
pub enum ChainEffectError {
    /// The plant refuses a parameter or the start.
    #[error(transparent)]
    Plant(#[from] InvalidValue),
    /// The controller refuses a setting.
    #[error(transparent)]
    Configuration(#[from] ConfigError),
    /// The scene refuses a setting.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The rig failed.
    #[error(transparent)]
    Rig(#[from] RigError),
    /// The controller failed.
    #[error(transparent)]
    Controller(#[from] ControllerError),
}

/// Periods before the measurement, periods measured, and number of timings.
const SETTLE: f64 = 600.0;
const LOOK: usize = 200;
const TIMINGS: usize = 60;

/// The settings of a chain that is off, whatever the scene's is.
const OFF: [&str; 9] = [
    "adc_bits='none'",
    "dac_bits='none'",
    "hold=false",
    "snr='none'",
    "filter='none'",
    "jitter=0",
    "delay=0",
    "reference=true",
    "compensate=true",
];

/// The effect of every stage of [`STAGES`] alone on the scene that `load` reads with further settings, and that of the scene's own chain.
///
/// # Errors
/// A scene that is refused, or one that the plant or the controller refuses.
pub fn effects(
    mut load: impl FnMut(&[Override]) -> Result<Scene, SceneError>,
) -> Result<Vec<Effect>, ChainEffectError> {
    let mut scenes = Vec::new();
    for (name, settings) in STAGES {
        let overrides = OFF
            .iter()
            .chain(settings)
            .map(|setting| format!("chain.{setting}").parse())
            .collect::<Result<Vec<Override>, SyntaxError>>()
            .map_err(SceneError::from)?;
        scenes.push((name, load(&overrides)?));
    }
    let own = load(&[])?;
    if own.chain.is_on() {
        scenes.push(("the scene's chain", own));
    }
    scenes.iter().map(|(name, scene)| effect(name, scene)).collect()
}

/// The plant and the controller of a scene, with the chain between them where it is on.
struct Bench {
    rig: Box<dyn Rig>,
    controller: BuiltIn,
    sample_time: f64,
}

impl Bench {
    fn new(scene: &Scene) -> Result<Self, ChainEffectError> {
        let plant = Simulated::new(scene.plant, scene.start)?;
        let (d, samples) = (scene.dimensionless(), scene.controller.samples_per_period);
        let rig = Chain::around(Box::new(plant), &scene.chain, &d, samples);
        Ok(Self {
            rig,
            controller: BuiltIn::new(&scene.controller_config())?,
            sample_time: scene.sample_time(),
        })
    }

    fn sample(&mut self) -> Result<Sample, ChainEffectError> {
        let sensors = self.rig.sense()?;
        let command = self.controller.sample(sensors, true)?;
        self.rig.advance(command.drive, self.sample_time)?;
        Ok(Sample { time: 0.0, sensors, command, ground_truth: None })
    }

    /// Runs for a number of samples and returns the time it takes.
    fn run(&mut self, samples: usize) -> Result<Duration, ChainEffectError> {
        let begin = Instant::now();
        for _ in 0..samples {
            self.sample()?;
        }
        Ok(begin.elapsed())
    }
}

/// The effect of the chain of the scene.
///
/// # Errors
/// As [`effects`].
pub fn effect(name: &'static str, scene: &Scene) -> Result<Effect, ChainEffectError> {
    let d = scene.dimensionless();
    let mut bench = Bench::new(scene)?;
    let settle = (SETTLE * scene.controller.samples_per_period) as usize;
    let mut fastest = f64::INFINITY;
    for _ in 0..TIMINGS {
        let taken = bench.run(settle / TIMINGS)?;
        fastest = fastest.min(taken.as_secs_f64() / (settle / TIMINGS) as f64);
    }
    let mut cycles = Vec::new();
    let (mut turns, mut samples, mut fault) = (0.0, Vec::new(), None);
    while cycles.len() < LOOK {
        let sample = bench.sample()?;
        samples.push(sample);
        fault = sample.command.fault.map(Fault::text);
        turns += sample.command.drive.omega * bench.sample_time / std::f64::consts::TAU;
        if turns >= 1.0 {
            turns -= 1.0;
            cycles.extend(Cycle::of(&samples, bench.sample_time, 0.0, 0.0));
            samples.clear();
        }
    }
    let omegas: Vec<f64> = cycles.iter().map(|cycle| cycle.omega).collect();
    Ok(Effect {
        name,
        sigma: d.sigma(mean(omegas.iter().copied())),
        c: mean(cycles.iter().map(|cycle| cycle.response[0].norm())) / d.b,
        wander: standard_deviation(&omegas) / d.omega_change(1.0),
        sample_seconds: fastest,
        fault,
    })
}
