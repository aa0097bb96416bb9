//! The server of a controller: answers every reading with a drive.

use std::net::SocketAddr;
use std::time::{Duration, Instant};

use super::error::LinkError;
use super::frame::{Frame, Kind, flag};
use super::payload::{read_reading, write_command};
use super::report::{Ended, Session};
use super::sequence_window::Arrival;
use super::server_session::{Event, Offer, ServerSession};
use vines_testbench::rig::{Command, Controller, ControllerError, Sensors};

/// Interval at which the server checks whether it should stop.
const IDLE: Duration = Duration::from_millis(50);

/// Settings of the server.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ControllerService {
    /// Sample time, s.
    pub sample_time: f64,
    /// Longest silence before the session is shut down, s; also the longest gap in the readings.
    pub silence: f64,
}

/// A server of a controller, one session at a time.
pub struct ControllerServer {
    session: ServerSession,
    service: ControllerService,
}

/// The controller of a session.
struct Run {
    controller: Box<dyn Controller>,
    /// The last valid reading.
    sensors: Sensors,
    active: bool,
    /// Frequency of the last drive, rad/s.
    omega: f64,
    samples: u64,
    began: Instant,
    ending: Option<Ended>,
}

impl ControllerServer {
    /// Listens on `address`; with port 0 the system chooses a free port.
    ///
    /// # Errors
    /// An address that is not available.
    pub fn listen(address: SocketAddr, service: ControllerService) -> Result<Self, LinkError> {
        let offer = Offer {
            controller: true,
            paced: false,
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

    /// Serves sessions until `stop` returns true. `make` creates the controller of a session; `tell` receives its report.
    ///
    /// # Errors
    /// A controller that fails, or the network.
    pub fn serve(
        &mut self,
        mut make: impl FnMut() -> Result<Box<dyn Controller>, ControllerError>,
        mut stop: impl FnMut() -> bool,
        mut tell: impl FnMut(&Session),
    ) -> Result<(), ControllerError> {
        let mut run: Option<Run> = None;
        loop {
            match self.session.next(Instant::now() + IDLE)? {
                Event::Opened => run = Some(Run::new(make()?)),
                Event::Again => self.session.send_again()?,
                Event::Frame(frame, arrival) => match &mut run {
                    Some(run) => self.answer(run, &frame, arrival)?,
                    None => self.tell_shut_down(&frame, 0.0)?,
                },
                Event::Farewell => end(&mut run, Ended::Farewell),
                Event::Nothing => {}
            }
            if self.session.silence().as_secs_f64() > self.service.silence {
                end(&mut run, Ended::Silence);
            }
            if stop() {
                end(&mut run, Ended::Stopped);
            }
            if let Some(over) = run.take_if(|run| run.ending.is_some()) {
                self.finish(&over, &mut tell);
            }
            if stop() {
                return Ok(());
            }
        }
    }

    fn answer(&mut self, run: &mut Run, frame: &Frame, arrival: Arrival) -> Result<(), ControllerError> {
        let missing = match arrival {
            Arrival::New { missing } => missing,
            Arrival::Repeated => return Ok(self.session.send_again()?),
            Arrival::Late => return Ok(()),
        };
        if missing as f64 * self.service.sample_time > self.service.silence {
            run.ending = Some(Ended::Silence);
            return Ok(self.tell_shut_down(frame, run.omega)?);
        }
        // The controller counts time in samples, so it also gets one for every lost reading.
        for _ in 0..missing {
            self.session.counters.held += 1;
            run.sample()?;
        }
        run.sensors = read_reading(frame).sensors;
        run.active = frame.has(flag::ACTIVE);
        let command = run.sample()?;
        let answer = write_command(self.session.answer(Kind::Drive, frame.sequence), &command);
        Ok(self.session.send(answer)?)
    }

    /// Answers a client whose session has ended: no drive.
    fn tell_shut_down(&mut self, frame: &Frame, omega: f64) -> Result<(), LinkError> {
        let mut none = Command::default();
        none.drive.omega = omega;
        let mut answer = write_command(self.session.answer(Kind::Drive, frame.sequence), &none);
        answer.flags |= flag::SHUT_DOWN;
        self.session.send(answer)
    }

    fn finish(&mut self, run: &Run, tell: &mut impl FnMut(&Session)) {
        let (Some(ended), Some(peer)) = (run.ending, self.session.peer()) else {
            return;
        };
        let counters = if ended == Ended::Silence {
            self.session.release()
        } else {
            self.session.close()
        };
        tell(&Session {
            peer,
            ended,
            samples: run.samples,
            sample_time: self.service.sample_time,
            seconds: run.began.elapsed().as_secs_f64(),
            punctuality: None,
            counters,
        });
    }
}

impl Run {
    fn new(controller: Box<dyn Controller>) -> Self {
        Self {
            controller,
            sensors: Sensors::default(),
            active: false,
            omega: 0.0,
            samples: 0,
            began: Instant::now(),
            ending: None,
        }
    }

    fn sample(&mut self) -> Result<Command, ControllerError> {
        let command = self.controller.sample(self.sensors, self.active)?;
        self.samples += 1;
        self.omega = command.drive.omega;
        Ok(command)
    }
}

fn end(run: &mut Option<Run>, ended: Ended) {
    if let Some(run) = run {
        run.ending.get_or_insert(ended);
    }
}
