//! Injected faults at a few instants; `vines faults` takes more.

use vines_testbench::faults::{FAULTS, Faults, Kind};
use vines_testbench::rig::Rig;
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
