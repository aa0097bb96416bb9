//! How accurate is the fit of the free decay, over its window and noise, and do its uncertainties cover the error?
//!
//! One clean decay of the default plant, with noise of constant power relative to the held response. Bias and RMS error of sigma over the
//! points with C > 0.2, against the zero crossings of the clean decay; share of the points within 1.96 of their standard uncertainties
//! of the same fit without noise.
//!
//! And the presets of shakers without noise: the stinger cut, the coil shorted, the coil open. Three RMS errors of sigma. Beside the same fit of the
//! driven mode alone: part of this is motion, as the impacts also move the other modes at the frequency of the driven one, less and less. Beside the
//! same fit of the driven mode and this part of faster modes, which is what disturbs. And the whole, beside the demodulated driven mode, which averages
//! over another window: where the intervals between impacts beat, as on the cantilever, no average is the frequency at an instant.
//!
//! Arguments: the number of SEEDS of the noise, 20 by default; with 0 the shakers only. Writes validation/decay.csv and shaker_decay.csv.

mod common;

use std::path::Path;

use common::*;
use vines_bench::identification::DECAY_WINDOW;
use vines_bench::rig::{RigError, RigStage, Sensors, SimulatedStructure};

/// Windows of the fit, periods.
const WINDOWS: [f64; 7] = [1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 6.0];
/// Noise, dB.
const RATIOS: [f64; 4] = [f64::INFINITY, 60.0, 50.0, 40.0];

/// A simulated structure, and what its driven mode alone and the modes of more than twice its frequency do at the cavity, and the lowest of these, rad/s.
struct Watched {
    rig: SimulatedStructure,
    omega0: f64,
    seen: Vec<[f64; 2]>,
    fast: f64,
}

impl Watched {
    /// What the driven mode does, and what faster modes do without their free motions: a mean with Hann's weights over two of the longest periods.
    fn without_ringing(&self, step: f64) -> Vec<f64> {
        let half = (std::f64::consts::TAU / self.fast / step).round() as usize;
        let weight = |n: usize| {
            (std::f64::consts::PI * (n + 1) as f64 / (2 * half + 2) as f64)
                .sin()
                .powi(2)
                / (half + 1) as f64
        };
        let weights: Vec<f64> = (0..=2 * half).map(weight).collect();
        let smooth = |n: usize| -> f64 {
            let near = |i: usize| self.seen[(n + i).saturating_sub(half).min(self.seen.len() - 1)][1];
            weights.iter().enumerate().map(|(i, weight)| weight * near(i)).sum()
        };
        (0..self.seen.len()).map(|n| self.seen[n][0] + smooth(n)).collect()
    }
}

impl RigStage for Watched {
    fn inner(&mut self) -> &mut dyn Rig {
        &mut self.rig
    }

    fn sense(&mut self) -> Result<Sensors, RigError> {
        let plant = self.rig.plant();
        let (sections, row) = (plant.host().sections(), plant.host().cavity_row());
        let omega = |n: usize| sections[n].oscillator.omega0;
        let far = |n: &usize| (omega(*n) - self.omega0).abs();
        let driven = (0..sections.len()).min_by(|one, other| far(one).total_cmp(&far(other)));
        let is_fast = |n: usize| omega(n) > 2.0 * self.omega0;
        let of = |is: &dyn Fn(usize) -> bool| {
            let kept = row
                .iter()
                .enumerate()
                .map(|(n, pair)| if is(n) { *pair } else { [0.0; 2] });
            plant.point(&kept.collect())[0]
        };
        self.seen.push([of(&|n| Some(n) == driven), of(&is_fast)]);
        self.fast = (0..sections.len())
            .filter(|n| is_fast(*n))
            .map(omega)
            .fold(f64::INFINITY, f64::min);
        self.rig.sense()
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
    let mut rig = Watched {
        rig,
        omega0: scene.dimensionless().omega0,
        seen: Vec::new(),
        fast: f64::INFINITY,
    };
    let mut clean = record(&mut rig, &scene.plan())?;
    let mut points = decay_points(&clean, &scene.knowledge(), DECAY_WINDOW).points;
    points.retain(|point| point.c > COMPARED_ABOVE);
    let mut fit_of = |values: &[f64]| -> Vec<[f64; 2]> {
        for (sample, value) in clean.samples.iter_mut().zip(values) {
            sample.sensors.response = *value;
        }
        let points = decay_points(&clean, &scene.knowledge(), DECAY_WINDOW).points;
        points.iter().map(|point| [point.tau, point.sigma]).collect()
    };
    let steady = fit_of(&rig.without_ringing(scene.sample_time()));
    let same = fit_of(&rig.seen.iter().map(|seen| seen[0]).collect::<Vec<f64>>());
    let rms = |truth: &[[f64; 2]]| {
        let errors = points
            .iter()
            .filter_map(|point| Some(point.sigma - at(truth, point.tau)?));
        mean_square(errors).sqrt()
    };
    let [beside_driven, disturbed, whole] = [same, steady, demodulated(&clean, &scene)].map(|truth| rms(&truth));
    Ok(format!(
        "{file},{state},{},{beside_driven:.1e},{disturbed:.1e},{whole:.1e}",
        points.len()
    ))
}

fn main() -> Result<(), Failure> {
    let presets = ["shaker-cantilever", "shaker-oscillator", "slip-table"];
    let all = presets
        .iter()
        .flat_map(|file| ["cut", "shorted", "open"].map(|state| (*file, state)));
    let mut rows = Vec::new();
    for (file, state) in all.filter(|(file, state)| (*file, *state) != ("slip-table", "cut")) {
        rows.push(shaker(file, state).unwrap_or_else(|error| format!("{file},{state},0,,,\"{error}\"")));
    }
    write(
        "shaker_decay",
        "scene,release,points,rms_beside_driven_mode,rms_disturbed,rms",
        2,
        &rows,
    )?;
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
