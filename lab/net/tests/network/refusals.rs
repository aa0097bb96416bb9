//! Sessions that are refused, each with a message that says what to do.

use std::net::{TcpStream, UdpSocket};
use std::time::{Duration, Instant};

use vines_net::frame::{Frame, Kind};
use vines_net::{Address, LinkError, NetController, NetRig, Refusal, Server};
use vines_testbench::scene::Definition;

use crate::bench::{controller, lock_step_rig, real_time_rig, scene, service, shake, socket};

#[test]
fn a_missing_server_is_reported_with_the_command_that_starts_it() {
    let silent = UdpSocket::bind("127.0.0.1:0").unwrap();
    let start = Instant::now();
    let place = silent.local_addr().unwrap();
    for (error, command) in [
        (
            NetRig::connect(Address::Udp(place), 1e-3, None).unwrap_err(),
            "vines rig --listen",
        ),
        (
            NetRig::connect(Address::Tcp(place), 1e-3, None).unwrap_err(),
            "vines rig --lock-step --listen",
        ),
        (
            NetController::connect(place, 1e-3, None, None).unwrap_err(),
            "vines controller --listen",
        ),
    ] {
        assert!(matches!(error, LinkError::Unreachable { .. }));
        assert!(error.to_string().contains(command), "{error}");
    }
    assert!(start.elapsed() < Duration::from_secs(5));
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
            .send_to(b"VINE\x03\x00 and what follows in version 3", from)
            .unwrap();
    });
    let error = NetRig::connect(Address::Udp(address), 1e-3, None).unwrap_err();
    newer.join().unwrap();
    assert!(matches!(error, LinkError::Version { theirs: 3, .. }));
    let text = error.to_string();
    assert!(text.contains("version 3") && text.contains("version 2"), "{text}");
}

/// The answer of a rig in real time to a datagram.
fn answer(bytes: &[u8]) -> Frame {
    let (server, _) = real_time_rig(&scene(&[]), 1.0);
    let client = UdpSocket::bind("127.0.0.1:0").unwrap();
    client.set_read_timeout(Some(Duration::from_secs(5))).unwrap();
    client.send_to(bytes, socket(server.address)).unwrap();
    let mut answer = [0; 256];
    let size = client.recv(&mut answer).unwrap();
    Frame::decode(&answer[..size]).unwrap()
}

#[test]
fn a_client_of_another_version_or_without_a_sample_time_is_refused() {
    let newer = answer(b"VINE\x09\x00 hello from the future");
    assert_eq!(
        (newer.kind, newer.values[..2].to_vec()),
        (Kind::Refusal, vec![4.0, 2.0])
    );
    let mut hello = Frame::new(Kind::Hello, 1);
    hello.values[0] = f64::NAN;
    let refusal = answer(&hello.encode());
    assert_eq!((refusal.kind, refusal.values[0]), (Kind::Refusal, 2.0));
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
    let ((rig, _), peer) = (lock_step_rig(&scene, 5.0), controller(&scene, 5.0));
    let sample_time = scene.sample_time();
    let error = NetRig::connect(peer.address, sample_time, None).unwrap_err();
    assert_eq!(refused(&error), Refusal::Role);
    let error = NetController::connect(socket(rig.address), sample_time, None, None).unwrap_err();
    assert_eq!(refused(&error), Refusal::Role);
}

#[test]
fn another_sample_time_is_refused_with_that_of_the_server() {
    let scene = scene(&[]);
    let (server, _) = lock_step_rig(&scene, 5.0);
    let error = NetRig::connect(server.address, 2.0 * scene.sample_time(), None).unwrap_err();
    assert_eq!(refused(&error), Refusal::SampleTime(scene.sample_time()));
    assert!(error.to_string().contains("same scene"), "{error}");
}

#[test]
fn a_rig_with_other_sensors_than_those_of_the_scene_is_refused() {
    let scene = scene(&["resonance.sensor='q1'"]);
    let (server, _) = lock_step_rig(&scene, 5.0);
    let connect = || NetRig::connect(server.address, scene.sample_time(), None).unwrap();
    assert!(connect().with_sensors(scene.resonance).is_ok());
    let error = connect().with_sensors(Definition::default()).unwrap_err();
    assert!(
        error
            .to_string()
            .contains("measures q1 and e, the [resonance] section of the scene needs v and e"),
        "{error}"
    );
}

#[test]
fn a_second_client_is_refused_during_the_session_of_the_first() {
    let scene = scene(&[]);
    for (server, _) in [lock_step_rig(&scene, 10.0), real_time_rig(&scene, 10.0)] {
        let mut first = NetRig::connect(server.address, scene.sample_time(), None).unwrap();
        let error = NetRig::connect(server.address, scene.sample_time(), None).unwrap_err();
        assert_eq!(refused(&error), Refusal::Busy);
        crate::bench::shake(&mut first, &scene, 10).unwrap();
    }
}

#[test]
fn a_port_in_use_is_named() {
    let scene = scene(&[]);
    let (first, _) = lock_step_rig(&scene, 5.0);
    let error = Server::listen(first.address, service(&scene, 1.0), None).err().unwrap();
    assert!(error.to_string().contains(&first.address.to_string()), "{error}");
    assert!(matches!(error, LinkError::Listen { .. }));
}

#[test]
fn a_server_stopped_by_its_owner_reports_the_session_it_had() {
    let scene = scene(&[]);
    let (server, _) = lock_step_rig(&scene, 5.0);
    let mut rig = NetRig::connect(server.address, scene.sample_time(), None).unwrap();
    crate::bench::shake(&mut rig, &scene, 10).unwrap();
    let sessions = server.stop();
    assert_eq!(sessions.len(), 1);
    assert_eq!(sessions[0].ended, vines_net::Ended::Stopped);
}

#[test]
fn silent_connections_do_not_keep_a_client_waiting() {
    let scene = scene(&[]);
    let (server, _) = lock_step_rig(&scene, 5.0);
    let _silent: Vec<_> = (0..130)
        .map(|_| TcpStream::connect(socket(server.address)).unwrap())
        .collect();
    // It gives up after 2 s.
    let mut rig = NetRig::connect(server.address, scene.sample_time(), None).unwrap();
    shake(&mut rig, &scene, 10).unwrap();
}
