//! Tests of `noise`.

use super::*;

/// Power of the noise on a sine of amplitude 3, relative to that of the sine, dB.
fn measured(of: RatioOf) -> f64 {
    let (mut sensor, mut normal) = (Sensor::new(40.0, of, 30.0, 100.0), NormalDistribution::new(7));
    let mut noise = 0.0;
    for n in 0..200_000 {
        let value = 3.0 * (f64::from(n) * 0.0628).sin();
        let added = sensor.read(value, &mut normal) - value;
        noise += if n < 1000 { 0.0 } else { added * added };
    }
    10.0 * (4.5 / (noise / 199_000.0)).log10()
}

#[test]
fn noise_has_the_power_that_was_asked_for() {
    assert!((measured(RatioOf::Signal) - 40.0).abs() < 0.1);
    // The range is ten times the signal, so the ratio is 20 dB lower.
    assert!((measured(RatioOf::Range) - 20.0).abs() < 0.1);
}

#[test]
fn the_same_seed_gives_the_same_noise() {
    let first = |seed| NormalDistribution::new(seed).next();
    assert_eq!(first(3), first(3));
    assert_ne!(first(3), first(4));
}
