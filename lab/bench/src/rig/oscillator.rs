//! The simulated plant as a rig, without an FMU.

use lovines::{InvalidValue, Parameters, Plant, Primary, Single, State};
use vines_model::{Definition, Sensor};

use super::{
    Chain, Clock, Drive, FrictionTotals, GroundTruth, Measured, Rig, RigError, Sensors, ShakerFault,
    SimulatedStructure, has_friction,
};
use vines_scene::scene::Scene;

/// The plant, stepped directly.
#[derive(Clone)]
pub struct Simulated<P: Primary = Single> {
    pub(super) plant: Plant<P>,
    pub(super) sensor: Sensor,
    pub(super) clock: Clock,
}

impl Simulated {
    /// A plant at its start; its response is v.
    pub fn new(parameters: Parameters, start: State) -> Result<Self, InvalidValue> {
        let plant = Plant::new(parameters, start)?;
        Ok(Self { plant, sensor: Sensor::V, clock: Clock::default() })
    }

    /// The rig of a scene, with its measurement chain.
    pub fn of(scene: &Scene) -> Result<Box<dyn Rig>, RigError> {
        Ok(Chain::around(Self::without_chain(scene)?, scene))
    }

    /// The rig of a scene with its sensors: one oscillator, or a structure.
    pub fn without_chain(scene: &Scene) -> Result<Box<dyn Rig>, RigError> {
        Self::failing(scene, None)
    }

    /// [`Self::without_chain`], with a fault of the shaker of a structure that begins after some seconds.
    pub(super) fn failing(scene: &Scene, fault: Option<(ShakerFault, f64)>) -> Result<Box<dyn Rig>, RigError> {
        Ok(match &scene.structure {
            None => Box::new(Self::new(scene.plant, scene.start)?.with_sensors(scene.resonance)),
            Some(structure) => {
                let mut rig = SimulatedStructure::new(structure, scene.plant, scene.start)?;
                rig.fault = fault;
                Box::new(Measured::new(
                    rig,
                    scene.resonance,
                    &scene.plant,
                    structure.compensated_mass(),
                ))
            }
        })
    }

    /// This plant with the sensors of a definition.
    pub fn with_sensors(mut self, definition: Definition) -> Measured<Self> {
        self.sensor = definition.sensor;
        let parameters = *self.plant.parameters();
        Measured::new(self, definition, &parameters, 0.0)
    }
}

impl<P: Primary> Simulated<P> {
    pub(super) fn step(&mut self, drive: lovines::Drive, step: f64) -> Result<(), RigError> {
        self.plant.set_time(self.clock.time());
        self.plant.advance(drive, step)?;
        self.clock.advance(step);
        Ok(())
    }
}

/// A drive as a plant takes it.
pub(super) fn of_plant(drive: Drive) -> lovines::Drive {
    match drive.is_held {
        true => lovines::Drive::held(drive.displacement),
        false => lovines::Drive::harmonic(drive.amplitude, drive.omega),
    }
}

impl<P: Primary> Rig for Simulated<P> {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        let response = match self.sensor {
            Sensor::V => self.plant.centre(),
            Sensor::Q1 => self.plant.state().q1,
        };
        Ok(Sensors { response, reference: Some(self.plant.base_displacement()) })
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        self.step(of_plant(drive), step)
    }

    fn ground_truth(&mut self) -> Result<Option<GroundTruth>, RigError> {
        let totals = self.plant.totals();
        Ok(Some(GroundTruth {
            impacts: i64::try_from(totals.impacts).unwrap_or(i64::MAX),
            impact_time: totals.impact_time,
            impact_velocity: totals.impact_velocity,
            particle_velocity: self.plant.state().dq2,
            friction: has_friction(self.plant.parameters()).then(|| FrictionTotals {
                sticks: i64::try_from(totals.sticks).unwrap_or(i64::MAX),
                stuck_time: totals.stuck_time,
                loss: totals.friction,
            }),
        }))
    }
}
