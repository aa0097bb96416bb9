//! The built-in phase-locked loop as a controller of the bench.

use phase_lock::{Config, ConfigError, Input, LockCriterion, Move, PhaseLock, State};

use super::{Command, Controller, ControllerError, Drive, Sensors};
use crate::scene::Scene;

/// The built-in controller: coefficients and state.
#[derive(Clone)]
pub struct BuiltIn {
    lock: PhaseLock,
    state: State,
}

impl BuiltIn {
    /// The controller that the scene describes.
    ///
    /// # Errors
    /// Settings that the controller cannot work with.
    pub fn new(scene: &Scene) -> Result<Self, ConfigError> {
        let lock = configuration(scene).build()?;
        Ok(Self {
            state: lock.start(),
            lock,
        })
    }

    /// The same, ready to hold the response: its drive has the limit of the scene's `[backbone]`.
    ///
    /// # Errors
    /// As [`BuiltIn::new`].
    pub fn for_backbone(scene: &Scene) -> Result<Self, ConfigError> {
        let d = scene.dimensionless();
        let limits = [scene.backbone.g_max, scene.controller.g_max];
        let g_max = limits.into_iter().filter(|limit| *limit > 0.0);
        let lock = Config {
            amplitude_max: d.amplitude(g_max.fold(f64::INFINITY, f64::min)),
            bandwidth: scene.backbone.bandwidth * d.omega0,
            ..configuration(scene)
        }
        .build()?;
        Ok(Self {
            state: lock.start(),
            lock,
        })
    }
}

/// The scene's controller settings in SI units.
#[must_use]
pub fn configuration(scene: &Scene) -> Config {
    let d = scene.dimensionless();
    let omega0 = d.omega0;
    let c = &scene.controller;
    let amplitude = scene.amplitude;
    let period = d.natural_period();
    let defaults = Config::for_resonance(omega0, amplitude);
    Config {
        sample_time: scene.sample_time(),
        omega_start: c.omega_start * omega0,
        omega_min: c.omega_min * omega0,
        omega_max: c.omega_max * omega0,
        bandwidth: c.bandwidth * omega0,
        damping_rate: 0.5 * scene.plant.damping / scene.plant.primary_mass,
        phase_target: c.phase_target_radians(),
        delay: scene.chain.stated_delay(omega0 * scene.sample_time()) / omega0
            + c.delay * scene.sample_time(),
        amplitude_max: d.amplitude(c.g_max),
        response_max: c.c_max * scene.plant.half_width,
        ramp_time: c.ramp_periods * period,
        release_time: c.release_periods * period,
        omega_rate: c.omega_rate * omega0 / period,
        acquire_timeout: c.acquire_periods * period,
        lock: LockCriterion {
            phase_tolerance: c.phase_tolerance.to_radians(),
            frequency_drift: c.frequency_drift,
            amplitude_drift: c.amplitude_drift,
            dwell: c.dwell_periods,
            ..defaults.lock
        },
        ..defaults
    }
}

impl Controller for BuiltIn {
    fn sample(&mut self, sensors: Sensors, active: bool) -> Result<Command, ControllerError> {
        let output = self.lock.process(
            &mut self.state,
            Input {
                response: sensors.response,
                reference: sensors.reference,
                active,
            },
        );
        Ok(Command {
            drive: Drive {
                omega: output.omega,
                amplitude: output.amplitude,
                displacement: output.drive,
            },
            phase_error: output.phase_error,
            settled: output.settled,
        })
    }

    fn hold_response(&mut self, to: Move) -> Result<(), ControllerError> {
        Ok(self.lock.hold_response(&mut self.state, to)?)
    }
}
