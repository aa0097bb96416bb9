//! A rig as a device: its parameters, its stream, the requests of the host, and one sample after another; and its server.

use std::f64::consts::TAU;
use std::io::{self, ErrorKind, Write};
use std::net::{SocketAddr, TcpListener, TcpStream, UdpSocket};
use std::thread;
use std::time::Instant;

use vines_net::{Ended, POLL, RealTimeClock, ServerError, Session, is_loopback};
use vines_rig::{Drive, Rig, RigError, Sensors};

use crate::codec::{
    ErrorCode, Frame, HARMONICS, MAX_PAYLOAD, MAX_VALUES, Packet, VERSION, message, of_bytes, size, take, to_bytes,
};

/// Longest silence of the host, s, before the output is disarmed; 0: no limit.
pub(crate) const WATCHDOG: &str = "rig_watchdog";
/// The parameters in the order of version 3, then those of the rig: name, type, and number of values if it is not 1. A host may set those
/// with an asterisk. What has no value here belongs to the waveform table or to the statistics of the processor, and stays 0.
const PARAMETERS: &str = "firmware c16, experiment c16, sample_freq f, ticks I, loop_time_last I, loop_time_max I, clock_jitter I, overruns I, \
    tick_timeouts I, records_dropped I, freq* f, target_coeffs* f33, forcing_coeffs* f33, table f4096, table_len H, table_freq f, table_gain f, \
    table_interp I, table_mode* I, table_mult I, table_phase f, table_trigger I, wake_phase_min I, wake_phase_max I, t_measure_max I, \
    t_actuate_max I, t_rest_max I, diag_reset* I, cmd_backlog_max I, arm* I, safety I, mcu_reboot I, rig_gain f, rig_out_max f, \
    rig_watchdog* f, impacts I";
/// The sources of a stream, with their units, as GetSources answers. A rig without a base sensor has no `reference`.
const SOURCES: &str =
    "response\0mm\0reference\0mm\0target\0V\0forcing\0V\0table\0V\0phase\0turns\0out\0V\0cmd_epoch\0count\0";
/// m per mm, and base displacement, m, per volt of the output: `rig_gain` is 1 mm/V.
const MILLI: f64 = 1e-3;
/// Turns of the phase accumulator per turn of the phase.
const TURN: f64 = 4_294_967_296.0;
/// Longest time before a packet is sent, s (protocol, "Stream channel").
const FLUSH: f64 = 0.005;

fn require(is_met: bool, otherwise: ErrorCode) -> Result<(), ErrorCode> {
    is_met.then_some(()).ok_or(otherwise)
}

/// A parameter. Its type is a letter as in Python's `struct`.
struct Parameter {
    name: &'static str,
    code: u8,
    is_writable: bool,
    values: Vec<f64>,
}

impl Parameter {
    /// The parameter of an entry in [`PARAMETERS`].
    fn of(entry: &'static str) -> Self {
        let (name, form) = entry.split_once(' ').expect("a name and a type");
        let (code, count) = (form.as_bytes()[0], form[1..].parse().unwrap_or(1));
        let (is_writable, values) = (name.ends_with('*'), vec![0.0; count]);
        let name = name.trim_end_matches('*');
        Self { name, code, is_writable, values }
    }
}

/// A device. Everything in it happens at a sample or between two of them, in the order of the calls.
pub struct Device {
    rig: Box<dyn Rig>,
    sample_rate: f64,
    parameters: Vec<Parameter>,
    /// Names and units.
    sources: String,
    /// The sources of the stream, the number of its records, or 0 for a stream without an end, and the packet that is being filled.
    streamed: Vec<u8>,
    count: u32,
    packet: Packet,
    /// Port of the host while the stream runs, and samples since its start.
    port: Option<u16>,
    samples: u64,
    /// Phase of the oscillator, 2^-32 turns.
    phase: u32,
    ticks: u32,
    /// Number of commands.
    epoch: u32,
    /// Samples since the last request.
    silence: u32,
}

impl Device {
    /// The rig `rig` as a device, sampled every `sample_time`, s; its output is limited to `max_amplitude`, m.
    pub fn new(mut rig: Box<dyn Rig>, sample_time: f64, max_amplitude: f64) -> Result<Self, RigError> {
        let absent = ["reference\0mm\0", "\0\0"][usize::from(rig.sense()?.reference.is_some())];
        let mut device = Self {
            rig,
            sample_rate: 1.0 / sample_time,
            parameters: PARAMETERS.split(", ").map(Parameter::of).collect(),
            sources: SOURCES.replace(absent, ""),
            streamed: Vec::new(),
            count: 0,
            packet: Packet::default(),
            port: None,
            samples: 0,
            phase: 0,
            ticks: 0,
            epoch: 0,
            silence: 0,
        };
        let firmware = concat!("vines ", env!("CARGO_PKG_VERSION"));
        for (name, text) in [("firmware", firmware), ("experiment", "vines")] {
            device.values(name).splice(..text.len(), text.bytes().map(f64::from));
        }
        device.values("sample_freq")[0] = device.sample_rate;
        device.values("rig_gain")[0] = 1.0;
        device.values("rig_out_max")[0] = max_amplitude / MILLI;
        Ok(device)
    }

    /// The values of a parameter of the table.
    fn values(&mut self, name: &str) -> &mut Vec<f64> {
        let parameter = self.parameters.iter_mut().find(|parameter| parameter.name == name);
        &mut parameter.expect("the parameter is in the table").values
    }

    /// The host has left: output and stream stop.
    pub fn disconnect(&mut self) {
        self.port = None;
        self.values("arm")[0] = 0.0;
    }

    /// Whether the output may be other than zero.
    pub fn is_driven(&mut self) -> bool {
        self.values("arm")[0] == 1.0
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
        let (all, done) = (self.sources.matches('\0').count() / 2, |()| Vec::new());
        match (kind, payload) {
            (message::GET_PARAMS, &[low, high]) => self.page(u16::from_le_bytes([low, high])),
            (message::GET_SOURCES, []) => Ok(self.sources.clone().into()),
            (message::GET_PAR, indices) => self.read(indices),
            (message::SET_PAR, setting) => self.set(setting).map(done),
            (message::STREAM_SETUP, setup) => self.set_up(setup, all).map(done),
            (message::STREAM_START, &[low, high]) => self.start(u16::from_le_bytes([low, high])).map(done),
            (message::STREAM_STOP, []) => {
                self.port = None;
                Ok(Vec::new())
            }
            (message::STATUS, []) => {
                let [low, high] = (self.parameters.len() as u16).to_le_bytes();
                let sample_rate = (self.sample_rate as f32).to_le_bytes();
                Ok([[VERSION, low, high, all as u8], sample_rate, uptime.to_le_bytes()].concat())
            }
            (message::GET_PARAMS | message::GET_SOURCES | message::STREAM_START..=message::STATUS, _) => {
                Err(ErrorCode::BadLength)
            }
            _ => Err(ErrorCode::UnknownType),
        }
    }

    /// A page of definitions: those from `start` on that fit into a payload.
    fn page(&self, start: u16) -> Result<Vec<u8>, ErrorCode> {
        let all = self.parameters.get(start.into()..).ok_or(ErrorCode::BadIndex)?;
        let (mut next, mut page) = (start, Vec::new());
        for Parameter { name, code, is_writable, values } in all {
            let [low, high] = (values.len() as u16).to_le_bytes();
            let definition = [name.as_bytes(), &[0, *code, low, high, (*is_writable).into()]].concat();
            if 4 + page.len() + definition.len() > MAX_PAYLOAD {
                break;
            }
            page.extend(definition);
            next += 1;
        }
        Ok([&start.to_le_bytes()[..], &next.to_le_bytes(), &page].concat())
    }

    /// The values of the parameters with these indices, as bytes.
    fn read(&self, indices: &[u8]) -> Result<Vec<u8>, ErrorCode> {
        let (indices, rest) = indices.as_chunks();
        let mut bytes = Vec::new();
        for index in indices {
            let parameter = self.parameters.get(usize::from(u16::from_le_bytes(*index)));
            let Parameter { code, values, .. } = parameter.ok_or(ErrorCode::BadIndex)?;
            bytes.extend(to_bytes(*code, values));
        }
        let is_allowed = !indices.is_empty() && rest.is_empty() && bytes.len() <= MAX_PAYLOAD;
        require(is_allowed, ErrorCode::BadLength).map(|()| bytes)
    }

    /// Sets a parameter: `index u16, values`.
    fn set(&mut self, mut payload: &[u8]) -> Result<(), ErrorCode> {
        let index = u16::from_le_bytes(take(&mut payload)?);
        let (highest, largest) = (0.5 * self.sample_rate, self.values("rig_out_max")[0]);
        let parameter = self.parameters.get_mut(usize::from(index)).ok_or(ErrorCode::BadIndex)?;
        require(parameter.is_writable, ErrorCode::ReadOnly)?;
        let length = parameter.values.len() * size(parameter.code);
        require(payload.len() == length, ErrorCode::BadLength)?;
        let values = of_bytes(parameter.code, payload);
        let (is_command, is_allowed) = match parameter.name {
            "freq" => (true, (0.0..highest).contains(&values[0])),
            "target_coeffs" | "forcing_coeffs" => (true, series(&values, 0)[1] <= largest),
            // There is no waveform table.
            "table_mode" => (true, values[0] == 0.0),
            "arm" => (false, values[0] <= 1.0),
            WATCHDOG => (false, values[0] >= 0.0 && values[0].is_finite()),
            _ => (false, true),
        };
        require(is_allowed, ErrorCode::BadValue)?;
        parameter.values = values;
        // Exact as a float.
        self.epoch = (self.epoch + u32::from(is_command)) % (1 << f32::MANTISSA_DIGITS);
        Ok(())
    }

    /// Sets the stream up: `decimation u16, count u32, n u8, source u8 × n`; `all` is the number of sources.
    fn set_up(&mut self, mut payload: &[u8], all: usize) -> Result<(), ErrorCode> {
        let decimation = u16::from_le_bytes(take(&mut payload)?);
        let count = u32::from_le_bytes(take(&mut payload)?);
        let [width] = take(&mut payload)?;
        let sources_exist = payload.iter().all(|source| usize::from(*source) < all);
        require(payload.len() == usize::from(width), ErrorCode::BadLength)?;
        require(self.port.is_none(), ErrorCode::Busy)?;
        require(decimation > 0 && width > 0 && sources_exist, ErrorCode::BadValue)?;
        (self.count, self.streamed) = (count, payload.into());
        self.packet = Packet { decimation, width, ..Packet::default() };
        Ok(())
    }

    /// Starts the stream to a port of the host.
    fn start(&mut self, port: u16) -> Result<(), ErrorCode> {
        require(self.port.is_none(), ErrorCode::Busy)?;
        require(port > 0 && !self.streamed.is_empty(), ErrorCode::BadValue)?;
        (self.port, self.samples, self.packet.sequence) = (Some(port), 0, 0);
        self.packet.values.clear();
        Ok(())
    }

    /// Takes the values of all sources at the present sample; returns a packet that is full, complete or old enough, and its port.
    fn record(&mut self, values: &[f64]) -> Option<(u16, Vec<u8>)> {
        let (port, packet) = (self.port?, &mut self.packet);
        let decimation = u64::from(packet.decimation);
        let (records, since) = (self.samples / decimation + 1, self.samples % decimation);
        if since == 0 {
            if packet.values.is_empty() {
                packet.first = self.ticks;
            }
            let read = |source: &u8| values[usize::from(*source)] as f32;
            packet.values.extend(self.streamed.iter().map(read));
        }
        self.samples += 1;
        let is_complete = records == self.count.into();
        let is_full = packet.values.len() + self.streamed.len() > MAX_VALUES;
        let is_due = f64::from(self.ticks.wrapping_sub(packet.first) + 2) > FLUSH * self.sample_rate;
        if packet.values.is_empty() || !(is_complete || is_full || is_due) {
            return None;
        }
        let bytes = packet.encode();
        packet.sequence = packet.sequence.wrapping_add(1);
        packet.values.clear();
        self.port.take_if(|_| is_complete);
        Some((port, bytes))
    }

    /// One sample: reads the sensors, drives the rig until the next sample, and returns a packet for a port of the host if one is complete.
    pub fn tick(&mut self) -> Result<Option<(u16, Vec<u8>)>, RigError> {
        let Sensors { response, reference } = self.rig.sense()?;
        let (step, phase) = (1.0 / self.sample_rate, self.phase);
        self.silence = self.silence.saturating_add(1);
        let watchdog = self.values(WATCHDOG)[0];
        if watchdog > 0.0 && f64::from(self.silence) * step > watchdog {
            self.values("arm")[0] = 0.0;
        }
        let [target, forcing] = ["target_coeffs", "forcing_coeffs"].map(|name| series(self.values(name), phase)[0]);
        // The output is zero unless armed, and never more than the limit.
        let (wanted, largest) = (target + forcing, self.values("rig_out_max")[0]);
        let is_quiet = !self.is_driven() || !wanted.is_finite();
        let out = if is_quiet { 0.0 } else { wanted.clamp(-largest, largest) };
        // Bits: 0 armed, 1 tripped (nothing trips here), 2 limited, 3 quiet.
        let (is_armed, is_limited) = (self.is_driven(), !is_quiet && out != wanted);
        let safety = u8::from(is_armed) | u8::from(is_limited) << 2 | u8::from(is_quiet) << 3;
        self.values("safety")[0] = safety.into();
        let (turns, epoch) = (f64::from(phase) / TURN, f64::from(self.epoch));
        let sensors = [Some(response), reference].into_iter().flatten();
        let sensors = sensors.map(|length| length / MILLI);
        let values: Vec<f64> = sensors.chain([target, forcing, 0.0, turns, out, epoch]).collect();
        let packet = self.record(&values);
        let displacement = out * MILLI;
        self.rig
            .advance(Drive { displacement, is_held: true, ..Drive::default() }, step)?;
        let turn = self.values("freq")[0] * step * TURN;
        self.phase = phase.wrapping_add(turn.round() as u32);
        self.ticks = self.ticks.wrapping_add(1);
        self.values("ticks")[0] = self.ticks.into();
        let impacts = self.rig.ground_truth()?.map_or(0, |inside| inside.impacts);
        self.values("impacts")[0] = impacts as f64;
        Ok(packet)
    }
}

/// Value of a Fourier series at a phase of its fundamental, and its upper bound.
fn series(coefficients: &[f64], phase: u32) -> [f64; 2] {
    let (cosines, sines) = coefficients[1..].split_at(HARMONICS);
    let (mut value, mut bound) = (coefficients[0], coefficients[0].abs());
    for (k, (a, b)) in (1..).zip(cosines.iter().zip(sines)) {
        if (*a, *b) != (0.0, 0.0) {
            let (sine, cosine) = (TAU * f64::from(phase.wrapping_mul(k)) / TURN).sin_cos();
            value += a * cosine + b * sine;
            bound += a.hypot(*b);
        }
    }
    [value, bound]
}

/// Port of the control channel; the stream has the next one.
pub const DEFAULT_PORT: u16 = 2350;

/// The connection to a host: what has arrived of its next request, and since when it is there.
struct Connection {
    control: TcpStream,
    peer: SocketAddr,
    request: Vec<u8>,
    opened: Instant,
}

impl Connection {
    /// Answers the requests that have arrived, until none is left or the host has sent bytes that are not a frame, or has left.
    fn exchange(&mut self, device: &mut Device, uptime: u32) -> io::Result<()> {
        loop {
            let request = Frame::read(&mut self.control, &mut self.request)?;
            self.control.write_all(&device.handle(&request, uptime).encode())?;
        }
    }
}

/// The sockets of a server: the control channel listens on `address` (TCP), and the stream is sent from the next port. With port 0 the
/// system chooses both ports.
pub fn listen(address: SocketAddr) -> io::Result<(TcpListener, UdpSocket)> {
    let control = TcpListener::bind(address)?;
    control.set_nonblocking(true)?;
    // A host on this machine may use the next port itself.
    let any_port = address.port() == 0 || is_loopback(address.ip());
    let port = if any_port { 0 } else { address.port().saturating_add(1) };
    let stream = UdpSocket::bind((address.ip(), port))?;
    stream.set_nonblocking(true)?;
    Ok((control, stream))
}

/// Serves `device`, sampled every `sample_time`, s, at the sockets of [`listen`] until `stop` returns true, one host at a time. `report`
/// receives the report when a host has left.
pub fn serve(
    (control, stream): (TcpListener, UdpSocket),
    mut device: Device,
    sample_time: f64,
    mut stop: impl FnMut() -> bool,
    mut report: impl FnMut(&Session),
) -> Result<(), ServerError> {
    let mut clock = RealTimeClock::start(sample_time);
    let mut host: Option<Connection> = None;
    let mut tick = 0;
    loop {
        let stopped = stop();
        if host.is_none()
            && let Ok((control, peer)) = control.accept()
        {
            control.set_nodelay(true)?;
            control.set_nonblocking(true)?;
            clock.forget();
            let (request, opened) = (Vec::new(), Instant::now());
            host = Some(Connection { control, peer, request, opened });
        }
        let uptime = clock.due(0).elapsed().as_millis() as u32;
        let failed = host.as_mut().and_then(|host| host.exchange(&mut device, uptime).err());
        let left = failed.is_some_and(|error| error.kind() != ErrorKind::WouldBlock);
        if let Some(Connection { peer, opened, .. }) = host.take_if(|_| left || stopped) {
            device.disconnect();
            let timing = clock.timing(0);
            report(&Session {
                peer,
                ended: if left { Ended::Farewell } else { Ended::Stopped },
                samples: timing.samples,
                sample_time,
                seconds: opened.elapsed().as_secs_f64(),
                timing: Some(timing),
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
            if let (Some((port, bytes)), Some(host)) = (device.tick()?, &host) {
                // A packet that cannot be sent now counts as lost in the network.
                let _ = stream.send_to(&bytes, (host.peer.ip(), port));
            }
        }
        thread::sleep(clock.due(tick + 1).saturating_duration_since(Instant::now()).min(POLL));
    }
}
