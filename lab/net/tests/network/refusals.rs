//! Sessions that are refused, each with a message that says what to do.

use std::net::UdpSocket;
use std::time::{Duration, Instant};

use vines_net::frame::{Frame, Kind};
use vines_net::{LinkError, NetController, NetRig, Refusal, RigServer};

use crate::bench::{controller, lock_step_rig, scene, service};

#[test]
fn a_missing_server_is_reported_with_the_command_that_starts_it() {
    let silent = UdpSocket::bind("127.0.0.1:0").unwrap();
    let start = Instant::now();
    let error = NetRig::connect(silent.local_addr().unwrap(), 1e-3).unwrap_err();
    assert!(start.elapsed() < Duration::from_secs(5));
    assert!(matches!(error, LinkError::Unreachable { .. }));
    assert!(error.to_string().contains("vines rig --listen"), "{error}");
}

#[test]
fn another_version_is_named_with_both_numbers() {
    let other = UdpSocket::bind("127.0.0.1:0").unwrap();
    let address = other.local_addr().unwrap();
    let newer = std::thread::spawn(move || {
        let mut bytes = [0; 256];
        other.set_read_timeout(Some(Duration::from_secs(5))).unwrap();
        let (_, from) = other.recv_from(&mut bytes).unwrap();
        other
            .send_to(b"VINE\x02\x00 and what follows in version 2", from)
            .unwrap();
    });
    let error = NetRig::connect(address, 1e-3).unwrap_err();
    newer.join().unwrap();
    assert!(matches!(error, LinkError::Version { theirs: 2, .. }));
    let text = error.to_string();
    assert!(text.contains("version 2") && text.contains("version 1"), "{text}");
}

#[test]
fn a_client_of_another_version_is_informed_of_the_version_of_the_server() {
    let server = lock_step_rig(&scene(&[]));
    let client = UdpSocket::bind("127.0.0.1:0").unwrap();
    client.set_read_timeout(Some(Duration::from_secs(5))).unwrap();
    client
        .send_to(b"VINE\x09\x00 hello from the future", server.address)
        .unwrap();
    let mut bytes = [0; 256];
    let size = client.recv(&mut bytes).unwrap();
    let answer = Frame::decode(&bytes[..size]).unwrap();
    assert_eq!(
        (answer.kind, answer.values[..2].to_vec()),
        (Kind::Refusal, vec![4.0, 1.0])
    );
}

fn refused(error: &LinkError) -> Refusal {
    let LinkError::Refused { reason, .. } = error else {
        panic!("{error}");
    };
    *reason
}

#[test]
fn a_rig_is_not_accepted_as_a_controller_nor_the_reverse() {
    let scene = scene(&[]);
    let (rig, peer) = (lock_step_rig(&scene), controller(&scene, 5.0));
    let sample_time = scene.sample_time();
    let error = NetRig::connect(peer.address, sample_time).unwrap_err();
    assert_eq!(refused(&error), Refusal::Role);
    let error = NetController::connect(rig.address, sample_time, None).unwrap_err();
    assert_eq!(refused(&error), Refusal::Role);
}

#[test]
fn another_sample_time_is_refused_with_that_of_the_server() {
    let scene = scene(&[]);
    let server = lock_step_rig(&scene);
    let error = NetRig::connect(server.address, 2.0 * scene.sample_time()).unwrap_err();
    assert_eq!(refused(&error), Refusal::SampleTime(scene.sample_time()));
    assert!(error.to_string().contains("same scene"), "{error}");
}

#[test]
fn a_second_client_is_refused_during_the_session_of_the_first() {
    let scene = scene(&[]);
    let server = lock_step_rig(&scene);
    let _first = NetRig::connect(server.address, scene.sample_time()).unwrap();
    let error = NetRig::connect(server.address, scene.sample_time()).unwrap_err();
    assert_eq!(refused(&error), Refusal::Busy);
}

#[test]
fn a_port_in_use_is_named() {
    let scene = scene(&[]);
    let first = lock_step_rig(&scene);
    let error = RigServer::listen(first.address, service(&scene, false, 1.0))
        .err()
        .unwrap();
    assert!(error.to_string().contains(&first.address.to_string()), "{error}");
    assert!(matches!(error, LinkError::Listen { .. }));
}

#[test]
fn a_server_stopped_by_its_owner_reports_the_session_it_had() {
    let scene = scene(&[]);
    let server = lock_step_rig(&scene);
    let mut rig = NetRig::connect(server.address, scene.sample_time()).unwrap();
    crate::bench::shake(&mut rig, &scene, 10).unwrap();
    let sessions = server.stop();
    assert_eq!(sessions.len(), 1);
    assert_eq!(sessions[0].ended, vines_net::Ended::Stopped);
}
