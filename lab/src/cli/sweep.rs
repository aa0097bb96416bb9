//! `vines sweep`: any parameters of a scene over grids, lists and random samples, to a Zarr store.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::{thread, time::Duration};

use clap::Args;
use vines::ArgumentError;
use vines::sweep::{self, Axis, Estimate, Monitor, Results, Settings, Shard, StoreError, Sweep};

use super::failure::{Failure, INTERRUPTED, stop_flag};
use super::options::{SceneArguments, warn_left_out};
use super::output::progress_bar;

const HELP: &str = "\
Axes; a key is sigma (the detuning), section.key of a scene, or G and r for excitation.G and plant.r:
  --axis plant.r=0.3:1:71          first : last : number of values
  --axis plant.r=0.3,0.5,0.8       a list
  --axis start.dq2=random:-1:1     one random number per sample; with --samples and --seed
  --axis plant.r=paired:0.3,0.5    samples of your own, such as a Sobol sequence of scipy.stats.qmc; one value per sample
Grids and lists have one dimension each; all random and paired axes share the dimension `sample`.

Results; the regime is always computed, as by `vines map`:
  regime     regime, periods to settle, impacts per period, pattern, Lyapunov exponent, synchrony, sticking
  response   amplitude C, and the powers that impacts and damper dissipate
  orbits     the exact symmetric 1:1 orbits at the drive of the cell, and their stability
  lock       the locked point: the experiment of `vines identify`, without its decay

The store is a Zarr group (version 3) that xarray.open_zarr reads; docs/scale.md describes it. It is written chunk by chunk. The same
command continues a sweep that was interrupted, and computes damaged chunks again. A cell that fails has its reason in the variable
`failure`.

Examples:
  vines sweep --axis sigma=-5:5:101 --axis excitation.G=0.1:3:59 --out map.zarr
  vines sweep --axis start.q1=random:-0.01:0.01 --axis start.dq1=random:-1:1 --samples 10000 --sigma=-1.14 --out basin.zarr
  vines sweep --axis sigma=-5:5:1000 --axis excitation.G=0.1:3:1000 --shard 3/8 --out map.zarr
  vines sweep --axis plant.r=0.3:1:71 --axis plant.b=0.005:0.02:61 --results response,orbits --out gap.zarr
  vines sweep --axis sigma=-5:5:1000 --axis excitation.G=0.1:3:1000 --periods 400 --adaptive --out fine.zarr";

/// Sweep any parameters of a scene and of its start, into a Zarr store
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(super) struct Arguments {
    #[command(flatten)]
    scene: SceneArguments,

    /// An axis; may be repeated
    #[arg(long, value_name = "KEY=VALUES", required = true)]
    axis: Vec<Axis>,

    /// Detuning, if it is not an axis [default: that of the scene's stable phase-resonant orbit, or 0]
    #[arg(long, value_name = "SIGMA", allow_negative_numbers = true)]
    sigma: Option<f64>,

    /// Number of samples of the random axes
    #[arg(long, value_name = "N")]
    samples: Option<u64>,

    /// Seed of the random axes
    #[arg(long, value_name = "SEED", default_value_t = 0)]
    seed: u64,

    /// Largest number of periods that a cell is followed; at least 100
    #[arg(long, value_name = "PERIODS", default_value_t = Settings::default().periods)]
    periods: usize,

    /// What to compute: regime, response, orbits, lock
    #[arg(long, value_name = "GROUPS", default_value = "regime", value_delimiter = ',')]
    results: Vec<String>,

    /// Largest number of cells in a chunk of the store
    #[arg(long, value_name = "CELLS", default_value_t = Settings::default().chunk)]
    chunk: u64,

    /// Only the regime: compute every N-th cell of two grids, then where neighbours differ; `inferred` marks the rest
    #[arg(long, value_name = "N", num_args = 0..=1, default_missing_value = "16", conflicts_with_all = ["shard", "merge"])]
    adaptive: Option<u64>,

    /// Folder of the store; created if it does not exist
    #[arg(long, value_name = "DIR", default_value = "sweep.zarr")]
    out: PathBuf,

    /// Compute only the I-th of N parts, I from 1; parts may share a store on a common file system
    #[arg(long, value_name = "I/N", value_parser = shard)]
    shard: Option<Shard>,

    /// Take the chunks that these stores of the same sweep have, before the others are computed
    #[arg(long, value_name = "DIR", num_args = 1.., conflicts_with = "shard")]
    merge: Vec<PathBuf>,

    /// Verify the checksums of the store; nothing is computed or written
    #[arg(long, conflicts_with = "merge")]
    verify: bool,

    /// Confirms a sweep of more than 2 hours or 20 GB
    #[arg(long)]
    yes: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<String, Failure> {
    let settings = Settings {
        axes: arguments.axis.clone(),
        sigma: arguments.sigma,
        samples: arguments.samples,
        seed: arguments.seed,
        periods: arguments.periods,
        results: Results::parse(arguments.results.iter().map(String::as_str))?,
        chunk: arguments.chunk,
        adaptive: arguments.adaptive,
    };
    let sweep = Sweep::new(arguments.scene.family()?, settings)?;
    warn_left_out(
        sweep.scene(),
        "regimes, responses and exact orbits of a sweep (not its locked points) are",
    );
    let part = arguments.shard.unwrap_or(Shard::ALL);
    if arguments.verify {
        return verify(&sweep, &arguments.out, part);
    }
    let estimate = sweep::estimate(&sweep, &AtomicBool::new(false))?;
    if estimate.is_large() && !arguments.yes && arguments.merge.is_empty() {
        let Estimate { cells, hours, bytes } = estimate;
        return Err(Failure::input(format!(
            "{cells} cells would take about {hours:.1} h on this machine and {:.1} GB before compression; confirm with --yes",
            bytes / 1e9
        )));
    }
    let monitor = Monitor::default();
    if !arguments.merge.is_empty() {
        sweep::collect(&sweep, &arguments.out, &arguments.merge, &monitor).map_err(Failure::input)?;
    }
    let work = || sweep::run(&sweep, &arguments.out, part, &monitor);
    let complete = watched(&sweep, "sweeping", &monitor, work)?;
    let [found, computed, failed, inferred] =
        [&monitor.found, &monitor.computed, &monitor.failed, &monitor.inferred].map(|count| count.load(Relaxed));
    let (cells, out) = (sweep.cells(), arguments.out.display());
    let mut text = format!(
        "{cells} cells (chunks: {}): {found} already complete, {computed} computed, {failed} of these failed\n",
        sweep.chunks()
    );
    if inferred > 0 {
        let share = 100.0 * inferred as f64 / cells as f64;
        text += &format!("{inferred} cells ({share:.1} %) were inferred from their neighbours\n");
    }
    let damage = monitor.damage().map_or(String::new(), |damage| {
        format!("{damage}. Their chunks were copied or computed again\n")
    });
    text += &damage;
    if let Some(reason) = monitor.reason.get() {
        text += &format!("First failure: {reason}\n");
    }
    if complete {
        return Ok(format!("{text}Written: {out}\n"));
    }
    let message = format!("{damage}interrupted; {out} has the complete chunks, and the same command continues");
    Err(Failure::new(INTERRUPTED, message))
}

/// The part `I/N` of a sweep.
fn shard(text: &str) -> Result<Shard, ArgumentError> {
    let parts = text
        .split_once('/')
        .and_then(|(one, of)| Some((one.parse::<u64>().ok()?, of.parse().ok()?)));
    match parts {
        Some((one, of)) if (1..=of).contains(&one) => Ok(Shard { number: one - 1, of }),
        _ => Err("expected I/N with I from 1 to N, for instance 3/8".into()),
    }
}

fn verify(sweep: &Sweep, out: &Path, part: Shard) -> Result<String, Failure> {
    let monitor = Monitor::default();
    let work = || sweep::verify(sweep, out, part, &monitor);
    let complete = watched(sweep, "verifying", &monitor, work)?;
    if !complete {
        return Err(Failure::new(INTERRUPTED, "interrupted; nothing was written"));
    }
    let (found, cells) = (monitor.found.load(Relaxed), part.cells(sweep));
    let undamaged = format!("{found} of {cells} cells are complete and undamaged");
    match monitor.damage() {
        None if found == cells => Ok(format!("{undamaged}\nVerified: {}\n", out.display())),
        damage => {
            let damage = damage.map_or(String::new(), |damage| format!("{damage}. "));
            Err(Failure::run(format!(
                "{damage}{undamaged}. Without --verify, the same command computes the others"
            )))
        }
    }
}

/// Does some work with a bar that shows the progress, until it is complete or a signal stops it.
fn watched(
    sweep: &Sweep,
    verb: &str,
    monitor: &Monitor,
    work: impl FnOnce() -> Result<bool, StoreError> + Send,
) -> Result<bool, Failure> {
    let signal = stop_flag()?;
    let template = format!("{verb} [{{wide_bar}}] {{pos}}/{{len}} cells, {{per_sec}}, {{eta}} left");
    let bar = progress_bar(sweep.cells(), &template);
    thread::scope(|scope| {
        let work = scope.spawn(work);
        let mut started = false;
        while !work.is_finished() {
            thread::sleep(Duration::from_millis(20));
            if signal.load(Relaxed) {
                monitor.stop.store(true, Relaxed);
            }
            let computed = monitor.computed.load(Relaxed);
            if computed > 0 && !started {
                // The rate counts only cells that are computed now.
                started = true;
                bar.set_position(monitor.found.load(Relaxed));
                bar.reset_eta();
            }
            bar.set_position(monitor.found.load(Relaxed) + computed);
        }
        bar.finish_and_clear();
        match work.join() {
            Ok(result) => Ok(result?),
            Err(panic) => std::panic::resume_unwind(panic),
        }
    })
}
