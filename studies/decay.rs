//! How accurate is the fit of the free decay, over its window and noise, and do its uncertainties cover the error?
//!
//! One clean decay of the default plant, with noise of constant power relative to the held response. Bias and RMS error of sigma over the
//! points with C > 0.2, against the zero crossings of the clean decay; share of the points within 1.96 of their standard uncertainties
//! of the same fit without noise.
//!
//! And the presets of shakers without noise: the stinger cut, the coil shorted, the coil open. Two RMS errors of sigma: what other modes and the shaker
//! disturb, beside the same fit of the driven mode alone; and the whole, beside the demodulated driven mode, which averages over another window. Where
//! the intervals between impacts beat, as on the cantilever, no average is the frequency at an instant.
//!
//! Arguments: the number of SEEDS of the noise, 20 by default; with 0 the shakers only. Writes validation/decay.csv and shaker_decay.csv.

mod common;

use std::path::Path;

use common::*;
use vines_testbench::identification::WINDOW;
use vines_testbench::rig::{RigError, RigStage, Sensors, SimulatedStructure};

/// Windows of the fit, periods.
const WINDOWS: [f64; 7] = [1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 6.0];
/// Noise, dB.
const RATIOS: [f64; 4] = [f64::INFINITY, 60.0, 50.0, 40.0];

/// A simulated structure, and what its driven mode alone does at the cavity: free motions of other modes move the zero crossings, not its frequency.
struct Watched {
    rig: SimulatedStructure,
    omega0: f64,
    seen: Vec<f64>,
}

impl RigStage for Watched {
    fn inner(&mut self) -> &mut dyn Rig {
        &mut self.rig
    }

    fn sense(&mut self) -> Result<Sensors, RigError> {
        let plant = self.rig.plant();
        let (sections, mut row) = (plant.host().sections(), plant.host().cavity_row().clone());
        let far = |n: &usize| (sections[*n].oscillator.omega0 - self.omega0).abs();
        let driven = (0..sections.len()).min_by(|one, other| far(one).total_cmp(&far(other)));
        let others = (0..row.len()).filter(|n| Some(*n) != driven);
        others.for_each(|n| row[n] = [0.0; 2]);
        self.seen.push(plant.point(&row)[0]);
        RigStage::sense(&mut self.rig)
    }
}

/// Points of the decay with C > 0.2 on a preset, and their RMS errors of sigma; without points where the motion with the shaker attached loses its
/// synchrony at once.
fn shaker(file: &str, state: &str) -> Result<String, Failure> {
    let text =
        std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../../scenes/{file}.toml")))?;
    let limit = "voltage_max";
    let text = match state {
        "cut" => text.replace("[shaker]", "[shaker]\nrelease = \"cut\""),
        "open" => {
            let kept: Vec<&str> = text.lines().filter(|line| !line.starts_with(limit)).collect();
            kept.join("\n")
                .replace("amplifier = \"voltage\"", "amplifier = \"current\"")
        }
        _ => text,
    };
    let scene = scene(&text, &[""; 0])?;
    let structure = scene.structure.as_ref().ok_or("no structure")?;
    let rig = SimulatedStructure::new(structure, scene.plant, scene.start)?;
    let mut rig = Watched { rig, omega0: scene.dimensionless().omega0, seen: Vec::new() };
    let mut clean = record(&mut rig, &scene.plan())?;
    let mut points = decay_points(&clean, &scene.knowledge(), WINDOW).points;
    points.retain(|point| point.c > COMPARED_ABOVE);
    for (sample, value) in clean.samples.iter_mut().zip(&rig.seen) {
        sample.sensors.response = *value;
    }
    let alone = decay_points(&clean, &scene.knowledge(), WINDOW).points;
    let same: Vec<[f64; 2]> = alone.iter().map(|point| [point.tau, point.sigma]).collect();
    let rms = |truth: &[[f64; 2]]| {
        let errors = points
            .iter()
            .filter_map(|point| Some(point.sigma - at(truth, point.tau)?));
        mean_square(errors).sqrt()
    };
    let [disturbed, whole] = [same, demodulated(&clean, &scene)].map(|truth| rms(&truth));
    Ok(format!("{file},{state},{},{disturbed:.1e},{whole:.1e}", points.len()))
}

fn main() -> Result<(), Failure> {
    let presets = ["shaker-cantilever", "shaker-oscillator", "slip-table"];
    let all = presets
        .iter()
        .flat_map(|file| ["cut", "shorted", "open"].map(|state| (*file, state)));
    let mut rows = Vec::new();
    for (file, state) in all.filter(|(file, state)| (*file, *state) != ("slip-table", "cut")) {
        rows.push(shaker(file, state).unwrap_or_else(|error| format!("{file},{state},0,,\"{error}\"")));
    }
    write("shaker_decay", "scene,release,points,rms_disturbed,rms", 2, &rows)?;
    let seeds: u64 = std::env::args().nth(1).map_or(Ok(20), |seeds| seeds.parse())?;
    if seeds == 0 {
        return Ok(());
    }
    let scene = scene("", &[""; 0])?;
    let clean = record(&mut Simulated::new(scene.plant, scene.start)?, &scene.plan())?;
    let truth = crossings(&clean, &scene);
    let mut rows = Vec::new();
    for window in WINDOWS {
        let points = decay_points(&clean, &scene.knowledge(), window).points;
        let noiseless: Vec<[f64; 2]> = points.iter().map(|point| [point.tau, point.sigma]).collect();
        for ratio in RATIOS {
            let (mut errors, mut pulls) = (Vec::new(), Vec::new());
            for seed in 1..=if ratio.is_finite() { seeds } else { 1 } {
                let points = decay_points(&noisy(&clean, ratio, seed), &scene.knowledge(), window).points;
                for point in points.iter().filter(|point| point.c > COMPARED_ABOVE) {
                    errors.extend(at(&truth, point.tau).map(|exact| point.sigma - exact));
                    let noise = at(&noiseless, point.tau).map(|sigma| (point.sigma - sigma).abs());
                    pulls.extend(noise.map(|noise| noise / point.u_sigma));
                }
            }
            let (bias, rms) = (mean(errors.iter().copied()), mean_square(errors).sqrt());
            let covered = share(&pulls, 1.96);
            rows.push(format!("{window},{ratio},{bias:+.4},{rms:.4},{covered:.3}"));
        }
    }
    write("decay", "window_periods,snr_dB,bias,rms,within_1.96u", 2, &rows)
}
