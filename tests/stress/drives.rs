//! A new drive at every sample, with and without a jump of the base, against an event-detecting simulation.
//!
//! The simulation starts every sample anew from the displacements and velocities of the plant: what the plant remembers in error shows
//! in the next sample, and no error grows from sample to sample.

use crate::figures::{ANY, Figures};
use crate::scenes::{Scene, decades, scene};
use crate::simulation::Simulation;
use lovines::{Drive, Event, Plant};
use proptest::prelude::*;

/// Samples of a scene.
const SAMPLES: usize = 30;
/// Relative change of start and drive that shows how a sample spreads errors.
const CHANGE: f64 = 1e-13;

/// A drive, drawn relative to what the base does at the end of the last sample.
#[derive(Clone, Debug)]
pub struct Change {
    /// How the displacement of the base goes on.
    joint: Joint,
    signal: [f64; 4],
    amplitude: f64,
    omega: f64,
    step: f64,
}

#[derive(Clone, Copy, Debug)]
enum Joint {
    /// Amplitude and displacement of the signal stay; frequency and derivatives change.
    Same,
    /// The amplitude changes, too, and the signal makes up for it, but for rounding.
    Balanced,
    /// The base jumps.
    Jump,
}

fn change() -> impl Strategy<Value = Change> {
    let size = || prop_oneof![1 => Just(0.0), 3 => decades(-4.0, 0.5)];
    let joint = prop_oneof![2 => Just(Joint::Same), 1 => Just(Joint::Balanced), 1 => Just(Joint::Jump)];
    let signal = (0..=3usize, size(), prop::array::uniform4(-1.0..1.0f64)).prop_map(|(order, size, mut signal)| {
        signal[order + 1..].fill(0.0);
        signal.map(|u| u * size)
    });
    let omega = prop_oneof![1 => Just(0.0), 3 => 0.0..3.0f64, 1 => -2.0..0.0f64];
    let change = |(joint, signal, amplitude, omega, step)| Change { joint, signal, amplitude, omega, step };
    (joint, signal, size(), omega, decades(-2.0, 0.5)).prop_map(change)
}

impl Change {
    fn drive(&self, plant: &Plant) -> Drive {
        let (mut signal, mut amplitude) = (self.signal, self.amplitude);
        let Drive { signal: [now, ..], amplitude: before, .. } = plant.base().drive;
        match self.joint {
            Joint::Same => (signal[0], amplitude) = (now, before),
            Joint::Balanced => signal[0] = now + (before - amplitude) * plant.base().phase.radians().sin(),
            Joint::Jump => {}
        }
        Drive { signal, amplitude, omega: self.omega }
    }
}

/// Follows the plant for one sample after the other, and the simulation three times for each: as it is, and with small changes.
pub fn follow((scene, changes): &(Scene, Vec<Change>), figures: &mut Figures) {
    let mut plant = Plant::new(scene.parameters, scene.start).expect("a valid scene");
    plant.begin(scene.drive).expect("a valid drive");
    let p = &scene.parameters;
    let omega0 = p.natural_frequency();
    for change in changes {
        let drive = change.drive(&plant);
        let step = change.step / omega0;
        let runs = [0.0, CHANGE, -CHANGE].map(|c| Simulation::new(scene, &plant, drive, c).run(step));
        let held = plant.contact().is_some();
        let mut let_go = false;
        let see = |event| let_go |= held && matches!(event, Event::Released { t: 0.0, .. });
        let outcome = plant.advance_with(drive, step, see).expect("a valid drive");
        record! { figures:
            "impacts" count outcome.impacts, ANY;
            "samples that begin in contact" count held, ANY;
            "of these, walls that let go at once" count let_go, ANY;
        }
        if let Some(wall) = plant.contact() {
            let now = plant.base().drive;
            let (push, error) = Simulation::new(scene, &plant, now, 0.0).pressing(wall);
            figures.count("walls that pull at the end of a sample", push < -error, 0.0);
        }
        let [Some(a), Some(b), Some(c)] = runs.each_ref().map(|run| run.as_ref().map(Simulation::result)) else {
            figures.count("samples with more than 20 000 impacts, left out", true, ANY);
            continue;
        };
        let s = plant.state();
        let got = [s.q1, s.dq1, plant.relative_displacement(), plant.relative_velocity()];
        let [u0, u1, ..] = plant.base().drive.signal;
        let displacements = [s.q1, p.half_width, u0, drive.amplitude];
        let velocities = [s.dq1, s.dq2, u1].map(|v| v / omega0);
        let sizes = displacements.into_iter().chain(velocities);
        let size = sizes.fold(0.0f64, |size, x| size.max(x.abs()));
        let units = [size, size * omega0, size, size * omega0];
        let largest = |of: &dyn Fn(usize) -> f64| (0..4).map(|n| of(n).abs() / units[n]).fold(0.0f64, f64::max);
        // The factor by which the sample spreads errors.
        let spread = 1.0 + largest(&|n| (b[n] - a[n]).abs().max((c[n] - a[n]).abs())) / CHANGE;
        let difference = largest(&|n| got[n] - a[n]) / spread;
        figures.largest("states differ from a simulation by, relative", difference, 1e-12);
    }
}

/// Half of the scenes begin at a wall, with much loss and damping: their particles rest often, and the slope of the base counts.
pub fn scenes() -> BoxedStrategy<(Scene, Vec<Change>)> {
    let at_wall = (any::<bool>(), 1e-3..0.7f64, -2.0..1.0f64);
    let changes = prop::collection::vec(change(), SAMPLES);
    let drawn = (scene(true), prop::option::of(at_wall), changes);
    let scenes = drawn.prop_map(|(mut scene, at_wall, changes)| {
        if let Some((plus, restitution, ratio)) = at_wall {
            (scene.parameters.restitution, scene.parameters.damping) = (restitution, 2.0 * 10f64.powf(ratio));
            scene.start_at(plus);
        }
        (scene, changes)
    });
    scenes.boxed()
}
