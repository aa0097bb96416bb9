//! The loop check on random rigs; `vines check --trials 1000` takes more.

use lovines::State;
use vines_testbench::loop_check::{Verdict, check, trials};
use vines_testbench::rig::{Drive, Rig, RigError, Sensors, Simulated};
use vines_testbench::scene::{PAPER, Scene};

fn scene() -> Scene {
    Scene::parse("paper.toml", PAPER, &["start.dq2=0".parse().unwrap()]).unwrap()
}

#[test]
fn healthy_rigs_pass_and_faults_are_named() {
    let found = trials(&scene(), 60, 5).unwrap();
    assert_eq!((found.healthy, found.faulty), ([60, 60], [60, 60]), "{:?}", found.wrong);
}

/// A rig that records its largest drive and the phase of its oscillator.
struct Recorded(Simulated, f64, f64);

impl Rig for Recorded {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        self.0.sense()
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        self.1 = self.1.max(drive.amplitude).max(drive.displacement.abs());
        self.2 += drive.omega * step;
        self.0.advance(drive, step)
    }
}

#[test]
fn the_check_drives_at_a_hundredth_and_ends_at_the_phase_where_it_began() {
    let scene = scene();
    let mut rig = Recorded(Simulated::new(scene.plant, scene.start).unwrap(), 0.0, 0.0);
    let found = check(&mut rig, &scene).unwrap();
    assert_eq!(found.verdict, Verdict::Healthy);
    assert!(rig.1 <= 0.01 * scene.amplitude * (1.0 + 1e-12));
    let turns = rig.2 / std::f64::consts::TAU;
    assert!((turns - turns.round()).abs() < 1e-9, "{turns}");
    assert!((found.response.gain - 1.0).abs() < 0.01 && found.response.phase.abs() < 3.0);
}

#[test]
fn a_rig_that_moves_before_the_drive_is_named() {
    let scene = scene();
    for speed in [1e-3, 0.05] {
        let start = State { dq1: speed, ..State::default() };
        let found = check(&mut Simulated::new(scene.plant, start).unwrap(), &scene).unwrap();
        assert_eq!(found.verdict, Verdict::NotAtRest, "{found:?}");
    }
}
