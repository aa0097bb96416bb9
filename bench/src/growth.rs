//! How the plant's run time grows with the work: periods, impacts, samples per period.

use std::path::Path;
use std::time::Instant;

use lovines::{Drive, Plant};
use serde_json::{Value, json};

use crate::scene::Scene;

/// Periods that samples are followed for.
const PERIODS: usize = 100;

/// Median wall time, ns, of repetitions for about `budget` seconds, three at least; and the work of one.
fn timed(budget: f64, mut run: impl FnMut() -> u64) -> (f64, u64) {
    let began = Instant::now();
    let (mut times, mut work) = (Vec::new(), 0);
    while times.len() < 3 || began.elapsed().as_secs_f64() < budget {
        let start = Instant::now();
        work = std::hint::black_box(run());
        times.push(start.elapsed().as_nanos() as f64);
    }
    times.sort_by(f64::total_cmp);
    (times[times.len() / 2], work)
}

/// The steady scene, from where a set of runs can begin.
struct Steady {
    plant: Plant,
    drive: Drive,
    period: f64,
}

impl Steady {
    fn load(folder: &Path) -> anyhow::Result<Self> {
        let scene = Scene::load(folder, "steady")?;
        let first = scene.steps[0];
        Ok(Self {
            plant: Plant::new(scene.parameters, scene.state())?,
            drive: first.drive(),
            period: first.duration,
        })
    }

    fn step_by_step(&self, steps: usize, duration: f64) -> u64 {
        let mut plant = self.plant;
        for _ in 0..steps {
            plant.advance(self.drive, duration).expect("a valid step");
            std::hint::black_box((plant.centre(), plant.base_displacement()));
        }
        steps as u64
    }

    fn in_one_step(&self, impacts: f64) -> u64 {
        let mut plant = self.plant;
        plant
            .advance(self.drive, 0.5 * impacts * self.period)
            .expect("a valid step");
        plant.totals().impacts
    }
}

/// Points `[size, ns, units of work]` up to `most` of what grows.
///
/// # Errors
/// An unknown name of what grows, or a scene that cannot be read.
pub fn measure(folder: &Path, what: &str, budget: f64, most: f64) -> anyhow::Result<Value> {
    let scene = Steady::load(folder)?;
    let mut points = Vec::new();
    let mut size = 10.0;
    while size <= most * 1.001 {
        let count = f64::round(size) as usize;
        let (ns, work) = match what {
            "periods" => timed(budget, || scene.step_by_step(count, scene.period)),
            "impacts" => timed(budget, || scene.in_one_step(size)),
            "samples per period" => timed(budget, || {
                scene.step_by_step(PERIODS * count, scene.period / count as f64)
            }),
            _ => anyhow::bail!("{what}: there are periods, impacts and samples per period"),
        };
        let grown = if what == "impacts" { work as f64 } else { count as f64 };
        points.push([grown, ns, work as f64]);
        size *= 10f64.sqrt();
    }
    Ok(json!({ "points": points }))
}
