//! Guards rigs and controllers on loopback: bits in lock-step, the drive of a rig in real time whatever the network does to the frames,
//! late and missing answers of a controller, and refused sessions.

mod controller;
mod lock_step;
mod real_time;

use std::net::SocketAddr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

use vines_net::{Address, LinkError, NetController, NetRig, Role, Served as Offered, Server, Service, Session};
use vines_testbench::rig::{BuiltIn, Controller, Drive, Rig, RigError, RigStage, Simulated};
use vines_testbench::scene::{PAPER, Scene};

/// A free port of this machine.
const ANYWHERE: ([u8; 4], u16) = ([127, 0, 0, 1], 0);
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
    sessions: Receiver<Session>,
}

impl Served {
    fn start(
        address: fn(SocketAddr) -> Address,
        service: Service,
        mut make: impl FnMut() -> Offered + Send + 'static,
    ) -> Self {
        let mut server = Server::listen(address(ANYWHERE.into()), service, None).unwrap();
        let (stop, (ended, sessions)) = (Arc::new(AtomicBool::new(false)), mpsc::channel());
        let (address, flag) = (server.address().unwrap(), Arc::clone(&stop));
        thread::spawn(move || {
            let report = |session: &Session| drop(ended.send(session.clone()));
            server
                .serve(|| Ok(make()), || flag.load(Ordering::Relaxed), report)
                .unwrap();
        });
        Self { address, stop, sessions }
    }

    /// Waits for the end of the next session, and returns its report.
    fn session(&self) -> Session {
        self.sessions
            .recv_timeout(Duration::from_secs(60))
            .expect("the session does not end")
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
    let copy = log.clone();
    let make = move || Offered::Rig(Box::new(Spy(plant.clone(), copy.clone())));
    (Served::start(address, service(scene, silence), make), log)
}

/// Serves any controller.
fn serve_controller<C: Controller + Clone + Send + 'static>(scene: &Scene, silence: f64, controller: C) -> Served {
    let (role, sample_time) = (Role::Controller, scene.sample_time());
    let make = move || Offered::Controller(Box::new(controller.clone()));
    Served::start(Address::Tcp, Service { role, sample_time, silence }, make)
}

/// Serves the controller of the scene.
fn serve_built_in(scene: &Scene) -> Served {
    serve_controller(scene, 5.0, BuiltIn::new(&scene.controller_config()).unwrap())
}

/// The drives of a rig.
#[derive(Clone, Default)]
struct Log(Arc<Mutex<Vec<Drive>>>);

impl Log {
    fn all(&self) -> Vec<Drive> {
        self.0.lock().unwrap().clone()
    }

    fn last(&self) -> Drive {
        *self.all().last().unwrap()
    }
}

/// A plant that logs its drives.
struct Spy(Simulated, Log);

impl RigStage for Spy {
    fn inner(&mut self) -> &mut dyn Rig {
        &mut self.0
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        self.1.0.lock().unwrap().push(drive);
        self.0.advance(drive, step)
    }

    fn hold(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        self.1.0.lock().unwrap().push(drive);
        self.0.hold(drive, step)
    }
}

/// A drive whose frequency identifies its sample.
fn drive(sample: usize) -> Drive {
    let omega = 50.0 + sample as f64 / 1024.0;
    Drive { omega, amplitude: 1e-4, displacement: 0.0 }
}

/// Drives a rig in open loop for some samples.
fn shake(rig: &mut dyn Rig, scene: &Scene, samples: usize) -> Result<(), RigError> {
    (0..samples).try_for_each(|n| {
        rig.sense()?;
        rig.ground_truth()?;
        rig.advance(drive(n), scene.sample_time())
    })
}

/// The error of the connection in the error of a rig.
fn link_error(error: &RigError) -> &LinkError {
    error.cause().unwrap_or_else(|| panic!("{error}"))
}
