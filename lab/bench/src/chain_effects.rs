//! The effect of each stage of the measurement chain on the locked point, and its run time.

use std::f64::consts::TAU;
use std::time::Instant;

use serde::Serialize;
use vines_model::numerics::{mean, standard_deviation};

use crate::experiment::{ExperimentError, Sample};
use crate::identification::Cycle;
use crate::rig::{BuiltIn, Chain, Controller, ControllerError, Fault, RigError, Simulated};
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

/// The scenes of every stage of [`STAGES`] alone, which `load` reads with further settings, and the scene itself if its chain is on.
pub fn scenes(
    mut load: impl FnMut(&[Override]) -> Result<Scene, SceneError>,
) -> Result<Vec<(&'static str, Scene)>, SceneError> {
    let mut scenes = Vec::new();
    for (name, settings) in STAGES {
        let settings = OFF
            .iter()
            .chain(settings)
            .map(|setting| format!("chain.{setting}").parse());
        scenes.push((name, load(&settings.collect::<Result<Vec<Override>, SyntaxError>>()?)?));
    }
    let own = load(&[])?;
    if own.chain.is_on() {
        scenes.push(("the scene's chain", own));
    }
    Ok(scenes)
}

/// The effect of the chain of the scene.
pub fn effect(name: &'static str, scene: &Scene) -> Result<Effect, ExperimentError> {
    let (d, step) = (scene.dimensionless(), scene.sample_time());
    let plant = Simulated::new(scene.plant, scene.start).map_err(RigError::from)?;
    let mut rig = Chain::around(Box::new(plant), scene);
    let mut controller = BuiltIn::new(&scene.controller_config()).map_err(ControllerError::from)?;
    let mut sample = || -> Result<Sample, ExperimentError> {
        let sensors = rig.sense()?;
        let command = controller.sample(sensors, true)?;
        rig.advance(command.drive, step)?;
        Ok(Sample { time: 0.0, sensors, command, ground_truth: None })
    };
    let timed = (SETTLE * scene.controller.samples_per_period) as usize / TIMINGS;
    let mut fastest = f64::INFINITY;
    for _ in 0..TIMINGS {
        let begin = Instant::now();
        for _ in 0..timed {
            sample()?;
        }
        fastest = fastest.min(begin.elapsed().as_secs_f64() / timed as f64);
    }
    let (mut turns, mut samples) = (0.0, Vec::new());
    while turns < LOOK as f64 + 0.5 {
        samples.push(sample()?);
        turns += samples[samples.len() - 1].command.drive.omega * step / TAU;
    }
    let cycles = &Cycle::all(&samples, step, 0.0)[..LOOK];
    let omegas: Vec<f64> = cycles.iter().map(|cycle| cycle.omega).collect();
    Ok(Effect {
        name,
        sigma: d.sigma(mean(omegas.iter().copied())),
        c: mean(cycles.iter().map(Cycle::amplitude)) / d.b,
        wander: standard_deviation(&omegas) / d.omega_change(1.0),
        sample_seconds: fastest,
        fault: samples.last().and_then(|sample| sample.command.fault).map(Fault::text),
    })
}
