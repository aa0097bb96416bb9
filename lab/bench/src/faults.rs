//! Injected faults: what the bench does when a sensor, the shaker, the clock, a peer or the lab itself fails.
//!
//! A fault begins at one sample of a run that was healthy until then. The drive that the rig gets is recorded until the run has ended.

mod inject;
mod table;

use std::panic::{AssertUnwindSafe, catch_unwind};

use lovines::Parameters;
use serde::Serialize;

use crate::backbone::track;
use crate::experiment::{self, ExperimentError, Plan};
use crate::rig::{BuiltIn, Chain, Drive, Rig, RigError, Sensors, Simulated};
use crate::scene::{Backbone, Scene};

use inject::FaultyController;
pub(crate) use inject::{FaultyRig, Log};
pub use inject::{Kind, Sensor};
pub use table::FAULTS;

/// What the bench does when the fault begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum During {
    /// It searches for phase resonance.
    Locking,
    /// It holds the lock.
    Holding,
    /// It tracks the backbone.
    Tracking,
    /// The drive ramps down.
    Releasing,
}

impl During {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Locking, Self::Holding, Self::Tracking, Self::Releasing];
}

/// The worst case over the instants at which a fault began.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Worst {
    /// Longest time from the fault to its detection, s.
    pub detection: f64,
    /// Longest time from the detection to a drive of zero, s.
    pub shutdown: f64,
    /// Runs in which the fault was not detected, or the drive did not become zero.
    pub missed: usize,
}

/// A fault and its worst cases in the order of [`During::ALL`].
#[derive(Debug, Clone, Serialize)]
pub struct Row {
    /// Name of the fault.
    pub fault: &'static str,
    /// Worst cases.
    pub worst: [Worst; 4],
    /// The last reason that the bench gave.
    pub reason: String,
}

/// Turns between the phases of successive instants.
const GOLDEN: f64 = 0.618_033_988_749_895;
/// Duration of the ramp at the release, natural periods.
const RELEASE: f64 = 2.0;

/// A scene with runs that are short, at the same working points.
fn short(scene: &Scene) -> Scene {
    let mut scene = scene.clone();
    let levels = scene.levels();
    let levels = &levels[..levels.len().min(4)];
    scene.backbone = Backbone {
        c_from: None,
        c_to: None,
        a_from: levels.first().copied(),
        a_to: levels.last().copied(),
        points: levels.len() as u32,
        ..scene.backbone
    };
    scene.controller.release_periods = RELEASE;
    scene.record.decay_periods = Some(3.0 * RELEASE);
    scene
}

/// Why a run ended, without the readings of that one run.
fn reason(error: &ExperimentError) -> String {
    match error {
        ExperimentError::Tripped { fault, .. } => fault.to_string(),
        other => other.to_string(),
    }
}

/// A rig that shows its sensors only, and says when it is dropped how long its fault was driven.
struct Rehearsal<F: FnMut(Option<f64>)> {
    rig: Box<dyn Rig>,
    log: Log,
    ended: F,
}

impl<F: FnMut(Option<f64>)> Drop for Rehearsal<F> {
    fn drop(&mut self) {
        if self.log.has_begun() {
            (self.ended)(self.log.times().map(|(detection, shutdown)| detection + shutdown));
        }
    }
}

impl<F: FnMut(Option<f64>)> Rig for Rehearsal<F> {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        self.rig.sense()
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        self.rig.advance(drive, step)
    }

    fn hold(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        self.rig.hold(drive, step)
    }
}

/// The rig of a checked scene as a rehearsal needs it: read by the scene's measurement chain, without ground truth, and with a fault that
/// begins after `seconds` of rig time. When it is dropped after that, `ended` gets the time from the fault to a drive of zero, s, or
/// `None` if the last drive was not zero.
pub fn rehearsal_rig(
    scene: &Scene,
    kind: Kind,
    seconds: f64,
    ended: impl FnMut(Option<f64>) + 'static,
) -> Box<dyn Rig> {
    let step = scene.sample_time();
    let log = Log::new((seconds / step).min(usize::MAX as f64) as usize, step);
    Box::new(Rehearsal { rig: failing(scene, kind, &log), log, ended })
}

fn failing(scene: &Scene, kind: Kind, log: &Log) -> Box<dyn Rig> {
    let rig = |stiffness: f64| -> Box<dyn Rig> {
        let plant = Parameters { stiffness, ..scene.plant };
        // A stiffer plant is as valid.
        let rig = Simulated::new(plant, scene.start).expect("a checked scene");
        Box::new(rig.with_sensors(scene.resonance))
    };
    let (stiffness, half_width) = (scene.plant.stiffness, scene.plant.half_width);
    let rig = FaultyRig::new(rig(stiffness), rig(1.21 * stiffness), kind, log, half_width);
    Chain::around(Box::new(rig), scene)
}

/// The bench of the faults.
pub struct Faults<'a> {
    scene: Scene,
    /// What the lab puts around its rig.
    around: &'a dyn Fn(Box<dyn Rig>) -> Box<dyn Rig>,
    /// First sample of each stage, and its length.
    stages: [[usize; 2]; 4],
}

impl<'a> Faults<'a> {
    /// The faults of a scene; `around` adds what the lab adds to its rig. Runs the experiment and the tracking once without a fault.
    pub fn new(scene: &Scene, around: &'a dyn Fn(Box<dyn Rig>) -> Box<dyn Rig>) -> Result<Self, ExperimentError> {
        let scene = short(scene);
        let mut faults = Self { scene, around, stages: [[0, 1]; 4] };
        let plan = Plan::of(&faults.scene);
        let log = Log::new(usize::MAX, plan.sample_time);
        let record = experiment::run(
            &mut *faults.rig(Kind::None, &log),
            &mut faults.controller(Kind::None, &log, During::Holding),
            &plan,
            |_, _, _| {},
        )?;
        let log = Log::new(usize::MAX, plan.sample_time);
        faults.track(Kind::None, &log)?;
        let released = record.released;
        let period = faults.scene.controller.samples_per_period as usize;
        let tracked = log.taken();
        faults.stages = [
            [record.settled / 3, record.settled / 3],
            [record.settled, released - record.settled - period],
            [tracked / 2, tracked / 3],
            [released + 1, 0],
        ];
        Ok(faults)
    }

    fn rig(&self, kind: Kind, log: &Log) -> Box<dyn Rig> {
        (self.around)(failing(&self.scene, kind, log))
    }

    fn controller(&self, kind: Kind, log: &Log, during: During) -> FaultyController {
        let config = match during {
            During::Tracking => self.scene.backbone_config(),
            _ => self.scene.controller_config(),
        };
        FaultyController::new(BuiltIn::new(&config).expect("a checked scene"), kind, log)
    }

    fn track(&self, kind: Kind, log: &Log) -> Result<Option<String>, ExperimentError> {
        let controller = &mut self.controller(kind, log, During::Tracking);
        Ok(track(&mut *self.rig(kind, log), controller, &self.scene, |_, _| {})?
            .ended
            .map(|why| reason(&why)))
    }

    /// One run with a fault: detection and shutdown, s, and the reason; `None` if it was missed.
    fn run(&self, kind: Kind, during: During, at: usize) -> Option<(f64, f64, String)> {
        let plan = Plan::of(&self.scene);
        let log = Log::new(at, plan.sample_time);
        let ended = catch_unwind(AssertUnwindSafe(|| match during {
            During::Tracking => self.track(kind, &log),
            _ => {
                let controller = &mut self.controller(kind, &log, during);
                let record = experiment::run(&mut *self.rig(kind, &log), controller, &plan, |_, _, _| {});
                record.map(|_| None)
            }
        }));
        let reason = match ended {
            Err(_) => Some("panic".to_string()),
            Ok(Err(error)) => Some(reason(&error)),
            Ok(Ok(reason)) => reason,
        };
        // At the release the drive ends whatever happens.
        let reason = reason.or((during == During::Releasing).then(|| "the ramp of the release".into()))?;
        let (detection, shutdown) = log.times()?;
        Some((detection, shutdown, reason))
    }

    /// A fault at `instants` instants of each stage.
    pub fn row(&self, fault: &'static str, kind: Kind, instants: usize) -> Row {
        let mut row = Row { fault, worst: [Worst::default(); 4], reason: String::new() };
        for (worst, (during, [from, length])) in row.worst.iter_mut().zip(During::ALL.into_iter().zip(self.stages)) {
            for n in 0..instants {
                // The phases of the instants fill the period evenly.
                let period = self.scene.controller.samples_per_period;
                let (turns, phase) = ((length * n / instants) as f64 / period, GOLDEN * n as f64 % 1.0);
                match self.run(kind, during, from + ((turns.floor() + phase) * period) as usize) {
                    Some((detection, shutdown, reason)) => {
                        worst.detection = worst.detection.max(detection);
                        worst.shutdown = worst.shutdown.max(shutdown);
                        if during != During::Releasing {
                            row.reason = reason;
                        }
                    }
                    None => worst.missed += 1,
                }
            }
        }
        row
    }

    /// Duration of the longest configured ramp after a fault, s.
    pub fn ramp(&self) -> f64 {
        let config = self.scene.controller_config();
        let rate = |rate: Option<f64>, amplitude: f64| rate.map_or(0.0, |rate| amplitude / rate);
        let largest = config.amplitude_max.unwrap_or(config.amplitude);
        rate(config.ramp_rate, largest).max(rate(config.release_rate, config.amplitude))
    }
}
