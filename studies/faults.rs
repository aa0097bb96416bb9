//! How long is a rig still driven after a fault?
//!
//! Every fault of `vines rig --fault` begins at some instants, at different phases, while the loop locks, holds and tracks on the default
//! scene, from sensor readings alone. Longest time from the fault to a drive of zero, ms, and runs in which the fault was missed.
//!
//! Arguments: INSTANTS, and settings of the scene, `KEY=VALUE`. Writes validation/faults.csv.

mod common;

use std::{cell::Cell, rc::Rc};

use common::*;

/// Periods to the lock and all of them, of an experiment or of a tracked backbone that does not end early.
fn run(rig: &mut dyn Rig, plan: &Plan, tracks: bool) -> Option<[f64; 2]> {
    if tracks {
        let found = tracked(rig, plan, 4.0).ok()?;
        return found.ended.is_none().then_some([found.periods_to_lock, found.periods]);
    }
    let record = record(rig, plan).ok()?;
    Some([record.settled, record.released].map(|samples| samples as f64 / plan.knowledge.samples(1.0) as f64))
}

/// Time from the fault to a drive of zero, s; `None` if it was missed.
fn zero(scene: &Scene, plan: &Plan, fault: RigFault, seconds: f64, tracks: bool) -> Option<f64> {
    let zero = Rc::new(Cell::new(None));
    let report = Rc::clone(&zero);
    let mut rig = faulty(scene, fault, seconds, move |time| report.set(time)).ok()?;
    let is_missed = run(&mut rig, plan, tracks).is_some();
    drop(rig);
    zero.get().filter(|_| !is_missed)
}

fn main() -> Result<(), Failure> {
    let given: Vec<String> = std::env::args().skip(1).collect();
    let (instants, settings) = given.split_first().ok_or("arguments: INSTANTS [KEY=VALUE ...]")?;
    let instants: usize = instants.parse()?;
    let scene = scene("", settings)?;
    let plan = scene.plan_on(scene.knowledge().measured(LinearResponse::of(&scene.plant)));
    let healthy = |tracks| -> Result<[f64; 2], Failure> {
        let run = run(&mut SensorsOnly::around(Simulated::of(&scene)?), &plan, tracks);
        Ok(run.ok_or("the run without a fault ended early")?)
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
                let time = zero(&scene, &plan, fault, seconds, tracks);
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
