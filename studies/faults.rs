//! How long is a rig still driven after a fault?
//!
//! Every fault of `vines rig --fault` begins at some instants, at different phases, while the loop locks, holds and tracks on the default
//! scene, from sensor readings alone. Longest time from the fault to a drive of zero, ms, and runs in which the fault was missed. With a shaker, the
//! faults of shakers too, and what ended the run at the first instant of the hold.
//!
//! Arguments: INSTANTS, the file of a scene, settings of it, `KEY=VALUE`, and parts of the names of the only faults to take. Writes
//! validation/faults.csv.

mod common;

use std::{cell::Cell, rc::Rc};

use common::*;
use vines_bench::experiment::ExperimentError;

/// Periods to the lock and all of them, of an experiment or of a tracked backbone that does not end early, or why it ends.
fn run(rig: &mut dyn Rig, plan: &Plan, tracks: bool) -> Result<[f64; 2], ExperimentError> {
    if tracks {
        let found = tracked(rig, plan, 4.0)?;
        return found.ended.map_or(Ok([found.periods_to_lock, found.periods]), Err);
    }
    let record = record(rig, plan)?;
    Ok([record.settled, record.released].map(|samples| samples as f64 / plan.knowledge.samples(1.0) as f64))
}

/// Time from the fault to a drive of zero, s, and what ended the run; `None` if it was missed.
fn zero(scene: &Scene, plan: &Plan, fault: RigFault, seconds: f64, tracks: bool) -> Option<(f64, String)> {
    let zero = Rc::new(Cell::new(None));
    let report = Rc::clone(&zero);
    let mut rig = faulty(scene, fault, seconds, move |time| report.set(time)).ok()?;
    let error = run(&mut rig, plan, tracks).err()?;
    drop(rig);
    Some((zero.get()?, error.to_string()))
}

fn main() -> Result<(), Failure> {
    let given = std::env::args().skip(1);
    let is_setting = |one: &String| one.contains('=') || one.ends_with(".toml") || one.parse::<usize>().is_ok();
    let (given, names): (Vec<String>, Vec<String>) = given.partition(is_setting);
    let usage = "arguments: INSTANTS [FILE.toml] [KEY=VALUE ...] [NAME ...]";
    let (instants, settings) = given.split_first().ok_or(usage)?;
    let instants: usize = instants.parse()?;
    let file = settings.first().filter(|first| first.ends_with(".toml"));
    let text = file.map_or(Ok(String::new()), std::fs::read_to_string)?;
    let scene = scene(&text, &settings[usize::from(file.is_some())..])?;
    let has_shaker = scene
        .structure
        .as_ref()
        .is_some_and(|structure| structure.shaker.is_some());
    let plan = scene.plan_on(scene.knowledge().measured(scene.knowledge().linear));
    let healthy = |tracks| -> Result<[f64; 2], Failure> {
        let run = run(&mut SensorsOnly(Simulated::of(&scene)?), &plan, tracks);
        Ok(run?)
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
                longest = longest.max(time.as_ref().map_or(0.0, |(time, _)| *time));
                if let Some((_, why)) = time.filter(|_| n == 0 && has_shaker) {
                    println!("{name}: {why}");
                }
            }
            format!("{:.1}", 1e3 * longest)
        });
        format!("{title},{instants},{name},{},{missed}", times.join(","))
    };
    let mut faults = RigFault::ALL.to_vec();
    // The fault that changes the structure is one of the oscillator.
    faults.retain(|(_, fault)| *fault != RigFault::Structure || scene.structure.is_none());
    if has_shaker {
        faults.extend(RigFault::OF_SHAKER);
    }
    let is_named = |name: &str| names.is_empty() || names.iter().any(|part| name.contains(part.as_str()));
    faults.retain(|(name, _)| is_named(name));
    let rows: Vec<String> = faults.into_par_iter().map(row).collect();
    let header = "scene,instants,fault,locking_ms,holding_ms,tracking_ms,missed";
    write("faults", header, 3, &rows)
}
