//! In lock-step, every bit equals that of the built-in plant, and a frame that is not allowed is answered at once.

use std::time::{Duration, Instant};

use vines_net::{Ended, LinkError, NetController, NetRig, RAMP_SAMPLES, Refusal};
use vines_testbench::experiment::{self, Plan};
use vines_testbench::record::Record;
use vines_testbench::rig::{BuiltIn, Chain, Controller, Drive, Rig, RigError, Simulated};
use vines_testbench::scene::Scene;

use crate::bench::{controller, drive, lock_step_rig, scene, shake, socket};

fn measure(scene: &Scene, rig: &mut dyn Rig, controller: &mut dyn Controller) -> Record {
    experiment::run(rig, controller, &Plan::of(scene), |_, _, _| {}).unwrap()
}

#[test]
fn an_experiment_across_the_network_gives_the_same_bits() {
    let scene = scene(&["controller.amplitude_tolerance=8e-3", "controller.bandwidth=0.3"]);
    let direct = measure(
        &scene,
        &mut Simulated::new(scene.plant, scene.start).unwrap(),
        &mut BuiltIn::new(&scene.controller_config()).unwrap(),
    );
    let (rig_server, _) = lock_step_rig(&scene, 5.0);
    let controller_server = controller(&scene, 5.0);
    let sample_time = scene.sample_time();
    {
        let mut rig = NetRig::connect(rig_server.address, sample_time, None).unwrap();
        let mut peer = NetController::connect(socket(controller_server.address), sample_time, None, None).unwrap();
        assert_eq!(rig.pace(), None);
        assert_eq!(measure(&scene, &mut rig, &mut peer), direct);
    }
    for session in [rig_server.sessions(1), controller_server.sessions(1)] {
        assert_eq!(session[0].ended, Ended::Farewell);
        assert_eq!(session[0].samples, direct.samples.len() as u64);
    }
}

#[test]
fn held_samples_cross_the_network_with_the_same_bits_and_ramp_to_zero() {
    let scene = scene(&["chain.hold=true", "chain.dac_bits=12", "record.decay_periods=150"]);
    let chain = |rig: Box<dyn Rig>| Chain::around(rig, &scene);
    let controller = || BuiltIn::new(&scene.controller_config()).unwrap();
    let plant = Simulated::new(scene.plant, scene.start).unwrap();
    let direct = measure(&scene, chain(Box::new(plant)).as_mut(), &mut controller());
    let (server, log) = lock_step_rig(&scene, 5.0);
    let rig = NetRig::connect(server.address, scene.sample_time(), None).unwrap();
    assert_eq!(
        measure(&scene, chain(Box::new(rig)).as_mut(), &mut controller()),
        direct
    );
    server.sessions(1);
    let mut rig = NetRig::connect(server.address, scene.sample_time(), None).unwrap();
    rig.sense().unwrap();
    rig.hold(Drive { displacement: 1e-3, ..Drive::default() }, scene.sample_time())
        .unwrap();
    rig.sense().unwrap();
    drop(rig);
    server.sessions(2);
    let log = log.lock().unwrap();
    let ramp = &log[log.len() - RAMP_SAMPLES as usize - 1..];
    assert!(ramp.windows(2).all(|pair| pair[1].displacement < pair[0].displacement));
    assert_eq!((ramp[0].displacement, ramp[ramp.len() - 1].displacement), (1e-3, 0.0));
}

#[test]
fn the_drive_of_a_client_that_has_left_ramps_to_zero() {
    let scene = scene(&[]);
    let (server, log) = lock_step_rig(&scene, 5.0);
    let mut rig = NetRig::connect(server.address, scene.sample_time(), None).unwrap();
    shake(&mut rig, &scene, 20).unwrap();
    drop(rig);
    assert_eq!(server.sessions(1)[0].samples, 20);
    let drives = log.lock().unwrap();
    assert_eq!(drives.len(), 20 + RAMP_SAMPLES as usize);
    assert_eq!(drives.last().unwrap().amplitude, 0.0);
}

fn link_error(error: &RigError) -> &LinkError {
    error.cause().unwrap_or_else(|| panic!("{error}"))
}

#[test]
fn a_drive_above_a_limit_is_refused_at_once_with_the_value_and_the_limit() {
    let scene = scene(&[]);
    let limit = scene.plant.half_width;
    for (index, bad) in [
        (0, Drive { omega: f64::NAN, ..drive(3) }),
        (0, Drive { omega: 1e9, ..drive(3) }),
        (1, Drive { amplitude: 1.01 * limit, ..drive(3) }),
        (1, Drive { amplitude: -1e-9, ..drive(3) }),
        (2, Drive { displacement: -1e3, ..drive(3) }),
    ] {
        let (server, log) = lock_step_rig(&scene, 5.0);
        let mut rig = NetRig::connect(server.address, scene.sample_time(), None).unwrap();
        shake(&mut rig, &scene, 3).unwrap();
        let start = Instant::now();
        let error = rig
            .sense()
            .and_then(|_| rig.advance(bad, scene.sample_time()))
            .and_then(|()| rig.sense())
            .unwrap_err();
        assert!(start.elapsed() < Duration::from_secs(1));
        let LinkError::Refused { reason: Refusal::Drive { index: named, .. }, .. } = link_error(&error) else {
            panic!("{error}");
        };
        assert_eq!(*named, index, "{error}");
        assert!(error.to_string().contains("allowed is up to"), "{error}");
        assert_eq!(server.sessions(1)[0].ended, Ended::Refused);
        // The rig never had it.
        assert!(
            log.lock()
                .unwrap()
                .iter()
                .all(|had| had.amplitude <= 1e-4 && had.omega < 51.0)
        );
    }
}

#[test]
fn a_silence_ramps_the_drive_down_and_a_client_that_returns_is_informed() {
    let scene = scene(&[]);
    let (server, log) = lock_step_rig(&scene, 0.2);
    let mut rig = NetRig::connect(server.address, scene.sample_time(), None).unwrap();
    shake(&mut rig, &scene, 20).unwrap();
    assert_eq!(server.sessions(1)[0].ended, Ended::Silence);
    assert_eq!(log.lock().unwrap().last().unwrap().amplitude, 0.0);
    let error = shake(&mut rig, &scene, 2).unwrap_err();
    assert!(matches!(link_error(&error), LinkError::Closed { .. }), "{error}");
    // Only another session arms the rig again.
    let mut next = NetRig::connect(server.address, scene.sample_time(), None).unwrap();
    shake(&mut next, &scene, 20).unwrap();
}
