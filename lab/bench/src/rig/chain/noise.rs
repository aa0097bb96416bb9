//! Sensor noise; reproducible on every machine for the same seed.

use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};
use rand_distr::{Distribution, StandardNormal};

use crate::scene::RatioOf;

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
#[path = "../../../tests/unit/noise.rs"]
mod tests;
