//! In lock-step, every bit equals that of the built-in plant, whatever the network loses, repeats or reorders.

use vines_net::frame::Kind;
use vines_net::{Counters, Ended, NetController, NetRig};
use vines_testbench::experiment::{self, Plan, Record};
use vines_testbench::rig::{BuiltIn, Controller, Rig, Simulated};
use vines_testbench::scene::Scene;

use crate::bench::{controller, lock_step_rig, scene, shake};
use crate::proxy::{Fate, Proxy};

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
    let (rig_server, controller_server) = (lock_step_rig(&scene), controller(&scene, 5.0));
    let sample_time = scene.sample_time();
    {
        let mut rig = NetRig::connect(rig_server.address, sample_time).unwrap();
        let mut peer = NetController::connect(controller_server.address, sample_time, None).unwrap();
        assert_eq!(measure(&scene, &mut rig, &mut peer), direct);
    }
    for session in [rig_server.sessions(1), controller_server.sessions(1)] {
        assert_eq!(session[0].ended, Ended::Farewell);
        assert_eq!(session[0].samples, direct.samples.len() as u64);
    }
}

/// Drives the plant through a proxy: the readings must equal those without a network. Returns the counters of client and
/// server, and the number of datagrams that did not just pass.
fn shaken(samples: usize, fate: impl FnMut(Kind, u64) -> Fate + Send + 'static) -> (Counters, Counters, u64) {
    let scene = scene(&[]);
    let direct = shake(&mut Simulated::new(scene.plant, scene.start).unwrap(), &scene, samples).unwrap();
    let server = lock_step_rig(&scene);
    let proxy = Proxy::before(server.address, fate);
    let mut rig = NetRig::connect(proxy.address, scene.sample_time()).unwrap();
    let told = shake(&mut rig, &scene, samples).unwrap();
    assert!(told == direct, "the readings differ");
    let client = rig.counters();
    drop(rig);
    let session = server.sessions(1).remove(0);
    // The client does not wait for the answer to the last drive.
    assert!(session.samples + 1 >= samples as u64 && session.samples <= samples as u64);
    println!("client: {client}\nserver: {}", session.counters);
    (client, session.counters, proxy.done())
}

#[test]
fn lost_frames_are_sent_again_and_change_no_bit() {
    let (client, _, lost) = shaken(600, |_, n| if n % 40 == 7 { Fate::Lose } else { Fate::Pass });
    assert!(lost > 20 && client.resent >= lost - 1);
}

#[test]
fn repeated_frames_are_counted_and_change_no_bit() {
    let (client, server, twice) = shaken(600, |_, n| if n % 5 == 3 { Fate::Repeat } else { Fate::Pass });
    assert!(twice > 200);
    assert!(client.repeated > 100 && server.repeated > 100);
}

#[test]
fn late_frames_are_counted_and_change_no_bit() {
    // A delayed frame passes after its repetition.
    let (client, server, swapped) = shaken(300, |_, n| if n % 40 == 7 { Fate::Swap } else { Fate::Pass });
    assert!(swapped > 10);
    assert!(client.repeated + server.repeated >= swapped - 1);
}

#[test]
fn corrupted_frames_are_counted_as_malformed_and_change_no_bit() {
    let (client, server, corrupted) = shaken(300, |_, n| if n % 40 == 7 { Fate::Corrupt } else { Fate::Pass });
    assert!(corrupted > 10);
    assert!(client.malformed + server.malformed >= corrupted - 1);
    assert!(client.malformed > 0 && server.malformed > 0);
}

#[test]
fn frames_of_another_sender_are_counted_as_foreign_and_change_no_bit() {
    let (client, server, copied) = shaken(600, |_, n| if n % 4 == 1 { Fate::Copy } else { Fate::Pass });
    assert!(copied > 200);
    assert!(client.foreign > 100 && server.foreign > 100);
}

#[test]
fn frames_of_another_session_are_counted_as_foreign() {
    let (client, server, _) = shaken(200, |_, n| {
        if n % 50 == 20 {
            Fate::Rewrite(|frame| frame.session ^= 1)
        } else {
            Fate::Pass
        }
    });
    assert!(client.foreign > 0 && server.foreign > 0);
}
