//! Stages of a rig: the sensors of a definition of resonance, no ground truth, a stop on a flag.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use lovines::Parameters;
use thiserror::Error;
use vines_model::{Definition, Reference, Sensor};

use super::{Drive, GroundTruth, Rig, RigError, RigStage, Sensors};

/// A rig whose response is a displacement and whose reference is the base, with the sensors of a definition of resonance.
///
/// An acceleration is the second difference of the displacement: an accelerometer that averages over two sample periods with the weights of
/// a triangle, which keep the instants of the walls' impulses. The force `k e + c e'` over k takes e' from a difference of e. Both
/// belong to the sample before; then response and reference are both read one sample late.
#[derive(Debug, Clone)]
pub struct Measured<R> {
    rig: R,
    definition: Definition,
    /// c/k, s, and omega0, rad/s.
    plant: [f64; 2],
    now: Sensors,
    /// The readings before, the latest first, each with the time to the next one, s.
    before: [(Sensors, f64); 2],
}

impl<R: Rig> Measured<R> {
    /// The rig `rig` with the parameters `plant` and the sensors of `definition`.
    pub fn new(rig: R, definition: Definition, plant: &Parameters) -> Self {
        Self {
            rig,
            definition,
            plant: [plant.damping / plant.stiffness, plant.natural_frequency()],
            now: Sensors::default(),
            before: [(Sensors::default(), 0.0); 2],
        }
    }

    /// Second difference over the displacement, times `step` (s): at omega0 exact for a sine.
    fn gain(&self, step: f64) -> f64 {
        let sine = (0.5 * self.plant[1] * step).sin();
        4.0 * sine * sine / step
    }

    fn step_begins(&mut self, step: f64) {
        self.before = [(self.now, step), self.before[0]];
    }
}

impl<R: Rig> RigStage for Measured<R> {
    fn inner(&mut self) -> &mut dyn Rig {
        &mut self.rig
    }

    fn sense(&mut self) -> Result<Sensors, RigError> {
        self.now = self.rig.sense()?;
        let [(middle, late), (first, early)] = self.before;
        if !self.definition.is_late() || early == 0.0 {
            return Ok(if self.definition.is_late() { middle } else { self.now });
        }
        let [leading, _] = self.plant;
        let rates = [
            (self.now.response - middle.response) / late,
            (middle.response - first.response) / early,
        ];
        let response = match self.definition.sensor {
            Sensor::V | Sensor::Q1 => middle.response,
            Sensor::Acceleration => (rates[1] - rates[0]) / self.gain(0.5 * (late + early)),
        };
        let force = |((now, middle), first): ((f64, f64), f64)| middle + leading * (now - first) / (late + early);
        let reference = match self.definition.reference {
            Reference::Base => middle.reference,
            Reference::Force => self.now.reference.zip(middle.reference).zip(first.reference).map(force),
        };
        Ok(Sensors { response, reference })
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        self.step_begins(step);
        self.rig.advance(drive, step)
    }

    fn hold(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        self.step_begins(step);
        self.rig.hold(drive, step)
    }
}

// A rig that shows its sensors only, as a real one does.

/// A rig without its ground truth.
pub struct SensorsOnly(Box<dyn Rig>);

impl SensorsOnly {
    /// Hides the ground truth of a rig.
    #[must_use]
    pub fn around(rig: Box<dyn Rig>) -> Self {
        Self(rig)
    }
}

impl RigStage for SensorsOnly {
    fn inner(&mut self) -> &mut dyn Rig {
        self.0.as_mut()
    }

    fn ground_truth(&mut self) -> Result<Option<GroundTruth>, RigError> {
        Ok(None)
    }
}

// A rig that stops on a flag, which a signal or another thread sets.

/// The flag was set.
#[derive(Debug, Error)]
#[error("interrupted by a signal; the drive is zero")]
pub struct Interrupted;

/// A rig that stops on a flag: it gets a zero drive, and its next reading is the error [`Interrupted`].
pub struct Stoppable {
    rig: Box<dyn Rig>,
    sample_time: f64,
    stop: Arc<AtomicBool>,
}

impl Stoppable {
    /// `sample_time` in s.
    pub fn around(rig: Box<dyn Rig>, sample_time: f64, stop: &Arc<AtomicBool>) -> Self {
        Self { rig, sample_time, stop: Arc::clone(stop) }
    }
}

impl RigStage for Stoppable {
    fn inner(&mut self) -> &mut dyn Rig {
        self.rig.as_mut()
    }

    fn sense(&mut self) -> Result<Sensors, RigError> {
        let sensors = self.rig.sense()?;
        if self.stop.load(Ordering::Relaxed) {
            self.rig.advance(Drive::default(), self.sample_time)?;
            return Err(RigError::Failed(Interrupted.into()));
        }
        Ok(sensors)
    }
}
