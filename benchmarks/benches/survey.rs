//! What the exact backbone of a structure costs, by its number of modes: all orbits with all multipliers, as `vines structure` computes them.
//!
//! ```text
//! cargo bench -p vines-benchmarks --bench survey
//! ```
//!
//! Times depend on the machine and on what else it does.

use std::cell::Cell;
use std::f64::consts::TAU;
use std::time::Instant;

use lovines::{Excitation, Host, Mode};
use vines_model::orbit::{Particle, StructureOrbits};

/// Orbits on a curve, as `vines structure` has them.
const POINTS: usize = 400;

/// Modes between the first one and some times its frequency, at equally distributed places of which none is near another.
fn modes(count: usize, highest: f64) -> Vec<Mode> {
    let share = |n: usize, of: f64| (n as f64 * of).fract();
    let first = Mode { omega: TAU * 8.8, zeta: 0.006, cavity: 0.51, drive: 0.3 };
    let others = (1..count).map(|n| Mode {
        omega: first.omega * (1.3 + (highest - 1.3) * share(n, 0.618_034)),
        zeta: 0.003 + 0.017 * share(n, 0.414_214),
        cavity: share(n, 0.732_051) - 0.5,
        drive: share(n, 0.236_068) - 0.5,
    });
    [first].into_iter().chain(others).collect()
}

fn main() -> Result<(), lovines::InvalidHost> {
    println!("modes | highest over driven frequency | seconds | orbits tried | orbits | stability changes");
    for (count, highest) in [(1, 60.0), (20, 60.0), (80, 60.0), (100, 60.0), (100, 6.0)] {
        let modes = modes(count, highest);
        let host = Host::from_modes(Excitation::Force, &modes)?;
        let particle = Particle { mass: 0.032, half_width: 0.01, restitution: 0.65 };
        let orbits = StructureOrbits::new(&host, particle);
        let tried = Cell::new(0);
        let range = [0.9, 1.1].map(|share| share * modes[0].omega);
        let begin = Instant::now();
        let facts = orbits.facts(0, range, POINTS, &|| tried.set(tried.get() + 1));
        let (seconds, all) = (
            begin.elapsed().as_secs_f64(),
            facts.map_or(Vec::new(), |facts| facts.all),
        );
        let found: usize = all.iter().map(|branch| branch.orbits.len()).sum();
        let changes: usize = all.iter().map(|branch| branch.changes.len()).sum();
        println!(
            "{count} | {highest} | {seconds:.2} | {} | {found} | {changes}",
            tried.get()
        );
    }
    Ok(())
}
