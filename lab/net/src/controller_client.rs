//! A controller at a network address.

use std::net::SocketAddr;
use std::time::{Duration, Instant};

use super::client::Client;
use super::counters::Counters;
use super::error::LinkError;
use super::frame::{Frame, Kind, flag};
use super::payload::{Reading, read_command, write_reading};
use super::sequence_window::{Arrival, SequenceWindow};
use vines_testbench::rig::{Command, Controller, ControllerError, Drive, Sensors};

/// A controller at a network address.
#[derive(Debug)]
pub struct NetController {
    client: Client,
    order: SequenceWindow,
    at: u64,
    /// Waiting time for an answer before the last one is held; None beside a rig that waits, too.
    patience: Option<Duration>,
    good: Command,
    failed: bool,
}

impl NetController {
    /// Opens a session with the controller server at `peer`; `sample_time` in s.
    ///
    /// Beside a rig in real time the client waits for an answer for half a sample period, and then holds the last one.
    /// `pace` is the longest silence of such a rig, s; it also limits the silence of the controller. For a rig that waits,
    /// `pace` is None.
    ///
    /// # Errors
    /// A server that does not answer, refuses, or has another version.
    pub fn connect(peer: SocketAddr, sample_time: f64, pace: Option<f64>) -> Result<Self, LinkError> {
        let mut client = Client::connect(peer, true, sample_time)?;
        if let Some(seconds) = pace {
            client.limit_silence(seconds);
        }
        Ok(Self {
            client,
            order: SequenceWindow::default(),
            at: 0,
            patience: pace.map(|_| Duration::from_secs_f64(0.5 * sample_time)),
            good: Command::default(),
            failed: false,
        })
    }

    /// The counters of the session.
    #[must_use]
    pub fn counters(&mut self) -> Counters {
        *self.client.counters()
    }

    fn ask(&mut self, sensors: Sensors, active: bool) -> Result<Command, LinkError> {
        if self.failed {
            return Err(self.client.silent());
        }
        let reading = Reading { sensors, ground_truth: None };
        let mut frame = write_reading(self.client.frame(Kind::Sensors, self.at), &reading);
        frame.flags |= if active { flag::ACTIVE } else { 0 };
        self.client.send(frame)?;
        let deadline = self.patience.map(|patience| Instant::now() + patience);
        let command = loop {
            let Some(frame) = self.client.receive(deadline)? else {
                self.client.counters().held += 1;
                break self.held(active);
            };
            if let Some(command) = self.read(&frame) {
                break command;
            }
        };
        self.at += 1;
        Ok(command)
    }

    /// The last answer, for a sample without one.
    fn held(&self, active: bool) -> Command {
        let drive = if active {
            self.good.drive
        } else {
            Drive { omega: self.good.drive.omega, ..Drive::default() }
        };
        Command { drive, settled: false, ..self.good }
    }

    /// The answer to the present sample, if the frame is this answer.
    fn read(&mut self, frame: &Frame) -> Option<Command> {
        let command = read_command(frame).filter(|_| frame.sequence <= self.at);
        let due = frame.sequence == self.at;
        let Some(command) = command.filter(|_| frame.kind == Kind::Drive) else {
            self.client.counters().malformed += 1;
            return None;
        };
        match self.order.arrive(frame.sequence) {
            Arrival::New { .. } => {
                self.good = command;
                self.client.answered();
                self.client.counters().late += u64::from(!due);
                return due.then_some(command);
            }
            Arrival::Late => self.client.counters().late += 1,
            Arrival::Repeated => self.client.counters().repeated += 1,
        }
        None
    }
}

impl Controller for NetController {
    fn sample(&mut self, sensors: Sensors, active: bool) -> Result<Command, ControllerError> {
        let answer = self.ask(sensors, active);
        // Latched: after one failure the peer is not asked again.
        self.failed |= answer.is_err();
        Ok(answer?)
    }
}
