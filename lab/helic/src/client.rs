//! The host: the parameters and sources of a device by name, and the device as a rig of the bench. The oscillator runs on the device; the
//! host sets frequency and amplitude, step by step.

use std::f64::consts::TAU;
use std::io;

use crate::codec::{
    COEFFICIENTS, ErrorCode, Frame, HARMONICS, Malformed, Packet, VERSION, message, take, take_text, to_bytes,
};
use crate::device::WATCHDOG;
use crate::network::Transport;
use vines_net::{Counters, Readings};
use vines_testbench::rig::{Drive, Rig, RigError, Sensors};
use vines_testbench::scene::Names;

/// Largest relative difference between the sample rates: the device states its own with 24 bits.
const SAME_RATE: f64 = 1e-6;
/// Largest relative difference between the commanded frequency and the present one of the device at which the drive begins: an error of the
/// phase that the next packet corrects.
const RUNNING: f64 = 0.01;
/// Interval at which the device is asked whether its output is on, as a share of the longest silence: a trip ends the run before the silence
/// of a device that has stopped would.
const CHECKED: f64 = 0.25;

impl From<Malformed> for RigError {
    fn from(_: Malformed) -> Self {
        failed("the helic device sent an answer that does not match the request: is it another version?")
    }
}

fn failed(message: impl Into<String>) -> RigError {
    RigError::Failed(message.into().into())
}

/// A device, seen from its host.
#[derive(Debug)]
struct Host<T> {
    transport: T,
    sequence: u8,
    /// Names and types.
    parameters: Vec<(String, u8)>,
    /// Names and units.
    sources: Vec<(String, String)>,
    /// Samples per second.
    sample_rate: f64,
}

impl<T: Transport> Host<T> {
    /// Reads what the device has.
    fn new(transport: T) -> Result<Self, RigError> {
        let (parameters, sources) = (Vec::new(), Vec::new());
        let mut host = Self {
            transport,
            sequence: 0,
            parameters,
            sources,
            sample_rate: 0.0,
        };
        let advice = "Status (is `vines rig --protocol helic` or the device running, with no other host?)";
        let answer = host.request(message::STATUS, Vec::new(), advice)?;
        let mut rest = &answer[..];
        let [version, low, high, _] = take(&mut rest)?;
        // The version first: everything after it may differ between versions.
        if version != VERSION {
            return Err(failed(format!(
                "the helic device has version {version} of the protocol, this program has version {VERSION}"
            )));
        }
        host.sample_rate = f32::from_le_bytes(take(&mut rest)?).into();
        let parameters = u16::from_le_bytes([low, high]);
        while host.parameters.len() < usize::from(parameters) {
            let start = host.parameters.len();
            let page = host.request(message::GET_PARAMS, (start as u16).to_le_bytes().into(), "GetParams")?;
            let mut rest = page.get(4..).ok_or(Malformed)?;
            while !rest.is_empty() {
                let name = take_text(&mut rest)?;
                let [code, _, _, _] = take(&mut rest)?;
                host.parameters.push((name, code));
            }
            if host.parameters.len() == start {
                return Err(Malformed.into());
            }
        }
        let answer = host.request(message::GET_SOURCES, Vec::new(), "GetSources")?;
        let mut rest = &answer[..];
        while !rest.is_empty() {
            host.sources.push((take_text(&mut rest)?, take_text(&mut rest)?));
        }
        Ok(host)
    }

    /// Sends a request and returns the payload of the answer; `what` names it in errors.
    fn request(&mut self, kind: u8, payload: Vec<u8>, what: &str) -> Result<Vec<u8>, RigError> {
        self.sequence = self.sequence.wrapping_add(1);
        let request = Frame { kind, sequence: self.sequence, payload };
        let answer = self.transport.request(&request).map_err(lost(what))?;
        match (answer.kind, &answer.payload[..]) {
            _ if answer.sequence != self.sequence => Err(Malformed.into()),
            (message::ERROR, &[code, cause]) if cause == kind => {
                let code = ErrorCode::of_number(code).ok_or(Malformed)?;
                Err(failed(format!("the helic device refuses {what}: {code:?}")))
            }
            (answered, _) if answered == kind => Ok(answer.payload),
            _ => Err(Malformed.into()),
        }
    }

    /// Index and type of a parameter, if the device has it.
    fn parameter(&self, name: &str) -> Option<(u16, u8)> {
        let mut all = (0..).zip(&self.parameters);
        all.find_map(|(index, (own, code))| (own == name).then_some((index, *code)))
    }

    /// Id of a source.
    fn source(&self, name: &str) -> Result<u8, RigError> {
        let index = self.sources.iter().position(|(own, _)| own == name);
        index.map(|index| index as u8).ok_or_else(|| {
            let all: Vec<_> = self.sources.iter().map(|(name, unit)| format!("{name} [{unit}]")).collect();
            failed(format!(
                "the helic device has no source \"{name}\"; it has: {}; [rig.names] of the scene maps response and base",
                all.join(", ")
            ))
        })
    }

    /// The request that sets a parameter.
    fn setting(&self, name: &str, values: &[f64]) -> Result<Frame, RigError> {
        let missing = || failed(format!("the helic device has no parameter \"{name}\""));
        let (index, code) = self.parameter(name).ok_or_else(missing)?;
        let payload = [&index.to_le_bytes()[..], &to_bytes(code, values)].concat();
        Ok(Frame { kind: message::SET_PAR, sequence: 0, payload })
    }

    /// Sets a parameter.
    fn set(&mut self, name: &str, values: &[f64]) -> Result<(), RigError> {
        let Frame { kind, payload, .. } = self.setting(name, values)?;
        self.request(kind, payload, name).map(drop)
    }

    /// Sets the stream up without an end, and starts it.
    fn stream(&mut self, sources: &[u8], decimation: u16) -> Result<(), RigError> {
        let [d, e] = decimation.to_le_bytes();
        let setup = [&[d, e, 0, 0, 0, 0, sources.len() as u8], sources].concat();
        let port = self.transport.port().map_err(lost("its stream"))?.to_le_bytes();
        for (kind, payload, what) in [
            (message::STREAM_STOP, Vec::new(), "StreamStop"),
            (message::STREAM_SETUP, setup, "StreamSetup"),
            (message::STREAM_START, port.into(), "StreamStart"),
        ] {
            self.request(kind, payload, what)?;
        }
        Ok(())
    }

    /// Checks that the output of the device is on, if it reports it.
    fn check_output(&mut self) -> Result<(), RigError> {
        let Some((index, _)) = self.parameter("safety") else {
            return Ok(());
        };
        let answer = self.request(message::GET_PAR, index.to_le_bytes().into(), "safety")?;
        match answer.first() {
            // Armed and not tripped; a device without a gate reads 0.
            Some(safety) if *safety != 0 && safety & 0b11 != 1 => Err(failed(format!(
                "the output of the helic device is off (safety = {safety}): it has tripped, or was disarmed; the drive is zero"
            ))),
            _ => Ok(()),
        }
    }
}

fn lost(what: &str) -> impl Fn(io::Error) -> RigError {
    move |error| {
        failed(format!(
            "the helic device, {what}: {error}; the drive is stopped as far as the device can still be reached"
        ))
    }
}

/// A device as a rig.
///
/// The device samples on its own clock, and its readings arrive in packets. A drive is sent when all readings that have arrived are used
/// up, so that there is one command per packet at most. A command takes effect at a sample that the host does not know; but the stream
/// contains the phase of the device's oscillator. The coefficients of the forcing turn it to the phase of the host's drive.
#[derive(Debug)]
pub struct HelicRig<T: Transport> {
    host: Host<T>,
    sample_time: f64,
    /// Sources of the stream: response, base displacement if a sensor reads it, and phase; m per unit of the first two.
    sources: Vec<u8>,
    factors: Vec<f64>,
    /// Base displacement per volt of the output, m.
    gain: f64,
    /// Samples of the device per sample of the scene.
    decimation: u16,
    is_streaming: bool,
    /// With the phase of the device's oscillator, turns.
    readings: Readings<f64>,
    now: Option<Sensors>,
    /// Number of the device's sample that the next packet begins with.
    next: Option<u32>,
    /// Lead of the host's drive over the device's oscillator at the last reading that arrived, turns.
    lead: Option<f64>,
    /// Phase of the device's oscillator at the present reading, unless it was lost, and its step since the reading before, turns.
    device_phase: Option<f64>,
    device_turn: Option<f64>,
    /// Time since the device was last asked whether its output is on, s.
    unchecked: f64,
    wanted: Drive,
    /// Frequency of the device, rad/s, and the cosine and sine of its forcing, V.
    omega: f64,
    parts: [f64; 2],
    /// Packets that have arrived, and samples that were reconstructed.
    pub counters: Counters,
}

impl<T: Transport> HelicRig<T> {
    /// Sets the device up. `names` are those of its sources, where they differ from the virtual device; `sample_time` in s.
    pub fn new(transport: T, names: &Names, sample_time: f64, samples_per_period: f64) -> Result<Self, RigError> {
        if let Some(name) = names.unknown(&["response", "base", "E"]) {
            return Err(failed(format!(
                "[rig.names] maps `{name}`; for a helic device there are response, base and E"
            )));
        }
        let mut host = Host::new(transport)?;
        let ratio = host.sample_rate * sample_time;
        if ratio < 0.5 || (ratio / ratio.round() - 1.0).abs() > SAME_RATE {
            return Err(failed(format!(
                "the helic device takes {} samples per second, which is not a multiple of the scene's {}: set \
                 controller.samples_per_period to {} (or that over an integer)",
                host.sample_rate,
                1.0 / sample_time,
                ratio * samples_per_period
            )));
        }
        // Of `vines rig --protocol helic`: mm, and mm per volt.
        let named = |ours: &str, name: &str| {
            let mapped = names.mapped(ours).map(|mapped| (mapped.name.clone(), mapped.factor));
            mapped.unwrap_or_else(|| (name.into(), 1e-3))
        };
        let sensors = [named("response", "response"), named("base", "reference")];
        let sensors = sensors.into_iter().filter(|(name, _)| !name.is_empty());
        let (mut sources, factors): (Vec<String>, Vec<f64>) = sensors.unzip();
        sources.push("phase".into());
        let sources = sources.iter().map(|name| host.source(name)).collect::<Result<_, _>>()?;
        host.set("arm", &[0.0])?;
        for series in ["target_coeffs", "forcing_coeffs"] {
            host.set(series, &[0.0; COEFFICIENTS])?;
        }
        let silence = host.transport.silence().as_secs_f64();
        for (name, value) in [
            ("table_mode", 0.0),
            ("control_mode", 0.0),
            ("freq", 0.0),
            (WATCHDOG, silence),
        ] {
            // Not every device has these.
            if host.parameter(name).is_some() {
                host.set(name, &[value])?;
            }
        }
        Ok(Self {
            host,
            sample_time,
            sources,
            factors,
            gain: named("E", "").1,
            decimation: ratio.round() as u16,
            is_streaming: false,
            readings: Readings::default(),
            now: None,
            next: None,
            lead: None,
            device_phase: None,
            device_turn: None,
            unchecked: 0.0,
            wanted: Drive::default(),
            omega: 0.0,
            parts: [0.0; 2],
            counters: Counters::default(),
        })
    }

    /// The connection to the device.
    pub fn transport(&mut self) -> &mut T {
        &mut self.host.transport
    }

    fn is_driven(&self) -> bool {
        self.parts != [0.0; 2]
    }

    fn reading(&mut self) -> Result<Sensors, RigError> {
        if let Some(now) = self.now {
            return Ok(now);
        }
        if !self.is_streaming {
            // Not earlier: readings that nobody takes only wait.
            self.host.stream(&self.sources, self.decimation)?;
            self.is_streaming = true;
        }
        let taken = loop {
            match self.readings.take(&mut self.counters) {
                Some(taken) => break taken,
                None => {
                    self.command()?;
                    self.receive()?;
                }
            }
        };
        if let Some(phase) = taken.with {
            self.device_turn = self.device_phase.map(|before| (phase - before).rem_euclid(1.0));
            self.lead = Some(self.readings.phase() - phase);
        }
        self.device_phase = taken.with;
        self.unchecked += self.sample_time;
        if self.is_driven() && self.unchecked > CHECKED * self.host.transport.silence().as_secs_f64() {
            self.unchecked = 0.0;
            self.host.check_output()?;
        }
        self.now = Some(taken.sensors);
        Ok(taken.sensors)
    }

    /// Waits for the next packet.
    fn receive(&mut self) -> Result<(), RigError> {
        let bytes = self.host.transport.datagram().map_err(lost("its stream"))?;
        let Ok(packet) = Packet::decode(&bytes) else {
            self.counters.malformed += 1;
            return Ok(());
        };
        let width = self.sources.len();
        if usize::from(packet.width) != width || packet.decimation != self.decimation {
            self.counters.foreign += 1;
            return Ok(());
        }
        let step = u32::from(packet.decimation);
        let missed = self.next.map_or(0, |next| packet.first.wrapping_sub(next) / step);
        // A difference in the upper half is negative: a packet that was overtaken, or came twice.
        if missed > u32::MAX / step / 2 {
            self.counters.late += 1;
            return Ok(());
        }
        let seconds = f64::from(missed) * self.sample_time;
        let allowed = self.host.transport.silence().as_secs_f64();
        if seconds > allowed {
            return Err(failed(format!(
                "{missed} samples of the helic device did not arrive, {seconds:.3} s; up to {allowed} s are bridged. Check the network and \
                 the load of this machine"
            )));
        }
        self.counters.received += 1;
        let first = self.readings.next() + u64::from(missed);
        for (number, record) in (first..).zip(packet.values.chunks_exact(width)) {
            let read = |n: usize| Some(self.factors.get(n)? * f64::from(record[n]));
            let sensors = Sensors { response: read(0).unwrap_or_default(), reference: read(1) };
            let phase = record[width - 1].into();
            self.readings.arrive(number, sensors, phase, &mut self.counters);
        }
        let records = (packet.values.len() / width) as u32;
        self.next = Some(packet.first.wrapping_add(records * step));
        Ok(())
    }

    /// Sends the drive, as far as it has changed.
    fn command(&mut self) -> Result<(), RigError> {
        if self.wanted.omega != self.omega {
            self.host.set("freq", &[self.wanted.omega / TAU])?;
            self.omega = self.wanted.omega;
        }
        let turn = self.omega * self.sample_time / TAU;
        let runs = self.device_turn.is_some_and(|now| (now - turn).abs() <= RUNNING * turn);
        let volts = self.wanted.amplitude / self.gain;
        let parts = match self.lead {
            // The drive begins when the oscillator has its frequency.
            Some(lead) if self.is_driven() || runs => {
                let (sine, cosine) = (TAU * lead).sin_cos();
                [volts * sine, volts * cosine].map(|part| f64::from(part as f32))
            }
            _ => [0.0; 2],
        };
        if parts == self.parts {
            return Ok(());
        }
        let was_driven = self.is_driven();
        let mut forcing = [0.0; COEFFICIENTS];
        if !was_driven {
            let stop = [
                self.host.setting("forcing_coeffs", &forcing)?,
                self.host.setting("arm", &[0.0])?,
            ];
            self.host.transport.guard(&stop).map_err(lost("arm"))?;
        }
        (forcing[1], forcing[1 + HARMONICS]) = (parts[0], parts[1]);
        self.host.set("forcing_coeffs", &forcing)?;
        self.parts = parts;
        if !was_driven {
            self.host.set("arm", &[1.0])?;
            self.unchecked = 0.0;
        } else if !self.is_driven() {
            self.host.check_output()?;
            self.host.set("arm", &[0.0])?;
            self.host.transport.guard(&[]).map_err(lost("arm"))?;
        }
        Ok(())
    }

    /// After an error the device is not driven any more.
    fn checked<V>(&mut self, outcome: Result<V, RigError>) -> Result<V, RigError> {
        outcome.inspect_err(|_| self.host.transport.close())
    }

    fn stop(&mut self) -> Result<(), RigError> {
        if self.is_driven() {
            self.host.set("forcing_coeffs", &[0.0; COEFFICIENTS])?;
        }
        self.host.set("arm", &[0.0])?;
        self.host.request(message::STREAM_STOP, Vec::new(), "StreamStop")?;
        Ok(())
    }
}

impl<T: Transport> Rig for HelicRig<T> {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        let reading = self.reading();
        self.checked(reading)
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        self.wanted = drive;
        self.now = None;
        self.readings.advance(drive.omega * step / TAU);
        if drive.amplitude == 0.0 && self.is_driven() {
            // A drive of zero is not delayed.
            let sent = self.command();
            return self.checked(sent);
        }
        Ok(())
    }
}

impl<T: Transport> Drop for HelicRig<T> {
    fn drop(&mut self) {
        if self.stop().is_err() {
            self.host.transport.close();
        }
        if self.counters.is_troubled() {
            log::warn!("helic device: {}", self.counters);
        }
    }
}
