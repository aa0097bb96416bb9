//! The client's side of a session: a rig or a controller at a network address.

use std::f64::consts::TAU;
use std::hash::{BuildHasher, Hasher, RandomState};
use std::net::SocketAddr;
use std::sync::{Arc, OnceLock};
use std::thread;
use std::time::{Duration, Instant};

use phase_lock::Config;
use vines_rig::Definition;
use vines_rig::{Command, Controller, ControllerError, Drive, GroundTruth, Move, Rig, RigError, Sensors};

use crate::address::{Address, LinkError};
use crate::frame::{
    Frame, FrameError, Kind, Message, Reading, Refusal, bit, flag, read_command, read_reading, write_command,
    write_move, write_reading,
};
use crate::link::Link;
use crate::readings::Readings;
use crate::seal::Key;
use crate::timing::{Counters, ReportLost, Timing};

/// Longest time until a server answers that has nothing to drive yet: forty repetitions of Hello.
pub const CONNECT: Duration = Duration::from_secs(2);
/// Time without an answer after which the last datagram is sent again: Hello, the first drive, or the farewell (protocol, "A session"). Also
/// the interval at which a server is asked again that has another client.
const RESEND: Duration = Duration::from_millis(50);

/// A session.
#[derive(Debug)]
struct Client {
    link: Link,
    peer: Address,
    session: u64,
    sample_time: f64,
    /// Longest silence of the server.
    silence: Duration,
    /// What the sensors of a rig read ([`Definition::channels`]).
    channels: u8,
    counters: Counters,
    /// Number of the present sample.
    at: u64,
    last: Frame,
    /// What the server says of its failure.
    message: Message,
}

impl Client {
    /// Opens a session. If the server has another client, which may be about to leave, it is asked again for a while.
    fn connect(peer: Address, controller: bool, sample_time: f64, key: Option<Key>) -> Result<Self, LinkError> {
        let end = Instant::now() + CONNECT;
        loop {
            match Self::open(peer, controller, sample_time, key) {
                // Over TCP, a server that has another client closes the connection.
                Err(LinkError::Refused { reason: Refusal::Busy, .. } | LinkError::Closed { .. })
                    if Instant::now() < end =>
                {
                    thread::sleep(RESEND);
                }
                outcome => return outcome,
            }
        }
    }

    fn open(peer: Address, controller: bool, sample_time: f64, key: Option<Key>) -> Result<Self, LinkError> {
        let seconds = CONNECT.as_secs_f64();
        let unreachable = || LinkError::Unreachable { peer, controller, seconds };
        let mut hello = Frame::new(Kind::Hello, RandomState::new().build_hasher().finish());
        hello.flags = bit(flag::CONTROLLER, controller);
        hello.values[0] = sample_time;
        let mut client = Self {
            link: Link::connect(peer, CONNECT, key).map_err(|_| unreachable())?,
            peer,
            session: hello.session,
            sample_time,
            silence: CONNECT,
            channels: 0,
            counters: Counters::default(),
            at: 0,
            last: hello,
            message: Message::default(),
        };
        client.send(hello)?;
        let end = Instant::now() + CONNECT;
        while let Some(answer) = client.receive(end)? {
            if answer.kind == Kind::Welcome {
                let [_, silence, channels, a, b, _] = answer.values;
                // Client and server use the same limit.
                client.silence = Duration::try_from_secs_f64(silence).unwrap_or(CONNECT);
                client.channels = channels as u8;
                client.link.seal.begin(answer.session, [a, b]);
                return Ok(client);
            }
        }
        Err(unreachable())
    }

    /// A frame of the present sample without content.
    fn frame(&self, kind: Kind) -> Frame {
        let (sequence, time) = (self.at, self.time());
        Frame { sequence, time, ..Frame::new(kind, self.session) }
    }

    /// Sends a frame, and keeps it for a repetition.
    fn send(&mut self, frame: Frame) -> Result<(), LinkError> {
        self.last = frame;
        Ok(self.link.send(&frame, self.peer.socket())?)
    }

    /// The next valid frame of this session, or None at `end`.
    fn receive(&mut self, end: Instant) -> Result<Option<Frame>, LinkError> {
        let (peer, time) = (self.peer, self.time());
        loop {
            let again = Instant::now() + RESEND;
            let until = if self.link.is_real_time() { end.min(again) } else { end };
            match self.link.receive(until)?.map(|(received, _)| received) {
                Some(Err(FrameError::Version(theirs))) => {
                    return Err(LinkError::Refused { peer, reason: Refusal::Version(theirs) });
                }
                Some(Err(FrameError::Closed)) => return Err(LinkError::Closed { peer, time }),
                Some(Err(_)) => self.counters.malformed += 1,
                Some(Ok(frame)) if frame.session != self.session => self.counters.foreign += 1,
                Some(Ok(frame)) if frame.kind == Kind::Text => self.message.take(&frame),
                Some(Ok(frame)) if frame.kind == Kind::Refusal => {
                    // Of the sample time the server refuses a Hello, which states it.
                    return Err(match Refusal::read(&frame, self.last.values[0]) {
                        Refusal::Failed { bytes } => {
                            let message = self.message.text(bytes);
                            LinkError::Failed { peer, time: frame.time, message }
                        }
                        reason => LinkError::Refused { peer, reason },
                    });
                }
                Some(Ok(frame)) if frame.has(flag::SHUT_DOWN) => {
                    let seconds = self.silence.as_secs_f64();
                    return Err(LinkError::ShutDown { peer, time: frame.time, seconds });
                }
                Some(Ok(frame)) => {
                    self.counters.received += 1;
                    return Ok(Some(frame));
                }
                None if Instant::now() >= end => return Ok(None),
                None => self.link.send(&self.last, self.peer.socket())?,
            }
        }
    }

    /// Time of the present sample, s.
    fn time(&self) -> f64 {
        self.at as f64 * self.sample_time
    }

    fn silent(&self) -> LinkError {
        let (peer, seconds) = (self.peer, self.silence.as_secs_f64());
        LinkError::Silent { peer, seconds, time: self.time() }
    }
}

impl Drop for Client {
    fn drop(&mut self) {
        if self.counters.is_troubled() {
            log::warn!("{}: {}", self.peer, self.counters);
        }
    }
}

/// A rig at a network address: in lock-step over TCP, in real time over UDP.
///
/// Lost readings are reconstructed, so that the controller gets every sample of the rig's clock.
#[derive(Debug)]
pub struct NetRig {
    client: Client,
    readings: Readings,
    /// The last one that has arrived.
    ground_truth: Option<GroundTruth>,
    timing: Arc<OnceLock<Result<Timing, ReportLost>>>,
}

impl NetRig {
    /// Opens a session with the rig server at `peer`; `sample_time` in s. A server with another key does not answer.
    pub fn connect(peer: Address, sample_time: f64, key: Option<Key>) -> Result<Self, LinkError> {
        Ok(Self {
            client: Client::connect(peer, false, sample_time, key)?,
            readings: Readings::default(),
            ground_truth: None,
            timing: Arc::default(),
        })
    }

    /// Refuses a rig whose sensors are not those of `expected`.
    pub fn with_sensors(self, expected: Definition) -> Result<Self, LinkError> {
        let (peer, channels, ours) = (self.client.peer, self.client.channels, expected.channel_names());
        if expected.channels() == channels {
            return Ok(self);
        }
        let theirs = Definition::of_channels(channels);
        let theirs = theirs.map_or("unknown".into(), |sensors| sensors.channel_names());
        Err(LinkError::Sensors { peer, theirs, ours })
    }

    /// The longest silence, s, of a rig in real time; None for a rig in lock-step.
    pub fn pace(&self) -> Option<f64> {
        let silence = self.client.silence.as_secs_f64();
        self.client.link.is_real_time().then_some(silence)
    }

    /// The counters of the session.
    pub fn counters(&self) -> Counters {
        self.client.counters
    }

    /// What a rig in real time reports about its timing. Set at the end of the session.
    pub fn timing(&self) -> Arc<OnceLock<Result<Timing, ReportLost>>> {
        Arc::clone(&self.timing)
    }

    /// Ends the session with a rig in real time. If this fails, the server's watchdog does.
    fn farewell(&mut self) -> Result<(), LinkError> {
        // As often as Hello (protocol, "A session"). The number counts and not the time, so that a client on a busy machine also asks for a report that
        // was lost.
        for _ in 0..CONNECT.as_millis() / RESEND.as_millis() {
            self.client.send(self.client.frame(Kind::Farewell))?;
            let end = Instant::now() + RESEND;
            loop {
                match self.client.receive(end) {
                    Ok(Some(frame)) if frame.kind == Kind::Report => {
                        let _ = self.timing.set(Ok(Timing::read(&frame)));
                        return Ok(());
                    }
                    // Readings of the ramp to zero.
                    Ok(Some(_)) | Err(LinkError::ShutDown { .. }) => {}
                    Ok(None) => break,
                    Err(error) => return Err(error),
                }
            }
        }
        Ok(())
    }
}

impl Rig for NetRig {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        let end = Instant::now() + self.client.silence;
        loop {
            if let Some(taken) = self.readings.take(&mut self.client.counters) {
                self.ground_truth = taken.ground_truth.or(self.ground_truth);
                return Ok(taken.sensors);
            }
            let frame = self.client.receive(end)?.ok_or_else(|| self.client.silent())?;
            if frame.kind == Kind::Sensors {
                let (reading, counters) = (read_reading(&frame), &mut self.client.counters);
                let samples = self.readings.arrive(frame.sequence, reading, counters);
                let Client { peer, sample_time, silence, .. } = self.client;
                let (seconds, allowed) = (samples as f64 * sample_time, silence.as_secs_f64());
                if seconds > allowed {
                    let time = self.client.time();
                    return Err(LinkError::Blackout { peer, samples, seconds, allowed, time }.into());
                }
            }
        }
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        let command = Command { drive, ..Command::default() };
        self.client
            .send(write_command(self.client.frame(Kind::Drive), &command))?;
        self.client.at += 1;
        // A rig that plays samples has no frequency: then a line is all that bridges a gap.
        self.readings.advance(drive.omega * step / TAU);
        Ok(())
    }

    fn ground_truth(&mut self) -> Result<Option<GroundTruth>, RigError> {
        self.sense()?;
        Ok(self.ground_truth)
    }
}

impl Drop for NetRig {
    fn drop(&mut self) {
        if self.client.link.is_real_time() {
            let _ = self.farewell();
            // Without effect if the report has arrived.
            let _ = self.timing.set(Err(ReportLost));
        }
    }
}

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
}

impl NetController {
    /// Opens a session with the controller server at `peer`, which has a configuration of its own.
    ///
    /// Beside a rig in real time the client waits for an answer for half a sample period, and then holds the last one.
    /// `pace` is the longest silence of such a rig, s; it also limits the silence of the controller. For a rig that waits,
    /// `pace` is None. A server with another key does not answer.
    pub fn connect(peer: SocketAddr, config: &Config, pace: Option<f64>, key: Option<Key>) -> Result<Self, LinkError> {
        let mut client = Client::connect(Address::Tcp(peer), true, config.sample_time, key)?;
        let limit = pace.and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
        client.silence = limit.map_or(client.silence, |limit| limit.min(client.silence));
        Ok(Self {
            client,
            patience: pace.map(|_| Duration::from_secs_f64(0.5 * config.sample_time)),
            waiting: None,
            good: Command::default(),
            answered: 0,
        })
    }

    /// The counters of the session.
    pub fn counters(&self) -> Counters {
        self.client.counters
    }
}

impl Controller for NetController {
    fn sample(&mut self, sensors: Sensors, active: bool) -> Result<Command, ControllerError> {
        let reading = Reading { sensors, ground_truth: None };
        let mut frame = write_reading(self.client.frame(Kind::Sensors), &reading);
        frame.flags |= bit(flag::ACTIVE, active);
        self.client.send(frame)?;
        let now = Instant::now();
        let end = *self.waiting.get_or_insert(now) + self.client.silence;
        let until = self.patience.map_or(end, |patience| (now + patience).min(end));
        let command = loop {
            let Some(frame) = self.client.receive(until)? else {
                if Instant::now() >= end {
                    return Err(self.client.silent().into());
                }
                self.client.counters.hold(self.client.at + 1 - self.answered);
                // The last answer. It also lasts beyond the release: the bench waits for the answer to that.
                let settled = self.good.settled.map(|_| false);
                break Command { settled, ..self.good };
            };
            if frame.kind != Kind::Drive || frame.sequence > self.client.at {
                let (peer, time) = (self.client.peer, self.client.time());
                return Err(LinkError::Invalid { peer, time }.into());
            }
            self.good = read_command(&frame);
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

    fn hold_response(&mut self, to: Move, phase_target: f64) -> Result<(), ControllerError> {
        let frame = write_move(self.client.frame(Kind::Move), to, phase_target);
        Ok(self.client.send(frame)?)
    }

    fn hold_drive(&mut self) -> Result<(), ControllerError> {
        let frame = self.client.frame(Kind::Move);
        Ok(self.client.send(Frame { flags: flag::HOLD, ..frame })?)
    }
}
