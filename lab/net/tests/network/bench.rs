//! Servers in threads of the test, on free ports of this machine.

use std::net::SocketAddr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use vines_net::{Address, Role, Served as Offered, Server, Service, Session};
use vines_testbench::rig::{BuiltIn, Controller, Drive, GroundTruth, Rig, RigError, Sensors, Simulated};
use vines_testbench::scene::{Override, PAPER, Scene};

/// A free port of this machine.
const ANYWHERE: ([u8; 4], u16) = ([127, 0, 0, 1], 0);
/// Time limit of a server.
const LONGEST: Duration = Duration::from_secs(60);

/// The default scene, 882 samples a second, with settings.
pub fn scene(settings: &[&str]) -> Scene {
    let overrides: Vec<Override> = settings.iter().map(|s| s.parse().unwrap()).collect();
    Scene::parse("paper.toml", PAPER, &overrides).unwrap()
}

/// A running server.
pub struct Served {
    pub address: Address,
    stop: Arc<AtomicBool>,
    sessions: Arc<Mutex<Vec<Session>>>,
    thread: Option<JoinHandle<()>>,
}

impl Served {
    /// Stops the server and returns its sessions.
    pub fn stop(mut self) -> Vec<Session> {
        self.end();
        self.sessions.lock().unwrap().clone()
    }

    /// Waits for the end of `count` sessions and returns them.
    pub fn sessions(&self, count: usize) -> Vec<Session> {
        let end = Instant::now() + LONGEST;
        loop {
            let sessions = self.sessions.lock().unwrap().clone();
            if sessions.len() >= count {
                return sessions;
            }
            assert!(Instant::now() < end, "the session does not end");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    fn end(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            thread.join().unwrap();
        }
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

/// Address of the socket, without the transport.
pub fn socket(address: Address) -> SocketAddr {
    match address {
        Address::Tcp(socket) | Address::Udp(socket) => socket,
    }
}

fn serve(
    address: fn(SocketAddr) -> Address,
    service: Service,
    mut make: impl FnMut() -> Offered + Send + 'static,
) -> Served {
    let mut server = Server::listen(address(ANYWHERE.into()), service, None).unwrap();
    let address = server.address().unwrap();
    let (stop, sessions) = (Arc::new(AtomicBool::new(false)), Arc::default());
    let (flag, list) = (Arc::clone(&stop), Arc::<Mutex<Vec<Session>>>::clone(&sessions));
    let end = Instant::now() + LONGEST;
    let thread = std::thread::spawn(move || {
        let stop = || flag.load(Ordering::Relaxed) || Instant::now() >= end;
        let tell = |session: &Session| list.lock().unwrap().push(session.clone());
        server.serve(|| Ok(make()), stop, tell).unwrap();
    });
    Served { address, stop, sessions, thread: Some(thread) }
}

/// Settings of a server for the plant of `scene`.
pub fn service(scene: &Scene, silence: f64) -> Service {
    Service {
        role: Role::Rig {
            max_amplitude: scene.plant.half_width,
            sensors: scene.resonance,
        },
        sample_time: scene.sample_time(),
        silence,
    }
}

fn spied_rig(scene: &Scene, silence: f64, address: fn(SocketAddr) -> Address) -> (Served, Log) {
    let (plant, log) = (Simulated::new(scene.plant, scene.start).unwrap(), Log::default());
    let copy = Arc::clone(&log);
    let make = move || Offered::Rig(Box::new(Spy(plant.clone(), Arc::clone(&copy))));
    (serve(address, service(scene, silence), make), log)
}

/// Serves the plant of the scene in lock-step; the log contains every drive of the plant.
pub fn lock_step_rig(scene: &Scene, silence: f64) -> (Served, Log) {
    spied_rig(scene, silence, Address::Tcp)
}

/// Serves the plant of the scene in real time; the log contains every drive of the plant.
pub fn real_time_rig(scene: &Scene, silence: f64) -> (Served, Log) {
    spied_rig(scene, silence, Address::Udp)
}

/// Serves the controller of the scene.
pub fn controller(scene: &Scene, silence: f64) -> Served {
    let controller = BuiltIn::new(&scene.controller_config()).unwrap();
    serve_controller(scene, silence, move || Box::new(controller.clone()))
}

/// Serves any controller.
pub fn serve_controller(
    scene: &Scene,
    silence: f64,
    mut make: impl FnMut() -> Box<dyn Controller> + Send + 'static,
) -> Served {
    let service = Service {
        role: Role::Controller,
        sample_time: scene.sample_time(),
        silence,
    };
    serve(Address::Tcp, service, move || Offered::Controller(make()))
}

/// The drives of a rig.
pub type Log = Arc<Mutex<Vec<Drive>>>;

/// A rig that logs its drives.
pub struct Spy(pub Simulated, pub Log);

impl Rig for Spy {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        self.0.sense()
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        self.1.lock().unwrap().push(drive);
        self.0.advance(drive, step)
    }

    fn hold(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        self.1.lock().unwrap().push(drive);
        self.0.hold(drive, step)
    }

    fn ground_truth(&mut self) -> Result<Option<GroundTruth>, RigError> {
        self.0.ground_truth()
    }
}

/// A drive whose frequency identifies its sample.
pub fn drive(sample: usize) -> Drive {
    Drive {
        omega: 50.0 + sample as f64 / 1024.0,
        amplitude: 1e-4,
        displacement: 0.0,
    }
}

/// Drives a rig in open loop for some samples. Returns all readings.
pub fn shake(
    rig: &mut dyn Rig,
    scene: &Scene,
    samples: usize,
) -> Result<Vec<(Sensors, Option<GroundTruth>)>, RigError> {
    (0..samples)
        .map(|n| {
            let told = (rig.sense()?, rig.ground_truth()?);
            rig.advance(drive(n), scene.sample_time())?;
            Ok(told)
        })
        .collect()
}
