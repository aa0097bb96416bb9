//! The plant with noisy sensors, as the rig of the test bench.

use lovines::{Drive, Event, InvalidValue, Plant};
use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use vines_testbench::rig::{self, Rig, RigError, Sensors};

/// The plant and the noise of its sensors.
#[derive(Clone)]
pub struct NoisyRig {
    pub plant: Plant,
    /// Standard deviation of the noise, m; 0: the sensors read exact values.
    pub noise: f64,
    random: ChaCha8Rng,
}

impl NoisyRig {
    pub fn new(plant: Plant, noise: f64) -> Self {
        Self { plant, noise, random: ChaCha8Rng::seed_from_u64(1) }
    }

    /// What the sensors read, m.
    pub fn read(&mut self) -> Sensors {
        let mut noise = || {
            if self.noise > 0.0 {
                let normal: f64 = StandardNormal.sample(&mut self.random);
                self.noise * normal
            } else {
                0.0
            }
        };
        Sensors {
            response: self.plant.centre() + noise(),
            reference: Some(self.plant.base_displacement() + noise()),
        }
    }

    /// One sample period under a harmonic drive. (One instance of the plant's code for all callers: it is most of the module.)
    pub fn step(&mut self, drive: rig::Drive, step: f64, on_event: &mut dyn FnMut(Event)) -> Result<(), InvalidValue> {
        let drive = Drive::harmonic(drive.amplitude, drive.omega);
        self.plant.advance_with(drive, step, on_event)?;
        Ok(())
    }
}

impl Rig for NoisyRig {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        Ok(self.read())
    }

    fn advance(&mut self, drive: rig::Drive, step: f64) -> Result<(), RigError> {
        Ok(self.step(drive, step, &mut |_| {})?)
    }
}
