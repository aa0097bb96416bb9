//! A rig that is served to the network: in real time, or in lock-step with the drives that arrive.

use std::net::SocketAddr;
use std::time::{Duration, Instant};

use super::error::LinkError;
use super::frame::{Frame, Kind, flag};
use super::host::{Event, Host, Offer};
use super::order::Arrival;
use super::pace::Pace;
use super::payload::{Reading, read_command, write_reading};
use super::report::{Ended, Session};
use super::watch::Watch;
use vines_testbench::rig::{Drive, Rig, RigError};

/// How often a server without a clock looks whether it shall stop.
const IDLE: Duration = Duration::from_millis(50);
/// How long a client may take from its hello to the first drive.
const FIRST_DRIVE: Duration = Duration::from_secs(5);

/// How a rig is served.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RigService {
    /// Time from sample to sample, s.
    pub sample_time: f64,
    /// In real time; else in lock-step: the rig advances when a drive arrives.
    pub paced: bool,
    /// Longest silence before the drive is shut down, s.
    pub silence: f64,
    /// Largest drive amplitude that is taken, m. A greater one is refused, and the last good drive held.
    pub max_amplitude: f64,
}

/// A socket that serves a rig, one session at a time.
pub struct RigServer {
    host: Host,
    service: RigService,
}

/// The rig of a session.
struct Run {
    rig: Box<dyn Rig>,
    /// Number of the last sample.
    at: u64,
    /// Number of the newest drive.
    newest: Option<u64>,
    watch: Watch,
    pace: Option<Pace>,
    /// When the first drive came.
    began: Option<Instant>,
    /// When the silence was last added up.
    checked: Instant,
    ending: Option<Ended>,
}

impl RigServer {
    /// Listens on `address`; port 0 takes a free one.
    ///
    /// # Errors
    /// An address that cannot be had.
    pub fn listen(address: SocketAddr, service: RigService) -> Result<Self, LinkError> {
        let offer = Offer {
            controller: false,
            paced: service.paced,
            sample_time: service.sample_time,
            silence: service.silence,
        };
        Ok(Self {
            host: Host::listen(address, offer)?,
            service,
        })
    }

    /// Where clients reach the rig.
    ///
    /// # Errors
    /// The system's.
    pub fn address(&self) -> Result<SocketAddr, LinkError> {
        self.host.address()
    }

    /// Serves sessions until `stop` says so: each with a rig of its own from `make`, each told to `tell` at its end.
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
            match self.host.next(self.deadline(run.as_ref()))? {
                Event::Opened => {
                    let fresh = run.insert(Run::new(make()?, self.service.silence));
                    self.tell_reading(fresh)?;
                }
                Event::Again => self.host.send_again()?,
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

    /// Takes a drive; in lock-step, the rig advances by it.
    fn drive(&mut self, run: &mut Run, frame: &Frame, arrival: Arrival) -> Result<(), RigError> {
        match arrival {
            Arrival::Late => return Ok(()),
            Arrival::Repeated if run.pace.is_none() => return Ok(self.host.send_again()?),
            Arrival::Repeated => return Ok(()),
            Arrival::New { .. } => {}
        }
        let Some(drive) = self.usable(frame) else {
            self.host.counters.malformed += 1;
            return Ok(());
        };
        run.watch.heard();
        run.watch.take(drive);
        run.checked = Instant::now();
        run.newest = Some(frame.sequence);
        if run.began.is_none() {
            run.began = Some(Instant::now());
            run.pace = self
                .service
                .paced
                .then(|| Pace::start(self.service.sample_time));
        }
        if run.pace.is_none() {
            return self.advance(run);
        }
        self.host.counters.late += u64::from(frame.sequence < run.at);
        Ok(())
    }

    /// The drive in a frame, if a rig may be given it.
    fn usable(&self, frame: &Frame) -> Option<Drive> {
        let drive = read_command(frame)?.drive;
        let nyquist = std::f64::consts::PI / self.service.sample_time;
        let largest = self.service.max_amplitude;
        (drive.omega <= nyquist
            && drive.amplitude <= largest
            && drive.displacement.abs() <= largest)
            .then_some(drive)
    }

    /// The deadline has passed: a sample is due, or somebody is silent.
    fn pass(&mut self, run: Option<&mut Run>) -> Result<(), RigError> {
        let Some(run) = run else {
            return Ok(());
        };
        if let Some(pace) = &mut run.pace {
            pace.serve(run.at + 1);
            if run.newest != Some(run.at) && !run.watch.is_latched() {
                self.host.counters.held += 1;
                run.watch.silent(self.service.sample_time);
            }
            return self.advance(run);
        }
        if run.began.is_some() {
            run.watch.silent(run.checked.elapsed().as_secs_f64());
            run.checked = Instant::now();
        } else if self.host.silence() > FIRST_DRIVE {
            run.watch.latch();
        }
        Ok(())
    }

    fn advance(&mut self, run: &mut Run) -> Result<(), RigError> {
        run.rig
            .advance(run.watch.drive(), self.service.sample_time)?;
        run.at += 1;
        self.tell_reading(run)
    }

    fn tell_reading(&mut self, run: &mut Run) -> Result<(), RigError> {
        self.host.horizon = run.at;
        let reading = Reading {
            sensors: run.rig.sense()?,
            witness: run.rig.witness()?,
        };
        let mut frame = write_reading(self.host.answer(Kind::Sensors, run.at), &reading);
        if run.watch.is_latched() {
            frame.flags |= flag::SHUT_DOWN;
        }
        Ok(self.host.send(frame)?)
    }

    /// The answer to a client whose session is over.
    fn tell_shut_down(&mut self) -> Result<(), LinkError> {
        let mut frame = self.host.answer(Kind::Sensors, self.host.horizon);
        frame.flags |= flag::SHUT_DOWN;
        self.host.send(frame)
    }

    /// Takes the drive away for good. A clock runs on until the drive is down; without one that is now.
    fn end(&mut self, run: Option<&mut Run>, ended: Ended) {
        if let Some(run) = run {
            run.watch.latch();
            run.ending.get_or_insert(ended);
        }
    }

    fn finish(&mut self, run: Option<Run>, ended: Ended, tell: &mut impl FnMut(&Session)) {
        let (Some(mut run), Some(peer)) = (run, self.host.peer()) else {
            return;
        };
        while run.pace.is_none() && !run.watch.is_down() {
            // A rig that fails now is going down anyway.
            let _ = run.rig.advance(run.watch.drive(), self.service.sample_time);
        }
        let counters = if ended == Ended::Silence {
            self.host.release()
        } else {
            self.host.close()
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
            watch: Watch::new(silence),
            pace: None,
            began: None,
            checked: Instant::now(),
            ending: None,
        }
    }

    /// How the session ended, once its drive is down.
    fn is_over(&self) -> Option<Ended> {
        let down = self.watch.is_down() || (self.pace.is_none() && self.watch.is_latched());
        down.then(|| self.ending.unwrap_or(Ended::Silence))
    }
}
