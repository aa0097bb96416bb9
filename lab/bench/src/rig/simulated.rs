//! The plant itself as a rig, with no FMU in between.

use lovines::{InvalidValue, Plant, State};

use super::{Drive, Rig, RigError, Sensors, Witness};
use crate::scene::{Scene, symbols};

/// The plant, stepped directly.
#[derive(Clone)]
pub struct Simulated {
    plant: Plant,
}

impl Simulated {
    /// The plant of the scene at its start.
    ///
    /// # Errors
    /// A parameter or a start that makes no sense.
    pub fn new(scene: &Scene) -> Result<Self, InvalidValue> {
        Ok(Self {
            plant: Plant::new(scene.plant, scene.start)?,
        })
    }
}

/// Parameters and start of the plant, under the names of the FMU's variables.
#[must_use]
pub fn start_values(scene: &Scene) -> [(&'static str, f64); 10] {
    let [mass, k, c, m, b, r] = symbols(&scene.plant);
    let State { q1, dq1, q2, dq2 } = scene.start;
    let [q1, dq1] = [("q1", q1), ("der(q1)", dq1)];
    [mass, k, c, m, b, r, q1, dq1, ("q2", q2), ("der(q2)", dq2)]
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
        self.plant
            .advance(lovines::Drive::held(displacement), step)?;
        Ok(())
    }

    fn witness(&mut self) -> Result<Option<Witness>, RigError> {
        let totals = self.plant.totals();
        Ok(Some(Witness {
            impacts: i64::try_from(totals.impacts).unwrap_or(i64::MAX),
            impact_time: totals.impact_time,
            impact_velocity: totals.impact_velocity,
            particle_velocity: self.plant.state().dq2,
        }))
    }
}
