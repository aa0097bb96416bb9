//! The client's side of a session.

use std::hash::{BuildHasher, Hasher, RandomState};
use std::thread;
use std::time::{Duration, Instant};

use super::address::Address;
use super::error::LinkError;
use super::frame::{Frame, FrameError, Kind, flag};
use super::handshake::{Refusal, SAME_TIME};
use super::link::Link;
use super::report::Counters;
use super::seal::Key;

/// Longest time until the server opens the session.
const CONNECT: Duration = Duration::from_secs(2);
/// Time without an answer after which the last datagram is sent again: Hello, the first drive, or the farewell. Also the
/// interval at which a server is asked again that has another client.
const RESEND: Duration = Duration::from_millis(50);

/// A session.
#[derive(Debug)]
pub(super) struct Client {
    link: Link,
    pub peer: Address,
    session: u64,
    sample_time: f64,
    /// Longest silence of the server.
    pub silence: Duration,
    /// What the sensors of a rig read ([`Definition::channels`](vines_testbench::scene::Definition::channels)).
    pub channels: u8,
    pub counters: Counters,
    /// Number of the present sample.
    pub at: u64,
    last: Frame,
}

impl Client {
    /// Opens a session; `flags` are those of Hello. If the server has another client, which may be about to leave, it is asked again for a while.
    pub fn connect(peer: Address, flags: u8, sample_time: f64, key: Option<Key>) -> Result<Self, LinkError> {
        let end = Instant::now() + CONNECT;
        loop {
            match Self::open(peer, flags, sample_time, key) {
                Err(LinkError::Refused { reason: Refusal::Busy, .. }) if Instant::now() < end => thread::sleep(RESEND),
                outcome => return outcome,
            }
        }
    }

    fn open(peer: Address, flags: u8, sample_time: f64, key: Option<Key>) -> Result<Self, LinkError> {
        let unreachable = || unreachable(peer, flags & flag::CONTROLLER != 0);
        let mut hello = Frame::new(Kind::Hello, RandomState::new().build_hasher().finish());
        hello.flags = flags;
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
        };
        client.send(hello)?;
        let end = Instant::now() + CONNECT;
        while let Some(answer) = client.receive(end)? {
            if answer.kind == Kind::Welcome {
                // Client and server use the same limit.
                client.silence = Duration::try_from_secs_f64(answer.values[1]).unwrap_or(CONNECT);
                client.channels = answer.values[2] as u8;
                client
                    .link
                    .seal
                    .begin(answer.session, [answer.values[3], answer.values[4]]);
                return Ok(client);
            }
        }
        Err(unreachable())
    }

    /// A frame of the present sample without content.
    pub fn frame(&self, kind: Kind) -> Frame {
        let (sequence, time) = (self.at, self.time());
        Frame { sequence, time, ..Frame::new(kind, self.session) }
    }

    /// Sends a frame, and keeps it for a repetition.
    pub fn send(&mut self, frame: Frame) -> Result<(), LinkError> {
        self.last = frame;
        Ok(self.link.send(&frame)?)
    }

    /// The next valid frame of this session, or None at `end`.
    pub fn receive(&mut self, end: Instant) -> Result<Option<Frame>, LinkError> {
        let (peer, time) = (self.peer, self.time());
        loop {
            let until = if self.is_real_time() {
                end.min(Instant::now() + RESEND)
            } else {
                end
            };
            match self.link.receive(until)? {
                Some(Err(FrameError::Version(theirs))) => return Err(LinkError::Version { peer, theirs }),
                Some(Err(FrameError::Closed)) => return Err(LinkError::Closed { peer, time }),
                Some(Err(_)) => self.counters.malformed += 1,
                Some(Ok(frame)) if frame.session != self.session => self.counters.foreign += 1,
                Some(Ok(frame)) if frame.kind == Kind::Refusal => {
                    return Err(LinkError::Refused { peer, reason: Refusal::read(&frame) });
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
                None => self.link.send(&self.last)?,
            }
        }
    }

    /// Whether the rig runs in real time.
    pub fn is_real_time(&self) -> bool {
        matches!(self.peer, Address::Udp(_))
    }

    /// Time of the present sample, s.
    fn time(&self) -> f64 {
        self.at as f64 * self.sample_time
    }

    /// Number of samples in the longest silence.
    pub fn patience(&self) -> u64 {
        (self.silence.as_secs_f64() / self.sample_time) as u64
    }

    /// Checks that a step has the length agreed on.
    pub fn check_step(&self, step: f64) -> Result<(), LinkError> {
        let (peer, sample_time) = (self.peer, self.sample_time);
        let agreed = (step / sample_time - 1.0).abs() <= SAME_TIME;
        agreed.then_some(()).ok_or(LinkError::Step { peer, step, sample_time })
    }

    pub fn silent(&self) -> LinkError {
        let (peer, seconds) = (self.peer, self.silence.as_secs_f64());
        LinkError::Silent { peer, seconds, time: self.time() }
    }

    /// Number of consecutive readings of a rig that were lost.
    pub fn blackout(&self, samples: u64) -> LinkError {
        let (peer, allowed) = (self.peer, self.silence.as_secs_f64());
        LinkError::Blackout {
            peer,
            samples,
            seconds: samples as f64 * self.sample_time,
            allowed,
            time: self.time(),
        }
    }

    pub fn invalid(&self) -> LinkError {
        LinkError::Invalid { peer: self.peer, time: self.time() }
    }
}

impl Drop for Client {
    fn drop(&mut self) {
        if self.counters.is_troubled() {
            log::warn!("{}: {}", self.peer, self.counters);
        }
    }
}

/// The error for a server that does not answer.
fn unreachable(peer: Address, controller: bool) -> LinkError {
    let command = match peer {
        Address::Tcp(place) if controller => format!("vines controller --listen {place}"),
        Address::Tcp(place) => format!("vines rig --lock-step --listen {place}"),
        Address::Udp(place) => format!("vines rig --listen {place}"),
    };
    LinkError::Unreachable { peer, command, seconds: CONNECT.as_secs_f64() }
}
