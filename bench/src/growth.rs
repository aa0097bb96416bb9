//! How the plant's run time grows with the work: periods, impacts, samples per period.

use std::path::Path;
use std::time::Instant;

use lovines::{Drive, Plant};
use serde_json::{Value, json};

use crate::scene::Scene;

/// Least wall time, ns, of repetitions for about `budget` seconds; at least two.
fn least(budget: f64, mut run: impl FnMut() -> u64) -> (f64, u64) {
    let began = Instant::now();
    let (mut best, mut times, mut work) = (f64::INFINITY, 0, 0);
    while times < 2 || began.elapsed().as_secs_f64() < budget {
        let start = Instant::now();
        work = std::hint::black_box(run());
        best = best.min(start.elapsed().as_nanos() as f64);
        times += 1;
    }
    (best, work)
}

/// Points `[work, ns]` up to `most` of what grows.
///
/// # Errors
/// An unknown name of what grows, or a scene that cannot be read.
pub fn measure(folder: &Path, what: &str, budget: f64, most: f64) -> Result<Value, String> {
    let scene = Scene::load(folder, "steady")?;
    let first = scene.steps[0];
    let drive = Drive::harmonic(first.amplitude, first.omega);
    let plant = Plant::new(scene.parameters, scene.state()).map_err(|e| e.to_string())?;
    let step_by_step = |steps: usize, duration: f64| {
        let mut plant = plant;
        for _ in 0..steps {
            plant.advance(drive, duration);
            std::hint::black_box((plant.centre(), plant.base_displacement()));
        }
        plant.tally().impacts
    };
    let mut points = Vec::new();
    let mut size = 10.0;
    while size <= most * 1.001 {
        let (ns, impacts) = match what {
            "periods" => least(budget, || step_by_step(size as usize, first.duration)),
            "impacts" => least(budget, || {
                let mut plant = plant;
                plant.advance(drive, 0.5 * size * first.duration);
                plant.tally().impacts
            }),
            "samples per period" => least(budget, || {
                step_by_step(100 * size as usize, first.duration / size)
            }),
            _ => {
                return Err(format!(
                    "{what}: there are periods, impacts, samples per period"
                ));
            }
        };
        points.push([
            if what == "impacts" {
                impacts as f64
            } else {
                size
            },
            ns,
        ]);
        size *= 10f64.sqrt();
    }
    Ok(json!({ "points": points }))
}
