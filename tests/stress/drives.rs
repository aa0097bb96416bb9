//! A new drive at every sample, with and without a jump of the base, against an event-detecting simulation.
//!
//! The simulation starts every sample anew from the displacements and velocities of the plant: what the plant remembers in error shows
//! in the next sample, and no error grows from sample to sample.

use crate::common::{Scene, scene};
use crate::random::draw;
use crate::simulation::Simulation;
use crate::table::Table;
use lovines::{Drive, Event, Plant};
use proptest::prelude::*;
use rayon::prelude::*;

/// Samples of a scene.
const SAMPLES: usize = 30;
/// Relative change of start and drive that shows how a sample spreads errors.
const CHANGE: f64 = 1e-13;

/// A drive, drawn relative to what the base does at the end of the last sample.
#[derive(Clone, Debug)]
struct Change {
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
    let size = || prop_oneof![1 => Just(0.0), 3 => (-4.0..0.5f64).prop_map(|x| 10f64.powf(x))];
    let joint = prop_oneof![2 => Just(Joint::Same), 1 => Just(Joint::Balanced), 1 => Just(Joint::Jump)];
    let signal = (0..=3usize, size(), prop::array::uniform4(-1.0..1.0f64)).prop_map(|(order, size, mut signal)| {
        signal[order + 1..].fill(0.0);
        signal.map(|u| u * size)
    });
    let omega = prop_oneof![1 => Just(0.0), 3 => 0.0..3.0f64, 1 => -2.0..0.0f64];
    (joint, signal, size(), omega, (-2.0..0.5f64).prop_map(|x| 10f64.powf(x)))
        .prop_map(|(joint, signal, amplitude, omega, step)| Change { joint, signal, amplitude, omega, step })
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

/// What samples show.
#[derive(Clone, Copy, Debug, Default)]
struct Compared {
    samples: u64,
    impacts: u64,
    /// Samples that begin with a wall that the particle rests on, and those in which such a wall lets go at once.
    stuck: u64,
    let_go: u64,
    /// Samples that the simulation gave up.
    left_out: u64,
    /// Samples at whose end a wall pulls the particle.
    pulled: u64,
    /// Largest difference of a state, relative to the motion and divided by the factor by which the sample spreads errors; and the
    /// scene that shows it.
    worst: f64,
    scene: usize,
}

/// Follows the plant for one sample after the other, and the simulation three times for each: as it is, and with small changes.
fn follow(scene: &Scene, changes: &[Change], number: usize) -> Compared {
    let mut plant = Plant::new(scene.parameters, scene.start).expect("a valid scene");
    plant.begin(scene.drive).expect("a valid drive");
    let p = &scene.parameters;
    let omega0 = p.natural_frequency();
    let mut all = Compared { scene: number, ..Compared::default() };
    for change in changes {
        let drive = change.drive(&plant);
        let step = change.step / omega0;
        let runs = [0.0, CHANGE, -CHANGE].map(|c| Simulation::new(scene, &plant, drive, c).run(step));
        let held = plant.contact();
        let mut released = f64::NAN;
        let see = |event| {
            if let Event::Released { t, .. } = event {
                released = released.min(t);
            }
        };
        let outcome = plant.advance_with(drive, step, see).expect("a valid drive");
        all.samples += 1;
        all.impacts += outcome.impacts;
        all.stuck += u64::from(held.is_some());
        all.let_go += u64::from(held.is_some() && released == 0.0);
        if let Some(wall) = plant.contact() {
            let now = plant.base().drive;
            let (push, error) = Simulation::new(scene, &plant, now, 0.0).pressing(wall);
            all.pulled += u64::from(push < -error);
        }
        let [Some(a), Some(b), Some(c)] = runs.each_ref().map(|run| run.as_ref().map(Simulation::result)) else {
            all.left_out += 1;
            continue;
        };
        let s = plant.state();
        let got = [s.q1, s.dq1, plant.relative_displacement(), plant.relative_velocity()];
        let [u0, u1, ..] = plant.base().drive.signal;
        let size = [
            s.q1,
            p.half_width,
            u0,
            drive.amplitude,
            s.dq1 / omega0,
            s.dq2 / omega0,
            u1 / omega0,
        ];
        let size = size.into_iter().fold(0.0f64, |size, x| size.max(x.abs()));
        let units = [size, size * omega0, size, size * omega0];
        let largest = |of: &dyn Fn(usize) -> f64| (0..4).map(|n| of(n).abs() / units[n]).fold(0.0f64, f64::max);
        let spread = largest(&|n| (b[n] - a[n]).abs().max((c[n] - a[n]).abs()));
        all.worst = all.worst.max(largest(&|n| got[n] - a[n]) / (1.0 + spread / CHANGE));
    }
    all
}

/// Half of the scenes begin at a wall, with much loss and damping: their particles rest often, and the slope of the base counts.
fn scenes() -> impl Strategy<Value = (Scene, Vec<Change>)> {
    let at_wall = (any::<bool>(), 1e-3..0.7f64, -2.0..1.0f64);
    (
        scene(true),
        prop::option::of(at_wall),
        prop::collection::vec(change(), SAMPLES),
    )
        .prop_map(|(mut scene, at_wall, changes)| {
            if let Some((plus, restitution, ratio)) = at_wall {
                let p = &mut scene.parameters;
                (p.restitution, p.damping) = (restitution, 2.0 * 10f64.powf(ratio));
                scene.start.q2 = scene.start.q1 - if plus { p.half_width } else { -p.half_width };
                scene.start.dq2 = scene.start.dq1;
            }
            (scene, changes)
        })
}

/// Follows scene `number` alone, and shows where it differs most.
pub fn one(number: usize) {
    let (scene, changes) = draw(&scenes().boxed(), number);
    println!("{scene:#?}\n{:#?}", follow(&scene, &changes, number));
}

/// Follows the given number of scenes.
pub fn compare(n: usize, table: &mut Table) {
    let each: Vec<Compared> = (0..n)
        .into_par_iter()
        .map_init(
            || scenes().boxed(),
            |strategy, number| {
                let (scene, changes) = draw(strategy, number);
                follow(&scene, &changes, number)
            },
        )
        .collect();
    let all = each.iter().fold(Compared::default(), |a, b| {
        let (worst, scene) = if b.worst > a.worst {
            (b.worst, b.scene)
        } else {
            (a.worst, a.scene)
        };
        Compared {
            samples: a.samples + b.samples,
            impacts: a.impacts + b.impacts,
            stuck: a.stuck + b.stuck,
            let_go: a.let_go + b.let_go,
            left_out: a.left_out + b.left_out,
            pulled: a.pulled + b.pulled,
            worst,
            scene,
        }
    });
    let among = format!("{n} scenes, {} samples, {} impacts", all.samples, all.impacts);
    table.row(
        "new drive at every sample: states differ from a simulation by, relative",
        &format!("{among}; worst: new drives {}", all.scene),
        all.worst,
        1e-12,
    );
    for (what, count, allowed) in [
        ("new drive at every sample: walls that pull", all.pulled, 0.0),
        (
            "new drive at every sample: samples with more than 20 000 impacts, left out",
            all.left_out,
            f64::INFINITY,
        ),
        (
            "new drive at every sample: samples that begin in contact",
            all.stuck,
            f64::INFINITY,
        ),
        (
            "new drive at every sample: of these, walls that let go at once without a jump",
            all.let_go,
            f64::INFINITY,
        ),
    ] {
        table.row(what, &among, count as f64, allowed);
    }
}
