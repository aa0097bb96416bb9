//! A controller at a network address.

use std::net::SocketAddr;
use std::time::{Duration, Instant};

use super::address::Address;
use super::client::Client;
use super::error::LinkError;
use super::frame::{Frame, Kind, flag};
use super::payload::{Reading, read_command, write_move, write_reading};
use super::report::Counters;
use super::seal::Key;
use vines_testbench::rig::{Command, Controller, ControllerError, Drive, Move, Sensors};

/// A controller at a network address.
#[derive(Debug)]
pub struct NetController {
    client: Client,
    /// Waiting time for an answer before the last one is held; None beside a rig that waits, too.
    patience: Option<Duration>,
    /// Since when an answer is due.
    waiting: Option<Instant>,
    /// The last answer, and the number of samples until then.
    good: Command,
    answered: u64,
    failed: bool,
}

impl NetController {
    /// Opens a session with the controller server at `peer`; `sample_time` in s.
    ///
    /// Beside a rig in real time the client waits for an answer for half a sample period, and then holds the last one.
    /// `pace` is the longest silence of such a rig, s; it also limits the silence of the controller. For a rig that waits,
    /// `pace` is None. A server with another key does not answer.
    pub fn connect(peer: SocketAddr, sample_time: f64, pace: Option<f64>, key: Option<Key>) -> Result<Self, LinkError> {
        let mut client = Client::connect(Address::Tcp(peer), flag::CONTROLLER, sample_time, key)?;
        let limit = pace.and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
        client.silence = limit.map_or(client.silence, |limit| limit.min(client.silence));
        Ok(Self {
            client,
            patience: pace.map(|_| Duration::from_secs_f64(0.5 * sample_time)),
            waiting: None,
            good: Command::default(),
            answered: 0,
            failed: false,
        })
    }

    /// The counters of the session.
    pub fn counters(&self) -> Counters {
        self.client.counters
    }

    fn ask(&mut self, sensors: Sensors, active: bool) -> Result<Command, LinkError> {
        let reading = Reading { sensors, ground_truth: None };
        let mut frame = write_reading(self.client.frame(Kind::Sensors), &reading);
        frame.flags |= if active { flag::ACTIVE } else { 0 };
        self.client.send(frame)?;
        let now = Instant::now();
        let end = *self.waiting.get_or_insert(now) + self.client.silence;
        let until = self.patience.map_or(end, |patience| (now + patience).min(end));
        let command = loop {
            let Some(frame) = self.client.receive(until)? else {
                if Instant::now() >= end {
                    return Err(self.client.silent());
                }
                self.client.counters.hold(self.client.at + 1 - self.answered);
                break self.held(active);
            };
            self.good = self.read(&frame)?;
            self.waiting = None;
            self.answered = frame.sequence + 1;
            if frame.sequence == self.client.at {
                break self.good;
            }
            self.client.counters.late += 1;
        };
        self.client.at += 1;
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

    /// The answer to this sample or an earlier one.
    fn read(&self, frame: &Frame) -> Result<Command, LinkError> {
        let command = read_command(frame);
        let Drive { omega, amplitude, .. } = command.drive;
        let valid = frame.values.iter().all(|x| x.is_finite()) && omega >= 0.0 && amplitude >= 0.0;
        let due = frame.kind == Kind::Drive && frame.sequence <= self.client.at;
        (valid && due).then_some(command).ok_or_else(|| self.client.invalid())
    }
}

impl Controller for NetController {
    fn sample(&mut self, sensors: Sensors, active: bool) -> Result<Command, ControllerError> {
        if self.failed {
            return Err(self.client.silent().into());
        }
        let answer = self.ask(sensors, active);
        // Latched: after one failure the peer is not asked again.
        self.failed = answer.is_err();
        Ok(answer?)
    }

    fn hold_response(&mut self, to: Move, phase_target: f64) -> Result<(), ControllerError> {
        let frame = write_move(self.client.frame(Kind::Move), to, phase_target);
        Ok(self.client.send(frame)?)
    }

    fn hold_drive(&mut self) -> Result<(), ControllerError> {
        let frame = self.client.frame(Kind::Move);
        Ok(self.client.send(Frame { flags: flag::HOLD, ..frame })?)
    }
}
