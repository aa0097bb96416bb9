//! The tracking of the backbone: the lab's own, run ahead on a copy of the bench. The bench then repeats it sample by sample with
//! the same bits.

use std::cell::Cell;

use phase_lock::Move;
use vines_bench::backbone;
use vines_bench::rig::{BuiltIn, Command, Controller, ControllerError, Sensors};
use vines_bench::scene::Scene;

use crate::message::Message;
use crate::rig::NoisyRig;

/// A point of the tracked backbone, dimensionless.
#[derive(Debug, Clone, Copy)]
pub struct BackbonePoint {
    /// Number of the sample after which the point is known.
    pub sample: u64,
    /// Frequency of the drive at that sample, rad/s, which the bench repeats.
    pub omega: f64,
    /// Detuning.
    pub sigma: f64,
    /// Amplitude of the response.
    pub c: f64,
    /// Excitation.
    pub g: f64,
    /// Whether the point had settled.
    pub settled: bool,
}

/// The moves that are still to be made, and the points that they lead to.
pub struct Tracking {
    /// Moves with their phase targets (rad) and the sample before which each is made, in reverse.
    moves: Vec<(u64, Move, f64)>,
    /// All points, also those that are not yet reached.
    pub points: Vec<BackbonePoint>,
}

impl Tracking {
    /// Ends the tracking before the given sample: only the points that are known then remain.
    pub fn stop(&mut self, sample: u64) {
        self.moves.clear();
        self.points.retain(|point| point.sample <= sample);
    }

    /// The move to be made before the given sample, and its phase target, rad.
    pub fn due(&mut self, sample: u64) -> Option<(Move, f64)> {
        self.moves
            .pop_if(|(at, ..)| *at <= sample)
            .map(|(_, to, phase)| (to, phase))
    }
}

/// The controller on a copy of the bench; notes its moves.
struct Ahead<'a> {
    controller: BuiltIn,
    /// Samples taken, and the frequency at the last one.
    last: &'a Cell<(u64, f64)>,
    moves: Vec<(u64, Move, f64)>,
}

impl Controller for Ahead<'_> {
    fn sample(&mut self, sensors: Sensors, active: bool) -> Result<Command, ControllerError> {
        let command = self.controller.sample(sensors, active)?;
        self.last.set((self.last.get().0 + 1, command.drive.omega));
        Ok(command)
    }

    fn hold_response(&mut self, to: Move, phase_target: f64) -> Result<(), ControllerError> {
        self.moves.push((self.last.get().0, to, phase_target));
        self.controller.hold_response(to, phase_target)
    }
}

/// Tracks the backbone with a controller, from its state before the sample `sample` on, on a copy of the rig.
pub fn track(scene: &Scene, rig: &NoisyRig, controller: BuiltIn, sample: u64) -> Result<Tracking, Message> {
    let last = Cell::new((sample, 0.0));
    let mut controller = Ahead { controller, last: &last, moves: Vec::new() };
    let mut begun = Vec::new();
    let tracked = backbone::track(
        &mut Vec::new(),
        &mut rig.clone(),
        &mut controller,
        &scene.plan(),
        |_| begun.push(last.get()),
    )?;
    let ends = begun.into_iter().skip(1).chain([last.get()]);
    let points = tracked.points.iter().zip(ends);
    let points = points.map(|(point, (sample, omega))| BackbonePoint {
        sample,
        omega,
        sigma: point.at.sigma,
        c: point.at.c,
        g: point.at.g,
        settled: point.settled,
    });
    controller.moves.reverse();
    Ok(Tracking { moves: controller.moves, points: points.collect() })
}
