//! A rig and a controller that fail at one sample.

use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::rc::Rc;

use crate::rig::{
    BuiltIn, Command, Controller, ControllerError, Drive, GroundTruth, LoopState, Move, NormalDistribution, Rig,
    RigError, Sensors,
};

/// A fault.
#[derive(Debug, Clone, Copy)]
pub enum Kind {
    /// No fault.
    None,
    /// The response sensor.
    Response(Sensor),
    /// The sensor of the base.
    Base(Sensor),
    /// Both sensors at once.
    Both(Sensor),
    /// Response and base are exchanged.
    Swapped,
    /// The drive that reaches the rig is this many times the one asked for.
    Shaker(f64),
    /// The natural frequency rises by a tenth.
    Structure,
    /// The rig's clock jumps forward by this many samples.
    Forward(usize),
    /// The rig is no longer heard. It still hears a drive.
    PeerLost,
    /// The controller ends with an error.
    ControllerLost,
    /// The controller asks for an amplitude that is not a number.
    ControllerNan,
    /// Something happens to the program.
    Call(fn()),
}

/// A failure of a sensor.
#[derive(Debug, Clone, Copy)]
pub enum Sensor {
    /// Reads zero.
    Dead,
    /// Reads the last value.
    Frozen,
    /// Reads the opposite sign.
    Reversed,
    /// Saturates at half the amplitude.
    Saturated,
    /// Reads the end of its range.
    Stuck,
    /// Reads this many times the value.
    Gain(f64),
    /// An offset of one amplitude is added.
    Offset,
    /// Noise with the RMS of the signal is added.
    Noisy,
    /// Reads zero for five of every ten samples.
    Loose,
    /// Reads this value.
    Value(f64),
    /// Reads the value of this many samples ago.
    Late(usize),
}

/// What happened since the fault began.
#[derive(Clone)]
pub struct Log(Rc<Record>);

struct Record {
    at: usize,
    sample_time: f64,
    /// Samples that the rig was advanced.
    taken: Cell<usize>,
    /// Whether the controller had switched off by then, and the amplitude of the drive, for each sample since the fault began.
    drives: RefCell<Vec<(bool, f64)>>,
    latched: Cell<bool>,
}

impl Log {
    pub fn new(at: usize, sample_time: f64) -> Self {
        Self(Rc::new(Record {
            at,
            sample_time,
            taken: Cell::new(0),
            drives: RefCell::default(),
            latched: Cell::new(false),
        }))
    }

    pub fn taken(&self) -> usize {
        self.0.taken.get()
    }

    pub fn has_begun(&self) -> bool {
        self.taken() >= self.0.at
    }

    fn drive(&self, amplitude: f64) {
        if self.has_begun() {
            self.0.drives.borrow_mut().push((self.0.latched.get(), amplitude));
        }
        self.0.taken.set(self.taken() + 1);
    }

    /// From the fault to its detection, and from then to a drive of zero, s; `None` if the last drive was not zero. A fault that the
    /// controller does not see is detected with the first drive of zero.
    pub fn times(&self) -> Option<(f64, f64)> {
        let drives = self.0.drives.borrow();
        let driven = drives.iter().rposition(|(_, amplitude)| *amplitude != 0.0);
        let zero = driven.map_or(0, |last| last + 1);
        if zero == drives.len() {
            return None;
        }
        let detected = drives
            .iter()
            .position(|(latched, _)| *latched)
            .unwrap_or(zero)
            .min(zero);
        let time = |samples: usize| samples as f64 * self.0.sample_time;
        Some((time(detected), time(zero - detected)))
    }
}

/// A rig that fails.
pub struct FaultyRig {
    rig: Box<dyn Rig>,
    /// The rig with a changed structure, under the same drive.
    changed: Box<dyn Rig>,
    kind: Kind,
    log: Log,
    /// End of the range of the sensors, m.
    range: f64,
    /// Healthy readings, the newest last.
    past: VecDeque<[f64; 2]>,
    normal: NormalDistribution,
}

/// Readings that are kept: more than a default period.
const KEPT: usize = 128;

impl FaultyRig {
    pub fn new(rig: Box<dyn Rig>, changed: Box<dyn Rig>, kind: Kind, log: &Log, half_width: f64) -> Self {
        Self {
            rig,
            changed,
            kind,
            log: log.clone(),
            range: 2.0 * half_width,
            past: VecDeque::new(),
            normal: NormalDistribution::new(1),
        }
    }

    /// The reading of a channel whose sensor fails.
    fn read(&mut self, channel: usize, sensor: Sensor, elapsed: usize) -> f64 {
        let kept = self.past.len();
        let ago = |samples: usize| self.past[kept.saturating_sub(1 + samples)][channel];
        let largest = self.past.iter().fold(0.0_f64, |most, one| most.max(one[channel].abs()));
        let value = ago(0);
        match sensor {
            Sensor::Dead => 0.0,
            Sensor::Frozen => ago(elapsed + 1),
            Sensor::Reversed => -value,
            Sensor::Saturated => value.clamp(-0.5 * largest, 0.5 * largest),
            Sensor::Stuck => self.range,
            Sensor::Gain(gain) => gain * value,
            Sensor::Offset => value + largest,
            Sensor::Noisy => value + largest * std::f64::consts::FRAC_1_SQRT_2 * self.normal.next(),
            Sensor::Loose if elapsed % 10 < 5 => 0.0,
            Sensor::Loose => value,
            Sensor::Value(value) => value,
            Sensor::Late(samples) => ago(samples),
        }
    }
}

impl Rig for FaultyRig {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        let begun = self.log.has_begun();
        let mut seen = match self.kind {
            Kind::Structure if begun => self.changed.sense()?,
            _ => self.rig.sense()?,
        };
        self.past.push_back([seen.response, seen.reference.unwrap_or(0.0)]);
        let elapsed = self.log.taken().saturating_sub(self.log.0.at);
        if self.past.len() > KEPT + elapsed {
            self.past.pop_front();
        }
        if !begun {
            return Ok(seen);
        }
        match self.kind {
            Kind::Response(sensor) => seen.response = self.read(0, sensor, elapsed),
            Kind::Base(sensor) => seen.reference = Some(self.read(1, sensor, elapsed)),
            Kind::Both(sensor) => {
                seen.response = self.read(0, sensor, elapsed);
                seen.reference = Some(self.read(1, sensor, elapsed));
            }
            Kind::Swapped => {
                let [response, base] = [0, 1].map(|channel| self.read(channel, Sensor::Gain(1.0), elapsed));
                (seen.response, seen.reference) = (base, Some(response));
            }
            Kind::PeerLost => return Err(RigError::Failed("the connection is lost".into())),
            Kind::Call(call) if elapsed == 0 => call(),
            _ => {}
        }
        Ok(seen)
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        let begun = self.log.has_begun();
        self.log.drive(drive.amplitude);
        self.changed.advance(drive, step)?;
        match self.kind {
            Kind::Forward(samples) if begun && self.log.taken() == self.log.0.at + 1 => {
                for _ in 0..samples {
                    self.rig.advance(drive, step)?;
                }
            }
            _ => {}
        }
        let gain = match self.kind {
            Kind::Shaker(gain) if begun => gain,
            _ => 1.0,
        };
        self.rig
            .advance(Drive { amplitude: gain * drive.amplitude, ..drive }, step)
    }

    fn hold(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        self.log.drive(drive.displacement);
        self.changed.hold(drive, step)?;
        self.rig.hold(drive, step)
    }

    fn ground_truth(&mut self) -> Result<Option<GroundTruth>, RigError> {
        self.rig.ground_truth()
    }
}

/// The built-in controller, which may fail.
pub struct FaultyController {
    controller: BuiltIn,
    kind: Kind,
    log: Log,
}

impl FaultyController {
    pub fn new(controller: BuiltIn, kind: Kind, log: &Log) -> Self {
        Self { controller, kind, log: log.clone() }
    }
}

impl Controller for FaultyController {
    fn sample(&mut self, sensors: Sensors, active: bool) -> Result<Command, ControllerError> {
        let mut command = self.controller.sample(sensors, active)?;
        if command.state.is_some_and(LoopState::is_latched) {
            self.log.0.latched.set(true);
        }
        match self.kind {
            Kind::ControllerLost if self.log.has_begun() => {
                return Err(ControllerError::Failed("the connection is lost".into()));
            }
            Kind::ControllerNan if self.log.has_begun() => command.drive.amplitude = f64::NAN,
            _ => {}
        }
        Ok(command)
    }

    fn hold_response(&mut self, to: Move, phase_target: f64) -> Result<(), ControllerError> {
        self.controller.hold_response(to, phase_target)
    }

    fn hold_drive(&mut self) -> Result<(), ControllerError> {
        self.controller.hold_drive()
    }
}
