//! The loop check on random rigs; `vines check --trials 1000` takes more.

use lovines::State;
use vines_testbench::loop_check::{Verdict, check, trials};
use vines_testbench::rig::{Chain, Drive, Rig, RigError, Sensors, Simulated};
use vines_testbench::scene::{PAPER, Scene};

fn scene() -> Scene {
    Scene::parse("paper.toml", PAPER, &["start.dq2=0".parse().unwrap()]).unwrap()
}

#[test]
fn healthy_rigs_pass_and_faults_are_named() {
    let found = trials(&scene(), 60, 5).unwrap();
    assert_eq!((found.healthy, found.faulty), ([60, 60], [60, 60]), "{:?}", found.wrong);
    // The integral gain, the response gain, and the damping rate in its uncertainty.
    let [integral, gain, damping] = found.linear.map(|[_, largest]| largest);
    assert!(integral < 0.05 && gain < 0.15 && damping < 3.0, "{:?}", found.linear);
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
fn a_rig_that_moves_before_the_drive_comes_to_rest_first_or_is_named() {
    let scene = scene();
    for (driven, expected) in [(false, Verdict::Healthy), (true, Verdict::NotAtRest)] {
        let start = State { dq1: 0.05, ..State::default() };
        let mut rig = Moving(Simulated::new(scene.plant, start).unwrap(), driven);
        let found = check(&mut rig, &scene).unwrap();
        assert_eq!(found.verdict, expected, "{found:?}");
    }
}

#[test]
fn a_particle_that_lies_beside_the_middle_is_an_offset_and_no_motion() {
    let scene = scene();
    for (q2, dq2) in [(0.95, 0.0), (-0.5, 0.005)] {
        let start = State { q2: q2 * scene.plant.half_width, dq2, ..State::default() };
        let mut rig = Simulated::new(scene.plant, start).unwrap();
        let found = check(&mut rig, &scene).unwrap();
        assert_eq!(found.verdict, Verdict::Healthy, "{found:?}");
    }
}

/// A rig that moves at first, or that something else drives all the time.
struct Moving(Simulated, bool);

impl Rig for Moving {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        self.0.sense()
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        let amplitude = drive.amplitude + if self.1 { 1e-5 } else { 0.0 };
        self.0.advance(Drive { amplitude, ..drive }, step)
    }
}

#[test]
fn the_check_measures_the_linear_response_and_states_gains_with_a_phase_margin() {
    for (settings, tolerance) in [
        (&[][..], 0.02),
        (
            &["chain.snr=40", "chain.adc_bits=16", "chain.response_range=0.02"],
            0.15,
        ),
    ] {
        let overrides: Vec<_> = settings
            .iter()
            .chain(&["start.dq2=0"])
            .map(|one| one.parse().unwrap())
            .collect();
        let scene = Scene::parse("paper.toml", PAPER, &overrides).unwrap();
        let d = scene.dimensionless();
        let plant = Simulated::new(scene.plant, scene.start).unwrap();
        let mut rig = Chain::around(Box::new(plant), &scene);
        let found = check(&mut *rig, &scene).unwrap().linear.unwrap();
        println!("{found:?}");
        let damping = 0.5 * d.epsilon * d.lambda * d.omega0;
        assert!((found.damping_rate / damping - 1.0).abs() < tolerance);
        assert!((found.response_gain / (0.5 * d.omega0) - 1.0).abs() < tolerance);
        assert!((found.omega_0 / d.omega0 - 1.0).abs() < 1e-3);
        assert!((50.0..60.0).contains(&found.phase_margin));
    }
}

/// A rig behind a connection: both channels are this many samples late.
struct Delayed(Simulated, Vec<Sensors>);

impl Rig for Delayed {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        self.1.push(self.0.sense()?);
        Ok(self.1.remove(0))
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        self.0.advance(drive, step)
    }
}

#[test]
fn a_delay_of_both_channels_cancels_and_is_healthy() {
    let scene = scene();
    let still = Sensors { response: 0.0, reference: Some(0.0) };
    // From 40 on, the phase alone is that of the opposite sign.
    for delay in [16, 30, 40, 44, 48] {
        let mut rig = Delayed(Simulated::new(scene.plant, scene.start).unwrap(), vec![still; delay]);
        let found = check(&mut rig, &scene).unwrap();
        assert_eq!(found.verdict, Verdict::Healthy, "{found:?}");
        assert!((found.base.unwrap().delay - delay as f64).abs() < 0.5, "{found:?}");
    }
}
