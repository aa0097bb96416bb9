//! The server of a rig: in real time, or in lock-step with the drives.

use std::net::SocketAddr;
use std::time::{Duration, Instant};

use super::error::LinkError;
use super::frame::{Frame, Kind, flag};
use super::payload::{Reading, read_command, write_reading};
use super::real_time_clock::RealTimeClock;
use super::report::{Ended, Session};
use super::sequence_window::Arrival;
use super::server_session::{Event, Offer, ServerSession};
use super::watchdog::Watchdog;
use vines_testbench::rig::{Drive, Rig, RigError};

/// Interval at which a server in lock-step checks whether it should stop.
const IDLE: Duration = Duration::from_millis(50);
/// Longest time from Hello to the first drive.
const FIRST_DRIVE: Duration = Duration::from_secs(5);

/// Settings of the server.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RigService {
    /// Sample time, s.
    pub sample_time: f64,
    /// Whether the rig runs in real time; otherwise it advances when a drive arrives (lock-step).
    pub paced: bool,
    /// Longest silence before the drive is shut down, s.
    pub silence: f64,
    /// Largest drive amplitude, m. A drive above it is refused, and the last valid drive is held.
    pub max_amplitude: f64,
}

/// A server of a rig, one session at a time.
pub struct RigServer {
    session: ServerSession,
    service: RigService,
}

/// The rig of a session.
struct Run {
    rig: Box<dyn Rig>,
    /// Number of the last sample.
    at: u64,
    /// Number of the newest drive.
    newest: Option<u64>,
    watchdog: Watchdog,
    pace: Option<RealTimeClock>,
    /// Time of the first drive.
    began: Option<Instant>,
    /// Time up to which the watchdog has counted the silence.
    checked: Instant,
    ending: Option<Ended>,
}

impl RigServer {
    /// Listens on `address`; with port 0 the system chooses a free port.
    ///
    /// # Errors
    /// An address that is not available.
    pub fn listen(address: SocketAddr, service: RigService) -> Result<Self, LinkError> {
        let offer = Offer {
            controller: false,
            paced: service.paced,
            sample_time: service.sample_time,
            silence: service.silence,
        };
        Ok(Self { session: ServerSession::listen(address, offer)?, service })
    }

    /// Address of the server.
    ///
    /// # Errors
    /// The system's.
    pub fn address(&self) -> Result<SocketAddr, LinkError> {
        self.session.address()
    }

    /// Serves sessions until `stop` returns true. `make` creates the rig of a session; `tell` receives its report.
    ///
    /// # Errors
    /// A rig that fails, or the network.
    pub fn serve(
        &mut self,
        mut make: impl FnMut() -> Result<Box<dyn Rig>, RigError>,
        mut stop: impl FnMut() -> bool,
        mut tell: impl FnMut(&Session),
    ) -> Result<(), RigError> {
        let mut run: Option<Run> = None;
        loop {
            match self.session.next(self.deadline(run.as_ref()))? {
                Event::Opened => {
                    let fresh = run.insert(Run::new(make()?, self.service.silence));
                    self.tell_reading(fresh)?;
                }
                Event::Again => self.session.send_again()?,
                Event::Frame(frame, arrival) => match &mut run {
                    Some(run) => self.drive(run, &frame, arrival)?,
                    None => self.tell_shut_down()?,
                },
                Event::Farewell => self.end(run.as_mut(), Ended::Farewell),
                Event::Nothing => self.pass(run.as_mut())?,
            }
            if stop() {
                self.end(run.as_mut(), Ended::Stopped);
            }
            if let Some(ended) = run.as_ref().and_then(Run::is_over) {
                let over = run.take();
                self.finish(over, ended, &mut tell);
            }
            if run.is_none() && stop() {
                return Ok(());
            }
        }
    }

    fn deadline(&self, run: Option<&Run>) -> Instant {
        let due = run.and_then(|run| Some(run.pace?.due(run.at + 1)));
        due.unwrap_or_else(|| Instant::now() + IDLE)
    }

    /// Processes a drive. In lock-step, the rig advances with it.
    fn drive(&mut self, run: &mut Run, frame: &Frame, arrival: Arrival) -> Result<(), RigError> {
        match arrival {
            Arrival::Late => return Ok(()),
            Arrival::Repeated if run.pace.is_none() => return Ok(self.session.send_again()?),
            Arrival::Repeated => return Ok(()),
            Arrival::New { .. } => {}
        }
        let Some(drive) = self.usable(frame) else {
            self.session.counters.malformed += 1;
            return Ok(());
        };
        run.watchdog.heard();
        run.watchdog.take(drive);
        run.checked = Instant::now();
        run.newest = Some(frame.sequence);
        if run.began.is_none() {
            run.began = Some(Instant::now());
            run.pace = self
                .service
                .paced
                .then(|| RealTimeClock::start(self.service.sample_time));
        }
        if run.pace.is_none() {
            return self.advance(run);
        }
        self.session.counters.late += u64::from(frame.sequence < run.at);
        Ok(())
    }

    /// The drive in a frame, if it is valid and within the limits.
    fn usable(&self, frame: &Frame) -> Option<Drive> {
        let drive = read_command(frame)?.drive;
        let nyquist = std::f64::consts::PI / self.service.sample_time;
        let largest = self.service.max_amplitude;
        (drive.omega <= nyquist && drive.amplitude <= largest && drive.displacement.abs() <= largest).then_some(drive)
    }

    /// The deadline has passed: a sample is due, or the client is silent.
    fn pass(&mut self, run: Option<&mut Run>) -> Result<(), RigError> {
        let Some(run) = run else {
            return Ok(());
        };
        if let Some(pace) = &mut run.pace {
            pace.serve(run.at + 1);
            if run.newest != Some(run.at) && !run.watchdog.is_latched() {
                self.session.counters.held += 1;
                run.watchdog.silent(self.service.sample_time);
            }
            return self.advance(run);
        }
        if run.began.is_some() {
            run.watchdog.silent(run.checked.elapsed().as_secs_f64());
            run.checked = Instant::now();
        } else if self.session.silence() > FIRST_DRIVE {
            run.watchdog.latch();
        }
        Ok(())
    }

    fn advance(&mut self, run: &mut Run) -> Result<(), RigError> {
        run.rig.advance(run.watchdog.drive(), self.service.sample_time)?;
        run.at += 1;
        self.tell_reading(run)
    }

    fn tell_reading(&mut self, run: &mut Run) -> Result<(), RigError> {
        self.session.horizon = run.at;
        let reading = Reading {
            sensors: run.rig.sense()?,
            ground_truth: run.rig.ground_truth()?,
        };
        let mut frame = write_reading(self.session.answer(Kind::Sensors, run.at), &reading);
        if run.watchdog.is_latched() {
            frame.flags |= flag::SHUT_DOWN;
        }
        Ok(self.session.send(frame)?)
    }

    /// Answers a client whose session has ended.
    fn tell_shut_down(&mut self) -> Result<(), LinkError> {
        let mut frame = self.session.answer(Kind::Sensors, self.session.horizon);
        frame.flags |= flag::SHUT_DOWN;
        self.session.send(frame)
    }

    /// Shuts the drive down. In real time the clock continues until the drive is zero; in lock-step the ramp follows at once.
    fn end(&mut self, run: Option<&mut Run>, ended: Ended) {
        if let Some(run) = run {
            run.watchdog.latch();
            run.ending.get_or_insert(ended);
        }
    }

    fn finish(&mut self, run: Option<Run>, ended: Ended, tell: &mut impl FnMut(&Session)) {
        let (Some(mut run), Some(peer)) = (run, self.session.peer()) else {
            return;
        };
        while run.pace.is_none() && !run.watchdog.is_down() {
            // An error of the rig changes nothing now: the session ends.
            let _ = run.rig.advance(run.watchdog.drive(), self.service.sample_time);
        }
        let counters = if ended == Ended::Silence {
            self.session.release()
        } else {
            self.session.close()
        };
        tell(&Session {
            peer,
            ended,
            samples: run.at,
            sample_time: self.service.sample_time,
            seconds: run.began.map_or(0.0, |began| began.elapsed().as_secs_f64()),
            punctuality: run.pace.map(|pace| pace.punctuality),
            counters,
        });
    }
}

impl Run {
    fn new(rig: Box<dyn Rig>, silence: f64) -> Self {
        Self {
            rig,
            at: 0,
            newest: None,
            watchdog: Watchdog::new(silence),
            pace: None,
            began: None,
            checked: Instant::now(),
            ending: None,
        }
    }

    /// The end of the session, after the drive has reached zero.
    fn is_over(&self) -> Option<Ended> {
        let down = self.watchdog.is_down() || (self.pace.is_none() && self.watchdog.is_latched());
        down.then(|| self.ending.unwrap_or(Ended::Silence))
    }
}
