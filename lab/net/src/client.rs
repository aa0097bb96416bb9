//! The client of a session: opens it, sends frames, waits for answers, and gives up after a silence.

use std::hash::{BuildHasher, Hasher, RandomState};
use std::net::SocketAddr;
use std::time::{Duration, Instant};

use super::counters::Counters;
use super::error::LinkError;
use super::frame::{Frame, FrameError, Kind, flag};
use super::frame_socket::FrameSocket;
use super::refusal::Refusal;

/// Time without an answer after which the last frame is sent again.
const RESEND: Duration = Duration::from_millis(50);
/// Longest time until the server opens the session.
const CONNECT: Duration = Duration::from_secs(2);
/// Number of farewell frames. One may be lost, and there is no answer to it.
const FAREWELLS: usize = 3;
/// Largest relative difference of two sample times that count as equal.
const SAME_TIME: f64 = 1e-9;

/// The client's side of a session.
#[derive(Debug)]
pub(super) struct Client {
    socket: FrameSocket,
    peer: SocketAddr,
    session: u64,
    sample_time: f64,
    paced: bool,
    silence: Duration,
    counters: Counters,
    /// The last frame, which is sent again if no answer arrives.
    last: Frame,
    last_sent: Instant,
    /// Time since which an answer is due.
    waiting: Option<Instant>,
}

impl Client {
    /// Opens a session with the rig, or the `controller`, at `peer`; `sample_time` in s.
    pub fn connect(peer: SocketAddr, controller: bool, sample_time: f64) -> Result<Self, LinkError> {
        let session = RandomState::new().build_hasher().finish();
        let mut hello = Frame::new(Kind::Hello, session);
        hello.flags = if controller { flag::CONTROLLER } else { 0 };
        hello.values[0] = sample_time;
        let mut client = Self {
            socket: FrameSocket::towards(peer)?,
            peer,
            session,
            sample_time,
            paced: false,
            silence: CONNECT,
            counters: Counters::default(),
            last: hello,
            last_sent: Instant::now(),
            waiting: None,
        };
        client.send(hello)?;
        let unreachable = LinkError::Unreachable {
            peer,
            role: if controller { "controller" } else { "rig" },
            seconds: CONNECT.as_secs_f64(),
        };
        let mut busy: Option<Refusal> = None;
        let welcome = loop {
            let frame = match (client.receive(None), busy) {
                (Ok(Some(frame)), _) => frame,
                (Ok(None), _) => continue,
                (Err(LinkError::Silent { .. }), Some(reason)) => {
                    return Err(LinkError::Refused { peer, reason });
                }
                (Err(LinkError::Silent { .. }), None) => return Err(unreachable),
                (Err(other), _) => return Err(other),
            };
            match (frame.kind, Refusal::read(&frame)) {
                (Kind::Welcome, _) => break frame,
                // The last client may be about to leave.
                (Kind::Refusal, reason @ Refusal::Busy) => busy = Some(reason),
                (Kind::Refusal, reason) => return Err(LinkError::Refused { peer, reason }),
                _ => {}
            }
        };
        client.answered();
        client.paced = welcome.has(flag::PACED);
        // Client and server use the same limit.
        client.silence = Duration::try_from_secs_f64(welcome.values[1]).unwrap_or(CONNECT);
        Ok(client)
    }

    /// Longest silence, s, of a server in real time.
    pub fn pace(&self) -> Option<f64> {
        self.paced.then_some(self.silence.as_secs_f64())
    }

    /// Reduces the longest silence to this value, s.
    pub fn limit_silence(&mut self, seconds: f64) {
        let limit = Duration::try_from_secs_f64(seconds).unwrap_or_default();
        self.silence = self.silence.min(limit);
    }

    /// The counters of the session.
    pub fn counters(&mut self) -> &mut Counters {
        &mut self.counters
    }

    /// A frame of sample `sequence` without content.
    pub fn frame(&self, kind: Kind, sequence: u64) -> Frame {
        Frame {
            sequence,
            time: sequence as f64 * self.sample_time,
            ..Frame::new(kind, self.session)
        }
    }

    /// Sends a frame and keeps it for a repetition.
    pub fn send(&mut self, frame: Frame) -> Result<(), LinkError> {
        self.last = frame;
        self.last_sent = Instant::now();
        self.counters.sent += 1;
        Ok(self.socket.send(&frame, self.peer)?)
    }

    /// The next valid frame of this session, or None at `until`. Repeats the last frame if no answer arrives.
    ///
    /// # Errors
    /// A peer that is silent for too long, has shut down its drive, or has another version.
    pub fn receive(&mut self, until: Option<Instant>) -> Result<Option<Frame>, LinkError> {
        let since = *self.waiting.get_or_insert_with(Instant::now);
        let end = since + self.silence;
        let until = until.unwrap_or(end + RESEND);
        loop {
            let again = self.last_sent + RESEND;
            if let Some((datagram, from)) = self.socket.receive(until.min(end).min(again))?
                && let Some(frame) = self.filter(datagram, from)?
            {
                return Ok(Some(frame));
            }
            let now = Instant::now();
            if now >= end {
                return Err(self.silent());
            }
            if now >= until {
                return Ok(None);
            }
            if now >= again {
                self.counters.resent += 1;
                self.send(self.last)?;
            }
        }
    }

    /// The expected answer has arrived.
    pub fn answered(&mut self) {
        self.waiting = None;
    }

    /// The error for a silent peer.
    pub fn silent(&self) -> LinkError {
        LinkError::Silent {
            peer: self.peer,
            seconds: self.silence.as_secs_f64(),
            time: self.last.time,
        }
    }

    /// Number of samples in the longest silence.
    pub fn patience(&self) -> u64 {
        (self.silence.as_secs_f64() / self.sample_time) as u64
    }

    /// Checks that a step has the length agreed on.
    pub fn check_step(&self, step: f64) -> Result<(), LinkError> {
        let sample_time = self.sample_time;
        if same_time(step, sample_time) {
            return Ok(());
        }
        Err(LinkError::Step { peer: self.peer, step, sample_time })
    }

    fn filter(&mut self, datagram: Result<Frame, FrameError>, from: SocketAddr) -> Result<Option<Frame>, LinkError> {
        if from != self.peer {
            self.counters.foreign += 1;
            return Ok(None);
        }
        match datagram {
            Err(FrameError::Version(theirs)) if self.last.kind == Kind::Hello => {
                let peer = self.peer;
                Err(LinkError::Version { peer, theirs })
            }
            Err(_) => {
                self.counters.malformed += 1;
                Ok(None)
            }
            Ok(frame) if frame.session != self.session => {
                self.counters.foreign += 1;
                Ok(None)
            }
            Ok(frame) if frame.has(flag::SHUT_DOWN) => Err(LinkError::ShutDown { peer: self.peer, time: frame.time }),
            Ok(frame) => {
                self.counters.received += 1;
                Ok(Some(frame))
            }
        }
    }
}

impl Drop for Client {
    fn drop(&mut self) {
        if self.counters.is_troubled() {
            log::warn!("udp://{}: {}", self.peer, self.counters);
        }
        for _ in 0..FAREWELLS {
            // If this fails, the server's watchdog ends the session.
            let _ = self.socket.send(&Frame::new(Kind::Farewell, self.session), self.peer);
        }
    }
}

/// Whether two sample times, s, are equal.
pub(super) fn same_time(a: f64, b: f64) -> bool {
    (a - b).abs() <= SAME_TIME * b.abs()
}
