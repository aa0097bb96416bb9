//! `--rig` and `--controller`: the implementations of the two sides of the bench.

use std::{path::PathBuf, str::FromStr};

use clap::Args;
use vines::{
    fmu::{FmuController, FmuRig},
    net::{BindScope, NetController, NetRig, resolve},
    rig::{BuiltIn, Chain, Controller, Rig, Simulated},
    scene::{Resonance, Scene},
};

use super::failure::Failure;

/// An implementation, as written on the command line.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Endpoint {
    /// `built-in`: that of this program.
    BuiltIn,
    /// The path of an FMU.
    Fmu(PathBuf),
    /// `udp://HOST:PORT`.
    Udp(String),
}

impl FromStr for Endpoint {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        if text == "built-in" {
            return Ok(Self::BuiltIn);
        }
        if text.starts_with("udp://") {
            return Ok(Self::Udp(text.into()));
        }
        let file = PathBuf::from(text);
        if file.is_file() {
            Ok(Self::Fmu(file))
        } else {
            Err(format!(
                "{text} does not exist; give `built-in`, the path of an FMU, or udp://HOST:PORT"
            ))
        }
    }
}

/// A rig, and, in real time, the longest silence that it tolerates, s.
pub(super) struct OpenRig {
    pub rig: Box<dyn Rig>,
    pub pace: Option<f64>,
}

impl Endpoint {
    /// The rig of this endpoint.
    pub(super) fn rig(&self, scene: &Scene, scope: BindScope) -> Result<OpenRig, Failure> {
        let mut pace = None;
        let rig: Box<dyn Rig> = match self {
            Self::BuiltIn => {
                let plant = Simulated::new(scene.plant, scene.start).map_err(Failure::input)?;
                Box::new(plant.with_sensors(scene.resonance))
            }
            Self::Fmu(file) => Box::new(FmuRig::load(file, &scene.start_values()).map_err(Failure::run)?),
            Self::Udp(address) => {
                let rig = NetRig::connect(resolve(address, scope)?, scene.sample_time())?;
                pace = rig.pace();
                Box::new(rig)
            }
        };
        let (d, samples) = (scene.dimensionless(), scene.controller.samples_per_period);
        let rig = Chain::around(rig, &scene.chain, &d, samples);
        Ok(OpenRig { rig, pace })
    }

    /// The controller of this endpoint, for a rig of that `pace`.
    pub(super) fn controller(
        &self,
        scene: &Scene,
        scope: BindScope,
        pace: Option<f64>,
    ) -> Result<Box<dyn Controller>, Failure> {
        if scene.resonance.resonance == Resonance::Peak && scene.controller.phase_target == -90.0 {
            return Err(Failure::input(
                "resonance.definition = \"peak\" with controller.phase_target = -90 degrees: the loop holds a phase, so set phase_target to the \
                 phase at the peak, which `vines orbit` prints",
            ));
        }
        Ok(match self {
            Self::BuiltIn => Box::new(BuiltIn::new(&scene.controller_config()).map_err(Failure::input)?),
            Self::Fmu(file) => Box::new(FmuController::load(file, &scene.controller_config()).map_err(Failure::run)?),
            Self::Udp(address) => {
                let peer = resolve(address, scope)?;
                Box::new(NetController::connect(peer, scene.sample_time(), pace)?)
            }
        })
    }
}

/// `--allow-remote`, which several commands share.
#[derive(Debug, Args)]
pub(super) struct ReachArguments {
    /// Allow network addresses beyond this machine. There is no authentication: anyone who can reach the address can drive the rig
    #[arg(long)]
    allow_remote: bool,
}

impl ReachArguments {
    pub(super) fn reach(&self) -> BindScope {
        if self.allow_remote {
            BindScope::Remote
        } else {
            BindScope::Loopback
        }
    }
}
