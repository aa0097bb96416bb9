//! A rig at a network address.

use std::f64::consts::TAU;
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use super::address::Address;
use super::bridge::Bridge;
use super::client::Client;
use super::error::LinkError;
use super::frame::{Frame, Kind, flag};
use super::payload::{Reading, read_reading, write_command};
use super::report::{Counters, ReportLost, Timing};
use super::seal::Key;
use vines_testbench::rig::{Command, Drive, GroundTruth, Rig, RigError, Sensors};
use vines_testbench::scene::Definition;

/// Longest time for the report of a rig in real time: twenty repetitions of the farewell.
const REPORT: Duration = Duration::from_secs(1);

/// A rig at a network address: in lock-step over TCP, in real time over UDP.
///
/// Lost readings are bridged, so that the controller gets every sample of the rig's clock.
#[derive(Debug)]
pub struct NetRig {
    client: Client,
    /// Reading of the present sample, if it has arrived.
    now: Option<Reading>,
    /// The last valid reading.
    good: Reading,
    /// The frame with the newest reading, which may be that of a later sample.
    newest: Option<Frame>,
    bridge: Bridge,
    /// Phase of the drive at the present sample, and its last step, turns.
    phase: f64,
    turn: f64,
    timing: Arc<OnceLock<Result<Timing, ReportLost>>>,
}

impl NetRig {
    /// Opens a session with the rig server at `peer`; `sample_time` in s. A server with another key does not answer.
    pub fn connect(peer: Address, sample_time: f64, key: Option<Key>) -> Result<Self, LinkError> {
        Ok(Self {
            client: Client::connect(peer, 0, sample_time, key)?,
            now: None,
            good: Reading::default(),
            newest: None,
            bridge: Bridge::default(),
            phase: 0.0,
            turn: 0.0,
            timing: Arc::default(),
        })
    }

    /// Refuses a rig whose sensors are not those of `expected`.
    pub fn with_sensors(self, expected: Definition) -> Result<Self, LinkError> {
        let is_theirs = |one: &Definition| one.channels() == self.client.channels;
        if is_theirs(&expected) {
            return Ok(self);
        }
        let theirs = Definition::all().into_iter().find(is_theirs);
        let theirs = theirs.map_or("unknown".into(), |one| one.channel_names());
        let (peer, ours) = (self.client.peer, expected.channel_names());
        Err(LinkError::Sensors { peer, theirs, ours })
    }

    /// The longest silence, s, of a rig in real time; None for a rig in lock-step.
    pub fn pace(&self) -> Option<f64> {
        self.client.is_real_time().then_some(self.client.silence.as_secs_f64())
    }

    /// The counters of the session.
    pub fn counters(&self) -> Counters {
        self.client.counters
    }

    /// What a rig in real time reports about its timing. Set at the end of the session.
    pub fn timing(&self) -> Arc<OnceLock<Result<Timing, ReportLost>>> {
        Arc::clone(&self.timing)
    }

    /// The reading of the present sample.
    fn reading(&mut self) -> Result<Reading, LinkError> {
        let end = Instant::now() + self.client.silence;
        loop {
            let reading = match (self.now, self.newest) {
                (Some(reading), _) => return Ok(reading),
                (None, Some(frame)) if frame.sequence == self.client.at => read_reading(&frame),
                (None, Some(frame)) if frame.sequence > self.client.at => {
                    let (next, ahead) = (read_reading(&frame), frame.sequence - self.client.at);
                    self.client.counters.hold(ahead);
                    let sensors = self.bridge.fill(self.phase, &next.sensors, ahead, self.turn);
                    Reading { sensors, ..self.good }
                }
                _ => {
                    self.wait(end)?;
                    continue;
                }
            };
            self.bridge.keep(self.phase, reading.sensors);
            self.good = reading;
            self.now = Some(reading);
        }
    }

    /// Waits for a later reading.
    fn wait(&mut self, end: Instant) -> Result<(), LinkError> {
        let frame = self.client.receive(end)?.ok_or_else(|| self.client.silent())?;
        if frame.kind != Kind::Sensors {
            return Ok(());
        }
        if self.newest.is_some_and(|newest| newest.sequence >= frame.sequence) {
            self.client.counters.late += 1;
            return Ok(());
        }
        let lost = frame.sequence.saturating_sub(self.client.at);
        if lost > self.client.patience() {
            return Err(self.client.blackout(lost));
        }
        self.newest = Some(frame);
        Ok(())
    }

    fn drive(&mut self, drive: Drive, flags: u8, step: f64) -> Result<(), LinkError> {
        self.client.check_step(step)?;
        let command = Command { drive, ..Command::default() };
        let frame = write_command(self.client.frame(Kind::Drive), &command);
        self.client.send(Frame { flags: frame.flags | flags, ..frame })?;
        self.client.at += 1;
        self.now = None;
        // A rig that plays samples has no frequency: then a line is all that bridges a gap.
        self.turn = drive.omega * step / TAU;
        self.phase += self.turn;
        Ok(())
    }

    /// Ends the session with a rig in real time. If this fails, the server's watchdog does.
    fn farewell(&mut self) -> Result<(), LinkError> {
        self.client.send(self.client.frame(Kind::Farewell))?;
        let end = Instant::now() + REPORT;
        loop {
            match self.client.receive(end) {
                Ok(Some(frame)) if frame.kind == Kind::Report => {
                    let _ = self.timing.set(Ok(Timing::read(&frame)));
                    return Ok(());
                }
                // Readings of the ramp to zero overtake a report that was lost.
                Ok(Some(_)) | Err(LinkError::ShutDown { .. }) => {}
                Ok(None) => return Ok(()),
                Err(error) => return Err(error),
            }
        }
    }
}

impl Rig for NetRig {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        Ok(self.reading()?.sensors)
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        Ok(self.drive(drive, 0, step)?)
    }

    fn hold(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        Ok(self.drive(drive, flag::HOLD, step)?)
    }

    fn ground_truth(&mut self) -> Result<Option<GroundTruth>, RigError> {
        Ok(self.reading()?.ground_truth)
    }
}

impl Drop for NetRig {
    fn drop(&mut self) {
        if self.client.is_real_time() {
            let _ = self.farewell();
            // Without effect if the report has arrived.
            let _ = self.timing.set(Err(ReportLost));
        }
    }
}
