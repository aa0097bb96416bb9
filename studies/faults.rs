//! How long is a rig still driven after a fault?
//!
//! Every fault of `vines rig --fault` begins at some instants, at different phases, while the loop locks, holds and tracks on the default
//! scene, from sensor readings alone. Longest time from the fault to a drive of zero, ms, and runs in which the fault was missed.
//!
//! ```sh
//! cargo run --release -p vines-testbench --example faults -- INSTANTS [KEY=VALUE ...]    # writes validation/faults.csv
//! ```

mod common;

use std::{cell::Cell, rc::Rc};

use common::{Failure, arguments, scene, write};
use rayon::prelude::*;
use vines_testbench::backbone::track;
use vines_testbench::experiment;
use vines_testbench::rig::{BuiltIn, Rig, RigFault, SensorsOnly, Simulated, faulty};
use vines_testbench::scene::{LinearResponse, Scene};

/// Runs the experiment, or tracks the backbone. Returns the periods to the lock and all of them, if the run does not end early.
fn run(rig: &mut dyn Rig, scene: &Scene, tracks: bool) -> Result<Option<[f64; 2]>, Failure> {
    if tracks {
        let mut controller = BuiltIn::new(&scene.backbone_config())?;
        let found = track(rig, &mut controller, scene, |_, _| {})?;
        return Ok(found.ended.is_none().then_some([found.periods_to_lock, found.periods]));
    }
    let mut controller = BuiltIn::new(&scene.controller_config())?;
    let record = experiment::run(rig, &mut controller, scene, |_, _, _| {});
    let periods = |samples: usize| samples as f64 / scene.controller.samples_per_period;
    Ok(record.ok().map(|record| [record.settled, record.released].map(periods)))
}

/// Time from the fault to a drive of zero, s; `None` if it was missed.
fn zero(scene: &Scene, fault: RigFault, seconds: f64, tracks: bool) -> Option<f64> {
    let zero = Rc::new(Cell::new(None));
    let report = Rc::clone(&zero);
    let mut rig = faulty(scene, fault, seconds, move |time| report.set(time)).ok()?;
    let ended = run(&mut rig, scene, tracks).is_ok_and(|ended| ended.is_some());
    drop(rig);
    zero.get().filter(|_| !ended)
}

fn main() -> Result<(), Failure> {
    let [instants, settings @ ..] = &arguments()[..] else {
        return Err("arguments: INSTANTS [KEY=VALUE ...]".into());
    };
    let instants: usize = instants.parse()?;
    let mut scene = scene("", settings)?;
    scene.measured = Some(LinearResponse::of(&scene));
    let healthy = |tracks| -> Result<[f64; 2], Failure> {
        let mut rig = SensorsOnly::around(Simulated::of(&scene)?);
        run(&mut rig, &scene, tracks)?.ok_or_else(|| "the run without a fault ended early".into())
    };
    let ([settled, released], [locked, tracked]) = (healthy(false)?, healthy(true)?);
    // First period and number of periods of each stage.
    let stages = [
        (settled / 3.0, settled / 3.0, false),
        (settled, released - settled - 1.0, false),
        (locked, 0.5 * (tracked - locked), true),
    ];
    let title = Some(settings.join(" ")).filter(|title| !title.is_empty());
    let title = title.unwrap_or_else(|| "default".into());
    let row = |(name, fault): (&str, RigFault)| {
        let mut missed = 0;
        let times = stages.map(|(from, length, tracks)| {
            let mut longest = 0.0_f64;
            for n in 0..instants {
                // The phases of the instants fill the period evenly.
                let periods = (length * n as f64 / instants as f64).floor() + (0.618 * n as f64) % 1.0;
                let seconds = (from + periods) * scene.dimensionless().natural_period();
                let time = zero(&scene, fault, seconds, tracks);
                missed += usize::from(time.is_none());
                longest = longest.max(time.unwrap_or(0.0));
            }
            format!("{:.1}", 1e3 * longest)
        });
        format!("{title},{instants},{name},{},{missed}", times.join(","))
    };
    let rows: Vec<String> = RigFault::ALL.into_par_iter().map(row).collect();
    let header = "scene,instants,fault,locking_ms,holding_ms,tracking_ms,missed";
    write("faults", header, 3, &rows)
}
