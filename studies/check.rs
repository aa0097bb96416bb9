//! Does the loop check pass healthy rigs, and name what is wrong with others?
//!
//! Random rigs, half of them with a fault: mass ratio 0.001 to 0.05, lambda 0.1 to 3, r 0.2 to 0.97, a natural frequency up to 0.5 % and a
//! damping up to 20 % away from the scene, 60 to 80 dB or as given, 16 to 24 bits, up to 3 samples of delay. Of the healthy ones: relative errors
//! of the loop's integral gain and of the response gain, the errors of damping rate and natural frequency in standard uncertainties u, the
//! root mean squares of these errors and of those of the response gain and its phase, and the median uncertainties.
//!
//! Arguments: RIGS of each, SEED, SNR in dB or `60-80`. Writes validation/check.csv.

mod common;

use common::*;
use phase_lock::Gains;

fn main() -> Result<(), Failure> {
    let [rigs, seed, snr] = &arguments(["RIGS", "SEED", "SNR"])?;
    let mut between = uniform(seed.parse()?);
    let (mut passed, mut named) = (0, 0);
    let mut errors = [const { Vec::new() }; 4];
    let (mut over_u, mut uncertainties) = ([const { Vec::new() }; 4], [const { Vec::new() }; 2]);
    let rig = |between: &mut dyn FnMut(f64, f64) -> f64| -> Result<[Scene; 2], Failure> {
        let mut rigs = checked_rig(between)?;
        if let Ok(snr) = snr.parse() {
            rigs.iter_mut().for_each(|scene| scene.chain.snr = Some(snr));
        }
        Ok(rigs)
    };
    for _ in 0..rigs.parse()? {
        let [scene, healthy] = rig(&mut between)?;
        let found = check(&mut *Simulated::of(&healthy)?, &scene.plan())?;
        if let Some(linear) = found.linear {
            passed += 1;
            let (omega0, damping) = (
                healthy.plant.natural_frequency(),
                0.5 * healthy.plant.damping / healthy.plant.primary_mass,
            );
            let gain = linear.response_gain / (0.5 * omega0) - 1.0;
            let of_response = found.quantities.iter().rev().take(2);
            let [over, phase] = of_response
                .map(|one| (one.measured - one.expected) / one.uncertainty)
                .collect::<Vec<_>>()[..]
            else {
                continue;
            };
            let integral = Gains::from_bandwidth(linear.bandwidth, damping).integral;
            let u = linear.u_damping_rate;
            let in_u = [
                (linear.damping_rate - damping) / u,
                (linear.omega_0 - omega0) / u,
                over,
                phase,
            ];
            let each = [linear.gains[1] / integral - 1.0, gain, in_u[0], in_u[1]];
            errors.iter_mut().zip(each).for_each(|(all, one)| all.push(one.abs()));
            over_u.iter_mut().zip(in_u).for_each(|(all, one)| all.push(one));
            [u / omega0, linear.u_gain]
                .into_iter()
                .zip(&mut uncertainties)
                .for_each(|(one, all)| all.push(one));
        } else {
            println!("healthy: {found:?}");
        }
        let [scene, broken] = rig(&mut between)?;
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
    let over_u = over_u.map(|values| format!("{:.2}", mean_square(values.iter().copied()).sqrt()));
    let uncertainties = uncertainties.map(|values| format!("{:.2e}", ends(&values)[0]));
    let header = "rigs,seed,snr_dB,passed,named,integral_gain_median,integral_gain_worst,response_gain_median,response_gain_worst,damping_u_median,\
                  damping_u_worst,frequency_u_median,frequency_u_worst,damping_within_1.96u,frequency_within_1.96u,damping_u_rms,frequency_u_rms,\
                  gain_u_rms,phase_u_rms,u_frequency_over_frequency_median,u_gain_median";
    let row = format!(
        "{rigs},{seed},{snr},{passed},{named},{},{covered},{},{}",
        errors.join(","),
        over_u.join(","),
        uncertainties.join(",")
    );
    write("check", header, 3, &[row])
}
