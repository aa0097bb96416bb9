//! `vines controller`: the phase-locked loop at a network address.

use clap::Args;
use vines::net::{ControllerServer, ControllerService};
use vines::rig::{BuiltIn, Controller};

use super::{
    failure::Failure,
    scene_arguments::SceneArguments,
    serving::{ServingArguments, positive},
};

const HELP: &str = "\
Examples:
  vines controller --listen 127.0.0.1:5511      then: vines identify --controller udp://127.0.0.1:5511

Answers every reading with a drive. The last valid reading replaces a lost one. After --silence the session ends, and
further readings are answered without a drive. See docs/network-protocol.md.

The server listens on this machine only, unless --allow-remote is given: there is no authentication and no encryption.";

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
    let first = BuiltIn::new(&scene.controller_config()).map_err(Failure::input)?;
    let service = ControllerService { sample_time: scene.sample_time(), silence: arguments.silence };
    let mut server = ControllerServer::listen(arguments.serving.address()?, service)?;
    let (stop, tell) = arguments.serving.begin("controller", server.address()?)?;
    server
        .serve(|| Ok(Box::new(first.clone()) as Box<dyn Controller>), stop, tell)
        .map_err(Failure::run)?;
    Ok(String::new())
}
