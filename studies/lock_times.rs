//! How fast does the phase lock, over the bandwidth of the detector, beside published times?
//!
//! Periods until the mean phase error has stayed within 2 degrees for twenty of them, on the default plant: from its start, where the
//! response has to grow first, and from its steady motion, by a controller that begins with no knowledge of it. The published times
//! are those of the same rule of gains on such a plant; their start and tolerance are not published.
//!
//! ```sh
//! cargo run --release -p vines-testbench --example lock_times    # writes validation/lock_times.csv
//! ```

mod common;

use common::{Failure, scene, write};
use vines_testbench::rig::{BuiltIn, Controller, Rig, Simulated};
use vines_testbench::scene::Scene;

/// Bandwidths, in units of omega0, and published periods.
const PUBLISHED: [(f64, f64); 5] = [(0.02, 234.0), (0.05, 102.0), (0.1, 55.0), (0.2, 35.0), (0.5, 25.0)];

/// Only the phase is to settle; the largest bandwidth needs more than a hundred samples per period.
const SETTINGS: [&str; 5] = [
    "controller.phase_tolerance=2.0",
    "controller.dwell_periods=20",
    "controller.frequency_tolerance=0.22",
    "controller.amplitude_tolerance=27.0",
    "controller.samples_per_period=200",
];

/// Periods until a loop settles, if that ends the run, at most 800.
fn run(rig: &mut Simulated, scene: &Scene, ends: bool) -> Result<f64, Failure> {
    let mut controller = BuiltIn::new(&scene.controller_config())?;
    let (step, mut periods) = (scene.sample_time(), 0.0);
    while periods < 800.0 {
        let command = controller.sample(rig.sense()?, true)?;
        if ends && command.settled {
            break;
        }
        rig.advance(command.drive, step)?;
        periods += command.drive.omega * step / std::f64::consts::TAU;
    }
    Ok(periods)
}

fn main() -> Result<(), Failure> {
    let mut scene = scene("", &SETTINGS)?;
    let start = Simulated::new(scene.plant, scene.start)?;
    let mut motion = start.clone();
    run(&mut motion, &scene, false)?;
    let mut rows = Vec::new();
    for (bandwidth, published) in PUBLISHED {
        scene.controller.bandwidth = bandwidth;
        let from_start = run(&mut start.clone(), &scene, true)?;
        let from_motion = run(&mut motion.clone(), &scene, true)?;
        rows.push(format!("{bandwidth},{from_start:.0},{from_motion:.0},{published}"));
    }
    write("lock_times", "bandwidth,from_start,from_motion,published", 1, &rows)
}
