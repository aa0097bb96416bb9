//! A device as a rig of the bench. Its oscillator runs on the device; the host sets frequency and amplitude, step by step.

use std::collections::VecDeque;
use std::f64::consts::TAU;

use super::codec::{Packet, message};
use super::host::{Host, HostError};
use super::registry::{COEFFICIENTS, HARMONICS};
use super::transport::Transport;
use crate::report::Counters;
use vines_testbench::rig::{Drive, Rig, RigError, Sensors};

/// Largest relative difference between the sample rates: the device states its own with 24 bits.
const SAME_RATE: f64 = 1e-6;
/// Packets after which the device is asked whether its output is on.
const SUPERVISION: u32 = 20;

/// What a host takes from a device, and gives to it.
#[derive(Debug, Clone, PartialEq)]
pub struct Channels {
    /// Source of the response, and m per unit of it.
    pub response: (String, f64),
    /// Source of the base displacement, and m per unit; None if no sensor reads it.
    pub reference: Option<(String, f64)>,
    /// Base displacement per volt of the output, m.
    pub gain: f64,
}

impl Default for Channels {
    /// Those of `vines rig --protocol helic`.
    fn default() -> Self {
        let source = |name: &str| (name.to_string(), 1e-3);
        Self {
            response: source("response"),
            reference: Some(source("reference")),
            gain: 1e-3,
        }
    }
}

/// A device as a rig.
///
/// The device samples on its own clock, and its readings arrive in packets. A drive is sent when all readings that have arrived are used
/// up, so that there is one command per packet at most. A lost packet costs held readings; a repeated one is not used.
#[derive(Debug)]
pub struct HelicRig<T: Transport> {
    host: Host<T>,
    channels: Channels,
    /// Cosine and sine of the device's oscillator at the start.
    origin: [f64; 2],
    sample_time: f64,
    /// Readings that have arrived, and the sensors before them.
    readings: VecDeque<Sensors>,
    now: Option<Sensors>,
    good: Sensors,
    /// Number of the sample that the next packet begins with.
    next: Option<u32>,
    /// Packets since the output was last asked for.
    unsupervised: u32,
    wanted: Drive,
    given: Drive,
    /// What has arrived, and what was held.
    pub counters: Counters,
}

impl<T: Transport> HelicRig<T> {
    /// Sets the device up and starts its stream; `sample_time` in s.
    pub fn new(transport: T, channels: Channels, sample_time: f64, samples_per_period: f64) -> Result<Self, HostError> {
        let mut host = Host::new(transport)?;
        let ratio = host.sample_rate * sample_time;
        if ratio < 0.5 || (ratio / ratio.round() - 1.0).abs() > SAME_RATE {
            let suggestion = ratio * samples_per_period;
            return Err(HostError::Rate {
                device: host.sample_rate,
                scene: 1.0 / sample_time,
                suggestion,
            });
        }
        let mut sources = vec![host.source(&channels.response.0)?];
        if let Some((name, _)) = &channels.reference {
            sources.push(host.source(name)?);
        }
        host.set("arm", &[0.0])?;
        host.set("target_coeffs", &[0.0; COEFFICIENTS])?;
        host.set("table_mode", &[0.0])?;
        let origin = host.stop_oscillator()?;
        host.stream(&sources, ratio.round() as u16, 0)?;
        host.set("arm", &[1.0])?;
        Ok(Self {
            host,
            channels,
            origin,
            sample_time,
            readings: VecDeque::new(),
            now: None,
            good: Sensors::default(),
            next: None,
            unsupervised: 0,
            wanted: Drive::default(),
            given: Drive::default(),
            counters: Counters::default(),
        })
    }

    /// The way to the device.
    pub fn transport(&mut self) -> &mut T {
        &mut self.host.transport
    }

    fn reading(&mut self) -> Result<Sensors, HostError> {
        while self.now.is_none() {
            match self.readings.pop_front() {
                Some(reading) => self.now = Some(reading),
                None => {
                    self.command()?;
                    self.receive()?;
                }
            }
        }
        self.good = self.now.unwrap_or_default();
        Ok(self.good)
    }

    /// Waits for the next packet.
    fn receive(&mut self) -> Result<(), HostError> {
        let bytes = self.host.transport.datagram()?;
        let Ok(packet) = Packet::decode(&bytes) else {
            self.counters.malformed += 1;
            return Ok(());
        };
        let width = 1 + usize::from(self.channels.reference.is_some());
        if usize::from(packet.width) != width {
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
        let silence = f64::from(missed) * self.sample_time;
        if silence > 1.0 {
            return Err(std::io::Error::from(std::io::ErrorKind::TimedOut).into());
        }
        let last = self.readings.back().copied().unwrap_or(self.good);
        self.readings.extend((0..missed).map(|_| last));
        self.counters.held += u64::from(missed);
        self.counters.received += 1;
        for record in packet.values.chunks_exact(width) {
            let read = |n: usize, factor: f64| factor * f64::from(record[n]);
            self.readings.push_back(Sensors {
                response: read(0, self.channels.response.1),
                reference: self.channels.reference.as_ref().map(|(_, factor)| read(1, *factor)),
            });
        }
        let records = (packet.values.len() / width) as u32;
        self.next = Some(packet.first.wrapping_add(records * step));
        self.unsupervised += 1;
        if self.unsupervised > SUPERVISION {
            self.unsupervised = 0;
            self.supervise()?;
        }
        Ok(())
    }

    /// The output of the device must be on, if it says whether it is.
    fn supervise(&mut self) -> Result<(), HostError> {
        let bytes = self.host.get("safety")?;
        let safety = bytes.first().copied().unwrap_or_default().into();
        // Devices without a gate read 0.
        if safety == 0 || safety & 0b11 == 1 {
            Ok(())
        } else {
            Err(HostError::Tripped(safety))
        }
    }

    /// Sends the drive, as far as it has changed.
    fn command(&mut self) -> Result<(), HostError> {
        if self.wanted.omega != self.given.omega {
            self.host.set("freq", &[self.wanted.omega / TAU])?;
        }
        if self.wanted.amplitude != self.given.amplitude {
            let ([cosine, sine], volts) = (self.origin, self.wanted.amplitude / self.channels.gain);
            let mut forcing = [0.0; COEFFICIENTS];
            (forcing[1], forcing[1 + HARMONICS]) = (-volts * sine, volts * cosine);
            self.host.set("forcing_coeffs", &forcing)?;
        }
        self.given = self.wanted;
        Ok(())
    }
}

impl<T: Transport> Rig for HelicRig<T> {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        Ok(self.reading()?)
    }

    fn advance(&mut self, drive: Drive, _: f64) -> Result<(), RigError> {
        self.wanted = drive;
        self.now = None;
        if drive.amplitude == 0.0 {
            // A drive of zero is not delayed.
            self.command()?;
        }
        Ok(())
    }
}

impl<T: Transport> Drop for HelicRig<T> {
    fn drop(&mut self) {
        // If the device does not answer any more, the end of the connection disarms it.
        let _ = self.host.set("arm", &[0.0]);
        let _ = self.host.request(message::STREAM_STOP, Vec::new(), "StreamStop");
        if self.counters.is_troubled() {
            log::warn!("helic device: {}", self.counters);
        }
    }
}
