//! Does the loop check pass healthy rigs, and name what is wrong with others?
//!
//! Random rigs, half of them with a fault: mass ratio 0.001 to 0.05, lambda 0.1 to 3, r 0.2 to 0.97, a natural frequency up to 0.5 % and a
//! damping up to 20 % away from the scene, 30 to 80 dB, 16 to 24 bits, up to 3 samples of delay. Of the healthy ones: relative errors
//! of the loop's integral gain and of the response gain, and the error of the damping rate in standard uncertainties.
//!
//! ```sh
//! cargo run --release -p vines-testbench --example check -- RIGS SEED    # RIGS of each; writes validation/check.csv
//! ```

mod common;

use common::{Failure, arguments, quantile, scene, uniform, write};
use phase_lock::Gains;
use vines_testbench::loop_check::{Verdict, check};
use vines_testbench::rig::{RigFault, SensorFault, Simulated, faulty};
use vines_testbench::scene::Scene;

/// A random fault, and what the check should say.
fn fault(between: &mut impl FnMut(f64, f64) -> f64) -> (Verdict, RigFault) {
    use {RigFault::*, SensorFault::*};
    let strong = between(1.15_f64.ln(), 1000_f64.ln()).exp();
    let gain = Gain(if between(0.0, 1.0) < 0.5 {
        strong
    } else {
        between(0.25, 0.85)
    });
    let late = Late(between(2.0, 33.0) as usize);
    match between(0.0, 15.0) as usize {
        0 => (Verdict::NotANumber, Response(Value(f64::NAN))),
        1 => (Verdict::NotANumber, Base(Value(f64::INFINITY))),
        2 => (Verdict::ShakerOff, Shaker(0.0)),
        3 => (Verdict::ResponseDead, Response(Dead)),
        4 => (Verdict::BaseDead, Base(Dead)),
        5 => (Verdict::Swapped, Swapped),
        6 => (Verdict::ResponseReversed, Response(Reversed)),
        7 => (Verdict::BaseReversed, Base(Reversed)),
        8 => (Verdict::BothReversed, Both(Reversed)),
        9 => (Verdict::ResponseGain, Response(gain)),
        10 => (Verdict::BaseGain, Base(gain)),
        11 => (Verdict::ResponseLate, Response(late)),
        12 => (Verdict::BaseLate, Base(late)),
        13 => (Verdict::ResponseNoisy, Response(Noisy)),
        _ => (Verdict::BaseNoisy, Base(Noisy)),
    }
}

/// A random scene, and that of a rig which differs from it.
fn rig(between: &mut impl FnMut(f64, f64) -> f64) -> Result<[Scene; 2], Failure> {
    let mut scene = scene("", &["start.dq2=0"])?;
    let epsilon = between(0.001_f64.ln(), 0.05_f64.ln()).exp();
    let lambda = between(0.1_f64.ln(), 3_f64.ln()).exp();
    scene.plant.particle_mass = epsilon * scene.plant.primary_mass;
    scene.plant.damping = lambda * scene.plant.particle_mass * scene.plant.natural_frequency();
    scene.plant.restitution = between(0.2, 0.97);
    scene.amplitude = epsilon * scene.plant.half_width * between(0.3, 3.0);
    scene.chain.snr = Some(between(30.0, 80.0));
    scene.chain.seed = between(0.0, 1e6) as u64;
    scene.chain.delay = between(0.0, 4.0) as u32;
    scene.chain.filter = Some(between(8.0, 40.0));
    scene.chain.adc_bits = Some(between(16.0, 25.0) as u32);
    let mut rig = scene.clone();
    rig.plant.stiffness *= between(0.99, 1.01);
    rig.plant.damping *= between(0.8, 1.2);
    Ok([scene, rig])
}

fn main() -> Result<(), Failure> {
    let [rigs, seed] = &arguments()[..] else {
        return Err("arguments: RIGS SEED".into());
    };
    let mut between = uniform(seed.parse()?);
    let (mut passed, mut named) = (0, 0);
    let mut errors = [const { Vec::new() }; 3];
    for _ in 0..rigs.parse()? {
        let [scene, healthy] = rig(&mut between)?;
        let found = check(&mut *Simulated::of(&healthy)?, &scene)?;
        if let Some(linear) = found.linear {
            passed += 1;
            let gain = 0.5 * healthy.plant.natural_frequency();
            let damping = 0.5 * healthy.plant.damping / healthy.plant.primary_mass;
            let integral = Gains::from_bandwidth(linear.bandwidth, damping).integral;
            errors[0].push((linear.gains[1] / integral - 1.0).abs());
            errors[1].push((linear.response_gain / gain - 1.0).abs());
            errors[2].push((linear.damping_rate - damping).abs() / linear.u_damping_rate);
        } else {
            println!("healthy: {found:?}");
        }
        let [scene, broken] = rig(&mut between)?;
        let (expected, fault) = fault(&mut between);
        let found = check(&mut faulty(&broken, fault, 0.0, |_| {})?, &scene)?;
        if found.verdict == expected {
            named += 1;
        } else {
            println!("{fault:?}, expected {expected:?}: {found:?}");
        }
    }
    let errors = errors.map(|values| format!("{:.1e},{:.1e}", quantile(&values, 0.5), quantile(&values, 1.0)));
    let header = "rigs,seed,passed,named,integral_gain_median,integral_gain_worst,response_gain_median,response_gain_worst,damping_u_median,damping_u_worst";
    let row = format!("{rigs},{seed},{passed},{named},{}", errors.join(","));
    write("check", header, 2, &[row])
}
