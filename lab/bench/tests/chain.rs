//! Guards the stages of the measurement chain between rig and controller, and how far they move the lock; `studies/chain.rs` takes all stages.

use vines_testbench::experiment::{self, ExperimentError, Plan};
use vines_testbench::identification::{Measured, identify};
use vines_testbench::rig::{BuiltIn, Chain, Drive, Rig, RigError, Sensors, Simulated};
use vines_testbench::scene::{Override, Scene};

fn scene(settings: &[&str]) -> Scene {
    let overrides: Vec<Override> = settings.iter().map(|s| s.parse().unwrap()).collect();
    let text = include_str!("../../../scenes/dimensionless.toml");
    Scene::parse("dimensionless.toml", text, &overrides).unwrap()
}

/// The lock behind the chain of a scene, held for 200 periods.
fn at(settings: &[&str]) -> Result<Measured, ExperimentError> {
    let scene = scene(&[settings, &["record.hold_periods=200"]].concat());
    let mut controller = BuiltIn::new(&scene.controller_config()).unwrap();
    let mut rig = Simulated::of(&scene).unwrap();
    let record = experiment::run(&mut *rig, &mut controller, &Plan::of(&scene), |_, _, _| {})?;
    Ok(identify(&record, &scene).unwrap().lock.at)
}

fn chained(rig: impl Rig + 'static, scene: &Scene) -> Chain {
    Chain::new(Box::new(rig), scene)
}

#[test]
fn sixteen_bits_held_and_a_sample_late_move_sigma_by_2e_3_at_most() {
    let ideal = at(&[]).unwrap();
    let real = at(&[
        "chain.adc_bits=16",
        "chain.dac_bits=16",
        "chain.hold=true",
        "chain.delay=1",
        "chain.reference=false",
    ])
    .unwrap();
    println!("sigma moves by {:.1e}", real.sigma - ideal.sigma);
    assert!((real.sigma - ideal.sigma).abs() <= 2e-3);
    assert!((real.c - ideal.c).abs() <= 2e-3);
}

#[test]
fn a_delay_that_nobody_compensates_is_seen_and_one_common_to_both_sensors_is_not() {
    let ideal = at(&[]).unwrap();
    let late = at(&["chain.delay=1", "chain.reference=false", "chain.compensate=false"]).unwrap();
    assert!((late.sigma - ideal.sigma + 0.078).abs() < 0.005);
    let both = at(&["chain.delay=1"]).unwrap();
    assert!((both.sigma - ideal.sigma).abs() < 1e-6);
}

#[test]
fn a_chain_that_is_off_gives_the_same_bits() {
    let scene = scene(&[]);
    let bare = || Simulated::new(scene.plant, scene.start).unwrap();
    let (mut rig, mut behind) = (bare(), chained(bare(), &scene));
    let drive = Drive { omega: 1.0, amplitude: 0.01, displacement: 0.0 };
    for _ in 0..2000 {
        assert_eq!(rig.sense().unwrap(), behind.sense().unwrap());
        rig.advance(drive, 0.06).unwrap();
        behind.advance(drive, 0.06).unwrap();
    }
}

/// A rig without an input for samples of the base, counting what it reads.
struct Counter(f64);

impl Rig for Counter {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        self.0 += 1.0;
        Ok(Sensors { response: self.0, reference: Some(-self.0) })
    }

    fn advance(&mut self, _: Drive, _: f64) -> Result<(), RigError> {
        Ok(())
    }
}

#[test]
fn a_delay_keeps_the_order_of_both_sensors_and_begins_in_silence() {
    let mut chain = chained(Counter(0.0), &scene(&["chain.delay=2"]));
    let read: Vec<_> = (0..5).map(|_| chain.sense().unwrap()).collect();
    let expected = [0.0, 0.0, 1.0, 2.0, 3.0];
    for (sensors, value) in read.iter().zip(expected) {
        assert_eq!(sensors.response, value);
        assert_eq!(sensors.reference.unwrap().abs(), value);
    }
}

#[test]
fn a_rig_without_an_input_for_samples_says_so() {
    let mut chain = chained(Counter(0.0), &scene(&["chain.hold=true"]));
    let refused = chain.advance(Drive::default(), 0.1).unwrap_err();
    assert!(matches!(refused, RigError::NoHold), "{refused}");
}

#[test]
fn settings_that_make_no_sense_are_refused_by_name() {
    for (setting, name) in [
        ("chain.adc_bits=40", "chain.adc_bits"),
        ("chain.dac_bits=12", "chain.dac_bits"),
        ("chain.filter=80.0", "chain.filter"),
        ("chain.jitter=0.5", "chain.jitter"),
        ("chain.snr=-100", "chain.snr"),
        ("chain.response_range=0", "chain.response_range"),
    ] {
        let text = include_str!("../../../scenes/dimensionless.toml");
        let refused = Scene::parse("scene", text, &[setting.parse().unwrap()]).unwrap_err();
        assert!(refused.to_string().contains(name), "{refused}");
    }
}

#[test]
fn a_response_within_one_step_of_its_converter_switches_the_drive_off() {
    let coarse = at(&["chain.adc_bits=6"]).unwrap_err();
    assert!(matches!(coarse, ExperimentError::Tripped { .. }), "{coarse}");
    at(&["chain.adc_bits=16"]).unwrap();
}
