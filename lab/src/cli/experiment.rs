//! What the commands share that drive a rig through an experiment: options, loop check, doubtful results, and what is kept of a failure.

use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

use clap::Args;
use phase_lock::Config;
use serde::Serialize;
use vines::experiment::{ExperimentError, Stage};
use vines::fmu::process::TemporaryFolder;
use vines::loop_check::{self, Verdict};
use vines::net::{ReportLost, Timing};
use vines::plan::Plan;
use vines::record::{Sample, table};
use vines::rig::{BuiltIn, Controller, Fault, Rig};
use vines::{FileError, ResultFolder, advice, scene::Scene};

use super::options::{Endpoint, OpenRig, ReachArguments, SceneArguments};
use super::output::{Results, Written, output, results, written};
use super::recording::Recording;
use super::signals::Orderly;
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
    out: PathBuf,

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

/// A rig that has passed its loop check, and a controller, both connected.
pub(super) struct Session {
    controller: Box<dyn Controller>,
    rig: OpenRig,
    watch: Option<Watch>,
    recording: Option<Recording>,
    folder: ResultFolder,
    orderly: Orderly,
}

/// What remains of a session after the measurement.
pub(super) struct Ended {
    _orderly: Orderly,
    folder: ResultFolder,
    /// What [`Ended::keep`] has written, and what to say about it.
    kept: (Vec<PathBuf>, Vec<String>),
    /// The file of --record.
    recorded: Result<Option<PathBuf>, FileError>,
    /// What a rig in real time reports.
    timing: Option<Result<Timing, ReportLost>>,
}

/// The file of a run that ended without a result.
pub(super) const INTERRUPTED_FILE: &str = "interrupted.csv";

impl ExperimentArguments {
    /// Loads the scene and connects rig and controller; without a rig, it is this program's FMU. Invalid settings and files that cannot be
    /// written are refused before anything is driven. `names`: the results that the command may write.
    pub(super) fn start(
        &self,
        command: &str,
        rig: Option<&Endpoint>,
        config: impl Fn(&Plan) -> Config,
        names: &[&'static str],
    ) -> Result<(Scene, Plan, Session), Failure> {
        let scene = self.scene.load()?;
        let watch = self.watch.start(command, &scene)?;
        let scope = self.reach.reach()?;
        BuiltIn::new(&config(&scene.plan()))?;
        let orderly = Orderly::new();
        let folder = results(&self.out, names)?;
        let recording = self
            .record
            .clone()
            .map(|path| Recording::open(path, &scene.knowledge().target))
            .transpose();
        let recording = recording.map_err(Failure::input)?;
        let mut open = match rig {
            Some(endpoint) => endpoint.rig(&scene, scope)?,
            None if scene.structure.is_some() => Endpoint::BuiltIn.rig(&scene, scope)?,
            None => {
                let temporary = tempfile::tempdir().map(TemporaryFolder::new).map_err(|error| {
                    let place = std::env::temp_dir();
                    let advice = "set TMPDIR to a folder that can be written to, or use --rig built-in";
                    Failure::run(format!(
                        "cannot pack the plant's FMU in {}: {error}; {advice}",
                        place.display()
                    ))
                })?;
                let (name, content) = fmus()?.swap_remove(0);
                let plant = temporary.path().join(name);
                std::fs::write(&plant, content)?;
                Endpoint::Fmu(plant).rig(&scene, scope)?
            }
        };
        let plan = self.checked(open.rig.as_mut(), &scene)?;
        let mut controller = self
            .controller
            .controller(&config(&plan), &scene.controller_names, scope, open.pace)?;
        if let Some(watch) = &watch {
            (open.rig, controller) = (watch.rig(open.rig), watch.controller(controller));
        }
        if let Some(recording) = &recording {
            open.rig = recording.rig(open.rig);
        }
        let session = Session { controller, rig: open, watch, recording, folder, orderly };
        Ok((scene, plan, session))
    }

    /// The plan of the experiment, with what the check of a rig that is not a simulation has measured. Refuses a rig that is not as expected.
    fn checked(&self, rig: &mut dyn Rig, scene: &Scene) -> Result<Plan, Failure> {
        let plan = scene.plan();
        rig.sense().map_err(ExperimentError::from)?;
        if rig.ground_truth().map_err(ExperimentError::from)?.is_some() || self.no_check {
            return Ok(plan);
        }
        let checked = loop_check::check(rig, &plan).map_err(ExperimentError::from)?;
        super::say(check::described(&checked, scene).trim_end_matches('\n'));
        let Verdict::Healthy = checked.verdict else {
            return Err(Failure::run(format!(
                "the loop check failed, and the drive is off: {}; --no-check skips it",
                check::named(&checked.verdict.to_string(), scene)
            )));
        };
        let Some(linear) = checked.linear else { return Ok(plan) };
        let knowledge = plan.knowledge.measured(linear.response);
        super::say(format_args!(
            "The measured natural frequency has a standard uncertainty of {:.1e} Hz; what is compared with it shares this.",
            knowledge.linear.uncertainty / TAU
        ));
        Ok(scene.plan_on(knowledge))
    }

    /// The result, as JSON or as text, and its files, with the `failure` that the result has in spite of them. If a rig in real time missed
    /// deadlines, or did not get its drives in time, stderr says so; more than a few make the results doubtful, and so does a rig that does
    /// not report.
    pub(super) fn finish<N: AsRef<Path> + 'static, C: AsRef<[u8]> + 'static>(
        &self,
        ended: Ended,
        result: &impl Serialize,
        text: &str,
        files: Result<Vec<(N, C)>, Failure>,
        failure: Option<Failure>,
    ) -> Result<Results, Failure> {
        let text = output(self.json, result, || format!("{text}\n"))?;
        Ok(Results::new(text, self.json, move || {
            let Ended { folder, recorded, timing, .. } = ended;
            let mut written = Written::default();
            written.failures.extend(failure);
            written.add(files.and_then(|files| Ok(folder.replace(files)?)));
            written.add(recorded);
            let doubt = |share: f64| match &timing {
                None => None,
                Some(Ok(timing)) => timing.doubt(share),
                Some(Err(lost)) => Some(lost.to_string()),
            };
            if let Some(doubt) = doubt(TOLERATED) {
                let message = format!("these results are doubtful: {doubt}");
                written.failures.push(Failure::new(LATE, message));
            } else if let Some(reason) = doubt(0.0) {
                super::say(format_args!("warning: {reason}"));
            }
            written
        }))
    }
}

impl Session {
    /// Measures, and ends the session. A rig in real time reports its missed deadlines. An experiment that ends early leaves what was
    /// measured in a file, and names the reason that the exact orbits know.
    pub(super) fn measure<T>(
        mut self,
        scene: &Scene,
        plan: &Plan,
        measure: impl FnOnce(&mut Vec<Sample>, &mut dyn Rig, &mut dyn Controller) -> Result<T, ExperimentError>,
    ) -> Result<(T, Ended), Failure> {
        let mut samples = Vec::new();
        let result = measure(&mut samples, self.rig.rig.as_mut(), self.controller.as_mut());
        // Before rig and controller are closed, which may not answer.
        let kept = match &result {
            Ok(_) => Default::default(),
            Err(_) => keep(&self.folder, &samples, plan),
        };
        drop(self.controller);
        let timing = self.rig.close();
        let recorded = self.recording.map_or(Ok(None), Recording::finish);
        let (_orderly, folder) = (self.orderly, self.folder);
        let ended = Ended { _orderly, folder, kept, recorded, timing };
        match result {
            Ok(result) => Ok((result, ended)),
            Err(error) => {
                let runs_away = || advice::runs_away(&samples, plan);
                let reason = match error {
                    // The orbits are those at the requested phase and drive.
                    ExperimentError::OtherThanAsked { .. } => runs_away(),
                    ExperimentError::NoLock { .. } | ExperimentError::NotReached { .. } => runs_away().or_else(|| {
                        advice::reason(scene, &plan.knowledge.numbers, advice::last_regime(&samples, plan))
                    }),
                    ExperimentError::Tripped { stage: Stage::Locking, fault: Fault::ResponseTooLarge, .. } => {
                        Some(runs_away().unwrap_or_else(|| advice::cut_off(scene, &plan.knowledge.numbers)))
                    }
                    // An irregular motion may resemble a failed sensor: was there another one to lock on?
                    ExperimentError::Tripped {
                        stage: Stage::Locking,
                        fault: Fault::Implausible | Fault::LockLost,
                        ..
                    } => advice::reason(scene, &plan.knowledge.numbers, None),
                    ExperimentError::Tripped { fault: Fault::NoSignal, .. } => advice::hit_at_once(scene, &samples),
                    _ => None,
                };
                let failure = Failure::from(error);
                if let Some(watch) = &mut self.watch {
                    watch.failure = Some(failure.message.clone());
                }
                Err(ended.without_result(failure, reason))
            }
        }
    }
}

impl Ended {
    /// Writes what was measured, for a failure.
    pub(super) fn keep(&mut self, samples: &[Sample], plan: &Plan) {
        self.kept = keep(&self.folder, samples, plan);
    }

    /// The failure with its reason, and the files with what was measured.
    pub(super) fn without_result(self, mut failure: Failure, reason: Option<String>) -> Failure {
        let mut lines = Vec::from_iter(reason);
        let (mut files, said) = self.kept;
        match self.recorded {
            Ok(file) => files.extend(file),
            Err(error) => lines.push(error.to_string()),
        }
        lines.extend(said);
        if !files.is_empty() {
            lines.push(written(&files).trim_end().into());
        }
        for line in lines {
            failure.message += &format!("\n{line}");
        }
        failure
    }
}

/// Writes what was measured to the file of a run without a result. Returns its path, and what to say about other files.
fn keep(folder: &ResultFolder, samples: &[Sample], plan: &Plan) -> (Vec<PathBuf>, Vec<String>) {
    if samples.is_empty() {
        return Default::default();
    }
    match folder.interrupt(INTERRUPTED_FILE, &table(samples, &plan.knowledge.target)) {
        Ok((file, previous)) => {
            let moved = |folder: PathBuf| format!("The results of an earlier run are in {}", folder.display());
            (vec![file], previous.map(moved).into_iter().collect())
        }
        Err(error) => (Vec::new(), vec![error.to_string()]),
    }
}
