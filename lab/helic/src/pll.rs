//! The loop of `control_mode` 2: the controller of this project with the parameters `pll_…`.

use std::f64::consts::TAU;

use super::registry::{HARMONICS, Registry};
use phase_lock::{Config, ConfigError, Input, LockCriterion, LoopState, Output, PhaseLock, State};

/// The loop. All lengths are in mm.
#[derive(Debug, Clone)]
pub struct Pll {
    controller: PhaseLock,
    state: State,
    /// Output of the last sample.
    pub output: Output,
}

/// The configuration of the controller. Its gains follow from the bandwidth of its detector.
fn config(registry: &Registry) -> Config {
    let real = |name| registry.real(name);
    let centre = real("pll_centre_freq");
    let forcing = registry.values("forcing_coeffs");
    let amplitude = forcing[1].hypot(forcing[1 + HARMONICS]) * real("rig_gain");
    let share = real("pll_response_min") / amplitude;
    Config {
        sample_time: 1.0 / real("sample_freq"),
        omega_min: TAU * real("pll_freq_min"),
        omega_max: TAU * real("pll_freq_max"),
        omega_rate: None,
        amplitude_max: None,
        // The host sets the amplitude itself.
        ramp_rate: None,
        phase_target: real("pll_target_phase").to_radians(),
        bandwidth: 1.0 / real("pll_demod_tau"),
        lock: LockCriterion {
            phase_tolerance: real("pll_lock_phase_tol").to_radians(),
            unlock_tolerance: real("pll_unlock_phase_tol").to_radians(),
            dwell: (centre * real("pll_lock_dwell")).ceil().max(1.0) as u32,
            response_min: if share.is_finite() { share } else { 0.0 },
            ..LockCriterion::default()
        },
        acquire_timeout: Some(real("pll_acquire_timeout")),
        // The contract has neither.
        signal_timeout: None,
        residual_max: None,
        ..Config::for_resonance(TAU * centre, amplitude)
    }
}

impl Pll {
    /// The loop before its first sample.
    ///
    /// # Errors
    /// Parameters that do not fit together.
    pub fn new(registry: &Registry) -> Result<Self, ConfigError> {
        let controller = config(registry).build()?;
        Ok(Self {
            state: controller.start(),
            output: controller.idle(),
            controller,
        })
    }

    /// Takes new parameters; the loop goes on.
    ///
    /// # Errors
    /// Parameters that do not fit together; then nothing changes.
    pub fn configure(&mut self, registry: &Registry) -> Result<(), ConfigError> {
        self.controller = config(registry).build()?;
        Ok(())
    }

    /// One sample: the readings of response and excitation, mm.
    pub fn update(&mut self, response: f64, excitation: f64) {
        let input = Input { response, reference: Some(excitation), active: true };
        self.output = self.controller.process(&mut self.state, input);
    }

    /// Whether the controller has switched the drive off; only a reset ends this.
    pub fn is_lost(&self) -> bool {
        self.output.state.is_latched()
    }

    /// Frequency until the next sample, Hz.
    pub fn frequency(&self) -> f64 {
        self.output.omega / TAU
    }

    /// The sources from `pll_phase` to `pll_resp_amp`, and `pll_state`: 0 fixed, 1 acquiring, 2 locked, 3 lock lost.
    pub fn sources(&self) -> ([f64; 4], f64) {
        let Output { phase_error, reference_amplitude, response_amplitude, .. } = self.output;
        let error = phase_error.map_or(f64::NAN, f64::to_degrees);
        let phase = error + self.controller.config().phase_target.to_degrees();
        let state = match self.output.state {
            LoopState::Acquiring => 1.0,
            LoopState::Locked => 2.0,
            lost if lost.is_latched() => 3.0,
            _ => 0.0,
        };
        let wrapped = (phase + 180.0).rem_euclid(360.0) - 180.0;
        ([wrapped, error, reference_amplitude, response_amplitude], state)
    }
}
