//! How far does each stage of the measurement chain move the lock?
//!
//! Each stage alone, and some together: differences of sigma and C of the lock from the lock of the ideal chain, the stated standard
//! uncertainty of sigma, or why there is no lock.
//!
//! ```sh
//! cargo run --release -p vines-testbench --example chain    # writes validation/chain.csv
//! ```

mod common;

use common::{Failure, scene, write};
use vines_testbench::experiment::run;
use vines_testbench::identification::{ResonancePoint, identify};
use vines_testbench::rig::{BuiltIn, Simulated};

/// Settings of `[chain]`, unless they name another section; the first is the ideal chain.
const STAGES: [&str; 18] = [
    "",
    "adc_bits=16",
    "adc_bits=12",
    "adc_bits=8",
    "hold=true reference=false",
    "hold=true reference=false phase_lock.delay=0",
    "hold=true",
    "hold=true reference=false dac_bits=16",
    "delay=1 reference=false",
    "delay=1 reference=false phase_lock.delay=0",
    "delay=1",
    "delay=5 reference=false",
    "filter=10.0",
    "filter=10.0 reference=false",
    "snr=60",
    "snr=40",
    "jitter=0.01",
    "adc_bits=16 dac_bits=16 hold=true delay=1 reference=false",
];

/// The lock behind a stage, held for 200 periods.
fn lock(stage: &str) -> Result<ResonancePoint, Failure> {
    let key = |setting: &str| match setting.starts_with("phase_lock.") {
        true => setting.to_string(),
        false => format!("chain.{setting}"),
    };
    let mut settings: Vec<String> = stage.split_whitespace().map(key).collect();
    settings.push("record.hold_periods=200".into());
    let scene = scene("", &settings)?;
    let mut controller = BuiltIn::new(&scene.controller_config())?;
    let mut rig = Simulated::of(&scene)?;
    let record = run(rig.as_mut(), &mut controller, &scene, |_, _, _| {})?;
    Ok(identify(&record, &scene)?.lock.at)
}

fn main() -> Result<(), Failure> {
    let ideal = lock(STAGES[0])?;
    let row = |stage: &&str| {
        let name = if stage.is_empty() { "ideal" } else { stage };
        match lock(stage) {
            Ok(at) => {
                let [sigma, c] = [at.sigma - ideal.sigma, at.c - ideal.c];
                format!("{name},{sigma:.1e},{c:.1e},{:.0e},", at.u_sigma)
            }
            Err(error) => format!("{name},,,,{}", error.to_string().replace(',', ";")),
        }
    };
    let rows: Vec<String> = STAGES.iter().map(row).collect();
    write("chain", "stage,sigma_moves,C_moves,u_sigma,no_lock", 1, &rows)
}
