//! Servers: `vines rig`, the plant at a network address, and `vines controller`, the phase-locked loop.

use std::cell::Cell;
use std::rc::Rc;
use std::str::FromStr;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use clap::{Args, ValueEnum};
use vines::ArgumentError;
use vines::fmu_rig;
use vines::helic::{self, Device};
use vines::net::{Address, LinkError, Role, Served, Server, ServerError, Service, Session, resolve};
use vines::rig::{BuiltIn, Rig, RigError, RigFault, SensorsOnly, Simulated, faulty};
use vines::scene::Measurand;

use super::failure::Failure;
use super::options::{Endpoint, ReachArguments, SceneArguments, no_key, positive};
use super::output::print;
use super::signals::{Orderly, reachable, stop_flag};
use super::watch::WatchArguments;

const RIG_HELP: &str = "\
Examples:
  vines rig --listen 127.0.0.1:5510                 in real time; then: vines identify --rig udp://127.0.0.1:5510
  vines rig --listen 127.0.0.1:5510 --lock-step     as fast as the drives arrive, with the bits of the built-in plant;
                                                    then: vines identify --rig tcp://127.0.0.1:5510
  vines rig --listen 127.0.0.1:5510 --rig LoViNes.fmu     an FMU
  vines rig --protocol helic --listen 127.0.0.1:2350
                                                    as a device of helic-daq; then: vines identify --rig helic://127.0.0.1
  vines rig --listen 127.0.0.1:5510 --sensors-only --set chain.snr=40 --set chain.adc_bits=12 --fault \"response sensor dead@60\"
                                                    a rehearsal: noise, converters, and a sensor that is unplugged after 60 s

Every session starts with the plant in the start state of the scene; the rig's clock starts with the first drive frame. Client and
server take the sample time from their scene: use the same scene for both. In real time, lost and late drives are counted, and the
last valid one is held. When the newest drive is older than --silence, the drive ramps to zero and stays there until another session
starts. In lock-step, a drive that is not allowed ends the session. See docs/network-protocol.md.

The server listens on this machine only, unless --key or --allow-remote is given. With --key, every frame is authenticated; nothing is
encrypted. Without it, everyone who can reach the address can drive the rig.";

/// Longest silence in lock-step, s: nothing moves in the meantime, and only a peer that has ended is silent for so long.
const SILENCE: f64 = 5.0;

/// Serve the plant to a controller or an experiment across the network
#[derive(Debug, Args)]
#[command(after_help = RIG_HELP)]
pub(super) struct RigArguments {
    #[command(flatten)]
    scene: SceneArguments,

    #[command(flatten)]
    serving: ServingArguments,

    #[command(flatten)]
    watch: WatchArguments,

    /// The protocol: `vines` (docs/network-protocol.md), or `helic`, as a device of helic-daq (rigs/helic/README.md)
    #[arg(long, value_enum, default_value_t = Protocol::Vines)]
    protocol: Protocol,

    /// With `--protocol helic`: samples of the device per sample of the scene
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u16).range(1..=100))]
    oversampling: u16,

    /// The rig that is served: `built-in` or an FMU
    #[arg(
        long,
        value_name = "ENDPOINT",
        default_value = "built-in",
        conflicts_with = "sensors_only"
    )]
    rig: Endpoint,

    /// Advance when a drive arrives instead of in real time
    #[arg(long)]
    lock_step: bool,

    /// Serve what the scene's measurement chain reads, and no impacts, from a plant at rest, as a real rig does
    #[arg(long)]
    sensors_only: bool,

    /// Begin a fault after this many seconds of rig time in each session, such as "response sensor dead@60"; a wrong name lists all faults
    #[arg(long, value_name = "NAME@SECONDS", requires = "sensors_only")]
    fault: Option<Fault>,

    /// Longest silence before the drive is shut down, s [default: 0.1, with --lock-step 5]
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    silence: Option<f64>,

    /// Largest drive amplitude: m, N of a force, V of a shaker [default: that which moves as a base of the half-width b of the cavity does]
    #[arg(long, value_name = "VALUE", value_parser = positive)]
    max_amplitude: Option<f64>,
}

/// Prints the time from the fault to a drive of zero, s.
fn print_reaction(zero: Option<f64>, json: bool) {
    let text = match zero {
        _ if json => format!("{}\n", serde_json::json!({ "drive_zero_after_fault": zero })),
        Some(seconds) => format!("the drive was zero {:.1} ms after the fault\n", 1e3 * seconds),
        None => "the drive was NOT ZERO at the end\n".into(),
    };
    // A closed output does not stop the server.
    let _ = print(&text);
}

/// A fault of the rig, and when it begins, s of rig time.
#[derive(Debug, Clone, Copy)]
struct Fault {
    kind: RigFault,
    seconds: f64,
}

impl FromStr for Fault {
    type Err = ArgumentError;

    fn from_str(text: &str) -> Result<Self, ArgumentError> {
        let (name, seconds) = text
            .rsplit_once('@')
            .ok_or("expected NAME@SECONDS, for instance \"response sensor dead@60\"")?;
        let seconds = positive(seconds)?;
        // The sign × is on few keyboards.
        let as_typed = |name: &str| name.replace('×', "x");
        let all = || RigFault::ALL.into_iter().chain(RigFault::OF_SHAKER);
        match all().find(|(fault, _)| as_typed(fault) == as_typed(name)) {
            Some((_, kind)) => Ok(Self { kind, seconds }),
            None => {
                let names: Vec<&str> = all().map(|(name, _)| name).collect();
                Err(format!("unknown fault; known are: {}", names.join(", ")).into())
            }
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Protocol {
    Vines,
    Helic,
}

pub(super) fn rig(arguments: &RigArguments) -> Result<String, Failure> {
    let mut scene = arguments.scene.load()?;
    let helic = arguments.protocol == Protocol::Helic;
    if let Some(structure) = scene.structure.as_ref().filter(|_| helic) {
        return Err(Failure::input(format!(
            "--protocol helic: a device has one oscillator, and this scene has a {}; drop --protocol",
            structure.section()
        )));
    }
    if arguments.sensors_only || helic {
        // A device runs on between its hosts.
        scene = scene.at_rest();
    }
    if helic && scene.resonance.measurands() != [Measurand::Displacement; 2] {
        return Err(Failure::input(
            "--protocol helic: the sensors of the device read displacements; drop resonance.sensor_quantity and resonance.reference_quantity",
        ));
    }
    if helic {
        scene = scene.sampled(f64::from(arguments.oversampling));
    }
    drop(Simulated::without_chain(&scene).map_err(Failure::input)?);
    // What cannot be served is refused before a client comes.
    match &arguments.rig {
        Endpoint::Network(address) => {
            let rule = "only `built-in` or an FMU can be served";
            return Err(Failure::input(format!("--rig {address}: {rule}")));
        }
        _ if arguments.lock_step && helic => {
            return Err(Failure::input(
                "--lock-step: a helic device samples on its own clock; drop --lock-step, or --protocol helic",
            ));
        }
        Endpoint::Fmu(file) => drop(fmu_rig::load(file, &scene).map_err(Failure::run)?),
        Endpoint::BuiltIn => {}
    }
    let (serving, json) = (&arguments.serving, arguments.serving.json);
    let watch = arguments.watch.start("vines rig", &scene)?;
    let make = || -> Result<Box<dyn Rig>, RigError> {
        let rig: Box<dyn Rig> = match (&arguments.rig, arguments.fault) {
            (Endpoint::Fmu(file), _) => reachable(fmu_rig::load(file, &scene)?, scene.sample_time()),
            (_, Some(Fault { kind, seconds })) => {
                Box::new(faulty(&scene, kind, seconds, move |zero| print_reaction(zero, json))?)
            }
            _ if arguments.sensors_only => Box::new(SensorsOnly(Simulated::of(&scene)?)),
            _ => Simulated::without_chain(&scene)?,
        };
        Ok(match &watch {
            Some(watch) => watch.rig(rig),
            None => rig,
        })
    };
    let step = scene.sample_time();
    let of_cavity = scene.units().command.of_metres(scene.plant.half_width);
    let max_amplitude = arguments.max_amplitude.unwrap_or(of_cavity);
    if helic {
        let device = Device::new(make().map_err(Failure::run)?, step, max_amplitude).map_err(Failure::run)?;
        return serving.serve_helic(device, step);
    }
    // The longest silence in real time, s, is about one period of the default scene.
    let (silence, mode, transport): (_, _, fn(_) -> _) = match arguments.lock_step {
        true => (SILENCE, "in lock-step", Address::Tcp),
        false => (0.1, "in real time", Address::Udp),
    };
    let service = Service {
        role: Role::Rig { max_amplitude, sensors: scene.resonance },
        sample_time: step,
        silence: arguments.silence.unwrap_or(silence),
    };
    let name = format!("rig, {mode}, {:.1} samples per second,", 1.0 / step);
    serving.serve(&name, transport, service, || Ok(Served::Rig(make()?)))
}

const CONTROLLER_HELP: &str = "\
Examples:
  vines controller --listen 127.0.0.1:5511      then: vines identify --controller tcp://127.0.0.1:5511

Answers every reading with a drive. After --silence the session ends. See docs/network-protocol.md.

The server listens on this machine only, unless --key or --allow-remote is given. With --key, every frame is authenticated; nothing is
encrypted. Without it, everyone who can reach the address can drive the rig.";

/// Serve the phase-locked loop to a rig or an experiment across the network
#[derive(Debug, Args)]
#[command(after_help = CONTROLLER_HELP)]
pub(super) struct ControllerArguments {
    #[command(flatten)]
    scene: SceneArguments,

    #[command(flatten)]
    serving: ServingArguments,

    /// Longest silence before the session is shut down, s
    #[arg(long, value_name = "SECONDS", default_value_t = SILENCE, value_parser = positive)]
    silence: f64,
}

pub(super) fn controller(arguments: &ControllerArguments) -> Result<String, Failure> {
    let scene = arguments.scene.load()?;
    let controller = BuiltIn::new(&scene.plan().lock)?;
    let (sample_time, silence) = (scene.sample_time(), arguments.silence);
    let service = Service { role: Role::Controller, sample_time, silence };
    let make = || Ok(Served::Controller(Box::new(controller.clone())));
    let serving = &arguments.serving;
    serving.serve("controller", Address::Tcp, service, make)
}

#[derive(Debug, Args)]
struct ServingArguments {
    /// Address of the server, such as 127.0.0.1:5510; with port 0 the system chooses a free port
    #[arg(long, value_name = "HOST:PORT")]
    listen: String,

    #[command(flatten)]
    reach: ReachArguments,

    /// End after this time, s [default: at Ctrl-C]
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    duration: Option<f64>,

    /// End after this many sessions
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    sessions: Option<u64>,

    /// Print a line of JSON per session instead of text
    #[arg(long)]
    json: bool,
}

impl ServingArguments {
    /// Serves `what` at a TCP or UDP address: prints the address, then a report per session.
    fn serve(
        &self,
        what: &str,
        transport: fn(std::net::SocketAddr) -> Address,
        service: Service,
        make: impl FnMut() -> Result<Served, ServerError>,
    ) -> Result<String, Failure> {
        let scope = self.reach.reach()?;
        let mut server = Server::listen(transport(resolve(&self.listen, scope)?), service, scope.key())?;
        let address = server.address().map_err(Failure::run)?;
        self.run(&format!("{what} on {address}"), |stop, report_session| {
            server.serve(make, stop, report_session)
        })
    }

    /// Serves `device` as a device of helic-daq, sampled every `sample_time`, s.
    fn serve_helic(&self, device: Device, sample_time: f64) -> Result<String, Failure> {
        let scope = self.reach.reach()?;
        no_key(scope)?;
        let address = resolve(&self.listen, scope)?;
        let listen = |source| LinkError::Listen { address: Address::Tcp(address), source };
        let sockets = helic::listen(address).map_err(listen)?;
        let what = format!("helic device, {:.1} samples per second, on", 1.0 / sample_time);
        let address = sockets.0.local_addr().map_err(Failure::run)?;
        self.run(&format!("{what} helic://{address}"), |stop, report_session| {
            helic::serve(sockets, device, sample_time, stop, report_session)
        })
    }

    /// Runs a server: prints `what`, then a report per session.
    fn run(
        &self,
        what: &str,
        serve: impl FnOnce(&mut dyn FnMut() -> bool, &mut dyn FnMut(&Session)) -> Result<(), ServerError>,
    ) -> Result<String, Failure> {
        let _orderly = Orderly::new();
        let stop = stop_flag();
        print(&format!("{what}\n"))?;
        let enough = Rc::new(Cell::new(false));
        let is_enough = Rc::clone(&enough);
        let end = self
            .duration
            .map(|seconds| Instant::now() + Duration::from_secs_f64(seconds));
        let mut stop =
            move || stop.load(Ordering::Relaxed) || is_enough.get() || end.is_some_and(|end| Instant::now() >= end);
        let (json, sessions, mut served) = (self.json, self.sessions, 0);
        let mut report_session = move |session: &Session| {
            let text = match json {
                true => serde_json::to_string(session).map_or_else(|error| error.to_string(), |line| line + "\n"),
                false => session.to_string(),
            };
            // A closed output does not stop the server.
            let _ = print(&text);
            served += 1;
            if sessions == Some(served) {
                enough.set(true);
            }
        };
        serve(&mut stop, &mut report_session).map_err(Failure::run)?;
        Ok(String::new())
    }
}
