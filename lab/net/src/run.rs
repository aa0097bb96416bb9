//! One session of a server.

use std::net::SocketAddr;
use std::time::{Duration, Instant};

use super::error::ServerError;
use super::frame::{Frame, Kind, flag};
use super::handshake::{Refusal, Service};
use super::link::Listener;
use super::payload::{Reading, read_move, read_reading, write_command, write_reading};
use super::ramp::Ramp;
use super::real_time_clock::{Punctuality, RealTimeClock};
use super::report::{Counters, Ended, Session, Timing};
use vines_testbench::rig::{Controller, Rig};

/// Longest time from Hello to the first drive of a rig in real time.
const FIRST_DRIVE: Duration = Duration::from_secs(5);

/// What a server offers in a session.
pub enum Served {
    /// A rig.
    Rig(Box<dyn Rig>),
    /// A controller.
    Controller(Box<dyn Controller>),
}

/// A session.
pub(super) struct Run {
    served: Served,
    service: Service,
    real_time: bool,
    pub peer: SocketAddr,
    welcome: Frame,
    opened: Instant,
    /// Time of the last frame.
    heard: Instant,
    pub counters: Counters,
    /// Number of the present sample.
    at: u64,
    /// Number of the newest drive of a rig in real time.
    newest: u64,
    drive: Ramp,
    /// The clock of a rig in real time, from the first drive on.
    clock: Option<RealTimeClock>,
    ended: Option<Ended>,
}

impl Run {
    pub fn new(served: Served, service: Service, real_time: bool, peer: SocketAddr, welcome: Frame) -> Self {
        let opened = Instant::now();
        Self {
            served,
            service,
            real_time,
            peer,
            welcome,
            opened,
            heard: opened,
            counters: Counters::default(),
            at: 0,
            newest: 0,
            drive: Ramp::default(),
            clock: None,
            ended: None,
        }
    }

    pub fn is_client(&self, from: SocketAddr, session: u64) -> bool {
        (self.peer, self.welcome.session) == (from, session)
    }

    /// When the next sample is due in real time, or the client has been silent for too long.
    pub fn due(&self) -> Option<Instant> {
        match &self.clock {
            Some(clock) => Some(clock.due(self.at + 1)),
            // A repeated Hello is not a sign of life: anyone can send a copy.
            None if self.real_time => Some(self.opened + FIRST_DRIVE),
            None => self
                .heard
                .checked_add(Duration::try_from_secs_f64(self.service.silence).ok()?),
        }
    }

    /// Shuts the drive down. In real time the clock continues until the drive is zero.
    pub fn end(&mut self, ended: Ended) {
        self.drive.shut_down();
        self.ended.get_or_insert(ended);
    }

    pub fn is_over(&self) -> bool {
        self.ended.is_some() && (self.clock.is_none() || self.drive.is_down())
    }

    /// Sends Welcome, and the first reading of a rig.
    pub fn welcome(&mut self, listener: &mut Listener) -> Result<(), ServerError> {
        listener.send(&self.welcome, self.peer)?;
        self.tell_reading(listener)
    }

    pub fn handle(&mut self, frame: &Frame, listener: &mut Listener) -> Result<(), ServerError> {
        self.heard = Instant::now();
        self.counters.received += 1;
        match (frame.kind, &self.served) {
            (Kind::Drive, Served::Rig(_)) if self.real_time => self.take_drive(frame),
            (Kind::Hello, _) if self.real_time && self.clock.is_none() => self.welcome(listener)?,
            (Kind::Hello, _) if self.real_time => {}
            (Kind::Farewell, _) if self.real_time => {
                self.end(Ended::Farewell);
                listener.send(&self.report(), self.peer)?;
            }
            _ if self.real_time => self.counters.malformed += 1,
            _ => {
                if let Err(refusal) = self.step(frame, listener)? {
                    let cause = Frame { sequence: self.at, ..*frame };
                    listener.send(&refusal.answer(&cause), self.peer)?;
                    self.end(Ended::Refused);
                }
            }
        }
        Ok(())
    }

    /// Answers a frame in lock-step.
    fn step(&mut self, frame: &Frame, listener: &mut Listener) -> Result<Result<(), Refusal>, ServerError> {
        match (&mut self.served, frame.kind) {
            _ if frame.sequence != self.at => Ok(Err(Refusal::Unexpected)),
            (Served::Controller(controller), Kind::Sensors) => {
                let command = controller.sample(read_reading(frame).sensors, frame.has(flag::ACTIVE))?;
                let answer = write_command(Frame { flags: 0, ..*frame }, &command);
                self.at += 1;
                listener.send(&answer, self.peer)?;
                Ok(Ok(()))
            }
            (Served::Controller(controller), Kind::Move) => {
                let (to, phase_target) = read_move(frame);
                // No answer: the next drive follows from it. A refusal ends the session.
                let held = if frame.has(flag::HOLD) {
                    controller.hold_drive()
                } else {
                    controller.hold_response(to, phase_target)
                };
                Ok(held.map_err(Refusal::from))
            }
            (Served::Rig(_), Kind::Drive) => match self.service.drive(frame) {
                Err(refusal) => Ok(Err(refusal)),
                Ok(drive) => {
                    self.drive.set(drive, frame.has(flag::HOLD));
                    self.advance()?;
                    self.tell_reading(listener)?;
                    Ok(Ok(()))
                }
            },
            _ => Ok(Err(Refusal::Unexpected)),
        }
    }

    /// Takes a drive in real time, if it is valid and newer than the last one.
    fn take_drive(&mut self, frame: &Frame) {
        let known = self.clock.is_some() && frame.sequence <= self.newest;
        let drive = self.service.drive(frame).ok().filter(|_| frame.sequence <= self.at);
        self.counters.late += u64::from(known || frame.sequence < self.at);
        self.counters.malformed += u64::from(drive.is_none());
        if let Some(drive) = drive.filter(|_| !known) {
            self.drive.set(drive, frame.has(flag::HOLD));
            self.newest = frame.sequence;
            self.clock
                .get_or_insert_with(|| RealTimeClock::start(self.service.sample_time));
        }
    }

    /// The deadline has passed: a sample is due, or the client is silent.
    pub fn pass(&mut self, listener: &mut Listener) -> Result<(), ServerError> {
        let Some(clock) = &mut self.clock else {
            self.end(Ended::Silence);
            return Ok(());
        };
        clock.serve(self.at + 1);
        if self.newest < self.at && !self.drive.is_shut_down() {
            self.counters.hold(self.at - self.newest);
            // The age of a drive counts from its sample, not from its arrival: a client that is too far behind is as bad as a
            // silent one.
            if (self.at - self.newest) as f64 * self.service.sample_time > self.service.silence {
                self.end(Ended::Silence);
            }
        }
        self.advance()?;
        self.tell_reading(listener)
    }

    fn advance(&mut self) -> Result<(), ServerError> {
        if let Served::Rig(rig) = &mut self.served {
            self.drive.apply(rig.as_mut(), self.service.sample_time)?;
            self.at += 1;
        }
        Ok(())
    }

    /// Sends the present reading of a rig.
    fn tell_reading(&mut self, listener: &mut Listener) -> Result<(), ServerError> {
        let Served::Rig(rig) = &mut self.served else {
            return Ok(());
        };
        let reading = Reading { sensors: rig.sense()?, ground_truth: rig.ground_truth()? };
        let mut frame = write_reading(Frame::new(Kind::Sensors, self.welcome.session), &reading);
        frame.sequence = self.at;
        frame.time = self.at as f64 * self.service.sample_time;
        if self.drive.is_shut_down() {
            frame.flags |= flag::SHUT_DOWN;
        }
        Ok(listener.send(&frame, self.peer)?)
    }

    /// The report to the client of a rig in real time.
    pub fn report(&self) -> Frame {
        let none = Punctuality::default();
        let all = self.clock.as_ref().map_or(&none, |clock| &clock.punctuality);
        let timing = Timing {
            samples: self.at,
            missed: all.missed,
            worst: all.worst,
            held: self.counters.held,
            quantiles: [0.99, 0.9999].map(|share| all.quantile(share)),
        };
        timing.write(self.welcome.session)
    }

    /// Ends the ramp of a rig in lock-step, and reports.
    pub fn finish(mut self) -> Session {
        let samples = self.at;
        if let Served::Rig(rig) = &mut self.served {
            while !self.drive.is_down() {
                // An error of the rig changes nothing now: the session ends.
                let _ = self.drive.apply(rig.as_mut(), self.service.sample_time);
            }
        }
        let began = self.clock.as_ref().map_or(self.opened, |clock| clock.due(0));
        Session {
            peer: self.peer,
            ended: self.ended.unwrap_or(Ended::Stopped),
            samples,
            sample_time: self.service.sample_time,
            seconds: began.elapsed().as_secs_f64(),
            punctuality: self.clock.map(|clock| clock.punctuality),
            counters: self.real_time.then_some(self.counters),
        }
    }
}
