//! The server of sessions: accepts one client at a time, and classifies incoming frames.

use std::net::SocketAddr;
use std::time::{Duration, Instant};

use super::client::same_time;
use super::counters::Counters;
use super::error::LinkError;
use super::frame::{Frame, FrameError, Kind, VERSION, flag};
use super::frame_socket::FrameSocket;
use super::refusal::Refusal;
use super::sequence_window::{Arrival, SequenceWindow};

/// Largest number of datagrams that are read after the deadline has passed.
const BURST: u32 = 256;

/// Properties of a server.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Offer {
    /// Whether it is a controller; otherwise it is a rig.
    pub controller: bool,
    /// Whether the rig runs in real time.
    pub paced: bool,
    /// Sample time, s.
    pub sample_time: f64,
    /// Longest silence, s.
    pub silence: f64,
}

/// An event for the server.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Event {
    /// A session has started.
    Opened,
    /// The client asks for the last answer again.
    Again,
    /// A frame of the session, and whether it is new.
    Frame(Frame, Arrival),
    /// The client ends the session.
    Farewell,
    /// The deadline has passed.
    Nothing,
}

#[derive(Debug, Clone, Copy)]
struct Session {
    peer: SocketAddr,
    id: u64,
    window: SequenceWindow,
    heard: Instant,
    /// Whether the drive has been shut down, so that another client may connect.
    over: bool,
}

/// A socket with at most one session.
#[derive(Debug)]
pub(super) struct ServerSession {
    socket: FrameSocket,
    offer: Offer,
    session: Option<Session>,
    /// Counters of the session. Frames between two sessions count for the next one.
    pub counters: Counters,
    /// The last answer.
    last: Option<Frame>,
    /// Largest valid sequence number: that of the present sample.
    pub horizon: u64,
    /// Datagrams read since the deadline has passed.
    burst: u32,
}

impl ServerSession {
    pub fn listen(address: SocketAddr, offer: Offer) -> Result<Self, LinkError> {
        Ok(Self {
            socket: FrameSocket::listen(address)?,
            offer,
            session: None,
            counters: Counters::default(),
            last: None,
            horizon: u64::MAX,
            burst: 0,
        })
    }

    /// Address of this server.
    pub fn address(&self) -> Result<SocketAddr, LinkError> {
        Ok(self.socket.address()?)
    }

    /// Address of the client, if there is one.
    pub fn peer(&self) -> Option<SocketAddr> {
        self.session.map(|session| session.peer)
    }

    /// Time since the last frame of the client.
    pub fn silence(&self) -> Duration {
        self.session.map_or(Duration::ZERO, |session| session.heard.elapsed())
    }

    /// Waits for the next event until `deadline`. Frames that have arrived come first, but a flood of them cannot stop the
    /// clock.
    pub fn next(&mut self, deadline: Instant) -> Result<Event, LinkError> {
        while self.burst < BURST {
            let Some((datagram, from)) = self.socket.receive(deadline)? else {
                break;
            };
            self.burst += u32::from(Instant::now() >= deadline);
            if let Some(event) = self.sort(datagram, from)? {
                return Ok(event);
            }
        }
        self.burst = 0;
        Ok(Event::Nothing)
    }

    /// An answer of sample `sequence` without content.
    pub fn answer(&self, kind: Kind, sequence: u64) -> Frame {
        Frame {
            sequence,
            time: sequence as f64 * self.offer.sample_time,
            ..Frame::new(kind, self.session.map_or(0, |session| session.id))
        }
    }

    /// Sends an answer to the client and keeps it for a repetition.
    pub fn send(&mut self, frame: Frame) -> Result<(), LinkError> {
        self.last = Some(frame);
        let Some(session) = self.session else {
            return Ok(());
        };
        self.counters.sent += 1;
        Ok(self.socket.send(&frame, session.peer)?)
    }

    /// Sends the last answer again.
    pub fn send_again(&mut self) -> Result<(), LinkError> {
        let Some(frame) = self.last else {
            return Ok(());
        };
        self.counters.resent += 1;
        self.send(frame)
    }

    /// Allows another client to connect, because the drive of this session has been shut down. Returns the counters.
    pub fn release(&mut self) -> Counters {
        if let Some(session) = &mut self.session {
            session.over = true;
        }
        std::mem::take(&mut self.counters)
    }

    /// Ends the session. Returns the counters.
    pub fn close(&mut self) -> Counters {
        self.session = None;
        self.last = None;
        std::mem::take(&mut self.counters)
    }

    fn sort(&mut self, datagram: Result<Frame, FrameError>, from: SocketAddr) -> Result<Option<Event>, LinkError> {
        let frame = match datagram {
            Ok(frame) => frame,
            Err(error) => {
                self.counters.malformed += 1;
                if let FrameError::Version(_) = error {
                    self.refuse(0, Refusal::Version(VERSION), from)?;
                }
                return Ok(None);
            }
        };
        if frame.kind == Kind::Hello {
            return self.hello(&frame, from);
        }
        let own = self
            .session
            .as_mut()
            .filter(|session| (session.peer, session.id) == (from, frame.session));
        let Some(session) = own else {
            // Clients send several farewells; the copies that follow the end of the session are no error.
            let echo = frame.kind == Kind::Farewell && self.session.is_none();
            self.counters.foreign += u64::from(!echo);
            return Ok(None);
        };
        session.heard = Instant::now();
        self.counters.received += 1;
        if frame.kind == Kind::Farewell {
            return Ok(Some(Event::Farewell));
        }
        let wanted = if self.offer.controller {
            Kind::Sensors
        } else {
            Kind::Drive
        };
        if frame.kind != wanted || frame.sequence > self.horizon {
            self.counters.malformed += 1;
            return Ok(None);
        }
        let arrival = session.window.arrive(frame.sequence);
        match arrival {
            Arrival::New { missing } => self.counters.lost += missing,
            Arrival::Late => self.counters.late += 1,
            Arrival::Repeated => self.counters.repeated += 1,
        }
        Ok(Some(Event::Frame(frame, arrival)))
    }

    fn hello(&mut self, frame: &Frame, from: SocketAddr) -> Result<Option<Event>, LinkError> {
        let Offer { controller, sample_time, .. } = self.offer;
        if let Some(session) = &mut self.session {
            if (session.peer, session.id) == (from, frame.session) {
                session.heard = Instant::now();
                self.counters.repeated += 1;
                self.welcome(frame.session, from)?;
                return Ok(Some(Event::Again));
            }
            if !session.over {
                self.counters.foreign += 1;
                return self.refuse(frame.session, Refusal::Busy, from);
            }
        }
        if frame.has(flag::CONTROLLER) != controller {
            return self.refuse(frame.session, Refusal::Role, from);
        }
        if !same_time(frame.values[0], sample_time) {
            return self.refuse(frame.session, Refusal::SampleTime(sample_time), from);
        }
        self.session = Some(Session {
            peer: from,
            id: frame.session,
            window: SequenceWindow::default(),
            heard: Instant::now(),
            over: false,
        });
        self.last = None;
        self.welcome(frame.session, from)?;
        Ok(Some(Event::Opened))
    }

    fn welcome(&mut self, session: u64, to: SocketAddr) -> Result<(), LinkError> {
        let Offer { controller, paced, sample_time, silence } = self.offer;
        let mut welcome = Frame::new(Kind::Welcome, session);
        welcome.flags |= if controller { flag::CONTROLLER } else { 0 };
        welcome.flags |= if paced { flag::PACED } else { 0 };
        welcome.values[0] = sample_time;
        welcome.values[1] = silence;
        self.counters.sent += 1;
        Ok(self.socket.send(&welcome, to)?)
    }

    fn refuse(&self, session: u64, reason: Refusal, to: SocketAddr) -> Result<Option<Event>, LinkError> {
        let refusal = reason.write(Frame::new(Kind::Refusal, session));
        self.socket.send(&refusal, to)?;
        Ok(None)
    }
}
