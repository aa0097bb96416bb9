//! `vines controller`: the phase-locked loop at a network address.

use clap::Args;
use vines::net::{Address, Role, Served, Service};
use vines::rig::BuiltIn;

use super::serving::{ServingArguments, positive};
use super::{failure::Failure, scene_arguments::SceneArguments};

const HELP: &str = "\
Examples:
  vines controller --listen 127.0.0.1:5511      then: vines identify --controller tcp://127.0.0.1:5511

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

    /// Longest silence before the session is shut down, s
    #[arg(long, value_name = "SECONDS", default_value_t = 5.0, value_parser = positive)]
    silence: f64,
}

pub(super) fn run(arguments: &Arguments) -> Result<String, Failure> {
    let scene = arguments.scene.load()?;
    let controller = BuiltIn::new(&scene.controller_config())?;
    let service = Service {
        role: Role::Controller,
        sample_time: scene.sample_time(),
        silence: arguments.silence,
    };
    let make = || Ok(Served::Controller(Box::new(controller.clone())));
    arguments
        .serving
        .serve("controller", Address::Tcp, service, make, |_| {})
}
