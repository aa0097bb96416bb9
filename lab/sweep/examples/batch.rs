//! Advances 10^4 plants over 200 periods on all cores, seven times: the least wall time, s, with which `scripts/sweep-demo --cost`
//! compares the Python package.

use std::time::Instant;

use lovines::Plant;
use rayon::prelude::*;
use vines_testbench::scene::Scene;

const PLANTS: usize = 10_000;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let scene = Scene::load(None, &[])?.dimensionless();
    let drive = scene.drive(-1.14);
    let duration = 200.0 * std::f64::consts::TAU / drive.omega;
    let mut least = f64::INFINITY;
    for _ in 0..7 {
        let start = |n: usize| [0.0, 0.0, 0.0, 0.3 + 0.6 * n as f64 / (PLANTS - 1) as f64];
        let mut plants = (0..PLANTS)
            .map(|n| scene.plant(start(n)))
            .collect::<Result<Vec<Plant>, _>>()?;
        let begin = Instant::now();
        plants
            .par_iter_mut()
            .try_for_each(|plant| plant.advance(drive, duration).map(drop))?;
        least = least.min(begin.elapsed().as_secs_f64());
    }
    println!("{least}");
    Ok(())
}
