//! The stream of a device: what the host has set up, and the packet that is being filled.

use super::codec::{ErrorCode, Packet, take};

/// Longest time before a packet is sent, s.
const FLUSH: f64 = 0.005;

/// The stream of a device.
#[derive(Debug, Default)]
pub struct Stream {
    /// Largest age of a packet, samples.
    flush: u32,
    sources: Vec<u8>,
    decimation: u16,
    /// Records, or 0 for a stream without an end.
    count: u32,
    /// Port of the host while the stream runs.
    port: Option<u16>,
    /// Samples and records since the start, and samples since the packet was begun.
    samples: u64,
    records: u32,
    age: u32,
    packet: Packet,
}

impl Stream {
    /// A stream that is not set up.
    pub fn new(sample_rate: f64) -> Self {
        let flush = ((FLUSH * sample_rate) as u32).max(1);
        Self { flush, ..Self::default() }
    }

    /// Sets the stream up: `decimation u16, count u32, n u8, source u8 × n`; `all` is the number of sources.
    pub fn set_up(&mut self, mut payload: &[u8], all: usize) -> Result<(), ErrorCode> {
        let [d, e, a, b, c, f, n] = take(&mut payload).map_err(|_| ErrorCode::BadLength)?;
        if payload.len() != usize::from(n) {
            return Err(ErrorCode::BadLength);
        }
        if self.port.is_some() {
            return Err(ErrorCode::Busy);
        }
        let decimation = u16::from_le_bytes([d, e]);
        if decimation == 0 || n == 0 || payload.iter().any(|source| usize::from(*source) >= all) {
            return Err(ErrorCode::BadValue);
        }
        (self.decimation, self.count, self.sources) = (decimation, u32::from_le_bytes([a, b, c, f]), payload.into());
        Ok(())
    }

    /// Starts the stream to a port of the host.
    pub fn start(&mut self, payload: &[u8]) -> Result<(), ErrorCode> {
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

    /// Stops the stream.
    pub fn stop(&mut self) {
        self.port = None;
    }

    /// Takes the values of all sources at sample `index`; returns a packet that is complete, and its port.
    pub fn record(&mut self, index: u32, values: &[f64]) -> Option<(u16, Vec<u8>)> {
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
        let full = packet.values.len() / width >= Packet::most(width) || self.age >= self.flush;
        if packet.values.is_empty() || !(full || complete) {
            return None;
        }
        let bytes = packet.encode();
        packet.sequence = packet.sequence.wrapping_add(1);
        packet.values.clear();
        self.age = 0;
        if complete {
            self.port = None;
        }
        Some((port, bytes))
    }
}
