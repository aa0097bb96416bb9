//! `vines rigs`: locks of randomly drawn rigs.

use clap::Args;
use vines::random_rigs::{self, Outcome, Row};
use vines::report::Table;
use vines::scene::Override;

use super::{failure::Failure, output::output, serving::count};

const HELP: &str = "\
Draws rigs at random, each with a drive at which a stable symmetric 1:1 orbit exists: epsilon from 0.001 to 0.05, lambda from
0.1 to 3, r from 0.2 to 0.97. Locks each from rest and compares the lock with the exact orbit:
  locked      on a stable symmetric orbit, within 2e-3 in sigma and C
  uncertain   farther from it, but within four of the standard uncertainties that the lock states
  inaccurate  symmetric, but farther from the orbit than that
  other       another regime, which coexists with the orbit; the message says so
  no lock     nothing stationary in the time allowed; the message says why
  failed      neither a lock nor a reason

Examples:
  vines rigs
  vines rigs --count 100 --seed 7 --set start.dq2=0.9     with a moving particle
  vines rigs --set chain.snr=40                           with sensor noise";

/// Lock random rigs from rest and compare the locks with their exact orbits
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(super) struct Arguments {
    /// Number of rigs
    #[arg(long, default_value_t = 300, value_parser = count::<usize>)]
    count: usize,

    /// Seed of the random numbers
    #[arg(long, default_value_t = 1)]
    seed: u64,

    /// Replace one value of the scene, such as start.dq2=0.9; may be repeated
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<Override>,

    /// Print a JSON array instead of the tables
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<String, Failure> {
    let fixed = ["plant", "excitation", "resonance", "controller.phase_target"];
    if let Some(one) = arguments.set.iter().find(|one| one.is_one_of(&fixed)) {
        let message = "plant.epsilon, plant.lambda, plant.r and excitation.G are drawn at random, and the exact orbits are those of the \
                       default [resonance] and controller.phase_target; set other keys, such as start.dq2, or use `vines identify`";
        return Err(one.error(message).into());
    }
    let rows = random_rigs::locks(arguments.count, arguments.seed, &arguments.set).map_err(Failure::input)?;
    output(arguments.json, &rows, || {
        format!("{}\n{}", summary(&rows).markdown(), exceptions(&rows).markdown())
    })
}

fn summary(rows: &[Row]) -> Table {
    let outcomes = [
        ("locked", Outcome::Locked),
        ("uncertain", Outcome::Uncertain),
        ("inaccurate", Outcome::Inaccurate),
        ("other regime", Outcome::OtherRegime),
        ("no lock", Outcome::NoLock),
        ("failed", Outcome::Failed),
    ];
    let headings = "outcome | rigs | periods: median | 90 % | most | distance: median | largest";
    Table::new(headings).rows(outcomes.map(|(name, outcome)| {
        let these = || rows.iter().filter(|row| row.outcome == outcome);
        let sorted = |value: fn(&Row) -> Option<f64>| {
            let mut values: Vec<f64> = these().filter_map(value).collect();
            values.sort_by(f64::total_cmp);
            values
        };
        let (periods, distances) = (sorted(|row| row.periods), sorted(|row| row.distance));
        let at = |values: &[f64], share: f64| values.get(((values.len().max(1) - 1) as f64 * share) as usize).copied();
        let whole = |share| at(&periods, share).map_or("–".into(), |value| format!("{value:.0}"));
        let small = |share| at(&distances, share).map_or("–".into(), |value| format!("{value:.1e}"));
        let count = these().count().to_string();
        [
            name.to_string(),
            count,
            whole(0.5),
            whole(0.9),
            whole(1.0),
            small(0.5),
            small(1.0),
        ]
    }))
}

/// Every rig that did not lock as expected.
fn exceptions(rows: &[Row]) -> Table {
    let others = rows.iter().filter(|row| row.outcome != Outcome::Locked);
    Table::new("epsilon | lambda | r | G | distance | message").rows(others.map(|row| {
        let d = &row.parameters;
        [
            format!("{:.4}", d.epsilon),
            format!("{:.3}", d.lambda),
            format!("{:.3}", d.r),
            format!("{:.4}", d.g),
            row.distance.map_or("–".into(), |distance| format!("{distance:.1e}")),
            row.message.clone().unwrap_or_default(),
        ]
    }))
}
