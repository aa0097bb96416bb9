//! Plant and controller, coupled sample by sample as `vines identify` couples them.

use std::f64::consts::{PI, TAU};

use lovines::{Event, Plant, Wall};
use phase_lock::Output;
use vines_bench::experiment::ExperimentError;
use vines_bench::live::{Decay, HarmonicMotion};
use vines_bench::rig::{BuiltIn, Controller, Drive, Rig, Sensors};
use vines_bench::scene::Scene;
use vines_model::regime::Regime;

use crate::message::Message;
use crate::rig::NoisyRig;
use crate::settings::{COUNT, Settings, changed, default_scene, index, settings_of};
use crate::tracking::{Tracking, track};

/// One sample of the record.
#[derive(Debug, Clone, Copy)]
pub struct Row {
    /// Time, s.
    pub time: f64,
    /// Displacement of the base, m, as its sensor reads it.
    pub base: f64,
    /// Response, m, as its sensor reads it.
    pub response: f64,
    /// Relative displacement of primary mass and particle, m.
    pub relative: f64,
    /// Output of the controller.
    pub output: Output,
    /// The drive from this sample on: the controller's, or that of the open loop.
    pub drive: Drive,
    /// Frequency of the drive, amplitude by the controller and present speed of the particle; along a free decay, those of the fit.
    pub motion: HarmonicMotion,
    /// Whether this is a free decay with two impacts per period, along the backbone.
    pub decays: bool,
}

/// The bench: rig, controller and clock.
pub struct Bench {
    /// The scene, with the settings applied.
    pub scene: Scene,
    /// The settings that it was made from.
    pub settings: Settings,
    /// The controller.
    pub controller: BuiltIn,
    /// Samples since the start.
    pub samples: u64,
    /// Whether the drive is requested.
    pub active: bool,
    /// Output of the controller at the last sample.
    pub output: Output,
    /// The motion at the last sample, as in [`Row`].
    pub motion: HarmonicMotion,
    /// The tracking of the backbone, while it runs, and the points of one that was ended.
    pub tracking: Option<Tracking>,
    decay: Decay,
    pub(crate) rig: NoisyRig,
    /// The plant at the last sample, and the drive from there on.
    before: (Plant, Drive),
}

impl Bench {
    /// The bench of the settings at its start.
    pub fn new(settings: Settings) -> Result<Self, Message> {
        let scene = changed(default_scene(), &settings);
        let plant = Plant::new(scene.plant, scene.start)?;
        let controller = BuiltIn::new(&scene.plan().lock)?;
        Ok(Self {
            samples: 0,
            active: true,
            output: controller.output,
            controller,
            motion: HarmonicMotion::default(),
            tracking: None,
            decay: Decay::default(),
            rig: NoisyRig::new(plant, settings[index::NOISE] * 0.01 * scene.plant.half_width),
            before: (plant, Drive::default()),
            settings,
            scene,
        })
    }

    /// The settings of the default scene.
    pub fn default_settings() -> [f64; COUNT] {
        settings_of(&default_scene())
    }

    /// Applies changed settings to the running bench. A change of a gap or of the mass ratio restarts it.
    ///
    /// # Errors
    /// The message for a value that is refused; then nothing changes.
    pub fn apply(&mut self, settings: Settings) -> Result<(), Message> {
        let differs = |one: usize| settings[one] != self.settings[one];
        if [index::GAP, index::GAP_DIFFERENCE, index::MASS_RATIO]
            .into_iter()
            .any(differs)
        {
            *self = Self::new(settings)?;
            return Ok(());
        }
        let scene = changed(default_scene(), &settings);
        let lock = scene.plan().lock.build()?;
        self.rig.plant.set_parameters(scene.plant)?;
        self.rig.noise = settings[index::NOISE] * 0.01 * scene.plant.half_width;
        self.tracking = None;
        (self.controller.lock, self.scene, self.settings) = (lock, scene, settings);
        Ok(())
    }

    /// Switches the drive. A tracking ends; its points up to now stay.
    pub fn drive(&mut self, on: bool) {
        self.active = on;
        if let Some(tracking) = &mut self.tracking {
            tracking.stop(self.samples);
        }
    }

    /// Tracks the backbone from here on.
    ///
    /// # Errors
    /// The message of a lab's error, such as no lock; then the bench runs on as before.
    pub fn track(&mut self) -> Result<(), Message> {
        let lock = self.scene.plan().tracking.build()?;
        let controller = BuiltIn { lock, ..self.controller.clone() };
        self.tracking = Some(track(&self.scene, &self.rig, controller.clone(), self.samples)?);
        self.controller = controller;
        self.active = true;
        Ok(())
    }

    /// Takes `samples` samples and hands the rows of the record to `on_row`.
    pub fn run(&mut self, samples: usize, mut on_row: impl FnMut(&Row)) -> Result<(), Message> {
        for left in (0..samples).rev() {
            // Only the last sample can be looked into. A plant is large, and WebAssembly copies the output in a call, too.
            on_row(&self.sample(left == 0)?);
        }
        Ok(())
    }

    /// One sample: sensors, controller, drive. Returns the row of the record.
    ///
    /// This is a sample of `ControlLoop`, without its record, its judgement of the lock and its end after a fault: the page keeps
    /// running for hours, also with the loop open, with settings that change and after a trip.
    fn sample(&mut self, is_last: bool) -> Result<Row, Message> {
        let due = self.tracking.as_mut().and_then(|tracking| tracking.due(self.samples));
        if let Some((to, phase_target)) = due {
            self.controller
                .hold_response(to, phase_target)
                .map_err(ExperimentError::from)?;
        }
        let step = self.controller.lock.config().sample_time;
        let constant = (self.settings[index::CLOSED] == 0.0).then(|| self.constant_drive());
        let (time, plant) = (self.time(), &self.rig.plant);
        let (before, speed) = (is_last.then_some(*plant), plant.state().dq2.abs());
        let relative = plant.relative_displacement();
        self.decay.watch(&self.rig.impacts, self.rig.phase);
        let sensors = self.rig.sense().map_err(ExperimentError::from)?;
        let command = self.controller.sample(sensors, self.active);
        let drive = constant.unwrap_or(command.map_err(ExperimentError::from)?.drive);
        self.rig.advance(drive, step).map_err(ExperimentError::from)?;
        let Sensors { response, reference } = sensors;
        let output = self.controller.output;
        let mut motion = HarmonicMotion {
            omega: drive.omega,
            amplitude: output.response_amplitude,
            speed,
        };
        if drive.amplitude == 0.0 {
            self.decay.sample(response, speed, step);
            motion = self.decay.motion;
        } else {
            self.decay.drive(motion);
        }
        if let Some(plant) = before {
            self.before = (plant, drive);
            self.output = output;
            self.motion = motion;
        }
        self.samples += 1;
        Ok(Row {
            time,
            base: reference.unwrap_or_default(),
            response,
            relative,
            output,
            drive,
            motion,
            decays: drive.amplitude == 0.0 && self.decay.synchronous,
        })
    }

    /// The constant drive of the open loop.
    fn constant_drive(&self) -> Drive {
        let omega = self.scene.dimensionless().omega(self.settings[index::DETUNING]);
        let amplitude = if self.active { self.scene.amplitude } else { 0.0 };
        Drive { omega, amplitude, ..Drive::default() }
    }

    /// Time of the next sample, s.
    pub fn time(&self) -> f64 {
        self.samples as f64 * self.controller.lock.config().sample_time
    }

    /// The plant `ahead` seconds after the last sample: for slow motion between two samples.
    pub fn between(&self, ahead: f64) -> Plant {
        let (mut plant, drive) = self.before;
        // The drive was accepted for the whole sample period; a shorter step cannot be refused.
        let drive = lovines::Drive::harmonic(drive.amplitude, drive.omega);
        let _ = plant.advance_with(drive, ahead.max(0.0), &mut (|_| {}) as &mut dyn FnMut(Event));
        plant
    }

    /// Time from the last sample to the first impact after it and before the next sample, s; its wall.
    pub fn first_impact(&self, later_than: f64) -> Option<(f64, Wall)> {
        let (mut plant, drive) = self.before;
        let mut first = None;
        let mut note = |event: Event| {
            if let Event::Impact { t, wall, .. } = event
                && first.is_none()
                && t > later_than
            {
                first = Some((t, wall));
            }
        };
        let drive = lovines::Drive::harmonic(drive.amplitude, drive.omega);
        plant
            .advance_with(
                drive,
                self.controller.lock.config().sample_time,
                &mut note as &mut dyn FnMut(Event),
            )
            .ok()?;
        first
    }

    /// Speed of the particle over `b omega0`.
    pub fn particle_speed(&self) -> f64 {
        self.scene.dimensionless().speed(self.rig.plant.state().dq2.abs())
    }

    /// The regime of the last impacts.
    pub fn regime(&self) -> Regime {
        self.rig.impacts.regime(self.rig.phase)
    }

    /// Amplitude of the drive, m.
    pub fn drive_amplitude(&self) -> f64 {
        self.before.1.amplitude
    }

    /// Puts the primary mass (together with the particle) or the particle alone somewhere, at rest: `to` is the displacement over b
    /// of the mass, or of the particle from the middle of its cavity. Base, clock and controller run on.
    pub fn place(&mut self, primary: bool, to: f64) -> Result<(), Message> {
        let b = self.scene.plant.half_width;
        let plant = &mut self.rig.plant;
        let mut state = plant.state();
        let mut from_mass = -plant.relative_displacement();
        if primary {
            (state.q1, state.dq1) = (to * b, 0.0);
        } else {
            from_mass = to * b;
        }
        // Rounding of the sum must not put the particle beyond a wall.
        let inside = |gap: f64| gap * (1.0 - 4.0 * f64::EPSILON) - f64::EPSILON * state.q1.abs();
        let [plus, minus] = plant.parameters().gaps().map(inside);
        (state.q2, state.dq2) = (state.q1 + from_mass.clamp(-plus, minus), 0.0);
        plant.set_state(state)?;
        Ok(())
    }

    /// The plant at the next sample.
    pub fn plant(&self) -> &Plant {
        &self.rig.plant
    }
}

/// Relaxations of the linear response after which a motion has its regime, and periods after which it is not waited for.
const RELAXATIONS: f64 = 6.0;
const MOST_PERIODS: f64 = 1000.0;

/// The regime under a constant drive of detuning `sigma` and excitation `g`, from the start of the scene.
pub fn regime_at(scene: &Scene, sigma: f64, g: f64) -> Result<Regime, Message> {
    let d = scene.dimensionless();
    let omega = d.omega(sigma);
    let drive = Drive { omega, amplitude: d.amplitude(g), ..Drive::default() };
    let mut rig = NoisyRig::new(Plant::new(scene.plant, scene.start)?, 0.0);
    // The amplitude relaxes by e in 1/(pi epsilon lambda) periods.
    let periods = (RELAXATIONS / (PI * d.epsilon * d.lambda)).min(MOST_PERIODS) as usize;
    for _ in 0..periods {
        rig.advance(drive, TAU / omega).map_err(ExperimentError::from)?;
    }
    // A slow particle may be silent for a while.
    let last = rig.impacts.0.last().map_or(0.0, |last| last.time);
    Ok(match last < 0.5 * TAU * periods as f64 {
        true => Regime::NoImpacts,
        false => rig.impacts.regime(last),
    })
}
