//! `--watch`: the live page for a running experiment, read-only, on this machine.
//!
//! Stages around rig and controller copy every sample into a bounded channel. Where it is full, the sample is dropped: the experiment never
//! waits, and allocates nothing for it. A thread evaluates the samples, and one thread per browser sends the rows as server-sent events.

use std::cell::Cell;
use std::collections::VecDeque;
use std::fmt::Display;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::rc::Rc;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use clap::Args;
use serde_json::{Value, json};
use vines::curves;
use vines::live::{Decay, LastImpacts, Motion};
use vines::regime::Impact;
use vines::rig::{Command, Controller, ControllerError, Drive, GroundTruth, Move, Rig, RigError, RigStage, Sensors};
use vines::scene::Scene;
use vines_model::Sensor;

use super::failure::Failure;

/// Samples that wait for the evaluation: more than a minute of the default scene in real time.
const CHANNEL: usize = 1 << 16;
/// Rows per natural period that are shown, at most.
const PER_PERIOD: f64 = 50.0;
/// Time of which a browser that comes late gets the rows, natural periods: the last minute of the default scene.
const KEPT_PERIODS: f64 = 520.0;
/// How often samples are evaluated and sent, and how long a browser that does not read is waited for.
const PACE: Duration = Duration::from_millis(40);
const PATIENCE: Duration = Duration::from_secs(2);
/// Connections at the same time; a browser has about six.
const MOST: usize = 32;

#[derive(Debug, Args)]
pub(super) struct WatchArguments {
    /// Show the live page while this runs, read-only, at http://127.0.0.1:PORT/ (without PORT: at a free one); the address is printed to
    /// stderr. Meant for a rig in real time: the page receives nothing more after the end
    #[arg(long, value_name = "PORT", num_args = 0..=1, default_missing_value = "0", require_equals = true)]
    watch: Option<u16>,
}

impl WatchArguments {
    /// Starts the server, if it is asked for, before this thread gets real-time priority, which a new thread would inherit.
    pub(super) fn start(&self, title: &str, scene: &Scene) -> Result<Option<Watch>, Failure> {
        self.watch.map(|port| Watch::start(port, title, scene)).transpose()
    }
}

/// The server of the page.
pub(super) struct Watch {
    sender: SyncSender<Sample>,
    /// The last command of the controller, which the stage around the rig sends with its sample.
    command: Rc<Cell<Option<Command>>>,
    shared: Arc<Mutex<Shared>>,
    thread: Option<thread::JoinHandle<()>>,
}

/// What the stages send.
#[derive(Debug, Clone, Copy, Default)]
struct Sample {
    /// Number of the sample since the start of the session.
    number: u64,
    /// Time, and time to the next sample, s.
    time: f64,
    step: f64,
    sensors: Sensors,
    ground_truth: Option<GroundTruth>,
    drive: Drive,
    command: Option<Command>,
}

impl Watch {
    fn start(port: u16, title: &str, scene: &Scene) -> Result<Self, Failure> {
        let refused = |error: io::Error| {
            Failure::run(format!(
                "--watch={port}: cannot listen on 127.0.0.1:{port}: {error}; --watch alone takes a free port"
            ))
        };
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port)).map_err(refused)?;
        listener.set_nonblocking(true).map_err(refused)?;
        let address = listener.local_addr().map_err(refused)?;
        let table = Arc::new(table(title, scene).to_string());
        let (sender, receiver) = sync_channel(CHANNEL);
        let shared = Arc::<Mutex<Shared>>::default();
        let (view, log) = (View::new(scene), Arc::clone(&shared));
        let thread = thread::spawn(move || serve(&listener, address, &receiver, view, &log, &table));
        eprintln!("Watch it at http://{address}/");
        Ok(Self { sender, command: Rc::default(), shared, thread: Some(thread) })
    }

    /// The rig, with its samples shown.
    pub(super) fn rig(&self, rig: Box<dyn Rig>) -> Box<dyn Rig> {
        let (sender, command) = (self.sender.clone(), Rc::clone(&self.command));
        Box::new(WatchedRig { rig, sender, command, now: Sample::default() })
    }

    /// The controller, with its state shown.
    pub(super) fn controller(&self, controller: Box<dyn Controller>) -> Box<dyn Controller> {
        Box::new(WatchedController { controller, command: Rc::clone(&self.command) })
    }

    /// Tells the browsers the error that the experiment ended with.
    pub(super) fn failed(&self, error: &dyn Display) {
        locked(&self.shared).failure = Some(error.to_string());
    }
}

impl Drop for Watch {
    /// The last rows and the outcome reach the browsers before the program ends.
    fn drop(&mut self) {
        locked(&self.shared).over = true;
        // A panic of the server was printed; the experiment is over.
        let _ = self.thread.take().map(thread::JoinHandle::join);
    }
}

struct WatchedRig {
    rig: Box<dyn Rig>,
    sender: SyncSender<Sample>,
    command: Rc<Cell<Option<Command>>>,
    now: Sample,
}

impl WatchedRig {
    fn send(&mut self, drive: Drive, step: f64) {
        let sample = Sample { drive, step, command: self.command.get(), ..self.now };
        // The receiver polls, so that this wakes no thread. A full channel, or a server that has ended, drops the sample.
        let _ = self.sender.try_send(sample);
        self.now.number += 1;
        self.now.time += step;
    }
}

impl RigStage for WatchedRig {
    fn inner(&mut self) -> &mut dyn Rig {
        self.rig.as_mut()
    }

    fn sense(&mut self) -> Result<Sensors, RigError> {
        self.now.sensors = self.rig.sense()?;
        Ok(self.now.sensors)
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        self.send(drive, step);
        self.rig.advance(drive, step)
    }

    fn hold(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        self.send(drive, step);
        self.rig.hold(drive, step)
    }

    fn ground_truth(&mut self) -> Result<Option<GroundTruth>, RigError> {
        self.now.ground_truth = self.rig.ground_truth()?;
        Ok(self.now.ground_truth)
    }
}

struct WatchedController {
    controller: Box<dyn Controller>,
    command: Rc<Cell<Option<Command>>>,
}

impl Controller for WatchedController {
    fn sample(&mut self, sensors: Sensors, active: bool) -> Result<Command, ControllerError> {
        let command = self.controller.sample(sensors, active)?;
        self.command.set(Some(command));
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

/// A row of the record, with the columns of the page's module (live/page/module.js); NaN: not measured.
type Row = [f64; 11];

/// Rows and state of the present session, which the threads share.
#[derive(Default)]
struct Shared {
    session: u64,
    /// Rows that are kept, and the number of the first of them.
    rows: VecDeque<Row>,
    first: u64,
    state: Value,
    /// The error that the experiment ended with.
    failure: Option<String>,
    /// No further sample comes; and no further row.
    over: bool,
    complete: bool,
    /// Browsers that receive events.
    streams: usize,
}

fn locked(shared: &Mutex<Shared>) -> MutexGuard<'_, Shared> {
    // Every change leaves the rows in order.
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Makes rows from samples.
struct View {
    scene: Scene,
    last: Sample,
    phase: f64,
    impacts: LastImpacts,
    fit: Decay,
    /// Position of the particle, m, where the rig reports its impacts.
    particle: f64,
}

impl View {
    fn new(scene: &Scene) -> Self {
        Self {
            scene: scene.clone(),
            last: Sample::default(),
            phase: 0.0,
            impacts: LastImpacts::default(),
            fit: Decay::default(),
            particle: scene.start.q2,
        }
    }

    /// The row of a sample.
    fn row(&mut self, now: &Sample) -> Row {
        let Sample { time, step, sensors, ground_truth, drive, command, .. } = *now;
        let driven = drive.amplitude != 0.0 || drive.displacement != 0.0;
        let was_driven = self.last.drive.amplitude != 0.0 || self.last.drive.displacement != 0.0;
        let follows = now.number == self.last.number + 1;
        // A window of samples without gaps, under a drive or without one.
        if !follows || driven != was_driven || self.fit.ended {
            let omega0 = self.scene.dimensionless().omega0;
            let omega = if drive.omega > 0.0 { drive.omega } else { omega0 };
            self.fit.drive(Motion { omega, ..self.fit.motion });
        }
        self.particle(now);
        let speed = ground_truth.map_or(f64::NAN, |truth| truth.particle_velocity.abs());
        self.fit
            .sample(sensors.response, speed, step, self.scene.record.window_periods);
        self.fit.watch(&self.impacts, self.phase);
        let mut motion = self.fit.motion;
        if driven {
            motion.speed = speed;
            if drive.omega > 0.0 {
                motion.omega = drive.omega;
            }
        }
        let epsilon = self.scene.plant.particle_mass / self.scene.plant.primary_mass;
        let relative = match (ground_truth, self.scene.resonance.sensor) {
            (Some(_), Sensor::V) => sensors.response - (1.0 + epsilon) * self.particle,
            _ => f64::NAN,
        };
        let decays = !driven && (ground_truth.is_none() || self.fit.synchronous);
        self.phase += drive.omega * step;
        self.last = *now;
        [
            time,
            sensors.reference.unwrap_or(f64::NAN),
            sensors.response,
            relative,
            command
                .and_then(|command| command.phase_error)
                .map_or(f64::NAN, f64::to_degrees),
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
        let before = self.last.ground_truth.map_or(0, |truth| truth.impacts);
        let velocity = truth.particle_velocity;
        if truth.impacts == before {
            self.particle += velocity * self.last.step;
            return;
        }
        let since = now.time - truth.impact_time;
        self.impacts.0.push(Impact {
            time: self.phase - now.drive.omega * since,
            velocity: truth.impact_velocity,
        });
        self.impacts.trim();
        let plant = &self.scene.plant;
        let epsilon = plant.particle_mass / plant.primary_mass;
        // The response v = q1 + epsilon q2 is smooth at an impact; the relative displacement is that of the wall there.
        let rate = (now.sensors.response - self.last.sensors.response) / self.last.step.max(f64::MIN_POSITIVE);
        let response = now.sensors.response - rate * since;
        let [plus, minus] = plant.gaps();
        let wall = if truth.impact_velocity > 0.0 { plus } else { -minus };
        self.particle = (response - wall) / (1.0 + epsilon) + velocity * since;
    }

    /// What the page shows beside the rows.
    fn state(&self) -> Value {
        let Sample { command, ground_truth, .. } = self.last;
        let state = command.and_then(|command| command.state);
        let fault = command.and_then(|command| command.fault);
        json!({
            "state": state.map(|state| state as u8),
            "settled": command.is_some_and(|command| command.settled),
            "fault": fault.map_or(0, |fault| fault as u8),
            "fault_text": fault.map_or("", |fault| fault.text()),
            "impacts": ground_truth.map(|truth| truth.impacts),
            "per_period": self.impacts.per_period(),
            "regime": ground_truth.map(|_| self.impacts.regime(self.phase).name()),
        })
    }
}

/// The settings of the page with the values of the scene, its curves, and what the module would know.
fn table(title: &str, scene: &Scene) -> Value {
    let d = scene.dimensionless();
    let lock = scene.controller_config().lock;
    let ([plus, minus], cavity) = (scene.plant.gaps(), scene.plant.cavity);
    let mut table: Value = serde_json::from_str(include_str!("../../../live/settings.json")).unwrap_or_default();
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
        "exact": curves::exact(&d, 120).collect::<Vec<_>>(),
    });
    table
}

// The server: GET only, and only what the page needs. HTTP without a library, because one for so few requests would be larger than this.

/// The files of the page: path and content.
macro_rules! files {
    ($($name:literal),*) => {
        [$((concat!("/", $name), include_str!(concat!("../../../live/page/", $name)))),*]
    };
}
const FILES: [(&str, &str); 16] = files![
    "index.html",
    "style.css",
    "controls.js",
    "link.js",
    "main.js",
    "map.js",
    "module.js",
    "page.js",
    "pictures.js",
    "plots.js",
    "record.js",
    "rig.js",
    "sound.js",
    "story.js",
    "strip.js",
    "watch.js"
];

/// The type of a file.
fn kind(name: &str) -> &'static str {
    match name.rsplit('.').next() {
        Some("html") => "text/html",
        Some("css") => "text/css",
        _ => "text/javascript",
    }
}

/// Evaluates samples and accepts browsers until the experiment is over; then waits until they have got the rest.
fn serve(
    listener: &TcpListener,
    address: SocketAddr,
    samples: &Receiver<Sample>,
    mut view: View,
    shared: &Arc<Mutex<Shared>>,
    table: &Arc<String>,
) {
    let mut browsers: Vec<thread::JoinHandle<()>> = Vec::new();
    loop {
        let over = locked(shared).over;
        evaluate(samples, &mut view, shared);
        while let Ok((stream, _)) = listener.accept() {
            browsers.retain(|browser| !browser.is_finished());
            if browsers.len() < MOST {
                let (shared, table) = (Arc::clone(shared), Arc::clone(table));
                // A browser that is closed ends its connection only.
                browsers.push(thread::spawn(move || drop(answer(&stream, address, &shared, &table))));
            }
        }
        if over {
            break;
        }
        thread::sleep(PACE);
    }
    locked(shared).complete = true;
    let since = Instant::now();
    // Browsers also hold connections without a request, which are not worth a long wait.
    while since.elapsed() < PATIENCE
        && (locked(shared).streams > 0
            || since.elapsed() < PATIENCE / 4 && browsers.iter().any(|browser| !browser.is_finished()))
    {
        thread::sleep(PACE);
    }
}

/// Turns all samples that wait into rows, a number of them per period.
fn evaluate(samples: &Receiver<Sample>, view: &mut View, shared: &Mutex<Shared>) {
    let period = view.scene.dimensionless().natural_period();
    let mut rows = Vec::new();
    let mut begins = false;
    for sample in samples.try_iter() {
        // A new session, also if its first samples were dropped.
        if sample.number == 0 || sample.number < view.last.number {
            *view = View::new(&view.scene);
            rows.clear();
            begins = true;
        }
        let row = view.row(&sample);
        let stride = (period / (PER_PERIOD * sample.step)).floor().max(1.0) as u64;
        if sample.number.is_multiple_of(stride) {
            rows.push(row);
        }
    }
    let mut shared = locked(shared);
    if begins {
        shared.session += 1;
        shared.rows.clear();
        shared.first = 0;
    }
    shared.state = view.state();
    shared.rows.extend(rows);
    let surplus = shared.rows.len().saturating_sub((KEPT_PERIODS * PER_PERIOD) as usize);
    shared.rows.drain(..surplus);
    shared.first += surplus as u64;
}

/// Answers one request.
fn answer(mut stream: &TcpStream, address: SocketAddr, shared: &Mutex<Shared>, table: &str) -> io::Result<()> {
    stream.set_nonblocking(false)?;
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    // A request of this page has less than a kilobyte.
    let head: Vec<String> = BufReader::new(stream.take(1 << 14))
        .lines()
        .take_while(|line| line.as_ref().is_ok_and(|line| !line.is_empty()))
        .collect::<Result<_, _>>()?;
    let words: Vec<&str> = head.first().map_or("", String::as_str).split(' ').collect();
    // A page of another site that gets this address by its own name must not read along.
    let local = [address.to_string(), format!("localhost:{}", address.port())];
    let host = |line: &String| {
        line.split_once(": ")
            .filter(|(name, _)| name.eq_ignore_ascii_case("host"))
            .map(|(_, host)| host.to_string())
    };
    let known = head.iter().find_map(host).is_some_and(|host| local.contains(&host));
    let path = words
        .get(1)
        .map_or("", |path| path.split('?').next().unwrap_or_default());
    let path = if path == "/" { "/index.html" } else { path };
    let file = FILES.iter().find(|(name, _)| *name == path);
    let (status, kind, content) = match (words.first(), path) {
        _ if !known => (
            "403 Forbidden",
            "text/plain",
            "this server answers at its own address only",
        ),
        (Some(&"GET"), "/rows") => return events(stream, shared),
        (Some(&"GET"), "/settings.json") => ("200 OK", "application/json", table),
        (Some(&"GET"), _) => match file {
            Some((name, text)) => ("200 OK", kind(name), *text),
            None => ("404 Not Found", "text/plain", "no such file"),
        },
        _ => ("405 Method Not Allowed", "text/plain", "only GET"),
    };
    let length = content.len();
    write!(
        stream,
        "HTTP/1.1 {status}\r\nContent-Type: {kind}; charset=utf-8\r\nContent-Length: {length}\r\nCache-Control: no-store\r\nConnection: close\r\n\r\n{content}"
    )
}

/// Sends what is new until everything is sent.
fn events(mut stream: &TcpStream, shared: &Mutex<Shared>) -> io::Result<()> {
    locked(shared).streams += 1;
    let mut send = || -> io::Result<()> {
        stream.write_all(b"HTTP/1.1 200 OK\r\nContent-Type: text/event-stream\r\nCache-Control: no-store\r\nConnection: close\r\n\r\n")?;
        let (mut session, mut next) = (0, 0);
        loop {
            let now = locked(shared);
            let begins = now.session != session;
            let from = if begins { now.first } else { next.max(now.first) };
            let rows: Vec<Row> = now.rows.iter().skip((from - now.first) as usize).copied().collect();
            (session, next) = (now.session, from + rows.len() as u64);
            let outcome = now.complete.then(|| json!({ "error": now.failure }));
            let state = now.state.clone();
            drop(now);
            // Also without rows: a closed browser is noticed at the next event.
            let event = json!({ "begins": begins, "rows": rows, "state": state, "outcome": outcome });
            write!(stream, "data: {event}\n\n")?;
            if outcome.is_some() {
                return Ok(());
            }
            thread::sleep(PACE);
        }
    };
    let sent = send();
    locked(shared).streams -= 1;
    sent
}
