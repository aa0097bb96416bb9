//! `vines rig`: the plant at a network address.

use std::{path::PathBuf, str::FromStr};

use clap::{Args, ValueEnum};
use vines::ArgumentError;
use vines::helic::Device;
use vines::net::{Address, Role, Served, Service, Session};
use vines::report;
use vines::rig::{Rig, RigError, RigFault, SensorsOnly, Simulated, faulty};
use vines::scene::Scene;

use super::endpoint::{Endpoint, fmu};
use super::serving::{ServingArguments, positive};
use super::{failure::Failure, output::print, scene_arguments::SceneArguments};

const HELP: &str = "\
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

/// Longest silence in real time, s: about one period of the default scene.
const SILENCE_PACED: f64 = 0.1;
/// Longest silence in lock-step, s. The rig does not move in the meantime.
const SILENCE_LOCK_STEP: f64 = 5.0;

/// Serve the plant to a controller or an experiment across the network
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(super) struct Arguments {
    #[command(flatten)]
    scene: SceneArguments,

    #[command(flatten)]
    serving: ServingArguments,

    /// Write the histogram of the lateness of each session to this file (CSV); each session overwrites it
    #[arg(long, value_name = "FILE")]
    histogram: Option<PathBuf>,

    /// The protocol: `vines` (docs/network-protocol.md), or `helic`, as a device of helic-daq (docs/helic.md)
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

    /// Begin a fault after this many seconds of rig time in each session, such as "response sensor dead@60"; a wrong name lists them
    #[arg(long, value_name = "NAME@SECONDS", requires = "sensors_only")]
    fault: Option<Fault>,

    /// Longest silence before the drive is shut down, s [default: 0.1, with --lock-step 5]
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    silence: Option<f64>,

    /// Largest drive amplitude, m [default: the half-width b of the cavity]
    #[arg(long, value_name = "METRES", value_parser = positive)]
    max_amplitude: Option<f64>,
}

/// Prints the time from the fault to a drive of zero, s.
fn tell(zero: Option<f64>, json: bool) {
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
        match RigFault::ALL.into_iter().find(|(one, _)| *one == name) {
            Some((_, kind)) => Ok(Self { kind, seconds }),
            None => {
                let names = RigFault::ALL.map(|(name, _)| name).join(", ");
                Err(format!("unknown fault; known are: {names}").into())
            }
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Protocol {
    Vines,
    Helic,
}

/// Refuses what cannot be served before a client comes.
fn refuse(arguments: &Arguments, scene: &Scene) -> Result<(), Failure> {
    match &arguments.rig {
        Endpoint::Network(address) => Err(Failure::input(format!(
            "--rig {address}: only `built-in` or an FMU can be served"
        ))),
        _ if arguments.lock_step && arguments.protocol == Protocol::Helic => Err(Failure::input(
            "--lock-step: a helic device samples on its own clock; drop --lock-step, or --protocol helic",
        )),
        Endpoint::Fmu(file) => fmu(file, scene).map(drop).map_err(Failure::run),
        Endpoint::BuiltIn => Ok(()),
    }
}

pub(super) fn run(arguments: &Arguments) -> Result<String, Failure> {
    let mut scene = arguments.scene.load()?;
    let helic = arguments.protocol == Protocol::Helic;
    if arguments.sensors_only || helic {
        // A device runs on between its hosts.
        scene.start = Default::default();
    }
    if helic {
        scene.controller.samples_per_period *= f64::from(arguments.oversampling);
    }
    let first = Simulated::new(scene.plant, scene.start)
        .map_err(Failure::input)?
        .with_sensors(scene.resonance);
    let (silence, mode, transport): (_, _, fn(_) -> _) = match arguments.lock_step {
        true => (SILENCE_LOCK_STEP, "in lock-step", Address::Tcp),
        false => (SILENCE_PACED, "in real time", Address::Udp),
    };
    let max_amplitude = arguments.max_amplitude.unwrap_or(scene.plant.half_width);
    let json = arguments.serving.json;
    let make = || -> Result<Box<dyn Rig>, RigError> {
        Ok(match &arguments.rig {
            Endpoint::Fmu(file) => Box::new(fmu(file, &scene)?),
            _ if arguments.sensors_only => match arguments.fault {
                Some(Fault { kind, seconds }) => Box::new(faulty(&scene, kind, seconds, move |zero| tell(zero, json))?),
                None => Box::new(SensorsOnly::around(Simulated::of(&scene)?)),
            },
            _ => Box::new(first.clone()),
        })
    };
    refuse(arguments, &scene)?;
    let keep = |session: &Session| {
        let (Some(file), Some(all)) = (&arguments.histogram, &session.punctuality) else {
            return;
        };
        if let Err(error) = report::write_lateness(&all.classes(), file) {
            eprintln!("warning: {error}");
        }
    };
    if helic {
        let step = scene.sample_time();
        let device = Device::new(make().map_err(Failure::run)?, step, max_amplitude).map_err(Failure::run)?;
        return arguments.serving.serve_helic(device, step, keep);
    }
    let service = Service {
        role: Role::Rig { max_amplitude, sensors: scene.resonance },
        sample_time: scene.sample_time(),
        silence: arguments.silence.unwrap_or(silence),
    };
    let what = format!("rig, {mode}, {:.1} samples per second,", 1.0 / service.sample_time);
    arguments
        .serving
        .serve(&what, transport, service, || Ok(Served::Rig(make()?)), keep)
}
