//! `--rig` and `--controller`: what stands on either side of the bench.

use std::{path::PathBuf, str::FromStr};

use vines::{
    rig::{BuiltIn, Controller, FmuController, FmuRig, Rig, Simulated},
    scene::Scene,
};

use super::failure::Failure;

/// What stands behind a door, as written on the command line.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Door {
    /// `built-in`: this program's own, with nothing in between.
    BuiltIn,
    /// The path of an FMU.
    Fmu(PathBuf),
}

impl FromStr for Door {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        if text == "built-in" {
            return Ok(Self::BuiltIn);
        }
        let file = PathBuf::from(text);
        if file.is_file() {
            Ok(Self::Fmu(file))
        } else {
            Err(format!(
                "{text} is not there; give `built-in` or the path of an FMU"
            ))
        }
    }
}

impl Door {
    /// The rig behind this door.
    pub(super) fn rig(&self, scene: &Scene) -> Result<Box<dyn Rig>, Failure> {
        Ok(match self {
            Self::BuiltIn => Box::new(Simulated::new(scene).map_err(Failure::input)?),
            Self::Fmu(file) => Box::new(FmuRig::load(file, scene).map_err(Failure::run)?),
        })
    }

    /// The controller behind this door.
    pub(super) fn controller(&self, scene: &Scene) -> Result<Box<dyn Controller>, Failure> {
        Ok(match self {
            Self::BuiltIn => Box::new(BuiltIn::new(scene).map_err(Failure::input)?),
            Self::Fmu(file) => Box::new(FmuController::load(file, scene).map_err(Failure::run)?),
        })
    }
}
