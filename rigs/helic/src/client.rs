//! The host: its connection to a device, the parameters and sources of the device by name, and the device as a rig of the bench. The
//! oscillator runs on the device; the host sets frequency and amplitude, step by step.

use std::collections::HashMap;
use std::error::Error;
use std::f64::consts::TAU;
use std::io::{self, ErrorKind, Write};
use std::net::{Shutdown, SocketAddr, TcpStream, UdpSocket};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::thread;
use std::time::{Duration, Instant};

use vines_net::{CONNECT, Counters, Reading, Readings, is_loopback};
use vines_rig::Names;
use vines_rig::{Drive, Rig, RigError, Sensors};

use crate::codec::{ErrorCode, Frame, HARMONICS, Packet, VERSION, message, size, take, take_text, to_bytes};
use crate::device::WATCHDOG;

/// Longest silence of a driven device, and of a host that drives it. The drive stops within 0.2 s, with 50 ms for the network.
pub const LONGEST_SILENCE: Duration = Duration::from_millis(150);

/// The connection to a device.
pub trait Transport {
    /// Sends a request and returns the answer.
    fn request(&mut self, request: &Frame) -> io::Result<Frame>;

    /// The next datagram of the stream.
    fn datagram(&mut self) -> io::Result<Vec<u8>>;

    /// The port on which the datagrams arrive, and the longest silence of either side while the device is driven. A transport without ports
    /// has any.
    fn stream(&self) -> (u16, Duration) {
        (1, LONGEST_SILENCE)
    }

    /// The host is alive. While it drives the device, it says so at every packet, with the requests `stop`: after a longer silence the
    /// transport sends them, which stops the drive, and closes the control channel. A transport without a clock does nothing.
    fn guard(&mut self, _stop: &[Frame]) {}
}

/// A device on the network.
#[derive(Debug)]
pub struct Network {
    control: TcpStream,
    /// What has arrived of the next answer.
    answer: Vec<u8>,
    stream: UdpSocket,
    silence: Duration,
    /// Gets the requests that stop the drive at every sign of life, as bytes; none if there is no drive.
    watchdog: Sender<Vec<u8>>,
    /// Time of the last sign of life of a host that drives.
    alive: Option<Instant>,
}

impl Network {
    /// Connects to the control channel at `peer`, and sends the device's stream port the datagram that opens firewalls. The drive stops after
    /// a silence of either side that is longer than `silence`; [`LONGEST_SILENCE`] fits a device that sends a packet every 5 ms.
    pub fn connect(peer: SocketAddr, silence: Duration) -> io::Result<Self> {
        let control = TcpStream::connect_timeout(&peer, CONNECT)?;
        control.set_nodelay(true)?;
        // While the device is driven, the watchdog ends the waiting earlier.
        control.set_read_timeout(Some(CONNECT))?;
        let stream = UdpSocket::bind((control.local_addr()?.ip(), 0))?;
        stream.set_read_timeout(Some(silence))?;
        if !is_loopback(peer.ip()) {
            stream.send_to(b"vines", (peer.ip(), peer.port().saturating_add(1)))?;
        }
        let ((watchdog, signs), channel) = (mpsc::channel(), control.try_clone()?);
        thread::Builder::new().spawn(move || watch(&signs, channel, silence))?;
        let (answer, alive) = (Vec::new(), None);
        Ok(Self { control, answer, stream, silence, watchdog, alive })
    }

    /// Calls what waits for the device; its errors say for how long.
    fn waiting<T>(&mut self, what: &str, call: impl FnOnce(&mut Self) -> io::Result<T>) -> io::Result<T> {
        let began = Instant::now();
        call(self).map_err(|error| {
            let (waited, silence) = (began.elapsed().as_secs_f64(), self.silence.as_secs_f64());
            io::Error::other(match error.kind() {
                // Who was too slow, the device or this program, says the time.
                _ if self.alive.is_some_and(|alive| alive.elapsed() >= self.silence) => format!(
                    "{what} for {waited:.2} s; this program took no reading for {silence} s, so the drive was stopped and the connection \
                     closed. Is the machine too busy?"
                ),
                ErrorKind::WouldBlock | ErrorKind::TimedOut => format!("{what} for {waited:.2} s"),
                ErrorKind::UnexpectedEof => "the connection is closed".into(),
                _ => error.to_string(),
            })
        })
    }
}

impl Transport for Network {
    fn request(&mut self, request: &Frame) -> io::Result<Frame> {
        self.waiting("no answer", |network| {
            network.control.write_all(&request.encode())?;
            Frame::read(&mut network.control, &mut network.answer)
        })
    }

    fn datagram(&mut self) -> io::Result<Vec<u8>> {
        self.waiting("no packet of its stream has arrived", |network| {
            let mut bytes = [0; 2048];
            loop {
                match network.stream.recv(&mut bytes) {
                    // A signal: whoever catches it decides what it means.
                    Err(error) if error.kind() == ErrorKind::Interrupted => {}
                    size => return Ok(bytes[..size?].into()),
                }
            }
        })
    }

    fn stream(&self) -> (u16, Duration) {
        (self.stream.local_addr().map_or(0, |own| own.port()), self.silence)
    }

    fn guard(&mut self, stop: &[Frame]) {
        // Before the watchdog's clock starts: when it closes the connection, this time is past for certain.
        let now = Instant::now();
        // This fails after the watchdog has closed the connection.
        let sent = self.watchdog.send(stop.iter().flat_map(Frame::encode).collect());
        if sent.is_ok() {
            self.alive = (!stop.is_empty()).then_some(now);
        }
    }
}

/// Stops the drive when the host takes no reading for longer than `silence`, whether it waits for an answer, for a disk or for a terminal:
/// sends the newest requests of `signs` without waiting for their answers, and closes the control channel. Ends with the connection.
fn watch(signs: &Receiver<Vec<u8>>, mut control: TcpStream, silence: Duration) {
    let mut stop = Vec::new();
    loop {
        let patience = if stop.is_empty() { Duration::MAX } else { silence };
        match signs.recv_timeout(patience) {
            Ok(requests) => stop = requests,
            Err(RecvTimeoutError::Timeout) => break,
            Err(RecvTimeoutError::Disconnected) => return,
        }
    }
    // What cannot be sent does not arrive; the end of the connection may.
    let _ = control.write_all(&stop);
    let _ = control.shutdown(Shutdown::Both);
}

/// Largest relative difference between the sample rates: the device states its own with 24 bits.
const SAME_RATE: f64 = 1e-6;
/// Largest relative difference between the commanded frequency and the present one of the device at which the drive begins: an error of the
/// phase that the next packet corrects.
const RUNNING: f64 = 0.01;
/// Interval at which the device is asked whether its output is on, as a share of the longest silence: a trip ends the run before the silence
/// of a device that has stopped would.
const CHECKED: f64 = 0.25;

type Cause = Box<dyn Error + Send + Sync>;

fn lost(what: &str) -> impl Fn(io::Error) -> String {
    move |error| {
        format!("the helic device, {what}: {error}; the drive is stopped as far as the device can still be reached")
    }
}

/// A device as a rig.
///
/// The device samples on its own clock, and its readings arrive in packets. A drive is sent when all readings that have arrived are used
/// up, so that there is one command per packet. A command takes effect at a sample that the host does not know; but the stream
/// contains the phase of the device's oscillator. The coefficients of the forcing turn it to the phase of the host's drive.
#[derive(Debug)]
pub struct HelicRig<T: Transport> {
    /// The connection to the device.
    pub transport: T,
    /// Number of the last request.
    sequence: u8,
    /// Index, type and number of values of the parameters by name.
    parameters: HashMap<String, (u16, u8, u16)>,
    /// The requests that stop the drive and the stream.
    stop: Vec<Frame>,
    sample_time: f64,
    /// Sources of the stream: response, base displacement if a sensor reads it, and phase; m per unit of the first two.
    sources: Vec<u8>,
    factors: Vec<f64>,
    /// Base displacement per volt of the output, m.
    gain: f64,
    /// Samples of the device per sample of the scene.
    decimation: u16,
    readings: Readings,
    /// Number of the device's sample that the first packet began with.
    origin: Option<u32>,
    is_streaming: bool,
    /// At the last reading that has arrived: phase of the device's oscillator, its step since the reading before, NaN after a gap, and
    /// phase of the host's drive, turns.
    device_phase: f64,
    device_turn: f64,
    phase: f64,
    wanted: Drive,
    /// Number of readings since the drive began, or the device was last asked whether its output is on; 0 if there is no drive.
    driven: u32,
    /// Packets that have arrived, and samples that were reconstructed.
    pub counters: Counters,
}

impl<T: Transport> HelicRig<T> {
    /// Sets the device up. `names` are those of its sources, where they differ from the virtual device; `sample_time` in s.
    pub fn new(transport: T, names: &Names, sample_time: f64, samples_per_period: f64) -> Result<Self, RigError> {
        let mut rig = Self {
            transport,
            sequence: 0,
            parameters: HashMap::new(),
            stop: Vec::new(),
            sample_time,
            sources: Vec::new(),
            factors: Vec::new(),
            gain: 1.0,
            decimation: 1,
            readings: Readings::default(),
            origin: None,
            is_streaming: false,
            device_phase: f64::NAN,
            device_turn: f64::NAN,
            phase: 0.0,
            wanted: Drive::default(),
            driven: 0,
            counters: Counters::default(),
        };
        rig.set_up(names, samples_per_period)?;
        Ok(rig)
    }

    /// Reads what the device has, and stops its drive.
    fn set_up(&mut self, names: &Names, samples_per_period: f64) -> Result<(), Cause> {
        if let Some(name) = names.unknown(&["response", "base", "E"]) {
            return Err(format!("[rig.names] maps `{name}`; for a helic device there are response, base and E").into());
        }
        let advice = "Status (is the device running, with no other host?)";
        let status = self.request(Frame::new(message::STATUS, []), advice)?;
        let mut rest = &status[..];
        let [version, low, high, _] = take(&mut rest)?;
        // The version first: everything after it may differ between versions.
        if version != VERSION {
            let text = format!("has version {version} of the protocol, this program has version {VERSION}");
            return Err(format!("the helic device {text}").into());
        }
        let rate = f64::from(f32::from_le_bytes(take(&mut rest)?));
        let ratio = rate * self.sample_time;
        if ratio < 0.5 || (ratio / ratio.round() - 1.0).abs() > SAME_RATE {
            let (scene, samples) = (1.0 / self.sample_time, ratio * samples_per_period);
            let text = format!(
                "the helic device takes {rate} samples per second, which is not a multiple of the scene's {scene}: set \
                 controller.samples_per_period to {samples} (or that over an integer)"
            );
            return Err(text.into());
        }
        self.decimation = ratio.round() as u16;
        let mut page;
        let mut rest = &[][..];
        for index in 0..u16::from_le_bytes([low, high]) {
            if rest.is_empty() {
                page = self.request(Frame::new(message::GET_PARAMS, index.to_le_bytes()), "GetParams")?;
                rest = page.get(4..).ok_or(ErrorCode::BadLength)?;
            }
            let name = take_text(&mut rest)?;
            let [code, low, high, _] = take(&mut rest)?;
            self.parameters
                .insert(name, (index, code, u16::from_le_bytes([low, high])));
        }
        let answer = self.request(Frame::new(message::GET_SOURCES, []), "GetSources")?;
        let answer = String::from_utf8_lossy(&answer);
        let sources: Vec<&str> = answer.split_terminator('\0').collect();
        let sources = sources.chunks_exact(2);
        for ours in ["response", "base", "phase"] {
            // Of `vines rig --protocol helic`: mm, and mm per volt.
            let (own, mapped) = (ours.replace("base", "reference"), names.mapped(ours));
            let (name, factor) = mapped.map_or((&own, 1e-3), |mapped| (&mapped.name, mapped.factor));
            if !name.is_empty() {
                let index = sources.clone().position(|entry| entry[0] == name).ok_or_else(|| {
                    let all: Vec<String> = sources.clone().map(|entry| entry.join(" [") + "]").collect();
                    let (all, maps) = (all.join(", "), "[rig.names] of the scene maps response and base");
                    format!("the helic device has no source \"{name}\"; it has: {all}; {maps}")
                })?;
                self.sources.push(index as u8);
                self.factors.push(factor);
            }
        }
        self.gain = names.mapped("E").map_or(1e-3, |voltage| voltage.factor);
        let silence = self.transport.stream().1.as_secs_f64();
        let zero = "arm target_coeffs forcing_coeffs table_mode control_mode freq".split(' ');
        for (name, value) in zero.map(|name| (name, 0.0)).chain([(WATCHDOG, silence)]) {
            // Not every device has all of these.
            if self.parameters.contains_key(name) {
                self.set(name, &[value])?;
            }
        }
        let stop = [self.setting("forcing_coeffs", &[])?, self.setting("arm", &[])?];
        self.stop = [&stop[..], &[Frame::new(message::STREAM_STOP, [])]].concat();
        Ok(())
    }

    /// Sends a request and returns the payload of the answer; `what` names it in errors.
    fn request(&mut self, request: Frame, what: &str) -> Result<Vec<u8>, Cause> {
        self.sequence = self.sequence.wrapping_add(1);
        let request = Frame { sequence: self.sequence, ..request };
        let answer = self.transport.request(&request).map_err(lost(what))?;
        match (answer.kind, &answer.payload[..]) {
            _ if answer.sequence != request.sequence => Err(ErrorCode::BadFrame.into()),
            (kind, _) if kind == request.kind => Ok(answer.payload),
            (message::ERROR, &[code, cause]) if cause == request.kind => {
                let code = ErrorCode::of_number(code).ok_or(ErrorCode::BadFrame)?;
                Err(format!("the helic device refuses {what}: {code:?}").into())
            }
            _ => Err(ErrorCode::BadFrame.into()),
        }
    }

    /// The request that sets a parameter; values that are not given are zero.
    fn setting(&self, name: &str, values: &[f64]) -> Result<Frame, Cause> {
        let missing = || format!("the helic device has no parameter \"{name}\"");
        let (index, code, count) = self.parameters.get(name).ok_or_else(missing)?;
        let mut payload = [&index.to_le_bytes()[..], &to_bytes(*code, values)].concat();
        payload.resize(2 + usize::from(*count) * size(*code), 0);
        Ok(Frame::new(message::SET_PAR, payload))
    }

    /// Sets a parameter.
    fn set(&mut self, name: &str, values: &[f64]) -> Result<(), Cause> {
        self.request(self.setting(name, values)?, name).map(drop)
    }

    /// Checks that the output of the device is on, if it reports it.
    fn check_output(&mut self) -> Result<(), Cause> {
        let Some((index, ..)) = self.parameters.get("safety") else {
            return Ok(());
        };
        let answer = self.request(Frame::new(message::GET_PAR, index.to_le_bytes()), "safety")?;
        let safety = answer.first().copied().unwrap_or_default();
        // Armed and not tripped; a device without a gate reads 0.
        if safety == 0 || safety & 0b11 == 1 {
            return Ok(());
        }
        let reason = "it has tripped, or was disarmed; the drive is zero";
        Err(format!("the output of the helic device is off (safety = {safety}): {reason}").into())
    }

    /// Waits for the next packet.
    fn receive(&mut self) -> Result<(), Cause> {
        let allowed = self.transport.stream().1.as_secs_f64();
        let bytes = self.transport.datagram().map_err(lost("its stream"))?;
        let (width, step, next) = (self.sources.len(), u32::from(self.decimation), self.readings.next());
        let is_ours = |packet: &Packet| usize::from(packet.width) == width && packet.decimation == self.decimation;
        let Some(packet) = Packet::decode(&bytes).ok().filter(is_ours) else {
            self.counters.malformed += 1;
            return Ok(());
        };
        let origin = *self.origin.get_or_insert(packet.first);
        let expected = origin.wrapping_add(step.wrapping_mul(next as u32));
        let missed = packet.first.wrapping_sub(expected) as i32 / self.decimation as i32;
        if missed < 0 {
            // Overtaken by a later one, or here for the second time.
            self.counters.late += 1;
            return Ok(());
        }
        let seconds = f64::from(missed) * self.sample_time;
        if seconds > allowed {
            let text = format!("did not arrive, {seconds:.3} s; up to {allowed} s are bridged");
            return Err(format!("{missed} samples of the helic device {text}").into());
        }
        self.counters.received += 1;
        for (number, record) in (next + missed as u64..).zip(packet.values.chunks_exact(width)) {
            let read = |n: usize| self.factors[n] * f64::from(record[n]);
            let (reference, phase) = ((width > 2).then(|| read(1)), f64::from(record[width - 1]));
            let sensors = Sensors { response: read(0), reference };
            let reading = Reading { sensors, ground_truth: None };
            let lost = self.readings.arrive(number, reading, &mut self.counters);
            let turn = (phase - self.device_phase).rem_euclid(1.0);
            (self.device_phase, self.device_turn) = (phase, if lost == 0 { turn } else { f64::NAN });
            self.driven += u32::from(self.driven > 0);
        }
        Ok(())
    }

    /// Sends the drive.
    fn command(&mut self) -> Result<(), Cause> {
        let Drive { omega, amplitude, .. } = self.wanted;
        let (turn, was_driven) = (omega * self.sample_time / TAU, self.driven > 0);
        // The drive begins when the oscillator has its frequency.
        let runs = was_driven || (self.device_turn - turn).abs() <= RUNNING * turn;
        let drives = runs && amplitude != 0.0;
        if was_driven || drives {
            self.transport.guard(&self.stop);
        }
        self.set("freq", &[omega / TAU])?;
        let unchecked = f64::from(self.driven) * self.sample_time;
        if unchecked > CHECKED * self.transport.stream().1.as_secs_f64() || (was_driven && !drives) {
            self.driven = 1;
            self.check_output()?;
        }
        if was_driven || drives {
            let (volts, lead) = (amplitude / self.gain, self.phase - self.device_phase);
            let mut forcing = [0.0; 2 + HARMONICS];
            (forcing[1], forcing[1 + HARMONICS]) = (volts * (TAU * lead).sin(), volts * (TAU * lead).cos());
            self.set("forcing_coeffs", &forcing)?;
        }
        if was_driven != drives {
            self.set("arm", &[f64::from(u8::from(drives))])?;
            self.driven = drives.into();
        }
        if !drives {
            self.transport.guard(&[]);
        }
        Ok(())
    }
}

impl<T: Transport> Rig for HelicRig<T> {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        if !self.is_streaming {
            // Not earlier: readings that nobody takes only wait.
            let ([d, e], count) = (self.decimation.to_le_bytes(), self.sources.len() as u8);
            let setup = [&[d, e, 0, 0, 0, 0, count], &self.sources[..]].concat();
            self.request(Frame::new(message::STREAM_SETUP, setup), "StreamSetup")?;
            let (port, _) = self.transport.stream();
            self.request(Frame::new(message::STREAM_START, port.to_le_bytes()), "StreamStart")?;
            self.is_streaming = true;
        }
        loop {
            if let Some(taken) = self.readings.take(&mut self.counters) {
                return Ok(taken.sensors);
            }
            self.command()?;
            self.receive()?;
        }
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        if drive.is_held {
            return Err(RigError::NoHold);
        }
        self.wanted = drive;
        self.phase = self.readings.phase();
        self.readings.advance(drive.omega * step / TAU);
        // A drive of zero is not delayed.
        if drive.amplitude == 0.0 && self.driven > 0 {
            self.command()?;
        }
        Ok(())
    }
}

impl<T: Transport> Drop for HelicRig<T> {
    fn drop(&mut self) {
        // If a request fails, the end of the connection stops the drive.
        let mut requests = std::mem::take(&mut self.stop).into_iter();
        let _ = requests.try_for_each(|stop| self.request(stop, "the end").map(drop));
        if self.counters.is_troubled() {
            log::warn!("helic device: {}", self.counters);
        }
    }
}
