//! Guards the verdicts of the loop check, on random rigs, healthy and with faults, and what it measures; `studies/check.rs` takes more rigs.

use lovines::State;
use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};
use rand_distr::{Distribution, Uniform};
use vines_testbench::loop_check::{Verdict, check};
use vines_testbench::rig::{Chain, Drive, Rig, RigError, RigFault, SensorFault, Sensors, Simulated, faulty};
use vines_testbench::scene::{PAPER, Scene};

fn scene() -> Scene {
    Scene::parse("paper.toml", PAPER, &["start.dq2=0".parse().unwrap()]).unwrap()
}

#[test]
fn healthy_rigs_pass_and_faults_are_named() {
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let mut between = move |low: f64, high: f64| Uniform::new(low, high).unwrap().sample(&mut random);
    for n in 0..60 {
        let mut scene = scene();
        let epsilon = between(0.001_f64.ln(), 0.05_f64.ln()).exp();
        let lambda = between(0.1_f64.ln(), 3_f64.ln()).exp();
        scene.plant.particle_mass = epsilon * scene.plant.primary_mass;
        scene.plant.damping = lambda * scene.plant.particle_mass * scene.plant.natural_frequency();
        scene.plant.restitution = between(0.2, 0.97);
        scene.amplitude = epsilon * scene.plant.half_width * between(0.3, 3.0);
        scene.chain.snr = Some(between(30.0, 80.0));
        scene.chain.seed = n;
        scene.chain.delay = between(0.0, 4.0) as u32;
        scene.chain.filter = Some(between(8.0, 40.0));
        scene.chain.adc_bits = Some(between(16.0, 25.0) as u32);
        let mut rig = scene.clone();
        rig.plant.stiffness *= between(0.99, 1.01);
        rig.plant.damping *= between(0.8, 1.2);
        let found = check(&mut *Simulated::of(&rig).unwrap(), &scene).unwrap();
        assert_eq!(found.verdict, Verdict::Healthy, "{found:?}");
        let linear = found.linear.unwrap();
        let damping = 0.5 * rig.plant.damping / rig.plant.primary_mass;
        assert!(
            (linear.response_gain / (0.5 * rig.plant.natural_frequency()) - 1.0).abs() < 0.03,
            "{linear:?}"
        );
        assert!(
            (linear.damping_rate - damping).abs() < 4.0 * linear.u_damping_rate,
            "{linear:?}"
        );
        let gains = phase_lock::Gains::from_bandwidth(linear.bandwidth, damping);
        assert!((linear.gains[1] / gains.integral - 1.0).abs() < 0.01, "{linear:?}");
        let (gain, late) = (between(1.15_f64.ln(), 1000_f64.ln()).exp(), between(2.0, 33.0) as usize);
        let faults = [
            (Verdict::NotANumber, RigFault::Response(SensorFault::Value(f64::NAN))),
            (Verdict::NotANumber, RigFault::Base(SensorFault::Value(f64::INFINITY))),
            (Verdict::ShakerOff, RigFault::Shaker(0.0)),
            (Verdict::ResponseDead, RigFault::Response(SensorFault::Dead)),
            (Verdict::BaseDead, RigFault::Base(SensorFault::Dead)),
            (Verdict::Swapped, RigFault::Swapped),
            (Verdict::ResponseReversed, RigFault::Response(SensorFault::Reversed)),
            (Verdict::BaseReversed, RigFault::Base(SensorFault::Reversed)),
            (Verdict::BothReversed, RigFault::Both(SensorFault::Reversed)),
            (Verdict::ResponseGain, RigFault::Response(SensorFault::Gain(gain))),
            (Verdict::BaseGain, RigFault::Base(SensorFault::Gain(gain))),
            (Verdict::ResponseGain, RigFault::Response(SensorFault::Gain(0.8))),
            (Verdict::ResponseLate, RigFault::Response(SensorFault::Late(late))),
            (Verdict::BaseLate, RigFault::Base(SensorFault::Late(late))),
            (Verdict::ResponseNoisy, RigFault::Response(SensorFault::Noisy)),
            (Verdict::BaseNoisy, RigFault::Base(SensorFault::Noisy)),
        ];
        let (expected, fault) = faults[n as usize % faults.len()];
        let found = check(&mut faulty(&rig, fault, 0.0, |_| {}).unwrap(), &scene).unwrap();
        assert_eq!(found.verdict, expected, "{fault:?}: {found:?}");
    }
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

/// The default scene with these settings, at rest.
fn at_rest(settings: &[&str]) -> Scene {
    let settings = settings.iter().chain(&["start.dq2=0"]);
    let overrides: Vec<_> = settings.map(|one| one.parse().unwrap()).collect();
    Scene::parse("paper.toml", PAPER, &overrides).unwrap()
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
        let scene = at_rest(settings);
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

/// A rig between whose sensors, drive and clock and the bench something is wrong.
struct Altered {
    plant: Box<dyn Rig>,
    factors: [f64; 2],
    /// Delays of the channels, samples, and their readings, the latest last.
    late: [usize; 2],
    past: Vec<Sensors>,
    clock: f64,
}

impl Altered {
    fn new(plant: Box<dyn Rig>) -> Self {
        Self {
            plant,
            factors: [1.0; 2],
            late: [0; 2],
            past: Vec::new(),
            clock: 1.0,
        }
    }
}

impl Rig for Altered {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        self.past.push(self.plant.sense()?);
        let ago = |samples: usize| self.past[(self.past.len() - 1).saturating_sub(samples)];
        Ok(Sensors {
            response: self.factors[0] * ago(self.late[0]).response,
            reference: ago(self.late[1]).reference.map(|base| self.factors[1] * base),
        })
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        self.plant.advance(drive, self.clock * step)
    }
}

#[test]
fn what_would_falsify_a_measurement_is_refused_with_and_without_noise() {
    type Alter = fn(&mut Altered);
    let cases: [(Alter, Verdict); 11] = [
        (|_| {}, Verdict::Healthy),
        (|rig| rig.factors[0] = 2.0, Verdict::ResponseGain),
        (|rig| rig.factors[0] = 0.9, Verdict::ResponseGain),
        (|rig| rig.factors[1] = 2.0, Verdict::BaseGain),
        (|rig| rig.factors[1] = 1.1, Verdict::BaseGain),
        (|rig| rig.late = [3, 0], Verdict::ResponseLate),
        (|rig| rig.late = [0, 3], Verdict::BaseLate),
        (|rig| rig.late = [1, 0], Verdict::ResponseLate),
        (|rig| rig.late = [5, 5], Verdict::Healthy),
        (|rig| rig.clock = 1.01, Verdict::Clock),
        (|rig| rig.clock = 0.99, Verdict::Clock),
    ];
    for settings in [
        &[][..],
        &["chain.snr=40"],
        &["chain.snr=30", "chain.seed=9"],
        &["resonance.reference='force'"],
    ] {
        let scene = at_rest(settings);
        for (alter, expected) in cases {
            let mut rig = Altered::new(Simulated::of(&scene).unwrap());
            alter(&mut rig);
            let found = check(&mut rig, &scene).unwrap();
            assert_eq!(found.verdict, expected, "{settings:?}: {found:?}");
        }
    }
}

#[test]
fn natural_frequency_and_damping_of_the_rig_replace_those_of_the_scene() {
    for settings in [&["start.dq2=0"][..], &["start.dq2=0", "chain.snr=40"]] {
        let overrides: Vec<_> = settings.iter().map(|one| one.parse().unwrap()).collect();
        let mut scene = Scene::parse("paper.toml", PAPER, &overrides).unwrap();
        let stated = scene.dimensionless();
        let mut plant = scene.plant;
        plant.stiffness *= 1.01;
        plant.damping *= 0.7;
        let rig = Simulated::new(plant, scene.start).unwrap();
        let found = check(&mut *Chain::around(Box::new(rig), &scene), &scene).unwrap();
        assert_eq!(found.verdict, Verdict::Healthy, "{found:?}");
        let differ: Vec<&str> = found
            .quantities
            .iter()
            .filter(|one| one.differs())
            .map(|one| one.name)
            .collect();
        assert_eq!(differ, ["natural frequency", "damping rate"]);
        let linear = found.linear.unwrap();
        println!("{settings:?}: {linear:?}");
        let (omega0, damping) = (plant.natural_frequency(), 0.5 * plant.damping / plant.primary_mass);
        // Clean, the fit is exact but for rounding.
        let limit = 3.0 * linear.u_damping_rate + 1e-6 * omega0;
        assert!((linear.omega_0 - omega0).abs() < limit && (linear.damping_rate - damping).abs() < limit);
        assert!(linear.u_damping_rate < 3e-4 * omega0);
        let step = scene.sample_time();
        scene.measured = Some(linear.response());
        let measured = scene.dimensionless();
        let config = scene.controller_config();
        assert_eq!((measured.omega0, scene.sample_time()), (linear.omega_0, step));
        assert!((config.damping_rate.unwrap() / linear.damping_rate - 1.0).abs() < 1e-12);
        assert!((config.omega_start / linear.omega_0 - scene.controller.omega_start).abs() < 1e-12);
        assert!((config.response_gain - 0.5 * linear.omega_0).abs() < 1e-9);
        assert_eq!(
            (measured.epsilon, measured.r, measured.b, measured.g),
            (stated.epsilon, stated.r, stated.b, stated.g)
        );
    }
}
