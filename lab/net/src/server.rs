//! The server: accepts one client at a time, for a rig or a controller.

use std::io;
use std::net::SocketAddr;
use std::time::{Duration, Instant};

use super::address::Address;
use super::error::{LinkError, ServerError};
use super::frame::{Frame, FrameError, Kind, VERSION, flag};
use super::handshake::{Refusal, Service};
use super::link::{Listener, Received};
use super::report::{Ended, Session};
use super::run::{Run, Served};
use super::seal::Key;

/// Interval at which a server without a running clock checks whether it should stop.
const IDLE: Duration = Duration::from_millis(50);
/// Largest number of frames that are read after the deadline has passed: a flood of them must not stop the clock.
const BURST: u32 = 256;

/// A server, one session at a time. Over UDP a rig runs in real time; over TCP it is in lock-step with the drives.
pub struct Server {
    listener: Listener,
    service: Service,
    /// The client of the last session, and the report on it.
    last: Option<(SocketAddr, Frame)>,
}

impl Server {
    /// Listens on `address`; with port 0 the system chooses a free port. With a key, only for clients that have it.
    pub fn listen(address: Address, service: Service, key: Option<Key>) -> Result<Self, LinkError> {
        let listener = Listener::bind(address, key).map_err(|source| LinkError::Listen { address, source })?;
        Ok(Self { listener, service, last: None })
    }

    /// Address of the server.
    pub fn address(&self) -> io::Result<Address> {
        self.listener.address()
    }

    /// Serves sessions until `stop` returns true. `make` creates the rig, or the controller, of a session;
    /// `tell` receives its report.
    pub fn serve(
        &mut self,
        mut make: impl FnMut() -> Result<Served, ServerError>,
        mut stop: impl FnMut() -> bool,
        mut tell: impl FnMut(&Session),
    ) -> Result<(), ServerError> {
        let mut run: Option<Run> = None;
        let mut burst = 0;
        loop {
            let (due, idle) = (run.as_ref().and_then(Run::due), Instant::now() + IDLE);
            let deadline = due.map_or(idle, |due| due.min(idle));
            let received = if burst < BURST {
                self.listener.receive(deadline)?
            } else {
                None
            };
            burst = if received.is_some() {
                burst + u32::from(Instant::now() >= deadline)
            } else {
                0
            };
            match (received, &mut run) {
                (Some((Ok(frame), from)), None) if frame.kind == Kind::Hello => {
                    run = self.open(&frame, from, &mut make)?
                }
                (Some((received, from)), run) => self.sort(run.as_mut(), received, from)?,
                (None, Some(run)) if due.is_some_and(|due| Instant::now() >= due) => run.pass(&mut self.listener)?,
                (None, _) => {}
            }
            let stopped = stop();
            if let Some(run) = run.as_mut().filter(|_| stopped) {
                run.end(Ended::Stopped);
            }
            if let Some(over) = run.take_if(|run| run.is_over()) {
                self.listener.close(over.peer);
                self.last = Some((over.peer, over.report()));
                tell(&over.finish());
            }
            if stopped && run.is_none() {
                return Ok(());
            }
        }
    }

    /// Answers Hello when there is no session.
    fn open(
        &mut self,
        hello: &Frame,
        from: SocketAddr,
        make: &mut impl FnMut() -> Result<Served, ServerError>,
    ) -> Result<Option<Run>, ServerError> {
        let mut welcome = match self.service.welcome(hello) {
            Ok(welcome) => welcome,
            Err(refusal) => {
                self.refuse(refusal, hello, from)?;
                return Ok(None);
            }
        };
        self.listener.prefer(from);
        let drawn = self.listener.seal.draw().map_err(io::Error::other)?;
        welcome.values[3..5].copy_from_slice(&drawn);
        self.listener.seal.begin(hello.session, drawn);
        let real_time = self.listener.is_real_time();
        let mut run = Run::new(make()?, self.service, real_time, from, welcome);
        run.welcome(&mut self.listener)?;
        Ok(Some(run))
    }

    /// Handles a frame that does not open a session.
    fn sort(&mut self, run: Option<&mut Run>, received: Received, from: SocketAddr) -> Result<(), ServerError> {
        match (received, run) {
            (Err(FrameError::Closed), Some(run)) if run.peer == from => run.end(Ended::Farewell),
            (Err(FrameError::Closed), _) => {}
            (Err(error), run) => {
                let version = matches!(error, FrameError::Version(_));
                if let Some(run) = run {
                    run.counters.malformed += 1;
                    // Over TCP, the refusal closes the connection.
                    if version && run.peer == from && !self.listener.is_real_time() {
                        run.end(Ended::Refused);
                    }
                }
                if version {
                    self.refuse(Refusal::Version(VERSION), &Frame::new(Kind::Hello, 0), from)?;
                }
            }
            (Ok(frame), Some(run)) if run.is_client(from, frame.session) => run.handle(&frame, &mut self.listener)?,
            (Ok(frame), Some(run)) => {
                run.counters.foreign += 1;
                if frame.kind == Kind::Hello {
                    self.refuse(Refusal::Busy, &frame, from)?;
                }
                // Over TCP, nobody else may keep the server from its client.
                self.listener.close(from);
            }
            // The report was lost, and the session has ended in the meantime.
            (Ok(frame), None) if frame.kind == Kind::Farewell => {
                let report = self
                    .last
                    .filter(|(to, last)| (*to, last.session) == (from, frame.session));
                if let Some((to, report)) = report {
                    self.listener.send(&report, to)?;
                }
            }
            // The session of this client has ended.
            (Ok(frame), None) if frame.kind == Kind::Drive => {
                let mut answer = Frame { kind: Kind::Sensors, values: [0.0; 6], ..frame };
                answer.flags = flag::SHUT_DOWN;
                self.listener.send(&answer, from)?;
            }
            (Ok(_), None) => {}
        }
        Ok(())
    }

    fn refuse(&mut self, refusal: Refusal, cause: &Frame, to: SocketAddr) -> io::Result<()> {
        self.listener.send(&refusal.answer(cause), to)?;
        self.listener.close(to);
        Ok(())
    }
}
