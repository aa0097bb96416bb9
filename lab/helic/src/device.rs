//! A rig as a device: its parameters, its stream, the requests of the host, and one sample after another; and its server, which has control
//! channel, stream and the clock of the device.

use std::f64::consts::TAU;
use std::io::{self, ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream, UdpSocket};
use std::thread;
use std::time::Instant;

use super::codec::{
    COEFFICIENTS, ErrorCode, Frame, HARMONICS, MAX_PAYLOAD, Packet, VERSION, message, of_bytes, size, take, to_bytes,
};
use vines_net::{Ended, POLL, RealTimeClock, ServerError, Session, is_loopback};
use vines_testbench::rig::{Drive, Rig, RigError, Sensors};

/// Longest silence of the host, s, before the output is disarmed; 0: no limit.
pub(crate) const WATCHDOG: &str = "rig_watchdog";
/// Names, type and number of values of the parameters, in the order of version 3; then come those of the rig.
const PARAMETERS: &[(&str, u8, usize)] = &[
    ("firmware experiment", b'c', 16),
    ("sample_freq", b'f', 1),
    ("ticks loop_time_last loop_time_max clock_jitter overruns", b'I', 1),
    ("tick_timeouts records_dropped", b'I', 1),
    ("freq", b'f', 1),
    ("target_coeffs forcing_coeffs", b'f', COEFFICIENTS),
    ("table", b'f', 4096),
    ("table_len", b'H', 1),
    ("table_freq table_gain", b'f', 1),
    ("table_interp table_mode table_mult", b'I', 1),
    ("table_phase", b'f', 1),
    ("table_trigger wake_phase_min wake_phase_max t_measure_max", b'I', 1),
    ("t_actuate_max t_rest_max diag_reset cmd_backlog_max", b'I', 1),
    ("arm safety mcu_reboot", b'I', 1),
    ("rig_gain rig_out_max", b'f', 1),
    (WATCHDOG, b'f', 1),
    ("impacts", b'I', 1),
];
/// Parameters that a host may set.
const WRITABLE: [&str; 7] = [
    "freq",
    "target_coeffs",
    "forcing_coeffs",
    "table_mode",
    "diag_reset",
    "arm",
    WATCHDOG,
];
/// Sources of a stream, with their units. A rig without a base sensor has no `reference`.
const SOURCES: [(&str, &str); 8] = [
    ("response", "mm"),
    ("reference", "mm"),
    ("target", "V"),
    ("forcing", "V"),
    ("table", "V"),
    ("phase", "turns"),
    ("out", "V"),
    ("cmd_epoch", "count"),
];
/// Base displacement per volt of the output, mm.
const GAIN: f64 = 1.0;
/// m per mm.
const MILLI: f64 = 1e-3;
/// Turns of the phase accumulator per turn of the phase.
const TURN: f64 = 4_294_967_296.0;
/// The command counter is exact as a float.
const EPOCH: u32 = 1 << 24;
/// Longest time before a packet is sent, s (protocol, "Stream channel").
const FLUSH: f64 = 0.005;

/// The definitions of all parameters: name, type, number of values.
fn parameters() -> impl Iterator<Item = (&'static str, u8, usize)> {
    let rows = PARAMETERS.iter();
    rows.flat_map(|&(names, code, count)| names.split(' ').map(move |name| (name, code, count)))
}

fn parameter(index: u16) -> Result<(&'static str, u8, usize), ErrorCode> {
    parameters().nth(index.into()).ok_or(ErrorCode::BadIndex)
}

/// A page of definitions: those from `start` on that fit into a payload.
fn page(start: u16) -> Result<Vec<u8>, ErrorCode> {
    if usize::from(start) > parameters().count() {
        return Err(ErrorCode::BadIndex);
    }
    let (mut next, mut page) = (start, Vec::new());
    for (name, code, count) in parameters().skip(start.into()) {
        let [low, high] = (count as u16).to_le_bytes();
        let writable = WRITABLE.contains(&name).into();
        let definition = [name.as_bytes(), &[0, code, low, high, writable]].concat();
        if 4 + page.len() + definition.len() > MAX_PAYLOAD {
            break;
        }
        page.extend(definition);
        next += 1;
    }
    Ok([&start.to_le_bytes()[..], &next.to_le_bytes(), &page].concat())
}

/// The stream: what the host has set up, and the packet that is being filled.
#[derive(Debug, Default)]
struct Stream {
    sources: Vec<u8>,
    decimation: u16,
    /// Records, or 0 for a stream without an end.
    count: u32,
    /// Port of the host while the stream runs.
    port: Option<u16>,
    /// Samples and records since the start, and samples since the last packet.
    samples: u64,
    records: u32,
    age: u32,
    packet: Packet,
}

impl Stream {
    /// Sets the stream up: `decimation u16, count u32, n u8, source u8 × n`; `all` is the number of sources.
    fn set_up(&mut self, mut payload: &[u8], all: usize) -> Result<(), ErrorCode> {
        let [d, e, a, b, c, f, n] = take(&mut payload).map_err(|_| ErrorCode::BadLength)?;
        let decimation = u16::from_le_bytes([d, e]);
        let sources_exist = payload.iter().all(|source| usize::from(*source) < all);
        match () {
            () if payload.len() != usize::from(n) => return Err(ErrorCode::BadLength),
            () if self.port.is_some() => return Err(ErrorCode::Busy),
            () if decimation == 0 || n == 0 || !sources_exist => return Err(ErrorCode::BadValue),
            () => {}
        }
        (self.decimation, self.count, self.sources) = (decimation, u32::from_le_bytes([a, b, c, f]), payload.into());
        Ok(())
    }

    /// Starts the stream to a port of the host.
    fn start(&mut self, payload: &[u8]) -> Result<(), ErrorCode> {
        let port = u16::from_le_bytes(payload.try_into().map_err(|_| ErrorCode::BadLength)?);
        if self.port.is_some() {
            return Err(ErrorCode::Busy);
        }
        if port == 0 || self.sources.is_empty() {
            return Err(ErrorCode::BadValue);
        }
        (self.port, self.samples, self.records, self.age) = (Some(port), 0, 0, 0);
        let width = self.sources.len() as u8;
        self.packet = Packet { decimation: self.decimation, width, ..Packet::default() };
        Ok(())
    }

    /// Takes the values of all sources at sample `index`; returns a packet that is full, complete or `flush` samples old, and its port.
    fn record(&mut self, index: u32, values: &[f64], flush: f64) -> Option<(u16, Vec<u8>)> {
        let (port, packet) = (self.port?, &mut self.packet);
        if self.samples.is_multiple_of(self.decimation.into()) {
            if packet.values.is_empty() {
                packet.first = index;
            }
            let record = self.sources.iter().map(|source| values[usize::from(*source)] as f32);
            packet.values.extend(record);
            self.records += 1;
        }
        self.samples += 1;
        self.age += 1;
        let width = self.sources.len();
        let complete = self.count != 0 && self.records == self.count;
        let due = packet.values.len() / width >= Packet::capacity(width) || f64::from(self.age + 1) > flush;
        if packet.values.is_empty() || !(due || complete) {
            return None;
        }
        let bytes = packet.encode();
        packet.sequence = packet.sequence.wrapping_add(1);
        packet.values.clear();
        self.age = 0;
        self.port.take_if(|_| complete);
        Some((port, bytes))
    }
}

/// A device. Everything in it happens at a sample or between two of them, in the order of the calls.
pub struct Device {
    rig: Box<dyn Rig>,
    has_reference: bool,
    sample_rate: f64,
    /// Largest output, V.
    largest: f64,
    /// Frequency of the oscillator, Hz, and its series target and forcing, V.
    frequency: f64,
    series: [Vec<f64>; 2],
    armed: bool,
    safety: u8,
    /// s
    watchdog: f64,
    impacts: u32,
    stream: Stream,
    /// Phase of the oscillator, 2^-32 turns.
    phase: u32,
    ticks: u32,
    /// Commands since the last sample, and up to it.
    commands: u32,
    epoch: u32,
    /// Samples since the last request.
    silence: u32,
}

impl Device {
    /// The rig `rig` as a device, sampled every `sample_time`, s; its output is limited to `max_amplitude`, m.
    pub fn new(mut rig: Box<dyn Rig>, sample_time: f64, max_amplitude: f64) -> Result<Self, RigError> {
        Ok(Self {
            has_reference: rig.sense()?.reference.is_some(),
            rig,
            sample_rate: 1.0 / sample_time,
            largest: max_amplitude / (GAIN * MILLI),
            frequency: 0.0,
            series: [vec![0.0; COEFFICIENTS], vec![0.0; COEFFICIENTS]],
            armed: false,
            safety: 0,
            watchdog: 0.0,
            impacts: 0,
            stream: Stream::default(),
            phase: 0,
            ticks: 0,
            commands: 0,
            epoch: 0,
            silence: 0,
        })
    }

    /// The host has left: output and stream stop.
    pub fn disconnect(&mut self) {
        self.stream.port = None;
        self.armed = false;
    }

    /// Whether the output may be other than zero.
    pub fn is_driven(&self) -> bool {
        self.armed
    }

    fn sources(&self) -> impl Iterator<Item = (&'static str, &'static str)> {
        let has_reference = self.has_reference;
        SOURCES
            .into_iter()
            .filter(move |(name, _)| has_reference || *name != "reference")
    }

    /// Answers a request. `uptime` in ms.
    pub fn handle(&mut self, request: &Frame, uptime: u32) -> Frame {
        let Frame { kind, sequence, ref payload } = *request;
        self.silence = 0;
        let (kind, payload) = match self.answer(kind, payload, uptime) {
            Ok(payload) => (kind, payload),
            Err(code) => (message::ERROR, vec![code as u8, kind]),
        };
        Frame { kind, sequence, payload }
    }

    fn answer(&mut self, kind: u8, payload: &[u8], uptime: u32) -> Result<Vec<u8>, ErrorCode> {
        if matches!(kind, message::GET_SOURCES | message::STREAM_STOP | message::STATUS) && !payload.is_empty() {
            return Err(ErrorCode::BadLength);
        }
        let empty = |()| Vec::new();
        match kind {
            message::GET_PARAMS => {
                let start = payload.try_into().map_err(|_| ErrorCode::BadLength)?;
                page(u16::from_le_bytes(start))
            }
            message::GET_SOURCES => {
                let entry = |(name, unit): (&str, &str)| format!("{name}\0{unit}\0").into_bytes();
                Ok(self.sources().flat_map(entry).collect())
            }
            message::GET_PAR => self.read(payload),
            message::SET_PAR => self.set(payload).map(empty),
            message::STREAM_SETUP => self.stream.set_up(payload, self.sources().count()).map(empty),
            message::STREAM_START => self.stream.start(payload).map(empty),
            message::STREAM_STOP => {
                self.stream.port = None;
                Ok(Vec::new())
            }
            message::STATUS => {
                let [low, high] = (parameters().count() as u16).to_le_bytes();
                let head = [VERSION, low, high, self.sources().count() as u8];
                let sample_rate = self.sample_rate as f32;
                Ok([head, sample_rate.to_le_bytes(), uptime.to_le_bytes()].concat())
            }
            _ => Err(ErrorCode::UnknownType),
        }
    }

    /// The values of the parameters with these indices, as bytes.
    fn read(&self, indices: &[u8]) -> Result<Vec<u8>, ErrorCode> {
        if indices.is_empty() || !indices.len().is_multiple_of(2) {
            return Err(ErrorCode::BadLength);
        }
        let mut bytes = Vec::new();
        for index in of_bytes(b'H', indices) {
            let (name, code, count) = parameter(index as u16)?;
            let text = |text: &str| text.bytes().map(f64::from).collect();
            let mut values: Vec<f64> = match name {
                "firmware" => text(concat!("vines ", env!("CARGO_PKG_VERSION"))),
                "experiment" => text("vines"),
                "sample_freq" => vec![self.sample_rate],
                "ticks" => vec![self.ticks.into()],
                "freq" => vec![self.frequency],
                "target_coeffs" => self.series[0].clone(),
                "forcing_coeffs" => self.series[1].clone(),
                "arm" => vec![self.armed.into()],
                "safety" => vec![self.safety.into()],
                "rig_gain" => vec![GAIN],
                "rig_out_max" => vec![self.largest],
                WATCHDOG => vec![self.watchdog],
                "impacts" => vec![self.impacts.into()],
                // The waveform table, and statistics of the processor.
                _ => Vec::new(),
            };
            values.resize(count, 0.0);
            bytes.extend(to_bytes(code, &values));
        }
        (bytes.len() <= MAX_PAYLOAD)
            .then_some(bytes)
            .ok_or(ErrorCode::BadLength)
    }

    /// Sets a parameter: `index u16, values`.
    fn set(&mut self, payload: &[u8]) -> Result<(), ErrorCode> {
        let (index, bytes) = payload.split_first_chunk().ok_or(ErrorCode::BadLength)?;
        let (name, code, count) = parameter(u16::from_le_bytes(*index))?;
        if !WRITABLE.contains(&name) {
            return Err(ErrorCode::ReadOnly);
        }
        if bytes.len() != count * size(code) {
            return Err(ErrorCode::BadLength);
        }
        let values = of_bytes(code, bytes);
        let value = values[0];
        let is_command = !["arm", WATCHDOG, "diag_reset"].contains(&name);
        match name {
            "freq" if (0.0..0.5 * self.sample_rate).contains(&value) => self.frequency = value,
            "target_coeffs" if amplitude(&values) <= self.largest => self.series[0] = values,
            "forcing_coeffs" if amplitude(&values) <= self.largest => self.series[1] = values,
            "arm" if value <= 1.0 => self.armed = value == 1.0,
            WATCHDOG if value >= 0.0 && value.is_finite() => self.watchdog = value,
            // There is no waveform table, and there are no statistics.
            "table_mode" if value == 0.0 => {}
            "diag_reset" => {}
            _ => return Err(ErrorCode::BadValue),
        }
        self.commands += u32::from(is_command);
        Ok(())
    }

    /// One sample: reads the sensors, drives the rig until the next sample, and returns a packet for a port of the host if one is complete.
    pub fn tick(&mut self) -> Result<Option<(u16, Vec<u8>)>, RigError> {
        let Sensors { response, reference } = self.rig.sense()?;
        let step = 1.0 / self.sample_rate;
        self.epoch = (self.epoch + std::mem::take(&mut self.commands)) % EPOCH;
        self.silence = self.silence.saturating_add(1);
        if self.watchdog > 0.0 && f64::from(self.silence) * step > self.watchdog {
            self.armed = false;
        }
        let [target, forcing] = [0, 1].map(|n| value(&self.series[n], self.phase));
        let out = self.gate(target + forcing);
        let (turns, epoch) = (f64::from(self.phase) / TURN, f64::from(self.epoch));
        let sensors = [Some(response), reference]
            .into_iter()
            .flatten()
            .map(|length| length / MILLI);
        let values: Vec<f64> = sensors.chain([target, forcing, 0.0, turns, out, epoch]).collect();
        let packet = self.stream.record(self.ticks, &values, FLUSH * self.sample_rate);
        let displacement = out * GAIN * MILLI;
        self.rig.hold(Drive { displacement, ..Drive::default() }, step)?;
        let turn = self.frequency * step * TURN;
        self.phase = self.phase.wrapping_add(turn.round() as u32);
        self.ticks = self.ticks.wrapping_add(1);
        self.impacts = self.rig.ground_truth()?.map_or(0, |inside| inside.impacts as u32);
        Ok(packet)
    }

    /// The output, V: zero unless armed, and never more than the limit.
    fn gate(&mut self, wanted: f64) -> f64 {
        let quiet = !self.armed || !wanted.is_finite();
        let out = if quiet {
            0.0
        } else {
            wanted.clamp(-self.largest, self.largest)
        };
        let limited = !quiet && out != wanted;
        // Bits: 0 armed, 1 tripped (nothing trips here), 2 limited, 3 quiet.
        self.safety = u8::from(self.armed) | u8::from(limited) << 2 | u8::from(quiet) << 3;
        out
    }
}

/// Upper bound of a Fourier series: mean, cosines, sines.
fn amplitude(coefficients: &[f64]) -> f64 {
    let (cosines, sines) = coefficients[1..].split_at(HARMONICS);
    let harmonics = cosines.iter().zip(sines).map(|(a, b)| a.hypot(*b));
    coefficients[0].abs() + harmonics.sum::<f64>()
}

/// Value of a Fourier series at a phase of its fundamental.
fn value(coefficients: &[f64], phase: u32) -> f64 {
    let (cosines, sines) = coefficients[1..].split_at(HARMONICS);
    let harmonics = (1..)
        .zip(cosines.iter().zip(sines))
        .filter(|(_, (a, b))| **a != 0.0 || **b != 0.0);
    let values = harmonics.map(|(k, (a, b))| {
        let (sine, cosine) = (TAU * f64::from(phase.wrapping_mul(k)) / TURN).sin_cos();
        a * cosine + b * sine
    });
    coefficients[0] + values.sum::<f64>()
}

/// Port of the control channel; the stream has the next one.
pub const DEFAULT_PORT: u16 = 2350;

/// The server of a device, one host at a time.
pub struct HelicServer {
    control: TcpListener,
    stream: UdpSocket,
    device: Device,
    sample_time: f64,
}

/// The connection to a host.
struct Connection {
    stream: TcpStream,
    peer: SocketAddr,
    bytes: Vec<u8>,
    opened: Instant,
    /// Number of its first sample.
    first: u64,
}

impl HelicServer {
    /// Listens on `address` (TCP), and sends the stream from the next port. With port 0 the system chooses both ports.
    pub fn listen(address: SocketAddr, device: Device, sample_time: f64) -> io::Result<Self> {
        let control = TcpListener::bind(address)?;
        control.set_nonblocking(true)?;
        // A host on this machine may use the next port itself.
        let any_port = address.port() == 0 || is_loopback(address.ip());
        let port = if any_port { 0 } else { address.port().saturating_add(1) };
        let stream = UdpSocket::bind((address.ip(), port))?;
        stream.set_nonblocking(true)?;
        Ok(Self { control, stream, device, sample_time })
    }

    /// Address of the control channel.
    pub fn address(&self) -> io::Result<SocketAddr> {
        self.control.local_addr()
    }

    /// Serves until `stop` returns true. `report` receives the report when a host has left.
    pub fn serve(
        &mut self,
        mut stop: impl FnMut() -> bool,
        mut report: impl FnMut(&Session),
    ) -> Result<(), ServerError> {
        let mut clock = RealTimeClock::start(self.sample_time);
        let mut host: Option<Connection> = None;
        let mut tick = 0;
        loop {
            let stopped = stop();
            if host.is_none()
                && let Ok((stream, peer)) = self.control.accept()
            {
                stream.set_nodelay(true)?;
                stream.set_nonblocking(true)?;
                clock.forget();
                let (bytes, opened) = (Vec::new(), Instant::now());
                host = Some(Connection { stream, peer, bytes, opened, first: tick });
            }
            let uptime = clock.due(0).elapsed().as_millis() as u32;
            let device = &mut self.device;
            let left = host.as_mut().is_some_and(|host| !host.exchange(device, uptime));
            if let Some(host) = host.take_if(|_| left || stopped) {
                device.disconnect();
                report(&Session {
                    peer: host.peer,
                    ended: if left { Ended::Farewell } else { Ended::Stopped },
                    samples: tick - host.first,
                    sample_time: self.sample_time,
                    seconds: host.opened.elapsed().as_secs_f64(),
                    timing: Some(clock.timing(0)),
                    histogram: clock.classes(),
                    counters: None,
                });
            }
            if stopped {
                return Ok(());
            }
            while Instant::now() >= clock.due(tick + 1) {
                tick += 1;
                clock.serve(tick);
                if let (Some((port, bytes)), Some(host)) = (self.device.tick()?, &host) {
                    // A packet that cannot be sent now counts as lost in the network.
                    let _ = self.stream.send_to(&bytes, (host.peer.ip(), port));
                }
            }
            thread::sleep(clock.due(tick + 1).saturating_duration_since(Instant::now()).min(POLL));
        }
    }
}

impl Connection {
    /// Answers the requests that have arrived; false if the host has left, or has sent bytes that are not a frame.
    fn exchange(&mut self, device: &mut Device, uptime: u32) -> bool {
        let mut more = [0; 2048];
        match self.stream.read(&mut more) {
            Ok(0) => return false,
            Ok(size) => self.bytes.extend(&more[..size]),
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => return true,
            Err(_) => return false,
        }
        loop {
            match Frame::take(&mut self.bytes) {
                Ok(Some(request)) => {
                    let answer = device.handle(&request, uptime).encode();
                    if self.stream.write_all(&answer).is_err() {
                        return false;
                    }
                }
                Ok(None) => return true,
                Err(_) => return false,
            }
        }
    }
}
