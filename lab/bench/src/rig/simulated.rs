//! The simulated plant as a rig, without an FMU.

use lovines::{InvalidValue, Parameters, Plant, State};

use crate::scene::Scene;
use vines_model::{Definition, Sensor};

use super::{Chain, Drive, GroundTruth, Measured, Rig, RigError, Sensors};

/// The plant, stepped directly.
#[derive(Clone)]
pub struct Simulated {
    plant: Plant,
    sensor: Sensor,
}

impl Simulated {
    /// A plant at its start; its response is v.
    pub fn new(parameters: Parameters, start: State) -> Result<Self, InvalidValue> {
        let plant = Plant::new(parameters, start)?;
        Ok(Self { plant, sensor: Sensor::V })
    }

    /// The rig of a scene, with its measurement chain.
    pub fn of(scene: &Scene) -> Result<Box<dyn Rig>, InvalidValue> {
        let plant = Self::new(scene.plant, scene.start)?.with_sensors(scene.resonance);
        Ok(Chain::around(Box::new(plant), scene))
    }

    /// The same with the sensors of a definition.
    pub fn with_sensors(mut self, definition: Definition) -> Measured<Self> {
        self.sensor = definition.sensor;
        let parameters = *self.plant.parameters();
        Measured::new(self, definition, &parameters)
    }
}

impl Rig for Simulated {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        let response = match self.sensor {
            Sensor::V => self.plant.centre(),
            Sensor::Q1 | Sensor::Acceleration => self.plant.state().q1,
        };
        Ok(Sensors { response, reference: Some(self.plant.base_displacement()) })
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        let drive = lovines::Drive::harmonic(drive.amplitude, drive.omega);
        self.plant.advance(drive, step)?;
        Ok(())
    }

    fn hold(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        self.plant.advance(lovines::Drive::held(drive.displacement), step)?;
        Ok(())
    }

    fn ground_truth(&mut self) -> Result<Option<GroundTruth>, RigError> {
        let totals = self.plant.totals();
        Ok(Some(GroundTruth {
            impacts: i64::try_from(totals.impacts).unwrap_or(i64::MAX),
            impact_time: totals.impact_time,
            impact_velocity: totals.impact_velocity,
            particle_velocity: self.plant.state().dq2,
        }))
    }
}
