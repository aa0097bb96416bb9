//! The loop check of a rig that is not a simulation, before the drive rises.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

use vines::net::{Address, Role, Served, Server, Service};
use vines::rig::{Drive, Rig, RigError, Sensors, Simulated};
use vines::scene::Scene;

use crate::vines;

/// Wiring of the two sensors.
type Wiring = fn(Sensors) -> Sensors;

/// A rig that does not report its impacts, as a real one; it notes its largest drive.
struct Wired {
    plant: Simulated,
    wiring: Wiring,
    largest: Arc<Mutex<f64>>,
}

impl Rig for Wired {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        Ok((self.wiring)(self.plant.sense()?))
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        let mut largest = self.largest.lock().unwrap();
        *largest = largest.max(drive.amplitude);
        self.plant.advance(drive, step)
    }
}

/// Runs a command with such a rig in lock-step: its exit code, its messages, and the largest drive over that of the scene.
fn run(command: &str, wiring: Wiring) -> (Option<i32>, String, f64) {
    let settings = ["start.dq2=0", "record.lock_periods=20"];
    let overrides = settings.map(|one| one.parse().unwrap());
    let scene = Scene::load(None, &overrides).unwrap();
    let role = Role::Rig {
        max_amplitude: scene.plant.half_width,
        sensors: scene.resonance,
    };
    let service = Service { role, sample_time: scene.sample_time(), silence: 30.0 };
    let mut server = Server::listen(Address::Tcp(([127, 0, 0, 1], 0).into()), service, None).unwrap();
    let rig = format!("{}", server.address().unwrap());
    let largest = Arc::new(Mutex::new(0.0));
    let ended = Arc::new(AtomicBool::new(false));
    let (seen, stop) = (Arc::clone(&largest), Arc::clone(&ended));
    let plant = Simulated::new(scene.plant, scene.start).unwrap();
    let thread = std::thread::spawn(move || {
        let make = || {
            let (plant, largest) = (plant.clone(), Arc::clone(&seen));
            Ok(Served::Rig(Box::new(Wired { plant, wiring, largest })))
        };
        server.serve(make, || stop.load(Ordering::Relaxed), |_| {}).unwrap();
    });
    let out = tempfile::tempdir().unwrap();
    let mut arguments = vec![command, "--rig", &rig, "--out", out.path().to_str().unwrap()];
    arguments.extend(settings.iter().flat_map(|one| ["--set", one]));
    let output = vines(&arguments);
    ended.store(true, Ordering::Relaxed);
    thread.join().unwrap();
    let largest = *largest.lock().unwrap() / scene.amplitude;
    (
        output.status.code(),
        String::from_utf8_lossy(&output.stderr).into(),
        largest,
    )
}

#[test]
fn a_rig_with_swapped_dead_or_reversed_sensors_is_never_driven_beyond_the_check() {
    let wirings: [(Wiring, &str); 6] = [
        (
            |s| Sensors { response: 2.0 * s.response, ..s },
            "the amplitude of the response is not as expected",
        ),
        (
            |s| Sensors { reference: s.reference.map(|base| 1.2 * base), ..s },
            "the amplitude of the base is not that of the drive",
        ),
        (
            |s| Sensors { response: s.reference.unwrap(), reference: Some(s.response) },
            "response and base are exchanged",
        ),
        (
            |s| Sensors { response: 0.0, ..s },
            "the response does not answer the drive",
        ),
        (
            |s| Sensors { reference: Some(0.0), ..s },
            "the base sensor does not answer the drive",
        ),
        (
            |s| Sensors { response: -s.response, ..s },
            "the response has the opposite sign",
        ),
    ];
    for (wiring, verdict) in wirings {
        for command in ["identify", "backbone"] {
            let (code, message, largest) = run(command, wiring);
            assert_eq!(code, Some(1), "{message}");
            assert!(
                message.contains(verdict) && message.contains("the drive is off"),
                "{message}"
            );
            assert!(largest > 0.0 && largest <= 0.01 * (1.0 + 1e-12), "{command}: {largest}");
        }
    }
}

#[test]
fn a_healthy_rig_is_driven_after_the_check() {
    let (_, message, largest) = run("identify", |sensors| sensors);
    assert!(
        message.contains("signs, gains, delays and noise are as expected"),
        "{message}"
    );
    assert!(
        message.contains("phase margin") && largest > 0.5,
        "{largest}: {message}"
    );
}
