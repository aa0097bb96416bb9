//! The host's side of the control channel: what a device has, and its values by name.

use std::io;

use thiserror::Error;

use super::codec::{ErrorCode, Frame, Malformed, Packet, Status, VERSION, message, text};
use super::registry::{COEFFICIENTS, HARMONICS};
use super::transport::Transport;
use vines_testbench::rig::RigError;

/// Forcing with which the phase of the oscillator is read while the output is off, V.
const PROBE: f64 = 0.01;

/// Why a device cannot be used.
#[derive(Debug, Error)]
#[expect(missing_docs, reason = "the messages explain the variants")]
pub enum HostError {
    #[error("the helic device: {0}; is `vines rig --protocol helic` or the device running, with no other host?")]
    System(#[from] io::Error),
    #[error("the helic device sent an answer that does not match the request: is it another version?")]
    Malformed(#[from] Malformed),
    #[error("the helic device has version {0} of the protocol, this program has version {VERSION}")]
    Version(u8),
    #[error("the helic device refuses {what}: {code}")]
    Refused { what: String, code: ErrorCode },
    #[error("the helic device has no {what} \"{name}\"; it has: {known}; [rig.names] of the scene maps names")]
    Missing {
        what: &'static str,
        name: String,
        known: String,
    },
    #[error(
        "the helic device takes {device} samples per second, which is not a multiple of the scene's {scene}: set \
         controller.samples_per_period to {suggestion} (or that over an integer)"
    )]
    Rate { device: f64, scene: f64, suggestion: f64 },
    #[error("the output of the helic device is off (safety = {0}): it has tripped, or was disarmed; the drive is zero")]
    Tripped(u32),
}

impl From<HostError> for RigError {
    fn from(error: HostError) -> Self {
        Self::Failed(error.into())
    }
}

/// A device, seen from its host.
#[derive(Debug)]
pub struct Host<T> {
    /// The way to it.
    pub transport: T,
    sequence: u8,
    parameters: Vec<(String, u8)>,
    /// Names and units of its sources.
    pub sources: Vec<(String, String)>,
    /// Samples per second.
    pub sample_rate: f64,
}

impl<T: Transport> Host<T> {
    /// Reads what the device has.
    pub fn new(transport: T) -> Result<Self, HostError> {
        let (parameters, sources) = (Vec::new(), Vec::new());
        let mut host = Self {
            transport,
            sequence: 0,
            parameters,
            sources,
            sample_rate: 0.0,
        };
        let answer = host.request(message::STATUS, Vec::new(), "Status")?;
        if let Some(version) = answer.first().filter(|version| **version != VERSION) {
            return Err(HostError::Version(*version));
        }
        let status = Status::decode(&answer)?;
        host.sample_rate = status.sample_rate.into();
        while host.parameters.len() < usize::from(status.parameters) {
            let start = (host.parameters.len() as u16).to_le_bytes();
            let page = host.request(message::GET_PARAMS, start.into(), "GetParams")?;
            let (echo, definitions) = page.split_first_chunk::<4>().ok_or(Malformed)?;
            let more = definitions_of(definitions)?;
            let next = usize::from(u16::from_le_bytes([echo[2], echo[3]]));
            if echo[..2] != start || more.is_empty() || next != host.parameters.len() + more.len() {
                return Err(Malformed.into());
            }
            host.parameters.extend(more);
        }
        let answer = host.request(message::GET_SOURCES, Vec::new(), "GetSources")?;
        let mut rest = &answer[..];
        while !rest.is_empty() {
            let (name, after) = text(rest)?;
            let (unit, after) = text(after)?;
            host.sources.push((name, unit));
            rest = after;
        }
        let complete = host.sources.len() == usize::from(status.sources);
        complete.then_some(host).ok_or_else(|| Malformed.into())
    }

    /// Sends a request and returns the payload of the answer; `what` names it in errors.
    pub fn request(&mut self, kind: u8, payload: Vec<u8>, what: &str) -> Result<Vec<u8>, HostError> {
        self.sequence = self.sequence.wrapping_add(1);
        let request = Frame { kind, sequence: self.sequence, payload };
        let Frame { kind: answered, sequence, payload } = self.transport.request(&request)?;
        if sequence != self.sequence {
            return Err(Malformed.into());
        }
        if let (message::ERROR, &[code, cause]) = (answered, &payload[..]) {
            let code = ErrorCode::of_number(code).filter(|_| cause == kind).ok_or(Malformed)?;
            return Err(HostError::Refused { what: what.into(), code });
        }
        if answered == kind {
            Ok(payload)
        } else {
            Err(Malformed.into())
        }
    }

    fn index(&self, name: &str) -> Result<(u16, u8), HostError> {
        let found = self.parameters.iter().position(|(known, _)| known == name);
        let known = || self.parameters.iter().map(|(name, _)| name.clone());
        let index = found.ok_or_else(|| missing("parameter", name, known()))?;
        Ok((index as u16, self.parameters[index].1))
    }

    /// Id of a source.
    pub fn source(&self, name: &str) -> Result<u8, HostError> {
        let found = self.sources.iter().position(|(known, _)| known == name);
        let known = || self.sources.iter().map(|(name, unit)| format!("{name} [{unit}]"));
        let index = found.ok_or_else(|| missing("source", name, known()))?;
        Ok(index as u8)
    }

    /// Sets a parameter. Real numbers become floats.
    pub fn set(&mut self, name: &str, values: &[f64]) -> Result<(), HostError> {
        let (index, code) = self.index(name)?;
        let mut payload = index.to_le_bytes().to_vec();
        for value in values {
            match code {
                b'f' => payload.extend((*value as f32).to_le_bytes()),
                b'H' | b'h' => payload.extend((*value as i32 as u16).to_le_bytes()),
                b'B' | b'b' => payload.push(*value as i32 as u8),
                _ => payload.extend((*value as i64 as u32).to_le_bytes()),
            }
        }
        self.request(message::SET_PAR, payload, &format!("{name} = {values:?}"))?;
        Ok(())
    }

    /// The bytes of a parameter.
    pub fn get(&mut self, name: &str) -> Result<Vec<u8>, HostError> {
        let (index, _) = self.index(name)?;
        self.request(message::GET_PAR, index.to_le_bytes().into(), name)
    }

    /// Sets the stream up, and starts it.
    pub fn stream(&mut self, sources: &[u8], decimation: u16, count: u32) -> Result<(), HostError> {
        self.request(message::STREAM_STOP, Vec::new(), "StreamStop")?;
        let setup = [
            &decimation.to_le_bytes()[..],
            &count.to_le_bytes(),
            &[sources.len() as u8],
            sources,
        ]
        .concat();
        self.request(message::STREAM_SETUP, setup, "StreamSetup")?;
        let port = self.transport.port()?.to_le_bytes();
        self.request(message::STREAM_START, port.into(), "StreamStart")?;
        Ok(())
    }

    fn value(&mut self, source: u8) -> Result<f64, HostError> {
        self.stream(&[source], 1, 1)?;
        loop {
            match Packet::decode(&self.transport.datagram()?) {
                Ok(Packet { width: 1, values, .. }) if values.len() == 1 => return Ok(values[0].into()),
                _ => {}
            }
        }
    }

    /// Stops the master oscillator, and returns its cosine and sine: its phase is a state of the device that no parameter sets. The output
    /// must be off.
    pub fn stop_oscillator(&mut self) -> Result<[f64; 2], HostError> {
        let forcing = self.source("forcing")?;
        self.set("freq", &[0.0])?;
        let mut parts = [0.0; 2];
        for (part, place) in parts.iter_mut().zip([1, 1 + HARMONICS]) {
            let mut coefficients = [0.0; COEFFICIENTS];
            coefficients[place] = PROBE;
            self.set("forcing_coeffs", &coefficients)?;
            *part = self.value(forcing)? / PROBE;
        }
        self.set("forcing_coeffs", &[0.0; COEFFICIENTS])?;
        Ok(parts)
    }
}

fn missing(what: &'static str, name: &str, known: impl Iterator<Item = String>) -> HostError {
    let known = known.collect::<Vec<_>>().join(", ");
    HostError::Missing { what, name: name.into(), known }
}

/// Names and types of the parameters of a page.
fn definitions_of(mut bytes: &[u8]) -> Result<Vec<(String, u8)>, Malformed> {
    let mut definitions = Vec::new();
    while !bytes.is_empty() {
        let (name, rest) = text(bytes)?;
        let ([code, ..], rest) = rest.split_first_chunk::<4>().ok_or(Malformed)?;
        definitions.push((name, *code));
        bytes = rest;
    }
    Ok(definitions)
}
