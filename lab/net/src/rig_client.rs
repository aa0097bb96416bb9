//! A rig at a network address.

use std::net::SocketAddr;

use super::client::Client;
use super::counters::Counters;
use super::error::LinkError;
use super::frame::{Frame, Kind};
use super::payload::{Reading, read_reading, write_command};
use super::sequence_window::{Arrival, SequenceWindow};
use vines_testbench::rig::{Command, Drive, GroundTruth, Rig, RigError, Sensors};

/// A rig at a network address.
///
/// The last valid reading replaces a lost one, so that the controller gets every sample of the rig's clock.
#[derive(Debug)]
pub struct NetRig {
    client: Client,
    order: SequenceWindow,
    /// Sequence number of the present sample.
    at: u64,
    /// Reading of the present sample, if it has arrived.
    now: Option<Reading>,
    /// The last valid reading.
    good: Reading,
    /// Reading of a later sample, which arrived first.
    ahead: Option<Frame>,
}

impl NetRig {
    /// Opens a session with the rig server at `peer`; `sample_time` in s.
    ///
    /// # Errors
    /// A server that does not answer, refuses, or has another version.
    pub fn connect(peer: SocketAddr, sample_time: f64) -> Result<Self, LinkError> {
        Ok(Self {
            client: Client::connect(peer, false, sample_time)?,
            order: SequenceWindow::default(),
            at: 0,
            now: None,
            good: Reading::default(),
            ahead: None,
        })
    }

    /// The longest silence, s, of a rig in real time; None for a rig in lock-step.
    #[must_use]
    pub fn pace(&self) -> Option<f64> {
        self.client.pace()
    }

    /// The counters of the session.
    #[must_use]
    pub fn counters(&mut self) -> Counters {
        *self.client.counters()
    }

    /// The reading of the present sample.
    fn reading(&mut self) -> Result<Reading, LinkError> {
        while self.now.is_none() {
            match self.ahead {
                Some(frame) if frame.sequence > self.at => {
                    self.client.counters().held += 1;
                    self.now = Some(self.good);
                }
                Some(frame) => {
                    self.ahead = None;
                    self.take(&frame);
                }
                None => self.wait()?,
            }
        }
        Ok(self.now.unwrap_or(self.good))
    }

    fn wait(&mut self) -> Result<(), LinkError> {
        let Some(frame) = self.client.receive(None)? else {
            return Ok(());
        };
        if frame.kind != Kind::Sensors {
            // A second Welcome.
            self.client.counters().repeated += 1;
            return Ok(());
        }
        match self.order.arrive(frame.sequence) {
            Arrival::New { missing } if missing > self.client.patience() => {
                return Err(self.client.silent());
            }
            Arrival::New { missing } => {
                self.client.answered();
                self.client.counters().lost += missing;
                self.ahead = Some(frame);
            }
            Arrival::Late => self.client.counters().late += 1,
            Arrival::Repeated => self.client.counters().repeated += 1,
        }
        Ok(())
    }

    fn take(&mut self, frame: &Frame) {
        self.good = read_reading(frame);
        self.now = Some(self.good);
    }

    fn drive(&mut self, drive: Drive, step: f64) -> Result<(), LinkError> {
        self.client.check_step(step)?;
        let frame = self.client.frame(Kind::Drive, self.at);
        let command = Command { drive, ..Command::default() };
        self.client.send(write_command(frame, &command))?;
        self.at += 1;
        self.now = None;
        Ok(())
    }
}

impl Rig for NetRig {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        Ok(self.reading()?.sensors)
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        Ok(self.drive(drive, step)?)
    }

    fn ground_truth(&mut self) -> Result<Option<GroundTruth>, RigError> {
        Ok(self.reading()?.ground_truth)
    }
}
