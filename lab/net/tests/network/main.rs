//! Guards rigs and controllers on loopback: bits in lock-step, the drive of a rig in real time whatever the network does to the frames,
//! late and missing answers of a controller, and refused sessions.

mod controller;
mod lock_step;
mod real_time;

use std::net::SocketAddr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use vines_net::{Address, NetController, NetRig, Role, Served as Offered, Server, Service, Session};
use vines_testbench::rig::{BuiltIn, Controller, Drive, GroundTruth, Rig, RigError, RigStage, Sensors, Simulated};
use vines_testbench::scene::{PAPER, Scene};

/// A free port of this machine.
const ANYWHERE: ([u8; 4], u16) = ([127, 0, 0, 1], 0);
/// Time limit of a server.
const LONGEST: Duration = Duration::from_secs(60);
/// A silence, s, longer than the pauses of a busy machine.
const PATIENT: f64 = 2.0;

/// The default scene, 882 samples a second, with settings.
fn scene(settings: &[&str]) -> Scene {
    let overrides: Vec<_> = settings.iter().map(|setting| setting.parse().unwrap()).collect();
    Scene::parse("paper.toml", PAPER, &overrides).unwrap()
}

/// A running server.
struct Served {
    address: Address,
    stop: Arc<AtomicBool>,
    sessions: Arc<Mutex<Vec<Session>>>,
    thread: Option<JoinHandle<()>>,
}

impl Served {
    fn start(
        address: fn(SocketAddr) -> Address,
        service: Service,
        mut make: impl FnMut() -> Offered + Send + 'static,
    ) -> Self {
        let mut server = Server::listen(address(ANYWHERE.into()), service, None).unwrap();
        let address = server.address().unwrap();
        let (stop, sessions) = (Arc::new(AtomicBool::new(false)), Arc::<Mutex<Vec<Session>>>::default());
        let (flag, list) = (Arc::clone(&stop), Arc::clone(&sessions));
        let end = Instant::now() + LONGEST;
        let thread = thread::spawn(move || {
            let stop = || flag.load(Ordering::Relaxed) || Instant::now() >= end;
            let report = |session: &Session| list.lock().unwrap().push(session.clone());
            server.serve(|| Ok(make()), stop, report).unwrap();
        });
        Self { address, stop, sessions, thread: Some(thread) }
    }

    /// Stops the server and returns its sessions.
    fn stop(mut self) -> Vec<Session> {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.take().unwrap().join().unwrap();
        self.sessions.lock().unwrap().clone()
    }

    /// Waits for the end of session `number`, from 1, and returns its report.
    fn session(&self, number: usize) -> Session {
        let end = Instant::now() + LONGEST;
        loop {
            if let Some(session) = self.sessions.lock().unwrap().get(number - 1) {
                return session.clone();
            }
            assert!(Instant::now() < end, "the session does not end");
            thread::sleep(Duration::from_millis(5));
        }
    }

    /// A client of the rig.
    fn rig(&self, scene: &Scene) -> NetRig {
        NetRig::connect(self.address, scene.sample_time(), None).unwrap()
    }

    /// A client of the controller, beside a rig of this `pace`.
    fn controller(&self, scene: &Scene, pace: Option<f64>) -> NetController {
        NetController::connect(self.address.socket(), &scene.controller_config(), pace, None).unwrap()
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

/// Settings of a server for the plant of `scene`.
fn service(scene: &Scene, silence: f64) -> Service {
    let (max_amplitude, sensors) = (scene.plant.half_width, scene.resonance);
    let role = Role::Rig { max_amplitude, sensors };
    Service { role, sample_time: scene.sample_time(), silence }
}

/// Serves the plant of the scene, in lock-step over TCP or in real time over UDP; the log contains every drive of the plant.
fn serve_rig(address: fn(SocketAddr) -> Address, scene: &Scene, silence: f64) -> (Served, Log) {
    let (plant, log) = (Simulated::new(scene.plant, scene.start).unwrap(), Log::default());
    let copy = Arc::clone(&log);
    let make = move || Offered::Rig(Box::new(Spy(plant.clone(), Arc::clone(&copy))));
    (Served::start(address, service(scene, silence), make), log)
}

/// Serves any controller.
fn serve_controller<C: Controller + 'static>(
    scene: &Scene,
    silence: f64,
    mut make: impl FnMut() -> C + Send + 'static,
) -> Served {
    let (role, sample_time) = (Role::Controller, scene.sample_time());
    let make = move || Offered::Controller(Box::new(make()));
    Served::start(Address::Tcp, Service { role, sample_time, silence }, make)
}

/// Serves the controller of the scene.
fn serve_built_in(scene: &Scene) -> Served {
    let controller = BuiltIn::new(&scene.controller_config()).unwrap();
    serve_controller(scene, 5.0, move || controller.clone())
}

/// The drives of a rig.
type Log = Arc<Mutex<Vec<Drive>>>;

/// A plant that logs its drives.
struct Spy(Simulated, Log);

impl RigStage for Spy {
    fn inner(&mut self) -> &mut dyn Rig {
        &mut self.0
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        self.1.lock().unwrap().push(drive);
        self.0.advance(drive, step)
    }

    fn hold(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        self.1.lock().unwrap().push(drive);
        self.0.hold(drive, step)
    }
}

/// A drive whose frequency identifies its sample.
fn drive(sample: usize) -> Drive {
    Drive {
        omega: 50.0 + sample as f64 / 1024.0,
        amplitude: 1e-4,
        displacement: 0.0,
    }
}

/// Drives a rig in open loop for some samples. Returns all readings.
fn shake(rig: &mut dyn Rig, scene: &Scene, samples: usize) -> Result<Vec<(Sensors, Option<GroundTruth>)>, RigError> {
    (0..samples)
        .map(|n| {
            let reading = (rig.sense()?, rig.ground_truth()?);
            rig.advance(drive(n), scene.sample_time())?;
            Ok(reading)
        })
        .collect()
}
