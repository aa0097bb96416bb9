//! A rig at a network address.

use std::net::SocketAddr;

use super::caller::Caller;
use super::counters::Counters;
use super::error::LinkError;
use super::frame::{Frame, Kind};
use super::order::{Arrival, Order};
use super::payload::{Reading, read_reading, write_command};
use vines_testbench::rig::{Command, Drive, Rig, RigError, Sensors, Witness};

/// A rig that is driven across the network, sample by sample.
///
/// A reading that is lost is replaced by the last good one, so that the controller sees every sample of the rig's clock.
#[derive(Debug)]
pub struct NetRig {
    caller: Caller,
    order: Order,
    /// Number of the sample that is due.
    at: u64,
    /// Its reading, once it is known.
    now: Option<Reading>,
    /// The last good reading.
    good: Reading,
    /// A reading of a later sample, which arrived first.
    ahead: Option<Frame>,
}

impl NetRig {
    /// Asks the rig server at `peer` for a session, sampled every `sample_time` s.
    ///
    /// # Errors
    /// A server that is not there, refuses, or speaks another version.
    pub fn connect(peer: SocketAddr, sample_time: f64) -> Result<Self, LinkError> {
        Ok(Self {
            caller: Caller::connect(peer, false, sample_time)?,
            order: Order::default(),
            at: 0,
            now: None,
            good: Reading::default(),
            ahead: None,
        })
    }

    /// The longest silence, s, that a rig in real time bears; None for one in lock-step.
    #[must_use]
    pub fn pace(&self) -> Option<f64> {
        self.caller.pace()
    }

    /// What has happened on the link.
    #[must_use]
    pub fn counters(&mut self) -> Counters {
        *self.caller.counters()
    }

    /// The reading of the sample that is due.
    fn reading(&mut self) -> Result<Reading, LinkError> {
        while self.now.is_none() {
            match self.ahead {
                Some(frame) if frame.sequence > self.at => {
                    self.caller.counters().held += 1;
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
        let Some(frame) = self.caller.receive(None)? else {
            return Ok(());
        };
        if frame.kind != Kind::Sensors {
            // A welcome that came twice.
            self.caller.counters().repeated += 1;
            return Ok(());
        }
        match self.order.arrive(frame.sequence) {
            Arrival::New { missing } if missing > self.caller.patience() => {
                return Err(self.caller.silent());
            }
            Arrival::New { missing } => {
                self.caller.answered();
                self.caller.counters().lost += missing;
                self.ahead = Some(frame);
            }
            Arrival::Late => self.caller.counters().late += 1,
            Arrival::Repeated => self.caller.counters().repeated += 1,
        }
        Ok(())
    }

    fn take(&mut self, frame: &Frame) {
        self.good = read_reading(frame);
        self.now = Some(self.good);
    }

    fn drive(&mut self, drive: Drive, step: f64) -> Result<(), LinkError> {
        self.caller.check_step(step)?;
        let frame = self.caller.frame(Kind::Drive, self.at);
        let command = Command {
            drive,
            ..Command::default()
        };
        self.caller.send(write_command(frame, &command))?;
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

    fn witness(&mut self) -> Result<Option<Witness>, RigError> {
        Ok(self.reading()?.witness)
    }
}
