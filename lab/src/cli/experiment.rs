//! What the commands share that drive a rig through an experiment: options, loop check, doubtful results, and what is kept of a failure.

use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use clap::Args;
use phase_lock::Config;
use serde::Serialize;
use vines::experiment::{ExperimentError, Stage};
use vines::net::{ReportLost, Timing};
use vines::record::Sample;
use vines::rig::{BuiltIn, Controller, Fault, Rig};
use vines::{advice, loop_check, report, scene::Scene};

use super::options::{Endpoint, OpenRig, ReachArguments, SceneArguments};
use super::output::{output, print, writable, written};
use super::tap::Tap;
use super::watch::{Watch, WatchArguments};
use super::{check, failure::Failure, pack::fmus};

/// Share of late samples of a rig in real time above which its results are doubtful. A late sample holds the drive for one more sample: at
/// this share, the default scene has one in every period.
const TOLERATED: f64 = 0.01;
/// Exit code for doubtful results.
const LATE: u8 = 3;

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
    controller: Endpoint,

    #[command(flatten)]
    reach: ReachArguments,

    #[command(flatten)]
    watch: WatchArguments,

    /// Do not check the loop of a rig that is not a simulation first; see `vines check`
    #[arg(long)]
    no_check: bool,

    /// Write what the sensors read from the start to the end (CSV), as `vines fit` reads it
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,

    /// Print the results as JSON instead of a table
    #[arg(long)]
    pub json: bool,
}

/// What a rig in real time reports at the end of a session.
pub(super) type Closed = Option<Result<Timing, ReportLost>>;

/// A rig that has passed its loop check, and a controller, both connected.
pub(super) struct Session {
    controller: Box<dyn Controller>,
    rig: OpenRig,
    watch: Option<Watch>,
    /// The file of --record, and the samples for it.
    record: Option<(PathBuf, Rc<RefCell<Vec<Sample>>>)>,
}

impl ExperimentArguments {
    /// Loads the scene and connects rig and controller; without a rig, it is this program's FMU. Invalid settings and a folder that
    /// cannot be written to are refused before anything is driven.
    pub(super) fn start(
        &self,
        command: &str,
        rig: Option<&Endpoint>,
        config: impl Fn(&Scene) -> Config,
    ) -> Result<(Scene, Session), Failure> {
        let mut scene = self.scene.load()?;
        let watch = self.watch.start(command, &scene)?;
        let scope = self.reach.reach()?;
        BuiltIn::new(&config(&scene))?;
        writable(&self.out)?;
        let mut open = match rig {
            Some(endpoint) => endpoint.rig(&scene, scope)?,
            None => {
                let folder = tempfile::tempdir()?;
                Endpoint::Fmu(fmus(folder.path())?.swap_remove(0)).rig(&scene, scope)?
            }
        };
        self.check_loop(open.rig.as_mut(), &mut scene)?;
        let mut controller = self
            .controller
            .controller(&config(&scene), &scene.controller_names, scope, open.pace)?;
        if let Some(watch) = &watch {
            (open.rig, controller) = (watch.rig(open.rig), watch.controller(controller));
        }
        let record = self.record.clone().map(|file| (file, Rc::default()));
        if let Some((_, samples)) = &record {
            let samples: Rc<RefCell<Vec<Sample>>> = Rc::clone(samples);
            open.rig = Tap::around(open.rig, move |sample, _| samples.borrow_mut().push(sample));
        }
        Ok((scene, Session { controller, rig: open, watch, record }))
    }

    /// Checks a rig that is not a simulation, and refuses one that is not as expected. Such a rig starts at rest.
    fn check_loop(&self, rig: &mut dyn Rig, scene: &mut Scene) -> Result<(), Failure> {
        rig.sense().map_err(ExperimentError::from)?;
        if rig.ground_truth().map_err(ExperimentError::from)?.is_some() {
            return Ok(());
        }
        scene.start = Default::default();
        if self.no_check {
            return Ok(());
        }
        let checked = loop_check::check(rig, scene).map_err(ExperimentError::from)?;
        eprint!("{}", check::described(&checked));
        scene.measured = checked.linear.map(|linear| linear.response());
        if let Some(measured) = &scene.measured {
            eprintln!(
                "All values of sigma share a standard uncertainty of {:.1e}, that of the natural frequency.",
                measured.uncertainty / scene.dimensionless().omega_change(1.0)
            );
        }
        match checked.verdict {
            loop_check::Verdict::Healthy => Ok(()),
            verdict => Err(Failure::run(format!(
                "the loop check failed, and the drive is off: {verdict}; --no-check skips it"
            ))),
        }
    }

    /// The result, as JSON or as a summary with the paths that were written. If a rig in real time missed deadlines, or did not get its
    /// drives in time, stderr says so; more than a few make the results doubtful, and so does a rig that does not report.
    pub(super) fn result(
        &self,
        result: &impl Serialize,
        summary: &str,
        paths: &[PathBuf],
        timing: Closed,
    ) -> Result<String, Failure> {
        let text = output(self.json, result, || format!("{summary}\n{}", written(paths)))?;
        let doubt = |share: f64| match &timing {
            None => None,
            Some(Ok(timing)) => timing.doubt(share),
            Some(Err(lost)) => Some(lost.to_string()),
        };
        if let Some(doubt) = doubt(TOLERATED) {
            print(&text)?;
            return Err(Failure::new(LATE, format!("these results are doubtful: {doubt}")));
        }
        if let Some(reason) = doubt(0.0) {
            eprintln!("warning: {reason}");
        }
        Ok(text)
    }
}

impl Session {
    /// Measures, ends the session, and writes the file of --record. A rig in real time reports its missed deadlines. An experiment that ends
    /// early leaves what was measured in a file, and names the reason that the exact orbits know.
    pub(super) fn measure<T>(
        mut self,
        scene: &Scene,
        out: &Path,
        measure: impl FnOnce(&mut Vec<Sample>, &mut dyn Rig, &mut dyn Controller) -> Result<T, ExperimentError>,
    ) -> Result<(T, Closed), Failure> {
        let mut samples = Vec::new();
        let result = measure(&mut samples, self.rig.rig.as_mut(), self.controller.as_mut());
        drop(self.controller);
        if let (Some(watch), Err(error)) = (&mut self.watch, &result) {
            watch.failure = Some(error.to_string());
        }
        let timing = self.rig.close();
        if let Some((file, samples)) = &self.record {
            vines::write_file(file, &vines::record::table(&samples.borrow()))?;
        }
        let result = result.map_err(|error| {
            let reason = match error {
                ExperimentError::NoLock { .. }
                | ExperimentError::NotReached { .. }
                | ExperimentError::Tripped { stage: Stage::Locking, fault: Fault::ResponseTooLarge, .. } => {
                    advice::reason(scene, advice::last_regime(&samples, scene))
                }
                _ => None,
            };
            kept(Failure::from(error), reason, &samples, out)
        });
        Ok((result?, timing))
    }
}

/// The failure with its reason, and what was measured in a file.
pub(super) fn kept(mut failure: Failure, reason: Option<String>, samples: &[Sample], out: &Path) -> Failure {
    let file = (!samples.is_empty()).then(|| match report::write_interrupted(samples, out) {
        Ok(files) => written(&files).trim_end().to_string(),
        Err(error) => error.to_string(),
    });
    for line in [reason, file].into_iter().flatten() {
        failure.message += &format!("\n{line}");
    }
    failure
}
