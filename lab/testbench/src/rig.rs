//! The two sides of the bench: a *rig* takes a drive and returns sensor samples, a *controller* turns sensor samples into a
//! drive. An experiment uses only these two traits, so an FMU, a network peer or hardware can replace either side.

mod chain;
mod faulty;
mod reference_control;
mod stages;

use std::error::Error;

use lovines::{InvalidValue, Parameters, Plant, Primary, Refused, Row, Single, State, StructureState};
use phase_lock::{Config, ConfigError, Input, Output, PhaseLock};
pub use phase_lock::{Fault, LoopState, Move};
use thiserror::Error;
use vines_model::{Definition, Sensor};

use crate::knowledge::Target;
pub use crate::knowledge::has_friction;
use crate::scene::{Excitation, Release, Scene, SceneShaker, Structure};

pub use chain::Chain;
pub use faulty::{RigFault, SensorFault, faulty};
pub(crate) use reference_control::OFF;
pub(crate) use stages::derivative;
pub use stages::{Interrupted, Measured, Scaled, SensorsOnly, Stoppable};

/// What the controller asks of the rig for the coming sample period.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Drive {
    /// Frequency of the base motion, rad/s.
    pub omega: f64,
    /// Amplitude of the base motion, m.
    pub amplitude: f64,
    /// Present base displacement, m, for a rig that is driven by samples.
    pub displacement: f64,
}

/// What the sensors of the rig read.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Sensors {
    /// Response, m, m/s or m/s², as the definition of resonance says.
    pub response: f64,
    /// Motion of the base, m, m/s or m/s², where a sensor reads it.
    pub reference: Option<f64>,
}

impl Sensors {
    /// Readings in SI units as displacements, m, as a loop with this target takes them.
    #[must_use]
    pub fn scaled(self, target: &Target) -> Self {
        Self {
            response: self.response * target.scale(0),
            reference: self.reference.map(|value| value * target.scale(1)),
        }
    }

    /// Readings in SI units, from [`Sensors::scaled`].
    #[must_use]
    pub fn unscaled(self, target: &Target) -> Self {
        Self {
            response: self.response / target.scale(0),
            reference: self.reference.map(|value| value / target.scale(1)),
        }
    }
}

/// What only a simulated rig knows, in addition to its sensors.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct GroundTruth {
    /// Impacts since the start.
    pub impacts: i64,
    /// Time of the last one, s.
    pub impact_time: f64,
    /// Relative velocity just before the last one, m/s: its sign identifies the wall.
    pub impact_velocity: f64,
    /// Velocity of the particle, m/s.
    pub particle_velocity: f64,
    /// What friction has done, where there is friction and the rig reports it.
    pub friction: Option<FrictionTotals>,
}

/// What friction in the cavity has done since the start.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct FrictionTotals {
    /// How often the particle stuck to the floor inside the cavity.
    pub sticks: i64,
    /// How long it stuck there, s.
    pub stuck_time: f64,
    /// Energy lost to friction, J.
    pub loss: f64,
}

/// A rig: anything that can be driven and measured.
pub trait Rig {
    /// What the sensors read now.
    ///
    /// # Errors
    /// Errors of the implementation: a refused call, a lost connection.
    fn sense(&mut self) -> Result<Sensors, RigError>;

    /// Drives the rig for one sample period of `step` seconds.
    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError>;

    /// Holds the base at the displacement of the drive for one sample period of `step` seconds.
    fn hold(&mut self, _drive: Drive, _step: f64) -> Result<(), RigError> {
        Err(RigError::NoHold)
    }

    /// Displacement of the force cell, m, from which the acceleration of the mass before it follows.
    fn cell_displacement(&mut self) -> Result<f64, RigError> {
        Ok(0.0)
    }

    /// The ground truth, if the rig is a simulation.
    fn ground_truth(&mut self) -> Result<Option<GroundTruth>, RigError> {
        Ok(None)
    }
}

/// A stage of the pipeline around a rig: it changes what is read or how the rig is driven, and passes everything else on.
pub trait RigStage {
    /// The rig that this stage surrounds, with the stages nearer to it.
    fn inner(&mut self) -> &mut dyn Rig;

    /// What the next stage or the controller reads: [`Rig::sense`].
    fn sense(&mut self) -> Result<Sensors, RigError> {
        self.inner().sense()
    }

    /// [`Rig::advance`].
    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        self.inner().advance(drive, step)
    }

    /// [`Rig::hold`].
    fn hold(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        self.inner().hold(drive, step)
    }

    /// [`Rig::cell_displacement`].
    fn cell_displacement(&mut self) -> Result<f64, RigError> {
        self.inner().cell_displacement()
    }

    /// [`Rig::ground_truth`].
    fn ground_truth(&mut self) -> Result<Option<GroundTruth>, RigError> {
        self.inner().ground_truth()
    }
}

impl<S: RigStage> Rig for S {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        RigStage::sense(self)
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        RigStage::advance(self, drive, step)
    }

    fn hold(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        RigStage::hold(self, drive, step)
    }

    fn cell_displacement(&mut self) -> Result<f64, RigError> {
        RigStage::cell_displacement(self)
    }

    fn ground_truth(&mut self) -> Result<Option<GroundTruth>, RigError> {
        RigStage::ground_truth(self)
    }
}

/// Output of a controller at a sample.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Command {
    /// The drive for the coming sample period.
    pub drive: Drive,
    /// Phase of the response relative to the base, less the target, rad; absent if it cannot be measured.
    pub phase_error: Option<f64>,
    /// Whether phase, frequency and amplitude have been stationary for the controller's dwell time; absent if it does not say so, and the
    /// bench judges.
    pub settled: Option<bool>,
    /// State of the loop; absent if the controller does not report it.
    pub state: Option<LoopState>,
    /// Why the controller switched the drive off.
    pub fault: Option<Fault>,
}

/// A controller: anything that can hold a rig at phase resonance.
pub trait Controller {
    /// Processes one sample; `active` switches the drive on. Returns the drive.
    ///
    /// # Errors
    /// Errors of the implementation: a refused call, a lost connection.
    fn sample(&mut self, sensors: Sensors, active: bool) -> Result<Command, ControllerError>;

    /// Controls the amplitude of the response from now on, moves it as stated, and holds the phase `phase_target`, rad.
    ///
    /// # Errors
    /// A controller that cannot control the response, or cannot do so now.
    fn hold_response(&mut self, _to: Move, _phase_target: f64) -> Result<(), ControllerError> {
        Err(ControllerError::NoResponseLoop(Vec::new()))
    }

    /// Controls the amplitude of the drive again, at its setpoint.
    fn hold_drive(&mut self) -> Result<(), ControllerError> {
        Err(ControllerError::NoResponseLoop(Vec::new()))
    }
}

// Why one side of the bench cannot go on.

/// The error of an implementation: of an FMU, or of a link to a peer.
type Cause = Box<dyn Error + Send + Sync>;

/// Why a rig cannot go on.
#[derive(Debug, Error)]
#[expect(missing_docs, reason = "the messages explain the variants")]
pub enum RigError {
    #[error("the rig: {0}")]
    Failed(#[from] Cause),
    #[error("the rig: {0}")]
    Refused(#[from] InvalidValue),
    #[error("the rig: {0}")]
    Structure(#[from] Refused),
    #[error(
        "the shaker reached its limit: the {name} is {value:.3e} {unit}, and shaker.{key} allows {limit} {unit}; its amplifier has switched off"
    )]
    ShakerLimit {
        name: &'static str,
        key: &'static str,
        value: f64,
        limit: f64,
        unit: &'static str,
    },
    #[error(
        "the shaker does not follow: {asked:.3e} {unit} are asked for, and the measured fundamental is off by {error:.3e} {unit} for {periods:.1} periods; {cause}"
    )]
    ReferenceOff {
        asked: f64,
        error: f64,
        periods: f64,
        unit: &'static str,
        cause: &'static str,
    },
    #[error(
        "the {} contradicts the command: by the path that the check has measured, command and response give {expected:.3e} {unit}, and {read:.3e} {unit} \
         are read. Check the amplifier (does it clip?), the stinger, and the {} with its cable",
        reference_of(unit),
        sensor_of(unit)
    )]
    PathContradicted {
        expected: f64,
        read: f64,
        unit: &'static str,
    },
    #[error(
        "the amplifier is at its limit: the drive asked for needs {times:.2} times the command that voltage_max or current_max of [shaker] allows; lower \
         the drive, or the responses of the backbone"
    )]
    AmplifierLimit { times: f64 },
    #[error(
        "the rig accepts frequency and amplitude only, not samples of the base displacement: chain.hold = true and \
         helic devices need a rig that does"
    )]
    NoHold,
}

/// What the control of a shaker reads, by its unit.
fn reference_of(unit: &str) -> &'static str {
    if unit == "N" { "force" } else { "table" }
}

/// The sensor of the reference, by its unit.
fn sensor_of(unit: &str) -> &'static str {
    if unit == "N" {
        "force cell"
    } else {
        "sensor on the table"
    }
}

/// Why a controller cannot go on.
#[derive(Debug, Error)]
#[expect(missing_docs, reason = "the messages explain the variants")]
pub enum ControllerError {
    #[error("the controller: {0}")]
    Failed(#[source] Cause),
    /// With the names of what it lacks, where these are known.
    #[error(
        "the controller cannot hold the amplitude of the response{}; use the built-in controller or PhaseLock.fmu, here or across the network",
        lacking(.0)
    )]
    NoResponseLoop(Vec<String>),
    #[error("the controller: {0}")]
    Refused(#[from] ConfigError),
}

fn lacking(names: &[String]) -> String {
    match names {
        [] => String::new(),
        names => format!(": it lacks {}", names.join(", ")),
    }
}

impl RigError {
    /// The error of the implementation, if it is an `E`.
    pub fn cause<E: Error + 'static>(&self) -> Option<&E> {
        self.source()?.downcast_ref()
    }
}

impl ControllerError {
    /// The error of the implementation, if it is an `E`.
    pub fn cause<E: Error + 'static>(&self) -> Option<&E> {
        self.source()?.downcast_ref()
    }
}

/// Time of a simulation in steps: their number times their length since that has changed. A sum of steps would carry a rounding error of
/// each, and a component with a clock of its own would now and then make no step, or two.
#[derive(Clone, Copy, Debug, Default)]
pub struct Clock {
    origin: f64,
    count: u32,
    step: f64,
}

impl Clock {
    /// The time, s.
    pub fn time(&self) -> f64 {
        self.origin + f64::from(self.count) * self.step
    }

    /// Goes on by a step, s.
    pub fn advance(&mut self, step: f64) {
        if step != self.step {
            *self = Self { origin: self.time(), count: 0, step };
        }
        self.count += 1;
    }
}

// The simulated plant as a rig, without an FMU.

/// The plant, stepped directly.
#[derive(Clone)]
pub struct Simulated<P: Primary = Single> {
    plant: Plant<P>,
    sensor: Sensor,
    clock: Clock,
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
        Ok(match &scene.structure {
            None => Box::new(Self::new(scene.plant, scene.start)?.with_sensors(scene.resonance)),
            Some(structure) => {
                let rig = SimulatedStructure::new(structure, scene.plant, scene.start)?;
                Box::new(Measured::new(rig, scene.resonance, &scene.plant).compensating(Some(structure)))
            }
        })
    }

    /// This plant with the sensors of a definition.
    pub fn with_sensors(mut self, definition: Definition) -> Measured<Self> {
        self.sensor = definition.sensor;
        let parameters = *self.plant.parameters();
        Measured::new(self, definition, &parameters)
    }
}

impl<P: Primary> Simulated<P> {
    fn step(&mut self, drive: lovines::Drive, step: f64) -> Result<(), RigError> {
        self.plant.set_time(self.clock.time());
        self.plant.advance(drive, step)?;
        self.clock.advance(step);
        Ok(())
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
        self.step(lovines::Drive::harmonic(drive.amplitude, drive.omega), step)
    }

    fn hold(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        self.step(lovines::Drive::held(drive.displacement), step)
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

// A structure as a rig of the bench, which measures the oscillator of its driven mode.

/// A simulated structure. Its drive is the base displacement that moves the oscillator of the driven mode as the drive moves the mode, and its
/// response the displacement of the driven mode at the cavity that the sensor would read: both m, and the loop, its limits and results are
/// those of one oscillator.
#[derive(Clone)]
pub struct SimulatedStructure {
    simulated: Simulated<lovines::Structure>,
    structure: Structure,
    /// The displacement at the sensor, by the sections.
    sensor: Row,
    /// Base displacement per command, and displacement at the sensor per displacement at the cavity.
    base_per_command: f64,
    reading_per_response: f64,
    /// Largest command that the amplifier passes on, V.
    clipped_at: f64,
    /// What fails, and when, s.
    fault: Option<(ShakerFault, f64)>,
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
            base_per_command: structure.base_per_command(),
            reading_per_response: structure.reading_per_response().abs(),
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

    /// With a fault of the shaker that begins after some seconds.
    #[must_use]
    pub fn failing(self, fault: ShakerFault, seconds: f64) -> Self {
        Self { fault: Some((fault, seconds)), ..self }
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
        let rows = &shaker.rows;
        let limits = &shaker.limits;
        for (name, key, row, per_command, limit, unit) in [
            (
                "voltage",
                "voltage_max",
                &rows.voltage,
                rows.voltage_per_command,
                limits.voltage,
                "V",
            ),
            (
                "current",
                "current_max",
                &rows.current,
                rows.current_per_command,
                limits.current,
                "A",
            ),
            (
                "displacement of the armature",
                "stroke_max",
                &rows.armature,
                0.0,
                limits.stroke,
                "m",
            ),
            ("force", "force_max", &rows.force, 0.0, limits.force, "N"),
        ] {
            let value = plant.point(row)[0] + per_command * plant.base_displacement();
            // The command is clipped at the limit itself.
            if let Some(limit) = limit.filter(|limit| value.abs() > limit * (1.0 + 1e-9)) {
                return Err(RigError::ShakerLimit { name, key, value, limit, unit });
            }
        }
        Ok(())
    }

    /// The reference as a base displacement, m: the drive, the force cell or the table.
    fn reference(&self) -> f64 {
        let plant = &self.simulated.plant;
        let Some(SceneShaker { rows, .. }) = &self.structure.shaker else {
            return plant.base_displacement() * self.base_per_command;
        };
        let row = match self.structure.excitation {
            Excitation::Base => &rows.end,
            Excitation::Force => &rows.force,
        };
        self.structure.base_per_drive() * plant.point(row)[0]
    }
}

impl RigStage for SimulatedStructure {
    fn inner(&mut self) -> &mut dyn Rig {
        &mut self.simulated
    }

    fn sense(&mut self) -> Result<Sensors, RigError> {
        let [displacement, ..] = self.simulated.plant.point(&self.sensor);
        Ok(Sensors {
            response: displacement / self.reading_per_response,
            reference: Some(self.reference()),
        })
    }

    fn cell_displacement(&mut self) -> Result<f64, RigError> {
        let shaker = self.structure.shaker.as_ref();
        Ok(shaker.map_or(0.0, |shaker| self.simulated.plant.point(&shaker.rows.end)[0]))
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        let amplitude = drive.amplitude / self.base_per_command;
        self.step(lovines::Drive::harmonic(amplitude, drive.omega), step)
    }

    fn hold(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        let [command, sample] =
            [drive.amplitude.hypot(drive.displacement), drive.displacement].map(|value| value / self.base_per_command);
        self.commanded(command, lovines::Drive::held(sample), step)
    }
}

// The built-in phase-locked loop as a controller of the bench.

/// The built-in controller.
#[derive(Clone)]
pub struct BuiltIn {
    /// Its coefficients.
    pub lock: PhaseLock,
    /// Its state.
    pub state: phase_lock::State,
    /// Its output at the last sample.
    pub output: Output,
}

impl BuiltIn {
    /// The controller of a configuration, at its start.
    pub fn new(config: &Config) -> Result<Self, ConfigError> {
        let lock = config.build()?;
        Ok(Self { state: lock.start(), output: lock.idle(), lock })
    }
}

impl From<Output> for Command {
    fn from(output: Output) -> Self {
        let Output { omega, amplitude, drive: displacement, .. } = output;
        Self {
            drive: Drive { omega, amplitude, displacement },
            phase_error: output.phase_error,
            settled: Some(output.settled),
            state: Some(output.state),
            fault: output.fault,
        }
    }
}

impl Controller for BuiltIn {
    fn sample(&mut self, sensors: Sensors, active: bool) -> Result<Command, ControllerError> {
        let Sensors { response, reference } = sensors;
        let input = Input { response, reference, active };
        self.output = self.lock.process(&mut self.state, input);
        Ok(self.output.into())
    }

    fn hold_response(&mut self, to: Move, phase_target: f64) -> Result<(), ControllerError> {
        self.lock.retune(self.lock.config().amplitude, phase_target)?;
        Ok(self.lock.hold_response(&mut self.state, to)?)
    }

    fn hold_drive(&mut self) -> Result<(), ControllerError> {
        self.lock.hold_drive(&mut self.state);
        Ok(())
    }
}
