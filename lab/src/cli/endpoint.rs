//! `--rig` and `--controller`: the implementations of the two sides of the bench.

use std::{
    path::PathBuf,
    str::FromStr,
    sync::{Arc, OnceLock},
};

use clap::Args;
use vines::{
    fmu::{FmuController, FmuRig},
    net::{Address, BindScope, NetController, NetRig, Timing},
    rig::{BuiltIn, Chain, Controller, Rig, Simulated},
    scene::Scene,
};

use super::{
    failure::Failure,
    interrupt::{Interruptible, stop_flag},
};

/// An implementation, as written on the command line.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Endpoint {
    /// `built-in`: that of this program.
    BuiltIn,
    /// The path of an FMU.
    Fmu(PathBuf),
    /// `tcp://HOST:PORT` or `udp://HOST:PORT`.
    Network(String),
}

impl FromStr for Endpoint {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        if text == "built-in" {
            return Ok(Self::BuiltIn);
        }
        if text.contains("://") {
            return Ok(Self::Network(text.into()));
        }
        let file = PathBuf::from(text);
        if file.is_file() {
            Ok(Self::Fmu(file))
        } else {
            Err(format!(
                "{text} does not exist; give `built-in`, the path of an FMU, tcp://HOST:PORT, or for a rig in real time \
                 udp://HOST:PORT"
            ))
        }
    }
}

/// A rig.
pub(super) struct OpenRig {
    pub rig: Interruptible,
    /// In real time, the longest silence that it tolerates, s.
    pub pace: Option<f64>,
    /// In real time, what it reports when the session has ended.
    timing: Arc<OnceLock<Timing>>,
}

impl OpenRig {
    /// Ends the session of a rig in real time. Its report tells how it kept its time.
    pub(super) fn close(self) -> Option<Timing> {
        drop(self.rig);
        self.timing.get().copied()
    }
}

impl Endpoint {
    /// The rig of this endpoint.
    pub(super) fn rig(&self, scene: &Scene, scope: BindScope) -> Result<OpenRig, Failure> {
        let (mut pace, mut timing) = (None, Arc::default());
        let rig: Box<dyn Rig> = match self {
            Self::BuiltIn => {
                let plant = Simulated::new(scene.plant, scene.start).map_err(Failure::input)?;
                Box::new(plant.with_sensors(scene.resonance))
            }
            Self::Fmu(file) => {
                let rig = FmuRig::load(file, &scene.start_values(), scene.resonance, &scene.plant);
                Box::new(rig.map_err(Failure::run)?)
            }
            Self::Network(address) => {
                let rig = NetRig::connect(Address::parse(address, scope)?, scene.sample_time())?;
                let rig = rig.with_sensors(scene.resonance)?;
                pace = rig.pace();
                timing = rig.timing();
                Box::new(rig)
            }
        };
        let (d, samples) = (scene.dimensionless(), scene.controller.samples_per_period);
        let rig = Chain::around(rig, &scene.chain, &d, samples);
        let rig = Interruptible::around(rig, scene.sample_time(), &stop_flag()?);
        Ok(OpenRig { rig, pace, timing })
    }

    /// The controller of this endpoint, for a rig of that `pace`.
    pub(super) fn controller(
        &self,
        scene: &Scene,
        scope: BindScope,
        pace: Option<f64>,
    ) -> Result<Box<dyn Controller>, Failure> {
        Ok(match self {
            Self::BuiltIn => Box::new(BuiltIn::new(&scene.controller_config()).map_err(Failure::input)?),
            Self::Fmu(file) => Box::new(FmuController::load(file, &scene.controller_config()).map_err(Failure::run)?),
            Self::Network(address) => match Address::parse(address, scope)? {
                Address::Tcp(peer) => Box::new(NetController::connect(peer, scene.sample_time(), pace)?),
                Address::Udp(_) => {
                    return Err(Failure::input(format!(
                        "{address}: a controller has an address tcp://HOST:PORT"
                    )));
                }
            },
        })
    }
}

/// Refuses settings with which no experiment can begin, before anything is written or driven.
pub(super) fn check(scene: &Scene) -> Result<(), Failure> {
    BuiltIn::new(&scene.controller_config()).map_err(Failure::input)?;
    Ok(())
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
