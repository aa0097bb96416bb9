//! A simulated structure as a rig, with the limits of a shaker, and what fails.

use lovines::{Parameters, Plant, Refused, Row, State, StructureState};
use vines_model::Sensor;

use super::oscillator::of_plant;
use super::{Clock, Drive, GroundTruth, Rig, RigError, Sensors, Simulated};
use vines_scene::scene::{Reference, Release, SceneShaker, Structure};

/// A simulated structure. It is driven with the displacement of its base, m, a force, N, or the command of its shaker, V. It reads the displacement at
/// the sensor, m, and the displacement of the base or the force.
#[derive(Clone)]
pub struct SimulatedStructure {
    simulated: Simulated<lovines::Structure>,
    structure: Structure,
    /// The displacement at the sensor, by the sections.
    sensor: Row,
    /// Largest command that the amplifier passes on, V.
    clipped_at: f64,
    /// What fails, and when, s.
    pub(super) fault: Option<(ShakerFault, f64)>,
    /// Largest command so far, V.
    driven: f64,
    /// The structure with its stinger, while this is cut by a release.
    attached: Option<Structure>,
}

/// How a shaker fails.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ShakerFault {
    /// The stinger breaks.
    StingerBreaks,
    /// The amplifier clips at half of the present command.
    AmplifierClips,
    /// The armature is at its stop: where it is now, or as soon as it moves outwards.
    AtStop,
}

impl SimulatedStructure {
    /// A structure at rest, and its particle at `start`; of `parameters` those of the particle and its cavity count.
    pub fn new(structure: &Structure, parameters: Parameters, start: State) -> Result<Self, Refused> {
        let start = StructureState { q2: start.q2, dq2: start.dq2, ..StructureState::default() };
        let plant = Plant::with_host(structure.host.clone(), parameters, &start)?;
        let clipped_at = structure
            .shaker
            .as_ref()
            .map_or(f64::INFINITY, SceneShaker::largest_command);
        Ok(Self {
            simulated: Simulated { plant, sensor: Sensor::Q1, clock: Clock::default() },
            sensor: structure.response(),
            structure: structure.clone(),
            clipped_at,
            fault: None,
            driven: 0.0,
            attached: None,
        })
    }

    /// The plant.
    pub fn plant(&self) -> &Plant<lovines::Structure> {
        &self.simulated.plant
    }

    /// The structure as it is now: with its stinger, or without.
    pub fn structure(&self) -> &Structure {
        &self.structure
    }

    /// Goes on as another structure with the same coordinates: with a cut stinger, or with its own.
    fn becomes(&mut self, structure: Structure) -> Result<(), RigError> {
        let coordinates = self.structure.coordinates_with_shaker();
        let coordinates = coordinates.map_err(|error| RigError::Failed(error.into()))?;
        let plant = &self.simulated.plant;
        let of = |derivative: usize| coordinates.iter().map(|row| plant.point(row)[derivative]).collect();
        let State { q2, dq2, .. } = plant.state();
        let state = StructureState { displacements: of(0), velocities: of(1), q2, dq2 };
        self.simulated.plant.replace_host(structure.host.clone(), &state)?;
        self.sensor = structure.response();
        self.structure = structure;
        Ok(())
    }

    /// Cuts the stinger. Returns the structure with it.
    fn cut_stinger(&mut self) -> Result<Option<Structure>, RigError> {
        self.driven = 0.0;
        let Some(cut) = self.structure.with_broken_stinger() else {
            return Ok(None);
        };
        let attached = self.structure.clone();
        self.becomes(cut.map_err(|error| RigError::Failed(error.into()))?)?;
        Ok(Some(attached))
    }

    /// What fails, is cut or attached now: `command`, V, is the amplitude of the drive. The next drive begins with the stinger again: a check of the
    /// loop ends with a release, too.
    fn change(&mut self, command: f64) -> Result<(), RigError> {
        if command > 0.0
            && let Some(attached) = self.attached.take()
        {
            self.becomes(attached)?;
        }
        let begins = |(_, at): &mut (ShakerFault, f64)| self.simulated.clock.time() >= *at;
        let fault = self.fault.take_if(begins).map(|(fault, _)| fault);
        let Some(shaker) = &mut self.structure.shaker else {
            return Ok(());
        };
        self.driven = command.max(self.driven);
        let is_released = command == 0.0 && self.driven > 0.0 && shaker.release == Release::Cut;
        match fault {
            Some(ShakerFault::AmplifierClips) => self.clipped_at = 0.5 * command,
            Some(fault @ ShakerFault::AtStop) => {
                let [at, velocity, _] = self.simulated.plant.point(&shaker.rows.armature);
                if at * velocity > 0.0 {
                    shaker.limits.stroke = Some(at.abs());
                } else {
                    self.fault = Some((fault, 0.0));
                }
            }
            Some(ShakerFault::StingerBreaks) => _ = self.cut_stinger()?,
            None if is_released => self.attached = self.cut_stinger()?,
            None => {}
        }
        Ok(())
    }

    /// Advances under a drive, m, N or V; a command is clipped, and the other limits of a shaker are looked at.
    ///
    /// # Errors
    /// A value that is not allowed; a limit of the shaker.
    pub fn step(&mut self, drive: lovines::Drive, step: f64) -> Result<(), RigError> {
        self.commanded(drive.amplitude.hypot(drive.signal[0]), drive, step)
    }

    /// The same under a command of this amplitude, of which a held sample can be zero.
    fn commanded(&mut self, command: f64, drive: lovines::Drive, step: f64) -> Result<(), RigError> {
        self.change(command)?;
        let Some(shaker) = &self.structure.shaker else {
            return self.simulated.step(drive, step);
        };
        let Simulated { plant, clock, .. } = &mut self.simulated;
        plant.set_time(clock.time());
        plant.advance_within(self.clipped_at, drive, step)?;
        clock.advance(step);
        for (name, key, channel) in shaker.limited() {
            let value = channel.read(plant);
            // The command is clipped at the limit itself.
            if let Some(limit) = channel.limit.filter(|limit| value.abs() > limit * (1.0 + 1e-9)) {
                return Err(RigError::ShakerLimit { name, key, value, limit, unit: channel.unit });
            }
        }
        Ok(())
    }

    /// The reference, m or N: the drive, the force cell or the table.
    fn reference(&self) -> f64 {
        let plant = &self.simulated.plant;
        let Some(SceneShaker { rows, .. }) = &self.structure.shaker else {
            return plant.base_displacement();
        };
        let row = match self.structure.excitation {
            Reference::Base => &rows.end,
            Reference::Force => &rows.force,
        };
        plant.point(row)[0]
    }
}

impl Rig for SimulatedStructure {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        let [response, ..] = self.simulated.plant.point(&self.sensor);
        Ok(Sensors { response, reference: Some(self.reference()) })
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        let of_plant = of_plant(drive);
        self.commanded(drive.amplitude.hypot(of_plant.signal[0]), of_plant, step)
    }

    fn cell_displacement(&mut self) -> Result<f64, RigError> {
        let shaker = self.structure.shaker.as_ref();
        Ok(shaker.map_or(0.0, |shaker| self.simulated.plant.point(&shaker.rows.end)[0]))
    }

    fn ground_truth(&mut self) -> Result<Option<GroundTruth>, RigError> {
        self.simulated.ground_truth()
    }
}
