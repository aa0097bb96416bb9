//! The server: one session at a time, for a rig or a controller.

use std::f64::consts::PI;
use std::io;
use std::net::SocketAddr;
use std::time::{Duration, Instant};

use crate::address::{Address, LinkError, ServerError};
use crate::frame::{
    Frame, FrameError, Kind, Reading, Refusal, VERSION, bit, flag, read_command, read_move, read_reading,
    write_command, write_failure, write_reading,
};
use crate::link::{Link, Received};
use crate::seal::Key;
use crate::timing::{Counters, Ended, RealTimeClock, Session, Timing};
use vines_rig::Definition;
use vines_rig::{Controller, Drive, Rig, RigError};

/// Largest relative difference of two sample times that count as equal: far above the rounding error of another program, and one sample in
/// 10⁹, which is two weeks at 882 samples a second.
const SAME_TIME: f64 = 1e-9;

/// What a server offers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Role {
    /// A controller.
    Controller,
    /// A rig.
    Rig {
        /// Largest drive amplitude, m. A drive above it is refused.
        max_amplitude: f64,
        /// What its sensors read.
        sensors: Definition,
    },
}

/// Settings of a server.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Service {
    /// What it offers.
    pub role: Role,
    /// Sample time, s.
    pub sample_time: f64,
    /// Longest silence of a client before its session is shut down, s.
    pub silence: f64,
}

impl Service {
    /// The answer to Hello.
    fn welcome(&self, hello: &Frame) -> Result<Frame, Refusal> {
        let (flags, channels) = match self.role {
            Role::Rig { sensors, .. } => (0, sensors.channels()),
            Role::Controller => (flag::CONTROLLER, 0),
        };
        if hello.flags & flag::CONTROLLER != flags {
            return Err(Refusal::Role);
        }
        let difference = (hello.values[0] / self.sample_time - 1.0).abs();
        if difference.is_nan() || difference > SAME_TIME {
            let (server, client) = (self.sample_time, hello.values[0]);
            return Err(Refusal::SampleTime { server, client });
        }
        let mut welcome = Frame { flags, ..Frame::new(Kind::Welcome, hello.session) };
        welcome.values[..3].copy_from_slice(&[self.sample_time, self.silence, channels.into()]);
        Ok(welcome)
    }

    /// The drive in a frame. What is not finite or above a limit must not reach a shaker.
    fn drive(&self, frame: &Frame) -> Result<Drive, Refusal> {
        let largest = match self.role {
            Role::Rig { max_amplitude, .. } => max_amplitude,
            Role::Controller => 0.0,
        };
        let Drive { omega, amplitude, displacement, .. } = read_command(frame).drive;
        let limits = [PI / self.sample_time, largest, largest];
        // The displacement has a sign.
        let sizes = [omega, amplitude, displacement.abs()];
        match (0..3).find(|&index| !(0.0..=limits[index]).contains(&sizes[index])) {
            Some(index) => Err(Refusal::Drive { index, value: frame.values[index], limit: limits[index] }),
            None => Ok(Drive {
                omega,
                amplitude,
                displacement,
                is_held: frame.has(flag::HOLD),
            }),
        }
    }
}

/// Interval at which a server without a running clock checks whether it should stop: Ctrl-C acts without a noticeable delay.
const IDLE: Duration = Duration::from_millis(50);
/// Largest number of frames that are read after the deadline has passed. Bounds the delay of a sample by a flood of frames.
const BURST: u32 = 256;

/// A server, one session at a time. Over UDP a rig runs in real time; over TCP it is in lock-step with the drives.
pub struct Server {
    link: Link,
    service: Service,
    /// The client of the last session, and the report on it.
    last: Option<(SocketAddr, Frame)>,
}

impl Server {
    /// Listens on `address`; with port 0 the system chooses a free port. With a key, only for clients that have it.
    pub fn listen(address: Address, service: Service, key: Option<Key>) -> Result<Self, LinkError> {
        let link = Link::bind(address, key).map_err(|source| LinkError::Listen { address, source })?;
        Ok(Self { link, service, last: None })
    }

    /// Address of the server.
    pub fn address(&self) -> io::Result<Address> {
        self.link.address()
    }

    /// Serves sessions until `stop` returns true. `make` creates the rig, or the controller, of a session;
    /// `report` receives the report on it.
    ///
    /// # Errors
    /// An error of the rig, of the controller or of the system. The client gets its message.
    pub fn serve(
        &mut self,
        mut make: impl FnMut() -> Result<Served, ServerError>,
        mut stop: impl FnMut() -> bool,
        mut report: impl FnMut(&Session),
    ) -> Result<(), ServerError> {
        let mut run: Option<Run> = None;
        let mut burst = 0;
        loop {
            let (due, idle) = (run.as_ref().and_then(Run::due), Instant::now() + IDLE);
            let deadline = due.map_or(idle, |due| due.min(idle));
            let may_read = burst < BURST;
            let received = if may_read { self.link.receive(deadline)? } else { None };
            let late = u32::from(Instant::now() >= deadline);
            burst = received.as_ref().map_or(0, |_| burst + late);
            let outcome = match (received, &mut run) {
                (Some((Ok(frame), from)), None) if frame.kind == Kind::Hello => {
                    self.open(&frame, from, &mut make, &mut run)
                }
                (Some((received, from)), run) => self.sort(run.as_mut(), received, from),
                (None, Some(run)) if due.is_some_and(|due| Instant::now() >= due) => run.pass(&mut self.link),
                (None, _) => Ok(()),
            };
            if let Err(error) = outcome {
                if let Some(run) = run {
                    report(&run.fail(&error, &mut self.link));
                }
                return Err(error);
            }
            let stopped = stop();
            if let Some(run) = run.as_mut().filter(|_| stopped) {
                run.end(Ended::Stopped);
            }
            if let Some(over) = run.take_if(|run| run.is_over()) {
                self.link.close(over.peer);
                self.last = Some((over.peer, over.report()));
                report(&over.finish());
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
        run: &mut Option<Run>,
    ) -> Result<(), ServerError> {
        let mut welcome = match self.service.welcome(hello) {
            Ok(welcome) => welcome,
            Err(refusal) => return Ok(self.refuse(refusal, hello, from)?),
        };
        let drawn = self.link.seal.draw().map_err(io::Error::other)?;
        welcome.values[3..5].copy_from_slice(&drawn);
        self.link.seal.begin(hello.session, drawn);
        let opened = Instant::now();
        let served = make().inspect_err(|error| {
            // Only in a session the message has a code.
            for frame in [vec![welcome], write_failure(welcome, &error.to_string())].concat() {
                // The error itself is returned.
                let _ = self.link.send(&frame, from);
            }
        })?;
        let run = run.insert(Run {
            served,
            service: self.service,
            real_time: self.link.is_real_time(),
            peer: from,
            welcome,
            opened,
            heard: opened,
            counters: Counters::default(),
            at: 0,
            newest: 0,
            drive: Ramp::default(),
            clock: None,
            ended: None,
        });
        run.welcome(&mut self.link)
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
                    if version && run.peer == from && !self.link.is_real_time() {
                        run.end(Ended::Refused);
                    }
                }
                if version {
                    self.refuse(Refusal::Version(VERSION), &Frame::new(Kind::Hello, 0), from)?;
                }
            }
            (Ok(frame), Some(run)) if (run.peer, run.welcome.session) == (from, frame.session) => {
                run.handle(&frame, &mut self.link)?;
            }
            (Ok(frame), Some(run)) => {
                run.counters.foreign += 1;
                if frame.kind == Kind::Hello {
                    self.refuse(Refusal::Busy, &frame, from)?;
                }
            }
            // The report was lost, and the session has ended in the meantime.
            (Ok(frame), None) if frame.kind == Kind::Farewell => {
                let is_its = |(to, last): &(_, Frame)| (*to, last.session) == (from, frame.session);
                if let Some((to, report)) = self.last.filter(is_its) {
                    self.link.send(&report, to)?;
                }
            }
            // The session of this client has ended.
            (Ok(frame), None) if frame.kind == Kind::Drive => {
                let mut answer = Frame { kind: Kind::Sensors, values: [0.0; 6], ..frame };
                answer.flags = flag::SHUT_DOWN;
                self.link.send(&answer, from)?;
                self.link.close(from);
            }
            // Over TCP, nobody without a session may keep the server from its clients.
            (Ok(_), None) => self.link.close(from),
        }
        Ok(())
    }

    fn refuse(&mut self, refusal: Refusal, cause: &Frame, to: SocketAddr) -> io::Result<()> {
        self.link.send(&refusal.answer(cause), to)?;
        self.link.close(to);
        Ok(())
    }
}

/// Longest time from Hello to the first drive of a rig in real time (protocol, "Security").
const FIRST_DRIVE: Duration = Duration::from_secs(5);

/// What a server offers in a session.
pub enum Served {
    /// A rig.
    Rig(Box<dyn Rig>),
    /// A controller.
    Controller(Box<dyn Controller>),
}

/// A session.
struct Run {
    served: Served,
    service: Service,
    real_time: bool,
    peer: SocketAddr,
    welcome: Frame,
    opened: Instant,
    /// Time of the last frame.
    heard: Instant,
    counters: Counters,
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
    /// When the next sample is due in real time, or the client has been silent for too long.
    fn due(&self) -> Option<Instant> {
        match &self.clock {
            Some(clock) => Some(clock.due(self.at + 1)),
            // A repeated Hello is not a sign of life: anyone can send a copy.
            None if self.real_time => Some(self.opened + FIRST_DRIVE),
            None => {
                let silence = Duration::try_from_secs_f64(self.service.silence).ok()?;
                self.heard.checked_add(silence)
            }
        }
    }

    /// Shuts the drive down. In real time the clock continues until the drive is zero.
    fn end(&mut self, ended: Ended) {
        self.drive.shut_down();
        self.ended.get_or_insert(ended);
    }

    fn is_over(&self) -> bool {
        self.ended.is_some() && (self.clock.is_none() || self.drive.is_down())
    }

    /// Sends Welcome, and the first reading of a rig.
    fn welcome(&mut self, link: &mut Link) -> Result<(), ServerError> {
        link.send(&self.welcome, self.peer)?;
        self.send_reading(link)
    }

    fn handle(&mut self, frame: &Frame, link: &mut Link) -> Result<(), ServerError> {
        self.heard = Instant::now();
        self.counters.received += 1;
        match frame.kind {
            _ if !self.real_time => match self.answer(frame, link) {
                Err(ServerError::Refused(refusal)) => {
                    let cause = Frame { sequence: self.at, ..*frame };
                    link.send(&refusal.answer(&cause), self.peer)?;
                    self.end(Ended::Refused);
                }
                outcome => outcome?,
            },
            Kind::Drive => self.take_drive(frame),
            Kind::Hello if self.clock.is_none() => self.welcome(link)?,
            Kind::Hello => {}
            Kind::Farewell => {
                self.end(Ended::Farewell);
                link.send(&self.report(), self.peer)?;
            }
            _ => self.counters.malformed += 1,
        }
        Ok(())
    }

    /// Answers a frame in lock-step.
    fn answer(&mut self, frame: &Frame, link: &mut Link) -> Result<(), ServerError> {
        match (&mut self.served, frame.kind) {
            _ if frame.sequence != self.at => Err(Refusal::Unexpected.into()),
            (Served::Controller(controller), Kind::Sensors) => {
                let command = controller.sample(read_reading(frame).sensors, frame.has(flag::ACTIVE))?;
                self.at += 1;
                Ok(link.send(&write_command(*frame, &command), self.peer)?)
            }
            (Served::Controller(controller), Kind::Move) => {
                let (to, phase_target) = read_move(frame);
                // No answer: the next drive follows from it.
                let held = match frame.has(flag::HOLD) {
                    true => controller.hold_drive(),
                    false => controller.hold_response(to, phase_target),
                };
                Ok(held.map_err(Refusal::from)?)
            }
            (Served::Rig(_), Kind::Drive) => {
                self.drive.set(self.service.drive(frame)?);
                self.advance(link)
            }
            _ => Err(Refusal::Unexpected.into()),
        }
    }

    /// Takes a drive in real time, if it is valid and newer than the last one.
    fn take_drive(&mut self, frame: &Frame) {
        let is_old = self.clock.is_some() && frame.sequence <= self.newest;
        let drive = self.service.drive(frame).ok().filter(|_| frame.sequence <= self.at);
        self.counters.late += u64::from(is_old || frame.sequence < self.at);
        self.counters.malformed += u64::from(drive.is_none());
        if let Some(drive) = drive.filter(|_| !is_old) {
            self.drive.set(drive);
            self.newest = frame.sequence;
            let start = || RealTimeClock::start(self.service.sample_time);
            self.clock.get_or_insert_with(start);
        }
    }

    /// The deadline has passed: a sample is due, or the client is silent.
    fn pass(&mut self, link: &mut Link) -> Result<(), ServerError> {
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
        self.advance(link)
    }

    /// Drives a rig for a sample, and sends the reading after it.
    fn advance(&mut self, link: &mut Link) -> Result<(), ServerError> {
        if let Served::Rig(rig) = &mut self.served {
            self.drive.apply(rig.as_mut(), self.service.sample_time)?;
            self.at += 1;
        }
        self.send_reading(link)
    }

    /// Sends the present reading of a rig.
    fn send_reading(&mut self, link: &mut Link) -> Result<(), ServerError> {
        let Served::Rig(rig) = &mut self.served else {
            return Ok(());
        };
        let reading = Reading { sensors: rig.sense()?, ground_truth: rig.ground_truth()? };
        let (sequence, time) = (self.at, self.at as f64 * self.service.sample_time);
        let mut frame = write_reading(Frame { sequence, time, ..self.welcome }, &reading);
        frame.flags |= bit(flag::SHUT_DOWN, self.drive.is_shut_down());
        Ok(link.send(&frame, self.peer)?)
    }

    /// Sends the client the message of an error, shuts the drive down, and reports.
    fn fail(mut self, error: &ServerError, link: &mut Link) -> Session {
        let (sequence, time) = (self.at, self.at as f64 * self.service.sample_time);
        let mut frames = write_failure(Frame { sequence, time, ..self.welcome }, &error.to_string());
        // The client of a rig in real time waits for it.
        frames.extend(self.real_time.then(|| self.report()));
        for frame in frames {
            // The error itself is returned.
            let _ = link.send(&frame, self.peer);
        }
        self.end(Ended::Failed);
        self.finish()
    }

    fn timing(&self) -> Option<Timing> {
        self.clock.as_ref().map(|clock| clock.timing(self.counters.held))
    }

    /// The report to the client of a rig in real time.
    fn report(&self) -> Frame {
        self.timing().unwrap_or_default().write(self.welcome.session)
    }

    /// Ends the ramp of a rig in lock-step, and reports.
    fn finish(mut self) -> Session {
        if let Served::Rig(rig) = &mut self.served {
            while !self.drive.is_down() {
                // An error of the rig changes nothing now: the session ends.
                let _ = self.drive.apply(rig.as_mut(), self.service.sample_time);
            }
        }
        let clock = self.clock.as_ref();
        Session {
            peer: self.peer,
            ended: self.ended.unwrap_or(Ended::Stopped),
            samples: self.at,
            sample_time: self.service.sample_time,
            seconds: clock.map_or_else(|| self.opened.elapsed().as_secs_f64(), RealTimeClock::seconds),
            timing: self.timing(),
            histogram: clock.map(RealTimeClock::classes).unwrap_or_default(),
            counters: self.real_time.then_some(self.counters),
        }
    }
}

/// Number of samples of the ramp to zero after a shutdown.
pub const RAMP_SAMPLES: u32 = 100;

/// A drive that can be shut down for the rest of a session.
#[derive(Debug, Clone, Copy, Default)]
struct Ramp {
    drive: Drive,
    /// The displacement before that of the drive, m, and whether the drive has arrived since the last sample.
    before: f64,
    is_new: bool,
    /// Remaining samples of the ramp after the shutdown.
    left: Option<u32>,
}

impl Ramp {
    /// Sets a new drive; without effect after the shutdown.
    fn set(&mut self, drive: Drive) {
        if self.left.is_none() {
            self.before = self.drive.displacement;
            (self.drive, self.is_new) = (drive, true);
        }
    }

    /// Drives the rig for the next sample period of `step` seconds.
    fn apply(&mut self, rig: &mut dyn Rig, step: f64) -> Result<(), RigError> {
        if self.drive.is_held && !self.is_new && self.left.is_none() {
            self.extrapolate(step);
        }
        self.is_new = false;
        rig.advance(self.next(), step)
    }

    /// Continues a sine of which the next displacement is late: a base that stops and jumps would be a disturbance of the structure.
    /// A drive without an amplitude is not known to be a sine.
    fn extrapolate(&mut self, step: f64) {
        let Drive { omega, amplitude, displacement, .. } = self.drive;
        if amplitude > 0.0 {
            let next = 2.0 * (omega * step).cos() * displacement - self.before;
            self.before = displacement;
            self.drive.displacement = next.clamp(-amplitude, amplitude);
        }
    }

    /// Shuts the drive down for the rest of the session.
    fn shut_down(&mut self) {
        self.left.get_or_insert(RAMP_SAMPLES);
    }

    /// Whether the drive has been shut down.
    fn is_shut_down(&self) -> bool {
        self.left.is_some()
    }

    /// Whether the drive has been shut down and is zero.
    fn is_down(&self) -> bool {
        self.left == Some(0)
    }

    /// The drive of the next sample period.
    fn next(&mut self) -> Drive {
        let Some(left) = &mut self.left else {
            return self.drive;
        };
        *left = left.saturating_sub(1);
        let share = f64::from(*left) / f64::from(RAMP_SAMPLES);
        self.drive.map(|value| share * value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    use vines_bench::rig::Sensors;

    /// A rig that shows the base displacement.
    #[derive(Default)]
    struct Base(f64);

    impl Rig for Base {
        fn sense(&mut self) -> Result<Sensors, RigError> {
            Ok(Sensors { response: self.0, reference: None })
        }

        fn advance(&mut self, drive: Drive, _: f64) -> Result<(), RigError> {
            assert!(drive.is_held);
            self.0 = drive.displacement;
            Ok(())
        }
    }

    #[test]
    fn a_base_of_held_samples_follows_its_sine_where_no_sample_arrives() {
        let (mut ramp, mut base) = (Ramp::default(), Base::default());
        let sample = |displacement| Drive { omega: 60.0, amplitude: 1e-4, displacement, is_held: true };
        for n in 0..140 {
            let displacement = 1e-4 * (0.06 * f64::from(n)).sin();
            if !(50..77).contains(&n) {
                ramp.set(sample(displacement));
            }
            ramp.apply(&mut base, 1e-3).unwrap();
            assert!((base.0 - displacement).abs() < 1e-12, "{n}");
        }
        // Samples that are not those of a sine: no displacement beyond the amplitude. Samples of an unknown motion are held.
        for displacement in [-1e-4, 1e-4] {
            ramp.set(sample(displacement));
        }
        for _ in 0..500 {
            ramp.apply(&mut base, 1e-3).unwrap();
            assert!(base.0.abs() <= 1e-4);
        }
        ramp.set(Drive { omega: 0.0, amplitude: 0.0, ..sample(5e-5) });
        (0..3).for_each(|_| ramp.apply(&mut base, 1e-3).unwrap());
        assert_eq!(base.0, 5e-5);
    }
}
