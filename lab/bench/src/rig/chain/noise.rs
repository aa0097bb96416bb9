//! Sensor noise; reproducible on every machine for the same seed.

use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};
use rand_distr::{Distribution, StandardNormal};

use crate::scene::RatioOf;

/// Normally distributed numbers.
pub struct NormalDistribution(ChaCha8Rng);

impl NormalDistribution {
    pub fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    /// The next number, with mean 0 and standard deviation 1.
    pub fn next(&mut self) -> f64 {
        StandardNormal.sample(&mut self.0)
    }
}

/// Adds white noise to a signal.
pub struct Sensor {
    /// Standard deviation of the noise relative to the RMS of the signal.
    ratio: f64,
    /// Mean square of the signal.
    power: f64,
    /// Weight of a new sample in the running mean square; 0 for a fixed one.
    follow: f64,
}

impl Sensor {
    /// A sensor with the signal-to-noise ratio `snr` (dB), relative to the mean power of about the last `memory` samples, or to
    /// a sine that fills `range`.
    pub fn new(snr: f64, of: RatioOf, range: f64, memory: f64) -> Self {
        let (power, follow) = match of {
            RatioOf::Signal => (0.0, 1.0 / memory),
            RatioOf::Range => (0.5 * range * range, 0.0),
        };
        Self { ratio: 10_f64.powf(-snr / 20.0), power, follow }
    }

    pub fn read(&mut self, value: f64, normal: &mut NormalDistribution) -> f64 {
        self.power += self.follow * (value * value - self.power);
        value + self.ratio * self.power.sqrt() * normal.next()
    }
}

#[cfg(test)]
mod tests {
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
}
