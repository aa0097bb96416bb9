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

use common::{Failure, LOCK_TIME_SETTINGS, LOCK_TIMES, periods_to_settle, scene, write};
use vines_testbench::rig::Simulated;

fn main() -> Result<(), Failure> {
    let mut scene = scene("", &LOCK_TIME_SETTINGS)?;
    let start = Simulated::new(scene.plant, scene.start)?;
    let mut motion = start.clone();
    periods_to_settle(&mut motion, &scene, false)?;
    let mut rows = Vec::new();
    for (bandwidth, published) in LOCK_TIMES {
        scene.controller.bandwidth = bandwidth;
        let from_start = periods_to_settle(&mut start.clone(), &scene, true)?;
        let from_motion = periods_to_settle(&mut motion.clone(), &scene, true)?;
        rows.push(format!("{bandwidth},{from_start:.0},{from_motion:.0},{published}"));
    }
    write("lock_times", "bandwidth,from_start,from_motion,published", 1, &rows)
}
