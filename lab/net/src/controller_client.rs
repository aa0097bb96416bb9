//! A controller at a network address.

use std::net::SocketAddr;
use std::time::{Duration, Instant};

use super::caller::Caller;
use super::counters::Counters;
use super::error::LinkError;
use super::frame::{Frame, Kind, flag};
use super::order::{Arrival, Order};
use super::payload::{Reading, read_command, write_reading};
use vines_testbench::rig::{Command, Controller, ControllerError, Drive, Sensors};

/// A controller that is asked across the network, sample by sample.
#[derive(Debug)]
pub struct NetController {
    caller: Caller,
    order: Order,
    at: u64,
    /// How long an answer is waited for before the last one is held; None where the rig waits, too.
    patience: Option<Duration>,
    good: Command,
    failed: bool,
}

impl NetController {
    /// Asks the controller server at `peer` for a session, sampled every `sample_time` s.
    ///
    /// Beside a rig in real time, an answer is waited for by half a sample period, then the last one is held; `pace` is
    /// the longest silence, s, that such a rig bears, and the controller is granted no longer one. Else (None) the rig waits,
    /// too.
    ///
    /// # Errors
    /// A server that is not there, refuses, or speaks another version.
    pub fn connect(
        peer: SocketAddr,
        sample_time: f64,
        pace: Option<f64>,
    ) -> Result<Self, LinkError> {
        let mut caller = Caller::connect(peer, true, sample_time)?;
        if let Some(seconds) = pace {
            caller.limit_silence(seconds);
        }
        Ok(Self {
            caller,
            order: Order::default(),
            at: 0,
            patience: pace.map(|_| Duration::from_secs_f64(0.5 * sample_time)),
            good: Command::default(),
            failed: false,
        })
    }

    /// What has happened on the link.
    #[must_use]
    pub fn counters(&mut self) -> Counters {
        *self.caller.counters()
    }

    fn ask(&mut self, sensors: Sensors, active: bool) -> Result<Command, LinkError> {
        if self.failed {
            return Err(self.caller.silent());
        }
        let reading = Reading {
            sensors,
            witness: None,
        };
        let mut frame = write_reading(self.caller.frame(Kind::Sensors, self.at), &reading);
        frame.flags |= if active { flag::ACTIVE } else { 0 };
        self.caller.send(frame)?;
        let deadline = self.patience.map(|patience| Instant::now() + patience);
        let command = loop {
            let Some(frame) = self.caller.receive(deadline)? else {
                self.caller.counters().held += 1;
                break self.held(active);
            };
            if let Some(command) = self.read(&frame) {
                break command;
            }
        };
        self.at += 1;
        Ok(command)
    }

    /// The last answer, for a sample that got none.
    fn held(&self, active: bool) -> Command {
        let drive = if active {
            self.good.drive
        } else {
            Drive {
                omega: self.good.drive.omega,
                ..Drive::default()
            }
        };
        Command {
            drive,
            phase_error: self.good.phase_error,
            settled: false,
        }
    }

    /// The answer to the sample that is due, if the frame is that.
    fn read(&mut self, frame: &Frame) -> Option<Command> {
        let command = read_command(frame).filter(|_| frame.sequence <= self.at);
        let due = frame.sequence == self.at;
        let Some(command) = command.filter(|_| frame.kind == Kind::Drive) else {
            self.caller.counters().malformed += 1;
            return None;
        };
        match self.order.arrive(frame.sequence) {
            Arrival::New { .. } => {
                self.good = command;
                self.caller.answered();
                self.caller.counters().late += u64::from(!due);
                return due.then_some(command);
            }
            Arrival::Late => self.caller.counters().late += 1,
            Arrival::Repeated => self.caller.counters().repeated += 1,
        }
        None
    }
}

impl Controller for NetController {
    fn sample(&mut self, sensors: Sensors, active: bool) -> Result<Command, ControllerError> {
        let answer = self.ask(sensors, active);
        // Latched: a peer that has failed once is not asked again.
        self.failed |= answer.is_err();
        Ok(answer?)
    }
}
