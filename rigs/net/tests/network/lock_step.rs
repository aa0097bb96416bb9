//! Guards lock-step: every bit equals that of the built-in plant, and a frame that is not allowed is answered at once. Refused sessions say
//! what to do.

use std::net::{SocketAddr, TcpStream};
use std::thread::{self, JoinHandle};

use vines_bench::experiment;
use vines_bench::rig::{
    BuiltIn, Chain, Command, Controller, ControllerError, Drive, Rig, RigError, RigStage, Sensors, Simulated,
};
use vines_bench::scene::Definition;
use vines_net::frame::{Frame, Kind};
use vines_net::{
    Address, Ended, Key, LinkError, NetController, NetRig, RAMP_SAMPLES, Refusal, Role, Served as Offered, Server,
    ServerError, Service,
};

use crate::fixture::socket;
use crate::{PATIENT, SCENE, drive, link_error, scene, serve_built_in, serve_rig, service, shake};

#[test]
fn an_experiment_with_held_samples_across_the_network_gives_the_same_bits() {
    let mut scene = scene(&[
        "chain.hold=true",
        "chain.dac_bits=12",
        "phase_lock.lock.amplitude_drift=3e-4",
    ]);
    scene.record.decay_periods = Some(150.0);
    let measure = |rig: Box<dyn Rig>, controller: &mut dyn Controller| {
        let mut rig = Chain::around(rig, &scene);
        experiment::run(&mut Vec::new(), rig.as_mut(), controller, &scene.plan(), |_, _| {}).unwrap()
    };
    let plant = Simulated::new(scene.plant, scene.start).unwrap();
    let direct = measure(Box::new(plant), &mut BuiltIn::new(&scene.plan().lock).unwrap());
    let (rig, peer) = (serve_rig(Address::Tcp, &scene, 5.0), serve_built_in(&scene));
    let client = rig.rig();
    assert_eq!(client.pace(), None);
    assert_eq!(measure(Box::new(client), &mut peer.controller(None)), direct);
    for session in [rig.session(), peer.session()] {
        let samples = direct.samples.len() as u64;
        assert_eq!((session.ended, session.samples), (Ended::Farewell, samples));
    }
}

#[test]
fn the_drive_of_a_client_that_has_left_ramps_to_zero() {
    let server = serve_rig(Address::Tcp, &SCENE, 5.0);
    shake(&mut server.rig(), 20).unwrap();
    assert_eq!(server.session().samples, 20);
    let left = 20 + RAMP_SAMPLES as usize;
    assert_eq!((server.drives().len(), server.last().amplitude), (left, 0.0));
    // A base of held samples, too.
    let (mut rig, base) = (
        server.rig(),
        Drive { displacement: 1e-3, is_held: true, ..Drive::default() },
    );
    rig.sense().unwrap();
    rig.advance(base, SCENE.sample_time()).unwrap();
    rig.sense().unwrap();
    drop(rig);
    server.session();
    let ramp = server.drives().split_off(left);
    assert!(ramp.windows(2).all(|pair| pair[1].displacement < pair[0].displacement));
    assert_eq!((ramp[0], server.last().displacement), (base, 0.0));
}

#[test]
fn a_drive_above_a_limit_is_refused_at_once_with_the_value_and_the_limit() {
    let limit = SCENE.plant.half_width;
    for (index, bad) in [
        (0, Drive { omega: f64::NAN, ..drive(3) }),
        (0, Drive { omega: 1e9, ..drive(3) }),
        (1, Drive { amplitude: 1.01 * limit, ..drive(3) }),
        (1, Drive { amplitude: -1e-9, ..drive(3) }),
        (2, Drive { displacement: -1e3, ..drive(3) }),
    ] {
        let server = serve_rig(Address::Tcp, &SCENE, 5.0);
        let mut rig = server.rig();
        shake(&mut rig, 3).unwrap();
        rig.sense().unwrap();
        let driven = rig.advance(bad, SCENE.sample_time());
        let error = driven.and_then(|()| rig.sense()).unwrap_err();
        let is_named = matches!(refused(link_error(&error)), Refusal::Drive { index: named, .. } if named == index);
        assert!(is_named && error.to_string().contains("allowed is up to"), "{error}");
        assert_eq!(server.session().ended, Ended::Refused);
        // The rig never had it.
        let mut drives = server.drives().into_iter();
        assert!(drives.all(|had| had.amplitude <= 1e-4 && had.omega < 51.0));
    }
}

#[test]
fn a_silence_ramps_the_drive_down_and_a_client_that_returns_is_informed() {
    let server = serve_rig(Address::Tcp, &SCENE, PATIENT);
    let mut rig = server.rig();
    shake(&mut rig, 20).unwrap();
    assert_eq!((server.session().ended, server.last().amplitude), (Ended::Silence, 0.0));
    let error = shake(&mut rig, 2).unwrap_err();
    assert!(matches!(link_error(&error), LinkError::Closed { .. }), "{error}");
    // Only another session arms the rig again.
    shake(&mut server.rig(), 20).unwrap();
}

#[test]
fn a_missing_server_is_reported_with_its_address_and_what_should_be_there() {
    let silent = socket();
    let place = silent.local_addr().unwrap();
    let rig = |address| NetRig::connect(address, 1e-3, None).unwrap_err();
    let controller = NetController::connect(place, &SCENE.plan().lock, None, None).unwrap_err();
    for (error, expected) in [
        (rig(Address::Udp(place)), (Address::Udp(place), false)),
        (rig(Address::Tcp(place)), (Address::Tcp(place), false)),
        (controller, (Address::Tcp(place), true)),
    ] {
        let LinkError::Unreachable { peer, controller, .. } = error else {
            panic!("{error}");
        };
        assert_eq!((peer, controller), expected);
    }
}

#[test]
fn another_version_is_named_with_both_numbers_and_a_client_without_a_sample_time_is_refused() {
    let [other, client] = [(); 2].map(|()| socket());
    let address = Address::Udp(other.local_addr().unwrap());
    let newer = std::thread::spawn(move || {
        let (_, from) = other.recv_from(&mut [0; 256]).unwrap();
        let answer = b"VINE\x03\x00 and what follows in version 3";
        other.send_to(answer, from).unwrap();
    });
    let error = NetRig::connect(address, 1e-3, None).unwrap_err();
    newer.join().unwrap();
    assert_eq!(refused(&error), Refusal::Version(3));
    let text = error.to_string();
    assert!(text.contains("version 3") && text.contains("version 2"), "{text}");

    let server = serve_rig(Address::Udp, &SCENE, 1.0);
    let mut hello = Frame::new(Kind::Hello, 1);
    hello.values[0] = f64::NAN;
    for (bytes, code) in [
        (&b"VINE\x09\x00 hello from the future"[..], 4.0),
        (&hello.encode(), 2.0),
    ] {
        client.send_to(bytes, server.address.socket()).unwrap();
        let mut answer = [0; 256];
        let size = client.recv(&mut answer).unwrap();
        let refusal = Frame::decode(&answer[..size]).unwrap();
        assert_eq!((refusal.kind, refusal.values[0]), (Kind::Refusal, code));
    }
}

fn refused(error: &LinkError) -> Refusal {
    let LinkError::Refused { reason, .. } = error else {
        panic!("{error}");
    };
    *reason
}

#[test]
fn another_role_another_sample_time_and_other_sensors_are_refused() {
    let scene = scene(&["resonance.sensor='q1'"]);
    let (rig, peer) = (serve_rig(Address::Tcp, &scene, 5.0), serve_built_in(&scene));
    let (step, config) = (scene.sample_time(), scene.plan().lock);
    let connect = |address, step| NetRig::connect(address, step, None).unwrap_err();
    let controller = NetController::connect(rig.address.socket(), &config, None, None).unwrap_err();
    let role = "it is a rig where a controller is needed, or the reverse";
    let other = connect(rig.address, 2.0 * step);
    for (error, reason, part) in [
        (connect(peer.address, step), Refusal::Role, role),
        (controller, Refusal::Role, role),
        (
            other,
            Refusal::SampleTime { server: step, client: 2.0 * step },
            "s, and that of this program 0.00226",
        ),
    ] {
        assert_eq!(refused(&error), reason);
        assert!(error.to_string().contains(part), "{error}");
    }
    assert!(rig.rig().with_sensors(scene.resonance).is_ok());
    let error = rig.rig().with_sensors(Definition::default()).unwrap_err();
    let message = "measures q1 and e, the [resonance] section of the scene needs v and e";
    assert!(error.to_string().contains(message), "{error}");
}

#[test]
fn a_second_client_is_refused_and_silent_connections_keep_nobody_waiting() {
    let [other, busy] = [
        "it has another client or another key",
        "it has another client; sessions are served one at a time",
    ];
    // A client gives up after 2 s.
    for (address, silent, reason) in [(Address::Tcp as fn(_) -> _, 130, other), (Address::Udp, 0, busy)] {
        let server = serve_rig(address, &SCENE, 10.0);
        let connect = |_| TcpStream::connect(server.address.socket()).unwrap();
        let _silent: Vec<_> = (0..silent).map(connect).collect();
        let mut first = server.rig();
        let error = NetRig::connect(server.address, SCENE.sample_time(), None).unwrap_err();
        assert!(error.to_string().contains(reason), "{error}");
        shake(&mut first, 10).unwrap();
    }
}

#[test]
fn a_port_in_use_is_named_and_a_server_that_is_stopped_reports_its_session() {
    let server = serve_rig(Address::Tcp, &SCENE, 5.0);
    let second = Server::listen(server.address, service(&SCENE, 1.0), None);
    let error = second.err().unwrap();
    assert!(matches!(error, LinkError::Listen { .. }));
    assert!(error.to_string().contains(&server.address.to_string()), "{error}");
    let mut rig = server.rig();
    shake(&mut rig, 10).unwrap();
    server.running.stop.store(true, std::sync::atomic::Ordering::Relaxed);
    assert_eq!(server.session().ended, Ended::Stopped);
}

/// A plant whose shaker is at its limit after some drives.
struct AtLimit(Simulated, usize);

impl RigStage for AtLimit {
    fn inner(&mut self) -> &mut dyn Rig {
        &mut self.0
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        self.1 = self.1.saturating_sub(1);
        if self.1 > 0 {
            return self.0.advance(drive, step);
        }
        Err(RigError::ShakerLimit {
            name: "displacement of the armature",
            key: "stroke_max",
            value: -8.801e-3,
            limit: 8.8e-3,
            unit: "m",
        })
    }
}

/// A controller that cannot go on.
struct Hot;

impl Controller for Hot {
    fn sample(&mut self, _: Sensors, _: bool) -> Result<Command, ControllerError> {
        Err(ControllerError::Failed("its processor is too hot, 92 degrees".into()))
    }
}

/// How a session and its server end.
type Outcome = (Option<Ended>, Result<(), ServerError>);

/// Serves one session of what `make` gives, and returns the address, and how session and server end.
fn serve_once(
    address: fn(SocketAddr) -> Address,
    service: Service,
    key: Option<Key>,
    mut make: impl FnMut() -> Result<Offered, ServerError> + Send + 'static,
) -> (Address, JoinHandle<Outcome>) {
    let mut server = Server::listen(address(([127, 0, 0, 1], 0).into()), service, key).unwrap();
    let at = server.address().unwrap();
    let serve = move || {
        let mut ended = None;
        let served = server.serve(&mut make, || false, |session| ended = Some(session.ended));
        (ended, served)
    };
    (at, thread::spawn(serve))
}

#[test]
fn an_error_of_a_served_rig_or_controller_reaches_the_client_with_its_name_and_numbers() {
    let limit = "the displacement of the armature is -8.801e-3 m, and shaker.stroke_max allows 0.0088 m";
    let step = SCENE.sample_time();
    for address in [Address::Tcp as fn(_) -> _, Address::Udp] {
        for key in [None, Key::of(b"0123456789abcdef")] {
            let plant = Simulated::new(SCENE.plant, SCENE.start).unwrap();
            let make = move || Ok(Offered::Rig(Box::new(AtLimit(plant.clone(), 20))));
            let (at, served) = serve_once(address, service(&SCENE, 5.0), key, make);
            let mut rig = NetRig::connect(at, step, key).unwrap();
            let error = shake(&mut rig, 100_000).unwrap_err();
            assert!(matches!(link_error(&error), LinkError::Failed { .. }), "{error}");
            assert!(error.to_string().contains(limit), "{error}");
            let (ended, served) = served.join().unwrap();
            assert_eq!(ended, Some(Ended::Failed));
            assert!(matches!(served, Err(ServerError::Rig(RigError::ShakerLimit { .. }))));
        }
    }
    // A rig that does not begin.
    let refuses = || Err(RigError::Failed("no calibration of channel 3".into()).into());
    let (at, _) = serve_once(Address::Tcp, service(&SCENE, 5.0), None, refuses);
    let error = NetRig::connect(at, step, None)
        .unwrap()
        .sense()
        .unwrap_err()
        .to_string();
    assert!(error.contains("no calibration of channel 3"), "{error}");
    let service = Service { role: Role::Controller, ..service(&SCENE, 5.0) };
    let (at, _) = serve_once(Address::Tcp, service, None, || Ok(Offered::Controller(Box::new(Hot))));
    let mut hot = NetController::connect(at.socket(), &SCENE.plan().lock, None, None).unwrap();
    let error = hot.sample(Sensors::default(), true).unwrap_err().to_string();
    assert!(error.contains("too hot, 92 degrees"), "{error}");
}
