//! The host's side of the control channel: what a device has, and its values by name.

use std::io;

use thiserror::Error;

use super::codec::{ErrorCode, Frame, Malformed, Status, VERSION, message, text};
use super::transport::Transport;
use vines_testbench::rig::RigError;

/// Why a device cannot be used.
#[derive(Debug, Error)]
#[expect(missing_docs, reason = "the messages explain the variants")]
pub enum HostError {
    #[error(
        "no answer from the helic device: {0}; is `vines rig --protocol helic` or the device running, with no other host?"
    )]
    Unreachable(#[source] io::Error),
    #[error("the helic device, {what}: {source}; the drive is stopped as far as the device can still be reached")]
    Lost { what: String, source: io::Error },
    #[error("the helic device: {0}")]
    System(#[from] io::Error),
    #[error(
        "{samples} samples of the helic device did not arrive, {seconds:.3} s; up to {allowed} s are bridged. Check the network and the          load of this machine"
    )]
    Blackout { samples: u32, seconds: f64, allowed: f64 },
    #[error(
        "the helic device has no source \"phase\", the phase of its oscillator: update its firmware to one with the standard programme of \
         protocol {VERSION}"
    )]
    NoPhase,
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
        let answer = match host.request(message::STATUS, Vec::new(), "Status") {
            Err(HostError::Lost { source, .. }) => return Err(HostError::Unreachable(source)),
            answer => answer?,
        };
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
        let lost = |source| HostError::Lost { what: what.into(), source };
        let Frame { kind: answered, sequence, payload } = self.transport.request(&request).map_err(lost)?;
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

    /// Whether the device has a parameter.
    pub fn has(&self, name: &str) -> bool {
        self.index(name).is_ok()
    }

    /// The request that sets a parameter. Real numbers become floats.
    pub fn setting(&self, name: &str, values: &[f64]) -> Result<Frame, HostError> {
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
        Ok(Frame { kind: message::SET_PAR, sequence: 0, payload })
    }

    /// Sets a parameter.
    pub fn set(&mut self, name: &str, values: &[f64]) -> Result<(), HostError> {
        let Frame { kind, payload, .. } = self.setting(name, values)?;
        let what = match values {
            [value] => format!("{name} = {value}"),
            _ => name.into(),
        };
        self.request(kind, payload, &what)?;
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
