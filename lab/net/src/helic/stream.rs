//! The stream of a device: what the host has set up, and the packet that is being filled.

use super::codec::{ErrorCode, Packet};

/// Longest time before a packet is sent, s.
const FLUSH: f64 = 0.005;

/// What the host has set up.
#[derive(Debug, Clone)]
struct Setup {
    decimation: u16,
    /// Records, or 0 for a stream without an end.
    count: u32,
    sources: Vec<u8>,
}

/// A stream that runs.
#[derive(Debug)]
struct Running {
    /// Port of the host.
    port: u16,
    /// Samples until the next record.
    wait: u16,
    /// Records so far.
    sent: u32,
    packet: Packet,
    /// Samples since the packet was begun.
    age: u32,
}

/// The stream of a device.
#[derive(Debug)]
pub struct Stream {
    setup: Option<Setup>,
    running: Option<Running>,
    /// Largest age of a packet, samples.
    flush: u32,
}

impl Stream {
    pub fn new(sample_rate: f64) -> Self {
        Self {
            setup: None,
            running: None,
            flush: ((FLUSH * sample_rate) as u32).max(1),
        }
    }

    /// Sets the stream up: `decimation u16, count u32, n u8, source u8 × n`.
    pub fn set_up(&mut self, payload: &[u8], sources: usize) -> Result<(), ErrorCode> {
        let Some((&[a, b, c, d, e, f, n], chosen)) = payload.split_first_chunk() else {
            return Err(ErrorCode::BadLength);
        };
        if chosen.len() != usize::from(n) {
            return Err(ErrorCode::BadLength);
        }
        if self.running.is_some() {
            return Err(ErrorCode::Busy);
        }
        let decimation = u16::from_le_bytes([a, b]);
        if decimation == 0 || n == 0 || chosen.iter().any(|source| usize::from(*source) >= sources) {
            return Err(ErrorCode::BadValue);
        }
        let count = u32::from_le_bytes([c, d, e, f]);
        self.setup = Some(Setup { decimation, count, sources: chosen.into() });
        Ok(())
    }

    /// Starts the stream to a port of the host.
    pub fn start(&mut self, payload: &[u8]) -> Result<(), ErrorCode> {
        let port = u16::from_le_bytes(payload.try_into().map_err(|_| ErrorCode::BadLength)?);
        if self.running.is_some() {
            return Err(ErrorCode::Busy);
        }
        let setup = self.setup.as_ref().filter(|_| port != 0).ok_or(ErrorCode::BadValue)?;
        let packet = Packet {
            decimation: setup.decimation,
            width: setup.sources.len() as u8,
            ..Packet::default()
        };
        self.running = Some(Running { port, wait: 0, sent: 0, packet, age: 0 });
        Ok(())
    }

    pub fn stop(&mut self) {
        self.running = None;
    }

    /// Takes the values of all sources at sample `index`; returns a packet that is complete, and its port.
    pub fn record(&mut self, index: u32, values: &[f64]) -> Option<(u16, Vec<u8>)> {
        let (setup, running) = (self.setup.as_ref()?, self.running.as_mut()?);
        let Running { packet, wait, age, .. } = running;
        if *wait == 0 {
            if packet.values.is_empty() {
                packet.first = index;
            }
            let record = setup.sources.iter().map(|source| values[usize::from(*source)] as f32);
            packet.values.extend(record);
            running.sent += 1;
            *wait = setup.decimation;
        }
        *wait -= 1;
        *age += 1;
        let width = setup.sources.len();
        let complete = setup.count != 0 && running.sent == setup.count;
        let full = packet.values.len() / width >= Packet::most(width) || *age >= self.flush;
        if packet.values.is_empty() || !(full || complete) {
            return None;
        }
        let sent = (running.port, packet.encode());
        packet.sequence = packet.sequence.wrapping_add(1);
        packet.values.clear();
        *age = 0;
        if complete {
            self.running = None;
        }
        Some(sent)
    }
}
