//! Periods to a phase lock over the bandwidth of the detector, beside published ones.

use serde::Serialize;

use crate::experiment::ExperimentError;
use crate::rig::{BuiltIn, Controller, ControllerError, Rig, RigError, Simulated};
use crate::scene::Scene;

/// Bandwidths, in units of omega0, and the periods to a phase lock that are reported for this rule of gains on such a plant, twenty of
/// them dwell. The tolerance of the phase and the start are not reported.
const REPORTED: [(f64, f64); 5] = [(0.02, 234.0), (0.05, 102.0), (0.1, 55.0), (0.2, 35.0), (0.5, 25.0)];
/// Periods for a steady motion.
const STEADY: f64 = 800.0;
/// Most periods to a lock.
const LONGEST: f64 = 600.0;

/// Periods until the mean phase error has stayed within 2 degrees for twenty of them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LockTime {
    /// Bandwidth of the detector, in units of omega0.
    pub bandwidth: f64,
    /// From the start of the scene, where the response has to grow first; absent without a lock.
    pub from_start: Option<f64>,
    /// From the steady motion of the scene, by a controller that begins with no knowledge of it.
    pub from_motion: Option<f64>,
    /// As reported.
    pub reported: f64,
}

/// The times of a scene with a simulated rig, for a lock of the phase whatever the amplitude does.
pub fn lock_times(scene: &Scene) -> Result<Vec<LockTime>, ExperimentError> {
    let mut scene = scene.clone();
    let settings = &mut scene.controller;
    (settings.phase_tolerance, settings.dwell_periods) = (2.0, 20);
    (settings.frequency_tolerance, settings.amplitude_tolerance) = (0.22, 27.0);
    // The largest bandwidth needs more than a hundred samples per period.
    settings.samples_per_period = settings.samples_per_period.max(200.0);
    let start = Simulated::new(scene.plant, scene.start).map_err(RigError::from)?;
    let mut motion = start.clone();
    run(&mut motion, &scene, STEADY, |_| false)?;
    let times = REPORTED.map(|(bandwidth, reported)| {
        scene.controller.bandwidth = bandwidth;
        let from = |mut rig: Simulated| run(&mut rig, &scene, LONGEST, |settled| settled);
        Ok(LockTime {
            bandwidth,
            from_start: from(start.clone())?,
            from_motion: from(motion.clone())?,
            reported,
        })
    });
    times.into_iter().collect()
}

/// Periods until `ends` says so; none within `longest`.
fn run(
    rig: &mut Simulated,
    scene: &Scene,
    longest: f64,
    ends: impl Fn(bool) -> bool,
) -> Result<Option<f64>, ExperimentError> {
    let mut controller = BuiltIn::new(&scene.controller_config()).map_err(ControllerError::from)?;
    let (step, mut periods) = (scene.sample_time(), 0.0);
    while periods < longest {
        let command = controller.sample(rig.sense()?, true)?;
        if ends(command.settled) {
            return Ok(Some(periods));
        }
        rig.advance(command.drive, step)?;
        periods += command.drive.omega * step / std::f64::consts::TAU;
    }
    Ok(None)
}
