//! Does the loop check pass healthy rigs, and name what is wrong with others?
//!
//! Random rigs, half of them with a fault: mass ratio 0.001 to 0.05, lambda 0.1 to 3, r 0.2 to 0.97, a natural frequency up to 0.5 % and a
//! damping up to 20 % away from the scene, 60 to 80 dB, 16 to 24 bits, up to 3 samples of delay. Of the healthy ones: relative errors
//! of the loop's integral gain and of the response gain, and the errors of damping rate and natural frequency in standard uncertainties u.
//!
//! Arguments: RIGS of each, SEED. Writes validation/check.csv.

mod common;

use common::*;
use phase_lock::Gains;

fn main() -> Result<(), Failure> {
    let [rigs, seed] = &arguments(["RIGS", "SEED"])?;
    let mut between = uniform(seed.parse()?);
    let (mut passed, mut named) = (0, 0);
    let mut errors = [const { Vec::new() }; 4];
    for _ in 0..rigs.parse()? {
        let [scene, healthy] = checked_rig(&mut between)?;
        let found = check(&mut *Simulated::of(&healthy)?, &scene.plan())?;
        if let Some(linear) = found.linear {
            passed += 1;
            let gain = 0.5 * healthy.plant.natural_frequency();
            let damping = 0.5 * healthy.plant.damping / healthy.plant.primary_mass;
            let integral = Gains::from_bandwidth(linear.bandwidth, damping).integral;
            errors[0].push((linear.gains[1] / integral - 1.0).abs());
            errors[1].push((linear.response_gain / gain - 1.0).abs());
            errors[2].push((linear.damping_rate - damping).abs() / linear.u_damping_rate);
            errors[3].push((linear.omega_0 - healthy.plant.natural_frequency()).abs() / linear.u_damping_rate);
        } else {
            println!("healthy: {found:?}");
        }
        let [scene, broken] = checked_rig(&mut between)?;
        let faults = checked_faults(&mut between);
        let (expected, fault) = faults[between(0.0, faults.len() as f64) as usize];
        let found = check(&mut faulty(&broken, fault, 0.0, |_| {})?, &scene.plan())?;
        if found.verdict == expected {
            named += 1;
        } else {
            println!("{fault:?}, expected {expected:?}: {found:?}");
        }
    }
    let covered = [2, 3].map(|n| format!("{:.4}", share(&errors[n], 1.96))).join(",");
    let errors = errors.map(|values| ends(&values).map(|error| format!("{error:.1e}")).join(","));
    let header = "rigs,seed,passed,named,integral_gain_median,integral_gain_worst,response_gain_median,response_gain_worst,damping_u_median,damping_u_worst,\
                  frequency_u_median,frequency_u_worst,damping_within_1.96u,frequency_within_1.96u";
    let row = format!("{rigs},{seed},{passed},{named},{},{covered}", errors.join(","));
    write("check", header, 2, &[row])
}
