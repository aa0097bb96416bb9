//! A scene's settings in SI units, in the form that plant and controller use.

use std::f64::consts::PI;

use lovines::State;
use phase_lock::{Config, LockCriterion};

use super::{Scene, Sensor, plant::symbols};

impl Scene {
    /// Parameters and start of the plant, under the names of the FMU's variables.
    pub fn start_values(&self) -> [(&'static str, f64); 10] {
        let [mass, k, c, m, b, r] = symbols(&self.plant);
        let State { q1, dq1, q2, dq2 } = self.start;
        let [q1, dq1] = [("q1", q1), ("der(q1)", dq1)];
        [mass, k, c, m, b, r, q1, dq1, ("q2", q2), ("der(q2)", dq2)]
    }

    /// Configuration of the controller for the scene's excitation.
    pub fn controller_config(&self) -> Config {
        let d = self.dimensionless();
        let omega0 = d.omega0;
        let c = &self.controller;
        let period = d.natural_period();
        // Without periods or without a drive, steps.
        let rate = |amplitude: f64, periods: f64| {
            Some(amplitude / (periods * period)).filter(|rate| *rate > 0.0 && rate.is_finite())
        };
        let amplitude_max = self.drive_max();
        let defaults = Config::for_resonance(omega0, self.amplitude);
        self.phase_lock.apply(Config {
            sample_time: self.sample_time(),
            omega_start: c.omega_start * omega0,
            omega_min: c.omega_min * omega0,
            omega_max: c.omega_max * omega0,
            bandwidth: c.bandwidth * omega0,
            damping_rate: Some(self.linear().damping_rate).filter(|rate| *rate > 0.0),
            phase_target: c.phase_target_radians(),
            delay: self.chain.stated_delay(omega0 * self.sample_time()) / omega0
                + (c.delay + f64::from(u8::from(self.resonance.is_late()))) * self.sample_time(),
            amplitude_max: Some(amplitude_max),
            response_max: c.c_max.map(|c| c * d.b),
            ramp_rate: match c.ramp_periods {
                Some(periods) => rate(self.amplitude, periods),
                // The velocity of a base that moves with the largest amplitude.
                None => Some(amplitude_max * omega0),
            },
            release_rate: rate(self.amplitude, c.release_periods),
            // The range in a period, or in half a time constant of the detector: the loop locks as fast as without a limit.
            omega_rate: Some((c.omega_max - c.omega_min) * omega0 * (2.0 * c.bandwidth * omega0).max(1.0 / period)),
            acquire_timeout: Some(self.lock_periods() * period),
            residual_max: Some(self.residual()),
            reference_connected: self.chain.reference,
            lock: self.lock_criterion(),
            ..defaults
        })
    }

    /// The lock criterion: the drifts that are left near the steady state, at the rate at which the response approaches it.
    fn lock_criterion(&self) -> LockCriterion {
        let c = &self.controller;
        let bandwidth = self.bandwidth().max(BANDWIDTH_MIN);
        let approached = PI * bandwidth;
        let defaults = LockCriterion::default();
        LockCriterion {
            phase_tolerance: c.phase_tolerance.to_radians(),
            frequency_drift: c.frequency_tolerance * bandwidth * approached,
            amplitude_drift: c.amplitude_tolerance * approached,
            dwell: c.dwell_periods,
            ..defaults
        }
    }

    /// Largest plausible difference between a reading and its prediction, as a share of the amplitude.
    fn residual(&self) -> f64 {
        let impulse = match self.resonance.sensor {
            // Impacts change the velocity within a sample. Two in a period that balance the base amplitude E have the acceleration
            // omega0^2 E samples/4; frequency and transients take a few times as much. The amplitude of the response is about b.
            Sensor::Acceleration => self.drive_needed() / self.dimensionless().b * self.controller.samples_per_period,
            Sensor::V | Sensor::Q1 => 0.0,
        };
        RESIDUAL + impulse
    }

    /// Largest drive, m: as set, or four times what is needed.
    fn drive_max(&self) -> f64 {
        self.drive_limit().unwrap_or(4.0 * self.drive_needed())
    }

    /// Largest drive, m, where `[controller]` sets it.
    fn drive_limit(&self) -> Option<f64> {
        let by_g = |g| self.dimensionless().amplitude(g);
        self.controller.e_max.or(self.controller.g_max.map(by_g))
    }

    /// The larger of the requested drive, m, and the one that holds the linear mode at the amplitude at which impacts certainly occur.
    fn drive_needed(&self) -> f64 {
        let linear = self.bandwidth().max(BANDWIDTH_MIN);
        self.amplitude.max(IMPACTS * linear * self.dimensionless().b)
    }

    /// Half-power bandwidth of the linear response over omega0: twice the damping ratio, and base over response at resonance.
    fn bandwidth(&self) -> f64 {
        let linear = self.linear();
        2.0 * linear.damping_rate.max(0.0) / linear.omega0
    }

    /// Natural periods in which the amplitude of the linear mode falls by a factor of e.
    pub fn relaxation_periods(&self) -> f64 {
        1.0 / (PI * self.bandwidth())
    }

    /// Time limit for the lock, natural periods: as set, or at least 3000 and 20 times the relaxation time.
    pub fn lock_periods(&self) -> f64 {
        let relaxation = PI * self.relaxation_periods();
        let samples_per_period = self.controller.samples_per_period;
        self.record
            .lock_periods
            .unwrap_or((20.0 * relaxation).max(3000.0).min(1e7 / samples_per_period))
    }

    /// Configuration of the controller for tracking: with the largest drive of `[backbone]`, and a bandwidth at which the loops are not coupled.
    pub fn backbone_config(&self) -> Config {
        let d = self.dimensionless();
        Config {
            amplitude_max: Some(
                self.backbone
                    .drive_max(&d)
                    .min(self.drive_limit().unwrap_or(f64::INFINITY)),
            ),
            bandwidth: self.controller.bandwidth.min(self.coupled_bandwidth()) * d.omega0,
            ..self.controller_config()
        }
    }

    /// Largest bandwidth of the loops of phase and amplitude, in units of omega0, at which their coupling is weak. A drive that changes shifts
    /// the phase that the detectors read, and a frequency that changes shifts the amplitude. From loop to loop the gain is the cube of the
    /// bandwidth times A/E, which is largest without impacts: the inverse of twice the damping ratio.
    fn coupled_bandwidth(&self) -> f64 {
        COUPLED * self.bandwidth().max(f64::MIN_POSITIVE).cbrt()
    }
}

/// That bandwidth over the cube root of E/A.
const COUPLED: f64 = 0.9;
/// Smallest half-power bandwidth over omega0 that counts for the lock criterion and the largest drive: with less, most of the energy is lost in
/// impacts.
const BANDWIDTH_MIN: f64 = 1e-4;
/// Share of the amplitude by which a reading may differ from its prediction: a resonant response changes slowly.
const RESIDUAL: f64 = 0.3;
/// Response amplitude over b at which impacts certainly occur: a particle at rest in the middle is hit at 1.
const IMPACTS: f64 = 1.1;
