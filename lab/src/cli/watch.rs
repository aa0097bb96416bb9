//! `--watch`: the live page for a running experiment, read-only, on this machine.
//!
//! Stages around rig and controller copy every sample into a bounded channel. Where it is full, the sample is dropped: the experiment never
//! waits, and allocates nothing for it. One thread evaluates the samples and sends the rows to all browsers as server-sent events.

use std::cell::Cell;
use std::collections::VecDeque;
use std::f64::consts::TAU;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::rc::Rc;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread;
use std::time::Duration;

use clap::Args;
use serde_json::{Value, json};
use vines::curves;
use vines::knowledge::Target;
use vines::live::{Decay, HarmonicMotion, LastImpacts};
use vines::numerics::equally_spaced;
use vines::record::Sample;
use vines::regime::Impact;
use vines::rig::{Command, Controller, ControllerError, Move, Rig, Sensors};
use vines::scene::{Measurand, Reference, Scene, Sensor, Structure};
use vines::survey::structure_backbone;

use super::failure::Failure;
use super::tap::Tap;

/// Samples that wait for the evaluation, and rows that a browser gets that comes late: more than a minute of the default scene in real time.
const KEPT: usize = 1 << 16;
/// Rows per natural period that are shown, at most.
const PER_PERIOD: f64 = 50.0;
/// Points of the drop-out: several per half-power bandwidth of a light structure.
const DROP_OUT: usize = 1200;
/// Time between two evaluations of the samples.
const EVALUATION_INTERVAL: Duration = Duration::from_millis(40);
/// Longest wait for the rest of a request, and for a browser that does not read.
const REQUEST_TIMEOUT: Duration = Duration::from_secs(2);

#[derive(Debug, Args)]
pub(super) struct WatchArguments {
    /// Show the live page while this runs, read-only, at http://127.0.0.1:PORT/ (without PORT: at a free one); the address is printed to
    /// stderr. Meant for a rig in real time: the page receives nothing more after the end
    #[arg(long, value_name = "PORT", num_args = 0..=1, default_missing_value = "0", require_equals = true)]
    watch: Option<u16>,
}

/// The server of the page.
pub(super) struct Watch {
    sender: SyncSender<Message>,
    /// The last command of the controller, which the stage around the rig sends with its sample.
    command: Rc<Cell<Command>>,
    thread: Option<thread::JoinHandle<()>>,
    target: Target,
    /// The error that the experiment ended with.
    pub failure: Option<String>,
}

enum Message {
    Sample(Numbered),
    /// The end of the experiment, with its error.
    End(Option<String>),
}

/// What the stages send.
#[derive(Clone, Copy)]
struct Numbered {
    /// Number of the sample since the start of the session.
    number: u64,
    sample: Sample,
    /// Time to the next sample, s.
    step: f64,
}

impl WatchArguments {
    /// Starts the server, if it is asked for.
    pub(super) fn start(&self, title: &str, scene: &Scene) -> Result<Option<Watch>, Failure> {
        let Some(port) = self.watch else { return Ok(None) };
        let listen = || {
            let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port))?;
            listener.set_nonblocking(true)?;
            let address = listener.local_addr()?;
            Ok((listener, address))
        };
        let (listener, address) = listen().map_err(|error: io::Error| {
            Failure::run(format!(
                "--watch={port}: cannot listen on 127.0.0.1:{port}: {error}; --watch alone takes a free port"
            ))
        })?;
        let table = table(title, scene).to_string();
        let (sender, receiver) = sync_channel(KEPT);
        let (view, target) = (View::new(scene.clone(), 0), scene.knowledge().target);
        let thread = thread::spawn(move || serve(&listener, address, &receiver, view, &table));
        super::say(format_args!("Watch it at http://{address}/"));
        let (command, thread) = (Rc::default(), Some(thread));
        Ok(Some(Watch { sender, command, thread, target, failure: None }))
    }
}

impl Watch {
    /// The rig, with its samples shown.
    pub(super) fn rig(&self, rig: Box<dyn Rig>) -> Box<dyn Rig> {
        let (sender, command, target, mut number) = (self.sender.clone(), Rc::clone(&self.command), self.target, 0);
        Tap::around(rig, move |mut sample, step| {
            let drive = target.drive(sample.command.drive);
            sample.command = Command { drive, ..command.get() };
            sample.sensors = target.scaled(sample.sensors);
            // The receiver polls, so that this wakes no thread. A full channel, or a server that has ended, drops the sample.
            let _ = sender.try_send(Message::Sample(Numbered { number, sample, step }));
            number += 1;
        })
    }

    /// The controller, with its state shown.
    pub(super) fn controller(&self, controller: Box<dyn Controller>) -> Box<dyn Controller> {
        Box::new(WatchedController { controller, command: Rc::clone(&self.command) })
    }
}

impl Drop for Watch {
    /// The last rows and the outcome reach the browsers before the program ends.
    fn drop(&mut self) {
        // A panic of the server was printed; the experiment is over.
        let _ = self.sender.send(Message::End(self.failure.take()));
        let _ = self.thread.take().map(thread::JoinHandle::join);
    }
}

struct WatchedController {
    controller: Box<dyn Controller>,
    command: Rc<Cell<Command>>,
}

impl Controller for WatchedController {
    fn sample(&mut self, sensors: Sensors, active: bool) -> Result<Command, ControllerError> {
        let command = self.controller.sample(sensors, active)?;
        self.command.set(command);
        Ok(command)
    }

    fn hold_response(&mut self, to: Move, phase_target: f64) -> Result<(), ControllerError> {
        self.controller.hold_response(to, phase_target)
    }

    fn hold_drive(&mut self) -> Result<(), ControllerError> {
        self.controller.hold_drive()
    }
}

// Evaluation.

/// A row of the record, with the columns of the page's module (lab/page/module.js); NaN: not measured.
type Row = [f64; 11];

/// Makes rows from the samples of a session, and keeps the last of them.
struct View {
    scene: Scene,
    session: u64,
    /// Rows that are kept, and the number of the first of them.
    rows: VecDeque<Row>,
    first: u64,
    last: Numbered,
    phase: f64,
    impacts: LastImpacts,
    fit: Decay,
    /// Position of the particle, m, where the rig reports its impacts.
    particle: f64,
}

impl View {
    fn new(scene: Scene, session: u64) -> Self {
        Self {
            particle: scene.start.q2,
            scene,
            session,
            rows: VecDeque::new(),
            first: 0,
            last: Numbered { number: 0, sample: Sample::default(), step: 0.0 },
            phase: 0.0,
            impacts: LastImpacts::default(),
            fit: Decay::default(),
        }
    }

    /// Takes a sample; a number of rows per period is kept.
    fn take(&mut self, sample: Numbered) {
        // A new session, also if its first samples were dropped.
        if sample.number == 0 || sample.number < self.last.number {
            *self = Self::new(self.scene.clone(), self.session + 1);
        }
        let row = self.row(sample);
        self.last = sample;
        let period = self.scene.dimensionless().natural_period();
        let stride = (period / (PER_PERIOD * sample.step)).floor().max(1.0) as u64;
        if sample.number.is_multiple_of(stride) {
            self.rows.push_back(row);
        }
        if self.rows.len() > KEPT {
            self.rows.pop_front();
            self.first += 1;
        }
    }

    /// The row of a sample.
    fn row(&mut self, now: Numbered) -> Row {
        let Numbered { sample, step, .. } = now;
        let Sample { time, sensors, command, ground_truth, .. } = sample;
        let (drive, before) = (command.drive, self.last.sample.command.drive);
        let [driven, was_driven] = [drive, before].map(|drive| !drive.is_off());
        let follows = now.number == self.last.number + 1;
        // A window of samples without gaps, under a drive or without one.
        if !follows || driven != was_driven || self.fit.ended {
            let omega0 = self.scene.dimensionless().omega0;
            let omega = if drive.omega > 0.0 { drive.omega } else { omega0 };
            self.fit.drive(HarmonicMotion { omega, ..self.fit.motion });
        }
        self.particle(&sample);
        let speed = ground_truth.map_or(f64::NAN, |truth| truth.particle_velocity.abs());
        self.fit.sample(sensors.response, speed, step);
        self.fit.watch(&self.impacts, self.phase);
        let mut motion = self.fit.motion;
        if driven {
            motion.speed = speed;
            if drive.omega > 0.0 {
                motion.omega = drive.omega;
            }
        }
        let relative = match (ground_truth, particle_in_response(&self.scene)) {
            (Some(_), Some(share)) => sensors.response - (1.0 + share) * self.particle,
            _ => f64::NAN,
        };
        let decays = !driven && (ground_truth.is_none() || self.fit.synchronous);
        self.phase += drive.omega * step;
        [
            time,
            sensors.reference.unwrap_or(f64::NAN),
            sensors.response,
            relative,
            command.phase_error.map_or(f64::NAN, f64::to_degrees),
            drive.omega,
            drive.amplitude,
            motion.amplitude,
            motion.omega,
            motion.speed,
            f64::from(u8::from(decays)),
        ]
    }

    /// Notes an impact since the sample before, and moves the particle: from the wall that it met, or on as it was.
    fn particle(&mut self, now: &Sample) {
        let Some(truth) = now.ground_truth else { return };
        let Numbered { sample: last, step, .. } = self.last;
        let before = last.ground_truth.map_or(0, |truth| truth.impacts);
        let velocity = truth.particle_velocity;
        if truth.impacts == before {
            self.particle += velocity * step;
            return;
        }
        let since = now.time - truth.impact_time;
        self.impacts.add(Impact {
            time: self.phase - now.command.drive.omega * since,
            velocity: truth.impact_velocity,
        });
        let Some(share) = particle_in_response(&self.scene) else {
            return;
        };
        // The response v = q1 + epsilon q2 is smooth at an impact, and q1 nearly so; the relative displacement is that of the wall there.
        let rate = (now.sensors.response - last.sensors.response) / step.max(f64::MIN_POSITIVE);
        let response = now.sensors.response - rate * since;
        let [plus, minus] = self.scene.plant.gaps();
        let wall = if truth.impact_velocity > 0.0 { plus } else { -minus };
        self.particle = (response - wall) / (1.0 + share) + velocity * since;
    }

    /// What the page shows beside the rows.
    fn state(&self) -> Value {
        let Sample { command, ground_truth, .. } = self.last.sample;
        json!({
            "state": command.state.map(|state| state as u8),
            "settled": command.settled,
            "fault": command.fault.map_or(0, |fault| fault as u8),
            "fault_text": command.fault.map_or("", |fault| fault.text()),
            "impacts": ground_truth.map(|truth| truth.impacts),
            "per_period": self.impacts.per_period(),
            "regime": ground_truth.map(|_| self.impacts.regime(self.phase).name()),
        })
    }
}

/// Share of the particle's displacement in the response: epsilon in v, nothing in the displacement at the cavity; `None`: the response is
/// measured elsewhere, or is not a displacement.
fn particle_in_response(scene: &Scene) -> Option<f64> {
    if scene.resonance.measurands()[0] != Measurand::Displacement {
        return None;
    }
    match (&scene.structure, scene.resonance.sensor) {
        (Some(structure), _) => (structure.sensor == structure.cavity).then_some(0.0),
        (None, Sensor::V) => Some(scene.plant.particle_mass / scene.plant.primary_mass),
        (None, Sensor::Q1) => Some(0.0),
    }
}

/// Points (sigma, C, 0 if unstable, G) of the exact backbone; not-a-number between two curves.
fn exact(scene: &Scene) -> Vec<[f64; 4]> {
    let d = scene.dimensionless();
    let Some(branches) = structure_backbone(scene, &d) else {
        return curves::exact(&d, 120).collect();
    };
    let gap = [f64::NAN, f64::NAN, 0.0, f64::NAN];
    let points = branches.iter().flat_map(|branch| {
        let points = branch
            .iter()
            .map(|orbit| [orbit.sigma, orbit.c, f64::from(u8::from(!orbit.is_unstable())), orbit.g]);
        points.chain([gap])
    });
    points.collect()
}

/// What drives a structure, in words, and what its shaker makes of a constant command.
fn host(scene: &Scene, structure: &Structure) -> Value {
    let (drive, unit) = (structure.excitation, structure.excitation.unit());
    let points = |shaker| {
        let ends = [scene.controller.omega_min, scene.controller.omega_max].map(|share| share * structure.mode().omega);
        let omegas = equally_spaced(ends[0], ends[1], DROP_OUT);
        let at = |omega: f64| [omega / TAU, structure.reference_by_command(shaker, omega).norm()];
        omegas.map(at).collect::<Vec<_>>()
    };
    let title = match drive {
        Reference::Force => "Drop-out: the force at a constant command, without impacts",
        Reference::Base => "Drop-out: the displacement of the table at a constant command, without impacts",
    };
    json!({
        "drive": drive,
        // The half-width as a response at the sensor, mm.
        "gap": 1e3 * structure.units().response.of_metres(scene.plant.half_width),
        "drop_out": structure.shaker.as_ref().map(|shaker| json!({ "title": title, "unit": unit, "points": points(shaker) })),
    })
}

/// The settings of the page with the values of the scene, its curves, and what the module would know.
fn table(title: &str, scene: &Scene) -> Value {
    let d = scene.dimensionless();
    let lock = scene.plan().lock.lock;
    let ([plus, minus], cavity) = (scene.plant.gaps(), scene.plant.cavity);
    let mut table: Value = serde_json::from_str(include_str!("../../page/settings.json")).unwrap_or_default();
    table["watch"] = json!({
        "title": title,
        "values": {
            "excitation": d.g, "restitution": d.r, "damping": d.lambda, "mass_ratio": d.epsilon, "gap": 1e3 * d.b,
            "gap_difference": 50.0 * (plus - minus) / d.b, "friction": cavity.kinetic_friction, "tilt": cavity.tilt.to_degrees(),
            "phase_target": scene.controller.phase_target, "bandwidth": scene.controller.bandwidth,
        },
        "sample_time": scene.sample_time(),
        "omega0": d.omega0,
        "tolerance": lock.phase_tolerance.to_degrees(),
        "unlock": lock.unlock_tolerance.to_degrees(),
        "manifold": curves::manifold(&d, 12.0, 1200).collect::<Vec<_>>(),
        "theory": curves::backbone(&d, 160).collect::<Vec<_>>(),
        "exact": exact(scene),
        "particle_in_response": particle_in_response(scene),
        "host": scene.structure.as_ref().map(|structure| host(scene, structure)),
    });
    table
}

// The server: GET only, and only what the page needs. A browser that does not read must not block the end of the experiment; tiny_http has no
// timeout for writing.

/// The files of the page: path and content.
macro_rules! files {
    ($($name:ident . $kind:ident)*) => {
        &[$((
            concat!("/", stringify!($name), ".", stringify!($kind)),
            include_str!(concat!("../../page/", stringify!($name), ".", stringify!($kind)))
        )),*]
    };
}
const PAGE_FILES: &[(&str, &str)] = files!(
    index.html style.css controls.js link.js main.js map.js module.js page.js pictures.js plots.js record.js rig.js sound.js story.js strip.js
    watch.js
);

/// The type of a file.
fn kind(name: &str) -> &'static str {
    match name.rsplit('.').next() {
        Some("html") => "text/html",
        Some("css") => "text/css",
        _ => "text/javascript",
    }
}

/// Evaluates samples and serves browsers until the experiment is over and its end is sent.
fn serve(listener: &TcpListener, address: SocketAddr, messages: &Receiver<Message>, mut view: View, table: &str) {
    let (mut browsers, mut silent) = (Vec::new(), Vec::new());
    let mut outcome = Value::Null;
    while outcome.is_null() {
        thread::sleep(EVALUATION_INTERVAL);
        for message in messages.try_iter() {
            match message {
                Message::Sample(sample) => view.take(sample),
                Message::End(error) => outcome = json!({ "error": error }),
            }
        }
        while let Ok((stream, _)) = listener.accept() {
            silent.extend(stream.set_nonblocking(true).map(|()| stream));
        }
        // Browsers open connections before they have a request.
        let asked;
        (silent, asked) = silent.into_iter().partition(is_silent);
        for stream in asked {
            let stream = answer(stream, address, table).ok().flatten();
            browsers.extend(stream.map(|stream| Browser { stream, session: 0, next: 0 }));
        }
        // A browser that is closed ends its connection only.
        browsers.retain_mut(|browser| browser.send(&view, &outcome).is_ok());
    }
}

/// Whether nothing has arrived on a connection yet, not even its end.
fn is_silent(stream: &TcpStream) -> bool {
    matches!(stream.peek(&mut [0]), Err(error) if error.kind() == io::ErrorKind::WouldBlock)
}

/// Answers one request. Returns the stream of a browser that asks for the rows.
fn answer(mut stream: TcpStream, address: SocketAddr, table: &str) -> io::Result<Option<TcpStream>> {
    stream.set_nonblocking(false)?;
    stream.set_read_timeout(Some(REQUEST_TIMEOUT))?;
    stream.set_write_timeout(Some(REQUEST_TIMEOUT))?;
    // A request of this page has less than a kilobyte.
    let head: Vec<String> = BufReader::new((&stream).take(1 << 14))
        .lines()
        .take_while(|line| !line.as_ref().is_ok_and(String::is_empty))
        .collect::<Result<_, _>>()?;
    let mut words = head.first().map_or("", String::as_str).split([' ', '?']);
    let (method, path) = (words.next(), words.next().unwrap_or_default());
    let path = if path == "/" { "/index.html" } else { path };
    // A page of another site that gets this address by its own name must not read along.
    let headers = head.iter().filter_map(|line| line.split_once(": "));
    let mut hosts = headers.filter(|(name, _)| name.eq_ignore_ascii_case("host"));
    let local = [address.to_string(), format!("localhost:{}", address.port())];
    let is_local = hosts
        .next()
        .is_some_and(|(_, host)| local.iter().any(|local| local == host));
    let (status, kind, content) = match (method, path) {
        _ if !is_local => (
            "403 Forbidden",
            "text/plain",
            "this server answers at its own address only",
        ),
        (Some("GET"), "/rows") => ("200 OK", "text/event-stream", ""),
        (Some("GET"), "/settings.json") => ("200 OK", "application/json", table),
        (Some("GET"), _) => match PAGE_FILES.iter().find(|(name, _)| *name == path) {
            Some((name, text)) => ("200 OK", kind(name), *text),
            None => ("404 Not Found", "text/plain", "no such file"),
        },
        _ => ("405 Method Not Allowed", "text/plain", "only GET"),
    };
    // The end of the connection is the end of the content.
    let headers = "Cache-Control: no-store\r\nConnection: close";
    write!(
        stream,
        "HTTP/1.1 {status}\r\nContent-Type: {kind}; charset=utf-8\r\n{headers}\r\n\r\n{content}"
    )?;
    Ok((kind == "text/event-stream").then_some(stream))
}

/// A browser that receives events.
struct Browser {
    stream: TcpStream,
    /// The session whose rows it gets, and the number of the next row.
    session: u64,
    next: u64,
}

impl Browser {
    /// Sends what is new. Also without rows: a closed browser is noticed at the next event.
    fn send(&mut self, view: &View, outcome: &Value) -> io::Result<()> {
        let begins = view.session != self.session;
        let from = if begins { view.first } else { self.next.max(view.first) };
        let rows: Vec<&Row> = view.rows.iter().skip((from - view.first) as usize).collect();
        (self.session, self.next) = (view.session, from + rows.len() as u64);
        let event = json!({ "begins": begins, "rows": rows, "state": view.state(), "outcome": outcome });
        self.stream.write_all(format!("data: {event}\n\n").as_bytes())
    }
}
