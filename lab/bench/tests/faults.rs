//! Injected faults at a few instants; `vines faults` takes more.

use std::cell::Cell;
use std::rc::Rc;

use vines_testbench::experiment::{self, ExperimentError, Plan};
use vines_testbench::faults::{FAULTS, Faults, Kind, Sensor, rehearsal_rig};
use vines_testbench::rig::{BuiltIn, Rig};
use vines_testbench::scene::{Override, PAPER, Scene};

fn scene(settings: &[&str]) -> Scene {
    let overrides: Vec<Override> = settings.iter().map(|one| one.parse().unwrap()).collect();
    Scene::parse("paper.toml", PAPER, &overrides).unwrap()
}

/// Injects every fault; none may be missed, and the drive must be zero within 10 ms and the ramp of its detection.
fn inject(settings: &[&str], instants: usize) {
    let around = |rig: Box<dyn Rig>| rig;
    let faults = Faults::new(&scene(settings), &around).unwrap();
    let panic = ("panic of the lab", Kind::Call(|| panic!("injected")));
    for (name, kind) in FAULTS.into_iter().chain([panic]) {
        let row = faults.row(name, kind, instants);
        for worst in &row.worst {
            assert_eq!(worst.missed, 0, "{row:?}");
            assert!(worst.shutdown <= 0.01 + faults.ramp(), "{row:?}");
        }
        let [locking, holding, tracking, _] = row.worst.map(|worst| worst.detection);
        assert!(locking.max(holding).max(tracking) < 0.06, "half a period: {row:?}");
        if name.contains("reversed") || name.contains("swapped") {
            assert!(locking.max(holding).max(tracking) < 0.02, "{row:?}");
        }
    }
}

#[test]
fn every_fault_switches_the_drive_off_within_its_ramp() {
    inject(&[], 2);
}

#[test]
fn every_fault_is_found_through_noise_and_12_bits() {
    inject(&["chain.snr=40", "chain.adc_bits=12", "controller.ramp_periods=0.5"], 1);
}

#[test]
fn faults_in_the_first_periods_of_the_drive_are_found_within_a_second() {
    let scene = scene(&["start.dq2=0"]);
    for kind in [
        Kind::Response(Sensor::Reversed),
        Kind::Base(Sensor::Reversed),
        Kind::Both(Sensor::Dead),
        Kind::Response(Sensor::Dead),
        Kind::Base(Sensor::Dead),
        Kind::Response(Sensor::Gain(0.3)),
        Kind::Response(Sensor::Gain(3.0)),
        Kind::Shaker(0.0),
        Kind::Swapped,
    ] {
        // A gain that is wrong from the start is found by the loop check, which compares it with the drive.
        let from_the_start = matches!(kind, Kind::Response(Sensor::Gain(gain)) if gain > 1.0);
        for seconds in [0.0, 0.25, 0.6, 0.9, 1.3, 2.0]
            .into_iter()
            .skip(usize::from(from_the_start))
        {
            let zero = Rc::new(Cell::new(None));
            let told = Rc::clone(&zero);
            let mut rig = rehearsal_rig(&scene, kind, seconds, move |time| told.set(time));
            let mut controller = BuiltIn::new(&scene.controller_config()).unwrap();
            let outcome = experiment::run(&mut *rig, &mut controller, &Plan::of(&scene), |_, _, _| {});
            assert!(
                matches!(outcome, Err(ExperimentError::Tripped { .. })),
                "{kind:?} at {seconds} s"
            );
            drop(rig);
            assert!(
                zero.get().is_some_and(|time| time < 1.0),
                "{kind:?} at {seconds} s: {zero:?}"
            );
        }
    }
}
