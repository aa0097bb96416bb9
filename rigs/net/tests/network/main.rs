//! Guards rigs and controllers on loopback: bits in lock-step, the drive of a rig in real time whatever the network does to the frames,
//! late and missing answers of a controller, and refused sessions.

mod controller;
#[path = "../fixture/mod.rs"]
mod fixture;
mod lock_step;
mod real_time;

use std::net::SocketAddr;
use std::sync::{Arc, LazyLock, Mutex};
use std::time::Duration;

use vines_bench::rig::{
    BuiltIn, Command, Controller, ControllerError, Drive, Rig, RigError, RigStage, Sensors, Simulated,
};
use vines_bench::scene::{PAPER, Scene};
use vines_net::{Address, LinkError, NetController, NetRig, Role, Served as Offered, Service, Session};

use fixture::Running;

/// A silence, s, longer than the pauses of a busy machine.
const PATIENT: f64 = 2.0;

/// The default scene, 882 samples a second.
static SCENE: LazyLock<Scene> = LazyLock::new(|| scene(&[]));

/// The default scene with settings.
fn scene(settings: &[&str]) -> Scene {
    let overrides: Vec<_> = settings.iter().map(|setting| setting.parse().unwrap()).collect();
    Scene::parse("paper.toml", PAPER, &overrides).unwrap()
}

/// A running server for a scene; `drives` contains every drive of its rig.
struct Served {
    running: Running,
    address: Address,
    scene: Scene,
    drives: Arc<Mutex<Vec<Drive>>>,
}

impl Served {
    /// Waits for the end of the next session, and returns its report.
    fn session(&self) -> Session {
        let ended = self.running.sessions.recv_timeout(Duration::from_secs(60));
        ended.expect("the session does not end")
    }

    /// A client of the rig.
    fn rig(&self) -> NetRig {
        NetRig::connect(self.address, self.scene.sample_time(), None).unwrap()
    }

    /// A client of the controller, beside a rig of this `pace`.
    fn controller(&self, pace: Option<f64>) -> NetController {
        NetController::connect(self.address.socket(), &self.scene.plan().lock, pace, None).unwrap()
    }

    fn drives(&self) -> Vec<Drive> {
        self.drives.lock().unwrap().clone()
    }

    /// The last drive of the rig.
    fn last(&self) -> Drive {
        *self.drives().last().unwrap()
    }
}

/// Settings of a server for the plant of `scene`.
fn service(scene: &Scene, silence: f64) -> Service {
    let (max_amplitude, sensors) = (scene.plant.half_width, scene.resonance);
    let role = Role::Rig { max_amplitude, sensors };
    Service { role, sample_time: scene.sample_time(), silence }
}

/// Serves the plant of a scene, in lock-step over TCP or in real time over UDP.
fn serve_rig(address: fn(SocketAddr) -> Address, scene: &Scene, silence: f64) -> Served {
    let (plant, drives) = (Simulated::new(scene.plant, scene.start).unwrap(), Arc::default());
    let log = Arc::clone(&drives);
    let make = move || Offered::Rig(Box::new(Spy(plant.clone(), Arc::clone(&log))));
    let running = Running::start(address, service(scene, silence), None, make);
    Served {
        address: running.address,
        running,
        scene: scene.clone(),
        drives,
    }
}

/// Serves any controller.
fn serve_controller(scene: &Scene, silence: f64, controller: impl Controller + Clone + Send + 'static) -> Served {
    let service = Service { role: Role::Controller, ..service(scene, silence) };
    let make = move || Offered::Controller(Box::new(controller.clone()));
    let running = Running::start(Address::Tcp, service, None, make);
    let (scene, drives) = (scene.clone(), Arc::default());
    Served { address: running.address, running, scene, drives }
}

/// Serves the controller of the scene.
fn serve_built_in(scene: &Scene) -> Served {
    serve_controller(scene, 5.0, BuiltIn::new(&scene.plan().lock).unwrap())
}

/// A controller that answers with a function of the response.
#[derive(Clone)]
struct Answers<F>(F);

impl<F: FnMut(f64) -> Command> Controller for Answers<F> {
    fn sample(&mut self, sensors: Sensors, _: bool) -> Result<Command, ControllerError> {
        Ok(self.0(sensors.response))
    }
}

/// A plant that logs its drives.
struct Spy(Simulated, Arc<Mutex<Vec<Drive>>>);

impl RigStage for Spy {
    fn inner(&mut self) -> &mut dyn Rig {
        &mut self.0
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        self.1.lock().unwrap().push(drive);
        self.0.advance(drive, step)
    }
}

/// A drive whose frequency identifies its sample.
fn drive(sample: usize) -> Drive {
    let omega = 50.0 + sample as f64 / 1024.0;
    Drive { omega, amplitude: 1e-4, ..Drive::default() }
}

/// Drives a rig in open loop for some samples of the default scene.
fn shake(rig: &mut dyn Rig, samples: usize) -> Result<(), RigError> {
    (0..samples).try_for_each(|n| {
        rig.sense()?;
        rig.ground_truth()?;
        rig.advance(drive(n), SCENE.sample_time())
    })
}

/// The error of the connection in the error of a rig or a controller.
fn link_error(error: &dyn std::error::Error) -> &LinkError {
    let cause = error.source().and_then(|cause| cause.downcast_ref());
    cause.unwrap_or_else(|| panic!("{error}"))
}
