//! How far does each stage of the measurement chain move the lock?
//!
//! Each stage alone, and some together: differences of sigma and C of the lock from the lock of the ideal chain, the stated standard
//! uncertainty of sigma, or why there is no lock.
//!
//! Writes validation/chain.csv.

mod common;

use common::*;

/// Settings of `[chain]`, unless they name another section.
const STAGES: &str = "adc_bits=16 | adc_bits=12 | adc_bits=8 | hold=true reference=false | hold=true reference=false phase_lock.delay=0 | \
                      hold=true | hold=true reference=false dac_bits=16 | delay=1 reference=false | \
                      delay=1 reference=false phase_lock.delay=0 | delay=1 | delay=5 reference=false | filter=10.0 | \
                      filter=10.0 reference=false | snr=60 | snr=40 | jitter=0.01 | \
                      adc_bits=16 dac_bits=16 hold=true delay=1 reference=false";

/// The lock behind a stage, held for 200 periods.
fn lock(stage: &str) -> Result<ResonancePoint, Failure> {
    let key = |setting: &str| match setting.starts_with("phase_lock.") {
        true => setting.to_string(),
        false => format!("chain.{setting}"),
    };
    let mut settings: Vec<String> = stage.split_whitespace().map(key).collect();
    settings.push("record.hold_periods=200".into());
    let scene = scene("", &settings)?;
    let record = record(&mut *Simulated::of(&scene)?, &scene.plan())?;
    Ok(identify(&record, &scene.plan())?.lock.at)
}

fn main() -> Result<(), Failure> {
    let ideal = lock("")?;
    let row = |name: &str| match lock(name.trim_start_matches("ideal")) {
        Ok(at) => {
            let [sigma, c] = [at.sigma - ideal.sigma, at.c - ideal.c];
            format!("{name},{sigma:.1e},{c:.1e},{:.0e},", at.u_sigma)
        }
        Err(error) => format!("{name},,,,{}", error.to_string().replace(',', ";")),
    };
    let rows: Vec<String> = ["ideal"].into_iter().chain(STAGES.split(" | ")).map(row).collect();
    write("chain", "stage,sigma_moves,C_moves,u_sigma,no_lock", 1, &rows)
}
