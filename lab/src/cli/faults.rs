//! `vines faults`: what the bench does when something fails.

use std::{panic, process, sync::atomic::Ordering, thread, time::Duration};

use clap::Args;
use vines::faults::{During, FAULTS, Faults, Kind, Row, Worst};
use vines::report::Table;
use vines::rig::{Rig, Stoppable};

use super::output::{output, print};
use super::{failure::Failure, interrupt::stop_flag, scene_arguments::SceneArguments, serving::count};

const HELP: &str = "\
Injects faults into runs on the built-in plant, at several instants while the loop locks, holds, tracks and releases, and prints the worst
case of each: the time from the fault to its detection, and from the detection to a drive of zero, ms of rig time. At the release the
drive ramps down in two periods whatever happens; the time there is that to zero. The exit code is 1 if a fault was missed, or if a drive
became zero later than 10 ms and the configured ramp after the detection.

Examples:
  vines faults
  vines faults --instants 40 --set chain.snr=40 --set chain.adc_bits=12
  vines faults --set controller.ramp_periods=2      with a slow ramp";

/// Inject faults and show how fast the drive becomes zero
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(super) struct Arguments {
    #[command(flatten)]
    scene: SceneArguments,

    /// Instants at which each fault begins in each stage
    #[arg(long, default_value_t = 16, value_parser = count::<usize>)]
    instants: usize,

    /// Print a JSON array instead of a table
    #[arg(long)]
    json: bool,
}

/// Longest time from the detection to a drive of zero without a ramp, s.
const AT_ONCE: f64 = 0.01;

/// What happens to the program itself.
const CALLS: [(&str, fn()); 3] = [
    ("Ctrl-C", || signal("-INT")),
    ("SIGTERM", || signal("-TERM")),
    ("panic of the lab", || panic!("injected")),
];

pub(super) fn run(arguments: &Arguments) -> Result<String, Failure> {
    let scene = arguments.scene.load()?;
    let stop = stop_flag()?;
    // The injected panics are part of the table.
    panic::set_hook(Box::new(|_| {}));
    let around = |rig: Box<dyn Rig>| -> Box<dyn Rig> {
        stop.store(false, Ordering::Relaxed);
        Box::new(Stoppable::around(rig, scene.sample_time(), &stop))
    };
    let faults = Faults::new(&scene, &around)?;
    let calls = CALLS.map(|(name, call)| (name, Kind::Call(call)));
    let rows: Vec<Row> = FAULTS
        .into_iter()
        .chain(calls)
        .map(|(name, kind)| faults.row(name, kind, arguments.instants))
        .collect();
    let allowed = AT_ONCE + faults.ramp();
    let failed = |worst: &Worst| worst.missed > 0 || worst.shutdown > allowed;
    let text = output(arguments.json, &rows, || table(&rows).markdown())?;
    if rows.iter().any(|row| row.worst.iter().any(failed)) {
        print(&text)?;
        return Err(Failure::run(format!(
            "a fault was missed, or the drive became zero later than {:.1} ms after the detection",
            1e3 * allowed
        )));
    }
    Ok(text)
}

/// Sends this program a signal, and waits until it has arrived.
fn signal(name: &str) {
    let sent = process::Command::new("kill")
        .args([name, &process::id().to_string()])
        .status();
    let arrived = || stop_flag().is_ok_and(|flag| flag.load(Ordering::Relaxed));
    while sent.as_ref().is_ok_and(|status| status.success()) && !arrived() {
        thread::sleep(Duration::from_millis(1));
    }
}

fn table(rows: &[Row]) -> Table {
    let headings = "fault | locking | holding | tracking | releasing | reason, while tracking";
    Table::new(headings).rows(rows.iter().map(|row| {
        let cell = |n: usize| {
            let Worst { detection, shutdown, missed } = row.worst[n];
            let [detection, shutdown] = [detection, shutdown].map(|time| format!("{:.1}", 1e3 * time));
            match (missed, During::ALL[n]) {
                (1.., _) => format!("missed {missed} times"),
                (0, During::Releasing) => detection,
                (0, _) => format!("{detection} + {shutdown}"),
            }
        };
        let reason = row.reason.rsplit(": ").next().unwrap_or_default().to_string();
        [row.fault.to_string(), cell(0), cell(1), cell(2), cell(3), reason]
    }))
}
