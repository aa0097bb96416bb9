//! The server's end of a link: grants one session at a time, and sorts what comes in.

use std::net::SocketAddr;
use std::time::{Duration, Instant};

use super::caller::same_time;
use super::counters::Counters;
use super::error::LinkError;
use super::frame::{Frame, FrameError, Kind, VERSION, flag};
use super::order::{Arrival, Order};
use super::port::Port;
use super::refusal::Refusal;

/// Most datagrams that are looked at before what is due.
const BURST: u32 = 256;

/// What a server offers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Offer {
    /// A controller, not a rig.
    pub controller: bool,
    /// The rig runs in real time.
    pub paced: bool,
    /// Time from sample to sample, s.
    pub sample_time: f64,
    /// Longest silence, s.
    pub silence: f64,
}

/// What has come in for the server.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Event {
    /// A session has begun.
    Opened,
    /// Its client asks for the last answer again.
    Again,
    /// A frame of the session with its place in the order.
    Frame(Frame, Arrival),
    /// The client is done.
    Farewell,
    /// Nothing, until the deadline.
    Nothing,
}

#[derive(Debug, Clone, Copy)]
struct Session {
    peer: SocketAddr,
    id: u64,
    order: Order,
    heard: Instant,
    /// The drive has been shut down: another client may take over.
    over: bool,
}

/// A socket with at most one session.
#[derive(Debug)]
pub(super) struct Host {
    port: Port,
    offer: Offer,
    session: Option<Session>,
    /// Of the session; what comes between two counts for the next one.
    pub counters: Counters,
    /// The last answer.
    last: Option<Frame>,
    /// Numbers beyond this make no sense: the client is ahead of its time.
    pub horizon: u64,
    /// Datagrams since the deadline was last looked at.
    burst: u32,
}

impl Host {
    pub fn listen(address: SocketAddr, offer: Offer) -> Result<Self, LinkError> {
        Ok(Self {
            port: Port::listen(address)?,
            offer,
            session: None,
            counters: Counters::default(),
            last: None,
            horizon: u64::MAX,
            burst: 0,
        })
    }

    /// Where clients reach this server.
    pub fn address(&self) -> Result<SocketAddr, LinkError> {
        Ok(self.port.address()?)
    }

    /// The client, while there is one.
    pub fn peer(&self) -> Option<SocketAddr> {
        self.session.map(|session| session.peer)
    }

    /// How long the client has been silent.
    pub fn silence(&self) -> Duration {
        self.session
            .map_or(Duration::ZERO, |session| session.heard.elapsed())
    }

    /// Waits for the next event until `deadline`. What is already there goes first, but no flood holds up the clock.
    pub fn next(&mut self, deadline: Instant) -> Result<Event, LinkError> {
        while self.burst < BURST {
            let Some((datagram, from)) = self.port.receive(deadline)? else {
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

    /// An answer with the number `sequence`, still without content.
    pub fn answer(&self, kind: Kind, sequence: u64) -> Frame {
        Frame {
            sequence,
            time: sequence as f64 * self.offer.sample_time,
            ..Frame::new(kind, self.session.map_or(0, |session| session.id))
        }
    }

    /// Sends an answer to the client, and keeps it for the case that it is asked for again.
    pub fn send(&mut self, frame: Frame) -> Result<(), LinkError> {
        self.last = Some(frame);
        let Some(session) = self.session else {
            return Ok(());
        };
        self.counters.sent += 1;
        Ok(self.port.send(&frame, session.peer)?)
    }

    /// Sends the last answer again.
    pub fn send_again(&mut self) -> Result<(), LinkError> {
        let Some(frame) = self.last else {
            return Ok(());
        };
        self.counters.resent += 1;
        self.send(frame)
    }

    /// Lets another client take over, because the drive of this session has been shut down; returns what happened.
    pub fn release(&mut self) -> Counters {
        if let Some(session) = &mut self.session {
            session.over = true;
        }
        std::mem::take(&mut self.counters)
    }

    /// Ends the session, and returns what happened.
    pub fn close(&mut self) -> Counters {
        self.session = None;
        self.last = None;
        std::mem::take(&mut self.counters)
    }

    fn sort(
        &mut self,
        datagram: Result<Frame, FrameError>,
        from: SocketAddr,
    ) -> Result<Option<Event>, LinkError> {
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
            // The farewell is said several times; the copies of the last client's are nobody's fault.
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
        let arrival = session.order.arrive(frame.sequence);
        match arrival {
            Arrival::New { missing } => self.counters.lost += missing,
            Arrival::Late => self.counters.late += 1,
            Arrival::Repeated => self.counters.repeated += 1,
        }
        Ok(Some(Event::Frame(frame, arrival)))
    }

    fn hello(&mut self, frame: &Frame, from: SocketAddr) -> Result<Option<Event>, LinkError> {
        let Offer {
            controller,
            sample_time,
            ..
        } = self.offer;
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
            order: Order::default(),
            heard: Instant::now(),
            over: false,
        });
        self.last = None;
        self.welcome(frame.session, from)?;
        Ok(Some(Event::Opened))
    }

    fn welcome(&mut self, session: u64, to: SocketAddr) -> Result<(), LinkError> {
        let Offer {
            controller,
            paced,
            sample_time,
            silence,
        } = self.offer;
        let mut welcome = Frame::new(Kind::Welcome, session);
        welcome.flags |= if controller { flag::CONTROLLER } else { 0 };
        welcome.flags |= if paced { flag::PACED } else { 0 };
        welcome.values[0] = sample_time;
        welcome.values[1] = silence;
        self.counters.sent += 1;
        Ok(self.port.send(&welcome, to)?)
    }

    fn refuse(
        &self,
        session: u64,
        reason: Refusal,
        to: SocketAddr,
    ) -> Result<Option<Event>, LinkError> {
        let refusal = reason.write(Frame::new(Kind::Refusal, session));
        self.port.send(&refusal, to)?;
        Ok(None)
    }
}
