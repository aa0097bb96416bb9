//! How far does each stage of the measurement chain move the lock?
//!
//! Each stage alone, and some together: mean detuning and response over 200 periods after 600, less those of the ideal chain; standard
//! deviation of the frequency from period to period (wander); and why the controller switched the drive off, if it did.
//!
//! ```sh
//! cargo run --release -p vines-testbench --example chain -- [KEY=VALUE ...]    # of the scene; writes validation/chain.csv
//! ```

mod common;

use std::f64::consts::TAU;

use common::{Failure, arguments, scene, write};
use vines_model::numerics::{mean, standard_deviation};
use vines_testbench::experiment::Sample;
use vines_testbench::identification::Cycle;
use vines_testbench::rig::{BuiltIn, Controller, Fault, Simulated};

/// Settings of `[chain]`; the first is the ideal chain.
const STAGES: [&str; 18] = [
    "",
    "adc_bits=16",
    "adc_bits=12",
    "adc_bits=8",
    "hold=true reference=false",
    "hold=true reference=false compensate=false",
    "hold=true",
    "hold=true reference=false dac_bits=16",
    "delay=1 reference=false",
    "delay=1 reference=false compensate=false",
    "delay=1",
    "delay=5 reference=false",
    "filter=10.0",
    "filter=10.0 reference=false",
    "snr=60",
    "snr=40",
    "jitter=0.01",
    "adc_bits=16 dac_bits=16 hold=true delay=1 reference=false",
];
/// Periods before the measurement, and measured.
const SETTLE: usize = 600;
const LOOK: usize = 200;

/// Detuning, response over b, wander, and the reason, if the drive is off.
fn effect(stage: &str) -> Result<([f64; 3], Option<Fault>), Failure> {
    let stage = stage.split_whitespace().map(|one| format!("chain.{one}"));
    let scene = scene("", &arguments().into_iter().chain(stage).collect::<Vec<_>>())?;
    let (d, step) = (scene.dimensionless(), scene.sample_time());
    let mut rig = Simulated::of(&scene)?;
    let mut controller = BuiltIn::new(&scene.controller_config())?;
    let mut sample = || -> Result<Sample, Failure> {
        let sensors = rig.sense()?;
        let command = controller.sample(sensors, true)?;
        rig.advance(command.drive, step)?;
        Ok(Sample { time: 0.0, sensors, command, ground_truth: None })
    };
    for _ in 0..SETTLE * scene.controller.samples_per_period as usize {
        sample()?;
    }
    let (mut turns, mut samples) = (0.0, Vec::new());
    while turns < LOOK as f64 + 0.5 {
        let last = sample()?;
        turns += last.command.drive.omega * step / TAU;
        samples.push(last);
    }
    let cycles = &Cycle::all(&samples, step, 0.0)[..LOOK];
    let omegas: Vec<f64> = cycles.iter().map(|cycle| cycle.omega).collect();
    let sigma = d.sigma(mean(omegas.iter().copied()));
    let wander = standard_deviation(&omegas) / d.omega_change(1.0);
    let c = mean(cycles.iter().map(Cycle::amplitude)) / d.b;
    Ok(([sigma, c, wander], samples[samples.len() - 1].command.fault))
}

fn main() -> Result<(), Failure> {
    let (ideal, _) = effect(STAGES[0])?;
    let row = |stage: &&str| -> Result<String, Failure> {
        let ([sigma, c, wander], fault) = effect(stage)?;
        let [sigma, c] = [sigma - ideal[0], c - ideal[1]];
        let reason = fault.map_or("", Fault::text).replace(',', ";");
        let name = if stage.is_empty() { "ideal" } else { stage };
        Ok(format!("{name},{sigma:.1e},{c:.1e},{wander:.0e},{reason}"))
    };
    let rows = STAGES.iter().map(row).collect::<Result<Vec<_>, _>>()?;
    write(
        "chain",
        "stage,sigma_moves,C_moves,sigma_wanders,switched_off",
        1,
        &rows,
    )
}
