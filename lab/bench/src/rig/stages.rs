//! Stages of a rig: the sensors of a definition of resonance, no ground truth, a stop on a flag.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use lovines::Parameters;
use thiserror::Error;
use vines_model::{Definition, Measurand, Reference};

use super::reference_control::ReferenceControl;
use super::{Drive, GroundTruth, Rig, RigError, RigStage, Sensors};
use vines_scene::knowledge::{Knowledge, Target};

/// A rig whose response and reference are displacements, with the sensors of a definition of resonance.
///
/// Velocities and accelerations are differences of displacements: an accelerometer that averages over two sample periods with the weights of a
/// triangle, which keep the instants of the walls' impulses. The force `k e + c e'` takes e' from a difference of e, and is read as the amplitude of
/// the base that makes it at omega0. All belong to the sample before; then response and reference are both read one sample late. So does the
/// acceleration by which the mass before a force cell is compensated.
#[derive(Debug, Clone)]
pub struct Measured<R> {
    rig: R,
    definition: Definition,
    /// c/k, s, and omega0, rad/s.
    plant: [f64; 2],
    now: Sensors,
    /// The readings before, the latest first, each with the time to the next one, s.
    before: [(Sensors, f64); 2],
    /// Mass that is compensated behind a force cell, kg; 0 without one.
    compensated: f64,
    /// Displacements of the cell, m: now and before.
    cell: [f64; 3],
}

impl<R: Rig> Measured<R> {
    /// The rig `rig` with the parameters `plant` and the sensors of `definition`. Its force cell reads less than the force by the mass `compensated`, kg,
    /// times the acceleration there.
    pub fn new(rig: R, definition: Definition, plant: &Parameters, compensated: f64) -> Self {
        Self {
            rig,
            definition,
            plant: [plant.damping / plant.stiffness, plant.natural_frequency()],
            now: Sensors::default(),
            before: [(Sensors::default(), 0.0); 2],
            compensated,
            cell: [0.0; 3],
        }
    }
}

/// The derivative of three values, `late` and `early` seconds apart, at the middle one; exact for a sine of the frequency `omega`, rad/s.
pub(crate) fn derivative(of: Measurand, [first, middle, now]: [f64; 3], [early, late]: [f64; 2], omega: f64) -> f64 {
    let step = 0.5 * (early + late);
    match of {
        Measurand::Displacement => middle,
        Measurand::Velocity => (now - first) * 0.5 * omega / (omega * step).sin(),
        Measurand::Acceleration => {
            let sine = (0.5 * omega * step).sin();
            let gain = omega * omega * step / (4.0 * sine * sine);
            ((now - middle) / late - (middle - first) / early) * gain
        }
    }
}

impl<R: Rig> RigStage for Measured<R> {
    fn inner(&mut self) -> &mut dyn Rig {
        &mut self.rig
    }

    fn sense(&mut self) -> Result<Sensors, RigError> {
        self.now = self.rig.sense()?;
        if self.compensated > 0.0 {
            self.cell[0] = self.rig.cell_displacement()?;
        }
        if !(self.definition.is_late() || self.compensated > 0.0) {
            return Ok(self.now);
        }
        let [(middle, late), (first, early)] = self.before;
        let measurands = self.definition.measurands();
        let [leading, omega0] = self.plant;
        if early == 0.0 {
            // Nothing moves before the first drive.
            let of = |measurand, value| {
                if measurand == Measurand::Displacement {
                    value
                } else {
                    0.0
                }
            };
            return Ok(Sensors {
                response: of(measurands[0], middle.response),
                reference: middle.reference.map(|value| of(measurands[1], value)),
            });
        }
        let read = |channel: usize, three| derivative(measurands[channel], three, [early, late], omega0);
        // As the base that makes it.
        let per_base = self.definition.reference.per_base(leading * omega0);
        let force = |[first, middle, now]: [f64; 3]| (middle + leading * (now - first) / (late + early)) / per_base;
        let of_base = |three| match self.definition.reference {
            Reference::Base => read(1, three),
            Reference::Force => force(three),
        };
        let base = first.reference.zip(middle.reference).zip(self.now.reference);
        let without_inertia = |force: f64| {
            let [now, middle, first] = self.cell;
            let acceleration = derivative(Measurand::Acceleration, [first, middle, now], [early, late], omega0);
            self.compensated.mul_add(-acceleration, force)
        };
        Ok(Sensors {
            response: read(0, [first.response, middle.response, self.now.response]),
            reference: base.map(|((first, middle), now)| without_inertia(of_base([first, middle, now]))),
        })
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        self.before = [(self.now, step), self.before[0]];
        self.cell = [self.cell[0], self.cell[0], self.cell[1]];
        self.rig.advance(drive, step)
    }
}

// What the bench makes of the readings of a rig.

/// A rig in metres of the oscillator, as [`Target::scaled`] and [`Target::command`] say, whose shaker, if there is one, is commanded so that it drives as
/// asked. Nearer to the rig all channels have their own units.
pub struct Scaled<'a, R: ?Sized> {
    rig: &'a mut R,
    target: Target,
    control: Option<ReferenceControl>,
    /// The last readings of response and reference.
    readings: [f64; 2],
}

impl<'a, R: Rig + ?Sized> Scaled<'a, R> {
    /// The rig `rig` with the channels of `target`. What it is driven with is the command.
    pub fn new(rig: &'a mut R, target: Target) -> Self {
        Self { rig, target, control: None, readings: [0.0; 2] }
    }

    /// The rig `rig`, which is driven with the reference, as far as `knowledge` says what its shaker makes of a command. Its readings are late by
    /// `delay` seconds.
    pub fn controlled(rig: &'a mut R, knowledge: &Knowledge, delay: f64) -> Self {
        let control = ReferenceControl::new(knowledge, delay);
        Self { control, ..Self::new(rig, knowledge.target) }
    }

    /// Samples so far with the command of a shaker at the limit of its amplifier; `None` without a shaker.
    pub fn clipped(&self) -> Option<usize> {
        self.control.as_ref().map(|control| control.clipped)
    }

    /// Amplitude of the last command of a shaker, V; `None` without a shaker.
    pub fn shaker_command(&self) -> Option<f64> {
        let control = self.control.as_ref()?;
        Some(self.target.units.command.of_metres(control.amplitude()))
    }
}

impl<R: Rig + ?Sized> Rig for Scaled<'_, R> {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        let sensors = self.target.scaled(self.rig.sense()?);
        self.readings = [sensors.response, sensors.reference.unwrap_or(0.0)];
        Ok(sensors)
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        let drive = match &mut self.control {
            Some(control) => control.command(self.readings, drive, step)?,
            None => drive,
        };
        self.rig.advance(self.target.command(drive), step)
    }

    fn ground_truth(&mut self) -> Result<Option<GroundTruth>, RigError> {
        self.rig.ground_truth()
    }
}

// A rig that shows its sensors only, as a real one does.

/// A rig without its ground truth.
pub struct SensorsOnly(pub Box<dyn Rig>);

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
            // A zero that the rig has not answered may not have arrived.
            self.rig.sense()?;
            return Err(RigError::Failed(Interrupted.into()));
        }
        Ok(sensors)
    }
}
