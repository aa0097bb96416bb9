//! A rig that is an FMU, loaded through the `fmi` crate: ours, or anybody's with the same variable names.

use std::path::{Path, PathBuf};

use fmi::fmi2::Fmi2Error;
use fmi::fmi2::import::Fmi2Import;
use fmi::fmi2::instance::{CoSimulation, Common, InstanceCS};
use fmi::traits::FmiImport;
use thiserror::Error;

use super::{Drive, Rig, Sensors, Witness};
use crate::scene::Scene;

/// Why a rig cannot go on.
#[derive(Debug, Error)]
pub enum RigError {
    /// The file is not an FMU that can be loaded here.
    #[error("cannot load {}: {source}", path.display())]
    Load {
        /// The FMU.
        path: PathBuf,
        /// What the loader said.
        source: fmi::Error,
    },
    /// The FMU lacks a variable that the bench needs.
    #[error("{} has no variable `{name}`, which the bench needs", path.display())]
    Variable {
        /// The FMU.
        path: PathBuf,
        /// What was looked for.
        name: &'static str,
    },
    /// The FMU refused a call; its own message has been logged.
    #[error("the rig refused to {action} at t = {time} s: {source}")]
    Refused {
        /// What was asked of it.
        action: &'static str,
        /// Simulated time, s.
        time: f64,
        /// The status it returned.
        source: Fmi2Error,
    },
}

/// Parameters and start of the plant, under the names of its variables.
pub(crate) fn start_values(scene: &Scene) -> [(&'static str, f64); 10] {
    let (plant, start) = (&scene.plant, &scene.start);
    [
        ("M", plant.mass),
        ("k", plant.stiffness),
        ("c", plant.damping),
        ("m", plant.particle_mass),
        ("b", plant.half_width),
        ("r", plant.restitution),
        ("q1", start.q1),
        ("der(q1)", start.dq1),
        ("q2", start.q2),
        ("der(q2)", start.dq2),
    ]
}

type Reference = <Fmi2Import as FmiImport>::ValueRef;

/// A plant FMU, initialised and stepped through FMI 2.0 co-simulation.
pub struct FmuRig {
    instance: InstanceCS,
    /// Keeps the unpacked FMU on disk while the instance lives.
    _import: Fmi2Import,
    time: f64,
    inputs: [Reference; 2],
    /// `v` and `base`.
    sensors: [Reference; 2],
    /// `impact_time`, `impact_velocity` and `der(q2)`.
    witness: [Reference; 3],
    impacts: Reference,
}

impl FmuRig {
    /// Loads the plant at `path` and initialises it with the parameters and the start of the scene.
    ///
    /// # Errors
    /// An FMU that cannot be loaded, lacks a variable, or refuses a value.
    pub fn load(path: &Path, scene: &Scene) -> Result<Self, RigError> {
        let loaded = |source| RigError::Load {
            path: path.into(),
            source,
        };
        let import: Fmi2Import = fmi::import::from_path(path).map_err(loaded)?;
        let find = |name: &'static str| {
            let variables = &import.model_description().model_variables.variables;
            variables
                .iter()
                .find(|variable| variable.name == name)
                .map(|variable| variable.value_reference)
                .ok_or(RigError::Variable {
                    path: path.into(),
                    name,
                })
        };
        let (mut references, mut numbers) = (Vec::new(), Vec::new());
        for (name, value) in start_values(scene) {
            references.push(find(name)?);
            numbers.push(value);
        }
        let inputs = [find("omega")?, find("E")?];
        let sensors = [find("v")?, find("base")?];
        let witness = [
            find("impact_time")?,
            find("impact_velocity")?,
            find("der(q2)")?,
        ];
        let impacts = find("impacts")?;
        let mut rig = Self {
            instance: import
                .instantiate_cs("plant", false, true)
                .map_err(loaded)?,
            _import: import,
            time: 0.0,
            inputs,
            sensors,
            witness,
            impacts,
        };
        rig.asked("take its parameters", |i| i.set_real(&references, &numbers))?;
        rig.asked("start", |i| i.setup_experiment(None, 0.0, None))?;
        rig.asked("start", Common::enter_initialization_mode)?;
        rig.asked("start", Common::exit_initialization_mode)?;
        Ok(rig)
    }

    fn asked<T>(
        &mut self,
        action: &'static str,
        call: impl FnOnce(&mut InstanceCS) -> Result<T, Fmi2Error>,
    ) -> Result<T, RigError> {
        call(&mut self.instance).map_err(|source| RigError::Refused {
            action,
            time: self.time,
            source,
        })
    }
}

impl Rig for FmuRig {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        let (references, mut values) = (self.sensors, [0.0; 2]);
        self.asked("read its sensors", |i| i.get_real(&references, &mut values))?;
        Ok(Sensors {
            response: values[0],
            reference: Some(values[1]),
        })
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        let (references, time) = (self.inputs, self.time);
        self.asked("take a drive", |i| {
            i.set_real(&references, &[drive.omega, drive.amplitude])
        })?;
        self.asked("advance", |i| i.do_step(time, step, true))?;
        self.time += step;
        Ok(())
    }

    fn witness(&mut self) -> Result<Option<Witness>, RigError> {
        let (references, mut values) = (self.witness, [0.0; 3]);
        self.asked("tell its impacts", |i| i.get_real(&references, &mut values))?;
        let (reference, mut impacts) = ([self.impacts], [0]);
        self.asked("tell its impacts", |i| {
            i.get_integer(&reference, &mut impacts)
        })?;
        Ok(Some(Witness {
            impacts: i64::from(impacts[0]),
            impact_time: values[0],
            impact_velocity: values[1],
            particle_velocity: values[2],
        }))
    }
}
