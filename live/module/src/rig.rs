//! The plant with noisy sensors, as the rig of the test bench.

use std::f64::consts::TAU;

use lovines::{Event, Plant};
use oorandom::Rand64;
use vines_bench::live::LastImpacts;
use vines_bench::rig::{Drive, Rig, RigError, Sensors};
use vines_model::regime::Impact;

/// The plant and the noise of its sensors.
#[derive(Clone)]
pub(crate) struct NoisyRig {
    pub plant: Plant,
    /// Standard deviation of the noise, m; 0: the sensors read exact values.
    pub noise: f64,
    /// The last impacts, and the phase of the drive since the start, rad.
    pub impacts: LastImpacts,
    pub phase: f64,
    random: Rand64,
}

impl NoisyRig {
    pub fn new(plant: Plant, noise: f64) -> Self {
        let (impacts, random) = (LastImpacts::default(), Rand64::new(1));
        Self { plant, noise, impacts, phase: 0.0, random }
    }
}

impl Rig for NoisyRig {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        let mut noise = [0.0; 2];
        if self.noise > 0.0 {
            // Two independent normal numbers (Box and Muller, 1958).
            let size = self.noise * libm::sqrt(-2.0 * libm::log(1.0 - self.random.rand_float()));
            let (sin, cos) = libm::sincos(TAU * self.random.rand_float());
            noise = [size * cos, size * sin];
        }
        Ok(Sensors {
            response: self.plant.centre() + noise[0],
            reference: Some(self.plant.base_displacement() + noise[1]),
        })
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        let (impacts, phase) = (&mut self.impacts, self.phase);
        let mut count = |event: Event| {
            if let Event::Impact { t, velocity, .. } = event {
                impacts.add(Impact { time: phase + drive.omega * t, velocity });
            }
        };
        // One instance of the plant's code for all callers: it is most of the module.
        let count: &mut dyn FnMut(Event) = &mut count;
        let harmonic = lovines::Drive::harmonic(drive.amplitude, drive.omega);
        self.plant.advance_with(harmonic, step, count)?;
        self.phase += drive.omega * step;
        Ok(())
    }
}
