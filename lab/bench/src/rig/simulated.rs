//! The simulated plant as a rig, without an FMU.

use lovines::{InvalidValue, Parameters, Plant, State};

use super::{Drive, GroundTruth, Rig, RigError, Sensors};

/// The plant, stepped directly.
#[derive(Clone)]
pub struct Simulated {
    plant: Plant,
}

impl Simulated {
    /// A plant at its start.
    ///
    /// # Errors
    /// An invalid parameter or start.
    pub fn new(parameters: Parameters, start: State) -> Result<Self, InvalidValue> {
        let plant = Plant::new(parameters, start)?;
        Ok(Self { plant })
    }
}

impl Rig for Simulated {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        Ok(Sensors {
            response: self.plant.centre(),
            reference: Some(self.plant.base_displacement()),
        })
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        let drive = lovines::Drive::harmonic(drive.amplitude, drive.omega);
        self.plant.advance(drive, step)?;
        Ok(())
    }

    fn hold(&mut self, displacement: f64, step: f64) -> Result<(), RigError> {
        self.plant.advance(lovines::Drive::held(displacement), step)?;
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
