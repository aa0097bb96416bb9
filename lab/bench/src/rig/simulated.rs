//! The simulated plant as a rig, without an FMU.

use lovines::{InvalidValue, Parameters, Plant, State};

use crate::scene::Scene;
use vines_model::{Definition, Reference, Sensor};

use super::{Chain, Drive, GroundTruth, Rig, RigError, Sensors};

/// The plant, stepped directly.
#[derive(Clone)]
pub struct Simulated {
    plant: Plant,
    definition: Definition,
    /// Velocity of the primary mass and reading of the reference at the beginning of the last step, and its duration.
    before: [f64; 3],
}

impl Simulated {
    /// A plant at its start.
    ///
    /// # Errors
    /// An invalid parameter or start.
    pub fn new(parameters: Parameters, start: State) -> Result<Self, InvalidValue> {
        let plant = Plant::new(parameters, start)?;
        let mut rig = Self { plant, definition: Definition::default(), before: [0.0; 3] };
        rig.step_begins(0.0);
        Ok(rig)
    }

    /// The rig of a scene, with its measurement chain.
    ///
    /// # Errors
    /// An invalid parameter or start.
    pub fn of(scene: &Scene) -> Result<Box<dyn Rig>, InvalidValue> {
        let plant = Self::new(scene.plant, scene.start)?.with_sensors(scene.resonance);
        let samples = scene.controller.samples_per_period;
        Ok(Chain::around(
            Box::new(plant),
            &scene.chain,
            &scene.dimensionless(),
            samples,
        ))
    }

    /// The same with the sensors of a definition. An accelerometer averages over a sample period, so that it does not miss the impulses
    /// of the walls; its reference is averaged likewise, and both lag by half a sample.
    #[must_use]
    pub fn with_sensors(mut self, definition: Definition) -> Self {
        self.definition = definition;
        self.step_begins(0.0);
        self
    }

    fn step_begins(&mut self, step: f64) {
        self.before = [self.plant.state().dq1, self.reference(), step];
    }

    /// The base displacement, or the force `k e + c e'` of a harmonic base over k, m.
    fn reference(&self) -> f64 {
        let e = self.plant.base_displacement();
        let base = self.plant.base();
        match self.definition.reference {
            Reference::Base => e,
            Reference::Force => {
                let p = self.plant.parameters();
                let rate = base.drive.amplitude * base.drive.omega * base.phase.radians().cos();
                e + p.damping / p.stiffness * rate
            }
        }
    }
}

impl Rig for Simulated {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        let State { q1, dq1, .. } = self.plant.state();
        let (reference, [velocity, earlier, step]) = (self.reference(), self.before);
        let (response, reference) = match self.definition.sensor {
            Sensor::V => (self.plant.centre(), reference),
            Sensor::Q1 => (q1, reference),
            Sensor::Acceleration if step > 0.0 => {
                let square = self.plant.parameters().natural_frequency().powi(2);
                ((velocity - dq1) / (step * square), 0.5 * (reference + earlier))
            }
            Sensor::Acceleration => (0.0, reference),
        };
        Ok(Sensors { response, reference: Some(reference) })
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        self.step_begins(step);
        let drive = lovines::Drive::harmonic(drive.amplitude, drive.omega);
        self.plant.advance(drive, step)?;
        Ok(())
    }

    fn hold(&mut self, displacement: f64, step: f64) -> Result<(), RigError> {
        self.step_begins(step);
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
