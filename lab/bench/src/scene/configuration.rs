//! A scene's settings in SI units, in the form that plant and controller use.

use lovines::State;
use phase_lock::{Config, LockCriterion};

use super::{Scene, plant::symbols};

impl Scene {
    /// Parameters and start of the plant, under the names of the FMU's variables.
    #[must_use]
    pub fn start_values(&self) -> [(&'static str, f64); 10] {
        let [mass, k, c, m, b, r] = symbols(&self.plant);
        let State { q1, dq1, q2, dq2 } = self.start;
        let [q1, dq1] = [("q1", q1), ("der(q1)", dq1)];
        [mass, k, c, m, b, r, q1, dq1, ("q2", q2), ("der(q2)", dq2)]
    }

    /// Configuration of the controller for the scene's excitation.
    #[must_use]
    pub fn controller_config(&self) -> Config {
        let d = self.dimensionless();
        let omega0 = d.omega0;
        let c = &self.controller;
        let amplitude = self.amplitude;
        let period = d.natural_period();
        let defaults = Config::for_resonance(omega0, amplitude);
        Config {
            sample_time: self.sample_time(),
            omega_start: c.omega_start * omega0,
            omega_min: c.omega_min * omega0,
            omega_max: c.omega_max * omega0,
            bandwidth: c.bandwidth * omega0,
            damping_rate: 0.5 * self.plant.damping / self.plant.primary_mass,
            phase_target: c.phase_target_radians(),
            delay: self.chain.stated_delay(omega0 * self.sample_time()) / omega0 + c.delay * self.sample_time(),
            amplitude_max: d.amplitude(c.g_max),
            response_max: c.c_max * self.plant.half_width,
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

    /// Configuration of the controller for tracking: with the largest drive and the bandwidth of `[backbone]`.
    #[must_use]
    pub fn backbone_config(&self) -> Config {
        let d = self.dimensionless();
        let limits = [self.backbone.g_max, self.controller.g_max];
        let g_max = limits.into_iter().filter(|limit| *limit > 0.0);
        Config {
            amplitude_max: d.amplitude(g_max.fold(f64::INFINITY, f64::min)),
            bandwidth: self.backbone.bandwidth * d.omega0,
            ..self.controller_config()
        }
    }
}
