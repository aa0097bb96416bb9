//! The plant with noisy sensors, as the rig of the test bench.

use std::f64::consts::TAU;

use lovines::{Event, InvalidValue, Plant};
use oorandom::Rand64;
use vines_testbench::rig::{Drive, Rig, RigError, Sensors};

/// The plant and the noise of its sensors.
#[derive(Clone)]
pub(crate) struct NoisyRig {
    pub plant: Plant,
    /// Standard deviation of the noise, m; 0: the sensors read exact values.
    pub noise: f64,
    random: Rand64,
}

impl NoisyRig {
    pub fn new(plant: Plant, noise: f64) -> Self {
        Self { plant, noise, random: Rand64::new(1) }
    }

    /// What the sensors read, m.
    pub fn read(&mut self) -> Sensors {
        let mut noise = [0.0; 2];
        if self.noise > 0.0 {
            // Two independent normal numbers (Box and Muller, 1958).
            let size = self.noise * libm::sqrt(-2.0 * libm::log(1.0 - self.random.rand_float()));
            let (sin, cos) = libm::sincos(TAU * self.random.rand_float());
            noise = [size * cos, size * sin];
        }
        Sensors {
            response: self.plant.centre() + noise[0],
            reference: Some(self.plant.base_displacement() + noise[1]),
        }
    }

    /// One sample period under a harmonic drive. (One instance of the plant's code for all callers: it is most of the module.)
    pub fn step(&mut self, drive: Drive, step: f64, on_event: &mut dyn FnMut(Event)) -> Result<(), InvalidValue> {
        let drive = lovines::Drive::harmonic(drive.amplitude, drive.omega);
        self.plant.advance_with(drive, step, on_event)?;
        Ok(())
    }
}

impl Rig for NoisyRig {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        Ok(self.read())
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        Ok(self.step(drive, step, &mut |_| {})?)
    }
}
