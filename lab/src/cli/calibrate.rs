//! `vines calibrate`: coverage of the uncertainties.

use std::path::PathBuf;

use clap::Args;
use indicatif::ProgressBar;
use vines::calibration::{self, Calibration, Coverage, Kind, Missing, OTHER_RIGS, Part, RATIOS, RIGS};
use vines::report::{self, Table};
use vines::scene::Scene;

use super::output::{output, saved, writable, written};
use super::{failure::Failure, serving::count};

/// The scene whose settings the rigs change.
const SCENE: &str = include_str!("../../../scenes/dimensionless.toml");

const HELP: &str = "\
Locks, releases and tracks three rigs through noise of 40, 30 and 20 dB, on all cores, and compares every result with the exact
orbits. Prints the share of the 95 % intervals that contain the exact value (target: 92 to 97 %), the largest error over its
standard uncertainty, and the RMS error beside the Cramér-Rao bound of the same samples. Takes some minutes.

Examples:
  vines calibrate                       504 runs; writes coverage.svg to out/
  vines calibrate --first-seed 1001 --other-rigs";

/// Show the coverage of the uncertainties over many noisy runs
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(super) struct Arguments {
    /// Number of seeds; each is run on three rigs at three ratios
    #[arg(long, default_value_t = 56, value_parser = count::<u64>)]
    seeds: u64,

    /// First seed
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u64).range(..=1_000_000_000))]
    first_seed: u64,

    /// Use the second set of rigs, which was not used to write the estimators
    #[arg(long)]
    other_rigs: bool,

    /// Folder for the figure; created if it does not exist
    #[arg(long, value_name = "DIR", default_value = "out")]
    out: PathBuf,

    /// Print every outcome as a JSON array instead of the table
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<String, Failure> {
    writable(&arguments.out)?;
    let rigs = if arguments.other_rigs { &OTHER_RIGS } else { &RIGS };
    let seeds = arguments.first_seed..arguments.first_seed + arguments.seeds;
    let bar = ProgressBar::new(arguments.seeds * (rigs.len() * RATIOS.len()) as u64);
    let load = |overrides: &[_]| Scene::parse("dimensionless.toml", SCENE, overrides);
    let found = calibration::calibrate(load, rigs, seeds, |done| bar.set_position(done)).map_err(Failure::input)?;
    bar.finish_and_clear();
    let tables = || {
        let tables = format!("{}\n{}", table(&found).markdown(), missing(&found).markdown());
        format!("{tables}\n{}\n", totals(&found))
    };
    let files = saved(report::write_calibration(&found, &arguments.out), || {
        output(arguments.json, &found.outcomes, tables)
    })?;
    output(arguments.json, &found.outcomes, || tables() + &written(&files))
}

/// One row for each ratio and quantity.
fn table(found: &Calibration) -> Table {
    let rows = RATIOS.into_iter().flat_map(|snr| {
        QUANTITIES.map(|(kind, quantity, name)| {
            let outcomes = found.outcomes.iter();
            let coverage =
                Coverage::of(outcomes.filter(|one| one.snr == snr && one.kind == kind && one.quantity == quantity));
            [
                format!("{snr} dB"),
                name.into(),
                coverage.count.to_string(),
                format!("{:.1} %", 100.0 * coverage.covered),
                format!("{:.1}", coverage.worst),
                format!("{:.1e}", coverage.rms),
                coverage.bound.map_or("-".into(), |bound| format!("{bound:.1e}")),
            ]
        })
    });
    Table::new("noise | result | number | covered | worst | RMS error | Cramér–Rao").rows(rows)
}

/// The results under study.
const QUANTITIES: [(Kind, &str, &str); 8] = [
    (Kind::Lock, "sigma", "lock: sigma"),
    (Kind::Lock, "C", "lock: C"),
    (Kind::Lock, "B", "lock: B"),
    (Kind::Lock, "G", "lock: G"),
    (Kind::Lock, "phase", "lock: phase, degrees"),
    (Kind::Tracked, "sigma", "tracked: sigma at equal C"),
    (Kind::Tracked, "G", "tracked: G at equal C"),
    (Kind::Decay, "sigma", "decay: sigma, corrected"),
];

/// Number of results without a value, for each ratio.
fn missing(found: &Calibration) -> Table {
    let rows = RATIOS.map(|snr| {
        let is_one = |what| move |one: &&Missing| one.snr == snr && one.what == what;
        let count = |what| found.missing.iter().filter(is_one(what)).count().to_string();
        let [lock, levels, settled] = [Part::Lock, Part::Levels, Part::Settled].map(count);
        [format!("{snr} dB"), lock, levels, settled]
    });
    Table::new("noise | no lock | tracking ended early | points not settled").rows(rows)
}

fn totals(found: &Calibration) -> String {
    let all = Coverage::of(found.outcomes.iter());
    let first = found.missing.first().map_or(String::new(), |first| {
        format!(". Missing, for example: {}", first.message)
    });
    format!(
        "{} runs, {} results: {:.1} % covered, worst error {:.1} standard uncertainties{first}\n",
        found.runs,
        all.count,
        100.0 * all.covered,
        all.worst
    )
}
