//! `vines controller`: the phase-locked loop at a network address.

use clap::Args;
use vines::net::{Address, Role, Served, Service};
use vines::rig::BuiltIn;

use super::serving::{ServingArguments, positive};
use super::{failure::Failure, scene_arguments::SceneArguments};

const HELP: &str = "\
Examples:
  vines controller --listen 127.0.0.1:5511      then: vines identify --controller tcp://127.0.0.1:5511
  vines controller --listen 127.0.0.1:5511 --sensors-only     for a rig that is at rest at the start, as a real one

Answers every reading with a drive. After --silence the session ends. See docs/network-protocol.md.

The server listens on this machine only, unless --key or --allow-remote is given. With --key, every frame is authenticated; nothing is
encrypted. Without it, everyone who can reach the address can drive the rig.";

/// Serve the phase-locked loop to a rig or an experiment across the network
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(super) struct Arguments {
    #[command(flatten)]
    scene: SceneArguments,

    #[command(flatten)]
    serving: ServingArguments,

    /// The rig is at rest at the start and shows its sensors only, as a real one: the controller captures a motion with impacts from rest
    /// (use it with `vines rig --sensors-only`)
    #[arg(long)]
    sensors_only: bool,

    /// Longest silence before the session is shut down, s
    #[arg(long, value_name = "SECONDS", default_value_t = 5.0, value_parser = positive)]
    silence: f64,
}

pub(super) fn run(arguments: &Arguments) -> Result<String, Failure> {
    let mut scene = arguments.scene.load()?;
    if arguments.sensors_only {
        scene.start = Default::default();
    }
    let first = BuiltIn::new(&scene.controller_config())?;
    let service = Service {
        role: Role::Controller,
        sample_time: scene.sample_time(),
        silence: arguments.silence,
    };
    let make = || Ok(Served::Controller(Box::new(first.clone())));
    arguments
        .serving
        .serve("controller", Address::Tcp, service, make, |_| {})
}
