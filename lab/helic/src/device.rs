//! A rig as a device: its parameters, its stream, the requests of the host, and one sample after another.

use std::f64::consts::TAU;

use vines_testbench::rig::{Drive, Rig, RigError, Sensors};

use crate::codec::{
    COEFFICIENTS, ErrorCode, Frame, HARMONICS, MAX_PAYLOAD, Packet, VERSION, message, of_bytes, size, take, to_bytes,
};

/// Longest silence of the host, s, before the output is disarmed; 0: no limit.
pub(crate) const WATCHDOG: &str = "rig_watchdog";
/// Names, type and number of values of the parameters, in the order of version 3; then come those of the rig. A host may set those with an
/// asterisk. What has no value here belongs to the waveform table or to the statistics of the processor, and stays 0.
const PARAMETERS: &[(&str, u8, usize)] = &[
    ("firmware experiment", b'c', 16),
    ("sample_freq", b'f', 1),
    ("ticks loop_time_last loop_time_max clock_jitter overruns", b'I', 1),
    ("tick_timeouts records_dropped", b'I', 1),
    ("freq*", b'f', 1),
    ("target_coeffs* forcing_coeffs*", b'f', COEFFICIENTS),
    ("table", b'f', 4096),
    ("table_len", b'H', 1),
    ("table_freq table_gain", b'f', 1),
    ("table_interp table_mode* table_mult", b'I', 1),
    ("table_phase", b'f', 1),
    ("table_trigger wake_phase_min wake_phase_max t_measure_max", b'I', 1),
    ("t_actuate_max t_rest_max diag_reset* cmd_backlog_max", b'I', 1),
    ("arm* safety mcu_reboot", b'I', 1),
    ("rig_gain rig_out_max", b'f', 1),
    ("rig_watchdog*", b'f', 1),
    ("impacts", b'I', 1),
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

/// The stream: what the host has set up, and the packet that is being filled.
#[derive(Debug, Default)]
struct Stream {
    sources: Vec<u8>,
    decimation: u16,
    /// Records, or 0 for a stream without an end.
    count: u32,
    /// Port of the host while the stream runs.
    port: Option<u16>,
    /// Samples and records since the start.
    samples: u64,
    records: u32,
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
        match () {
            () if self.port.is_some() => return Err(ErrorCode::Busy),
            () if port == 0 || self.sources.is_empty() => return Err(ErrorCode::BadValue),
            () => {}
        }
        (self.port, self.samples, self.records) = (Some(port), 0, 0);
        let (decimation, width) = (self.decimation, self.sources.len() as u8);
        self.packet = Packet { decimation, width, ..Packet::default() };
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
        let is_complete = self.records == self.count;
        let is_full = packet.values.len() >= self.sources.len() * Packet::capacity(self.sources.len());
        let is_due = f64::from(index.wrapping_sub(packet.first) + 2) > flush;
        if packet.values.is_empty() || !(is_complete || is_full || is_due) {
            return None;
        }
        let bytes = packet.encode();
        packet.sequence = packet.sequence.wrapping_add(1);
        packet.values.clear();
        self.port.take_if(|_| is_complete);
        Some((port, bytes))
    }
}

/// A parameter. Its type is a letter as in Python's `struct`.
struct Parameter {
    name: &'static str,
    code: u8,
    is_writable: bool,
    values: Vec<f64>,
}

/// A device. Everything in it happens at a sample or between two of them, in the order of the calls.
pub struct Device {
    rig: Box<dyn Rig>,
    has_reference: bool,
    sample_rate: f64,
    parameters: Vec<Parameter>,
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
        let all = PARAMETERS.iter().flat_map(|&(names, code, count)| {
            names.split(' ').map(move |name| {
                let is_writable = name.ends_with('*');
                let name = name.trim_end_matches('*');
                Parameter { name, code, is_writable, values: vec![0.0; count] }
            })
        });
        let mut device = Self {
            has_reference: rig.sense()?.reference.is_some(),
            rig,
            sample_rate: 1.0 / sample_time,
            parameters: all.collect(),
            stream: Stream::default(),
            phase: 0,
            ticks: 0,
            commands: 0,
            epoch: 0,
            silence: 0,
        };
        for (name, text) in [
            ("firmware", concat!("vines ", env!("CARGO_PKG_VERSION"))),
            ("experiment", "vines"),
        ] {
            let letters = device.values(name).iter_mut().zip(text.bytes());
            letters.for_each(|(value, letter)| *value = letter.into());
        }
        device.values("sample_freq")[0] = device.sample_rate;
        device.values("rig_gain")[0] = GAIN;
        device.values("rig_out_max")[0] = max_amplitude / (GAIN * MILLI);
        Ok(device)
    }

    /// The values of a parameter of the table.
    fn values(&mut self, name: &str) -> &mut Vec<f64> {
        let parameter = self.parameters.iter_mut().find(|parameter| parameter.name == name);
        &mut parameter.expect("the parameter is in the table").values
    }

    /// The host has left: output and stream stop.
    pub fn disconnect(&mut self) {
        self.stream.port = None;
        self.values("arm")[0] = 0.0;
    }

    /// Whether the output may be other than zero.
    pub fn is_driven(&mut self) -> bool {
        self.values("arm")[0] == 1.0
    }

    fn sources(&self) -> impl Iterator<Item = (&'static str, &'static str)> {
        let has_reference = self.has_reference;
        let all = SOURCES.into_iter();
        all.filter(move |(name, _)| has_reference || *name != "reference")
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
                self.page(u16::from_le_bytes(start))
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
                let [low, high] = (self.parameters.len() as u16).to_le_bytes();
                let head = [VERSION, low, high, self.sources().count() as u8];
                let sample_rate = self.sample_rate as f32;
                Ok([head, sample_rate.to_le_bytes(), uptime.to_le_bytes()].concat())
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
        is_allowed.then_some(bytes).ok_or(ErrorCode::BadLength)
    }

    /// Sets a parameter: `index u16, values`.
    fn set(&mut self, payload: &[u8]) -> Result<(), ErrorCode> {
        let (index, bytes) = payload.split_first_chunk().ok_or(ErrorCode::BadLength)?;
        let (highest, largest) = (0.5 * self.sample_rate, self.values("rig_out_max")[0]);
        let parameter = self.parameters.get_mut(usize::from(u16::from_le_bytes(*index)));
        let parameter = parameter.ok_or(ErrorCode::BadIndex)?;
        if !parameter.is_writable {
            return Err(ErrorCode::ReadOnly);
        }
        if bytes.len() != parameter.values.len() * size(parameter.code) {
            return Err(ErrorCode::BadLength);
        }
        let values = of_bytes(parameter.code, bytes);
        let (is_command, is_allowed) = match parameter.name {
            "freq" => (true, (0.0..highest).contains(&values[0])),
            "target_coeffs" | "forcing_coeffs" => (true, amplitude(&values) <= largest),
            // There is no waveform table.
            "table_mode" => (true, values[0] == 0.0),
            "arm" => (false, values[0] <= 1.0),
            WATCHDOG => (false, values[0] >= 0.0 && values[0].is_finite()),
            _ => (false, true),
        };
        if !is_allowed {
            return Err(ErrorCode::BadValue);
        }
        parameter.values = values;
        self.commands += u32::from(is_command);
        Ok(())
    }

    /// One sample: reads the sensors, drives the rig until the next sample, and returns a packet for a port of the host if one is complete.
    pub fn tick(&mut self) -> Result<Option<(u16, Vec<u8>)>, RigError> {
        let Sensors { response, reference } = self.rig.sense()?;
        let (step, phase) = (1.0 / self.sample_rate, self.phase);
        self.epoch = (self.epoch + std::mem::take(&mut self.commands)) % EPOCH;
        self.silence = self.silence.saturating_add(1);
        let watchdog = self.values(WATCHDOG)[0];
        if watchdog > 0.0 && f64::from(self.silence) * step > watchdog {
            self.values("arm")[0] = 0.0;
        }
        let [target, forcing] = ["target_coeffs", "forcing_coeffs"].map(|name| value(self.values(name), phase));
        let out = self.gate(target + forcing);
        let (turns, epoch) = (f64::from(phase) / TURN, f64::from(self.epoch));
        let sensors = [Some(response), reference].into_iter().flatten();
        let sensors = sensors.map(|length| length / MILLI);
        let values: Vec<f64> = sensors.chain([target, forcing, 0.0, turns, out, epoch]).collect();
        let packet = self.stream.record(self.ticks, &values, FLUSH * self.sample_rate);
        let displacement = out * GAIN * MILLI;
        self.rig.hold(Drive { displacement, ..Drive::default() }, step)?;
        let turn = self.values("freq")[0] * step * TURN;
        self.phase = phase.wrapping_add(turn.round() as u32);
        self.ticks = self.ticks.wrapping_add(1);
        self.values("ticks")[0] = self.ticks.into();
        let impacts = self.rig.ground_truth()?.map_or(0, |inside| inside.impacts);
        self.values("impacts")[0] = impacts as f64;
        Ok(packet)
    }

    /// The output, V: zero unless armed, and never more than the limit.
    fn gate(&mut self, wanted: f64) -> f64 {
        let (is_armed, largest) = (self.is_driven(), self.values("rig_out_max")[0]);
        let is_quiet = !is_armed || !wanted.is_finite();
        let out = if is_quiet { 0.0 } else { wanted.clamp(-largest, largest) };
        let is_limited = !is_quiet && out != wanted;
        // Bits: 0 armed, 1 tripped (nothing trips here), 2 limited, 3 quiet.
        let safety = u8::from(is_armed) | u8::from(is_limited) << 2 | u8::from(is_quiet) << 3;
        self.values("safety")[0] = safety.into();
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
    let harmonics = (1..).zip(cosines.iter().zip(sines));
    let values = harmonics
        .filter(|(_, (a, b))| **a != 0.0 || **b != 0.0)
        .map(|(k, (a, b))| {
            let (sine, cosine) = (TAU * f64::from(phase.wrapping_mul(k)) / TURN).sin_cos();
            a * cosine + b * sine
        });
    coefficients[0] + values.sum::<f64>()
}
