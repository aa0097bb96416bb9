//! What the commands share that drive a rig through an experiment.

use std::path::PathBuf;

use clap::Args;
use vines::{experiment::ExperimentError, loop_check, net::BindScope, rig::Rig, scene::Scene};

use super::endpoint::{Endpoint, ReachArguments};
use super::{check, failure::Failure, output::log_warnings, scene_arguments::SceneArguments};

#[derive(Debug, Args)]
pub(super) struct ExperimentArguments {
    #[command(flatten)]
    scene: SceneArguments,

    /// Folder for the results; created if it does not exist
    #[arg(long, value_name = "DIR", default_value = "out")]
    pub out: PathBuf,

    /// The controller: `built-in`, an FMU (for `vines backbone` with the inputs `hold_response` and `move.*` of PhaseLock.fmu), or
    /// tcp://HOST:PORT
    #[arg(long, value_name = "ENDPOINT", default_value = "built-in")]
    pub controller: Endpoint,

    #[command(flatten)]
    reach: ReachArguments,

    /// Do not check the loop of a rig that is not a simulation first; see `vines check`
    #[arg(long)]
    no_check: bool,

    /// Print the results as JSON instead of a table
    #[arg(long)]
    pub json: bool,
}

impl ExperimentArguments {
    /// The scene, and the network addresses that are allowed.
    pub(super) fn begin(&self) -> Result<(Scene, BindScope), Failure> {
        let scene = self.scene.load()?;
        log_warnings();
        Ok((scene, self.reach.reach()?))
    }

    /// Checks a rig that is not a simulation, and refuses one that is not as expected. Such a rig starts at rest.
    pub(super) fn check_loop(&self, rig: &mut impl Rig, scene: &mut Scene) -> Result<(), Failure> {
        rig.sense().map_err(ExperimentError::from)?;
        if rig.ground_truth().map_err(ExperimentError::from)?.is_some() {
            return Ok(());
        }
        scene.start = Default::default();
        if self.no_check {
            return Ok(());
        }
        let found = loop_check::check(rig, scene).map_err(ExperimentError::from)?;
        eprint!("{}", check::described(&found));
        scene.measured = found.linear.map(|linear| linear.response());
        if let Some(measured) = &scene.measured {
            eprintln!(
                "All values of sigma share a standard uncertainty of {:.1e}, that of the natural frequency.",
                measured.uncertainty / scene.dimensionless().omega_change(1.0)
            );
        }
        match found.verdict {
            loop_check::Verdict::Healthy => Ok(()),
            verdict => Err(Failure::run(format!(
                "the loop check failed, and the drive is off: {verdict}; --no-check skips it"
            ))),
        }
    }
}
