//! A controller that is served to the network: a drive for every reading that arrives.

use std::net::SocketAddr;
use std::time::{Duration, Instant};

use super::error::LinkError;
use super::frame::{Frame, Kind, flag};
use super::host::{Event, Host, Offer};
use super::order::Arrival;
use super::payload::{read_reading, write_command};
use super::report::{Ended, Session};
use vines_testbench::rig::{Command, Controller, ControllerError, Sensors};

/// How often the server looks whether it shall stop.
const IDLE: Duration = Duration::from_millis(50);

/// How a controller is served.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ControllerService {
    /// Time from sample to sample, s.
    pub sample_time: f64,
    /// Longest silence before the session is shut down, s; also the longest gap in the readings that is bridged.
    pub silence: f64,
}

/// A socket that serves a controller, one session at a time.
pub struct ControllerServer {
    host: Host,
    service: ControllerService,
}

/// The controller of a session.
struct Run {
    controller: Box<dyn Controller>,
    /// The last good reading.
    sensors: Sensors,
    active: bool,
    /// Frequency of the last drive, rad/s.
    omega: f64,
    samples: u64,
    began: Instant,
    ending: Option<Ended>,
}

impl ControllerServer {
    /// Listens on `address`; port 0 takes a free one.
    ///
    /// # Errors
    /// An address that cannot be had.
    pub fn listen(address: SocketAddr, service: ControllerService) -> Result<Self, LinkError> {
        let offer = Offer {
            controller: true,
            paced: false,
            sample_time: service.sample_time,
            silence: service.silence,
        };
        Ok(Self {
            host: Host::listen(address, offer)?,
            service,
        })
    }

    /// Where clients reach the controller.
    ///
    /// # Errors
    /// The system's.
    pub fn address(&self) -> Result<SocketAddr, LinkError> {
        self.host.address()
    }

    /// Serves sessions until `stop` says so: each with a controller of its own from `make`, each told to `tell` at its end.
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
            match self.host.next(Instant::now() + IDLE)? {
                Event::Opened => run = Some(Run::new(make()?)),
                Event::Again => self.host.send_again()?,
                Event::Frame(frame, arrival) => match &mut run {
                    Some(run) => self.answer(run, &frame, arrival)?,
                    None => self.tell_shut_down(&frame, 0.0)?,
                },
                Event::Farewell => end(&mut run, Ended::Farewell),
                Event::Nothing => {}
            }
            if self.host.silence().as_secs_f64() > self.service.silence {
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

    fn answer(
        &mut self,
        run: &mut Run,
        frame: &Frame,
        arrival: Arrival,
    ) -> Result<(), ControllerError> {
        let missing = match arrival {
            Arrival::New { missing } => missing,
            Arrival::Repeated => return Ok(self.host.send_again()?),
            Arrival::Late => return Ok(()),
        };
        if missing as f64 * self.service.sample_time > self.service.silence {
            run.ending = Some(Ended::Silence);
            return Ok(self.tell_shut_down(frame, run.omega)?);
        }
        // The controller counts time in samples: it gets one for every reading that was lost, too.
        for _ in 0..missing {
            self.host.counters.held += 1;
            run.sample()?;
        }
        run.sensors = read_reading(frame).sensors;
        run.active = frame.has(flag::ACTIVE);
        let command = run.sample()?;
        let answer = write_command(self.host.answer(Kind::Drive, frame.sequence), &command);
        Ok(self.host.send(answer)?)
    }

    /// The answer to a client whose session is over: no drive.
    fn tell_shut_down(&mut self, frame: &Frame, omega: f64) -> Result<(), LinkError> {
        let mut none = Command::default();
        none.drive.omega = omega;
        let mut answer = write_command(self.host.answer(Kind::Drive, frame.sequence), &none);
        answer.flags |= flag::SHUT_DOWN;
        self.host.send(answer)
    }

    fn finish(&mut self, run: &Run, tell: &mut impl FnMut(&Session)) {
        let (Some(ended), Some(peer)) = (run.ending, self.host.peer()) else {
            return;
        };
        let counters = if ended == Ended::Silence {
            self.host.release()
        } else {
            self.host.close()
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
