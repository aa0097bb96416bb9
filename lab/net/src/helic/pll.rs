//! The phase-locked loop of a device, by its published contract: phase of the response less that of the excitation, PI control of the
//! frequency within bounds, and a loss of lock that latches. (The loop of this project is the crate `phase-lock`.)

use std::f64::consts::TAU;

/// Time constants before an observation counts.
const WARM_UP: f64 = 5.0;

/// State of the loop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PllState {
    /// The frequency is fixed.
    Fixed = 0,
    Acquiring = 1,
    Locked = 2,
    /// Only a reset leaves this state.
    LockLost = 3,
}

/// Settings: Hz, degrees, s, and units of the sensors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PllSettings {
    centre: f64,
    bounds: [f64; 2],
    /// Proportional and integral gain, Hz/degree and Hz/(degree s).
    gains: [f64; 2],
    pub target: f64,
    delay: f64,
    dc_tau: f64,
    demod_tau: f64,
    /// Smallest amplitudes of excitation and response.
    least: [f64; 2],
    lock_phase: f64,
    unlock_phase: f64,
    lock_frequency: f64,
    lock_dwell: f64,
    unlock_dwell: f64,
    timeout: f64,
    saturation_dwell: f64,
}

impl PllSettings {
    /// From the parameters `pll_…`.
    pub fn of(real: impl Fn(&'static str) -> f64) -> Self {
        Self {
            centre: real("pll_centre_freq"),
            bounds: [real("pll_freq_min"), real("pll_freq_max")],
            gains: [real("pll_kp"), real("pll_ki")],
            target: real("pll_target_phase"),
            delay: real("pll_delay_s"),
            dc_tau: real("pll_dc_tau"),
            demod_tau: real("pll_demod_tau"),
            least: [real("pll_excitation_min"), real("pll_response_min")],
            lock_phase: real("pll_lock_phase_tol"),
            unlock_phase: real("pll_unlock_phase_tol"),
            lock_frequency: real("pll_lock_freq_tol"),
            lock_dwell: real("pll_lock_dwell"),
            unlock_dwell: real("pll_unlock_dwell"),
            timeout: real("pll_acquire_timeout"),
            saturation_dwell: real("pll_saturation_dwell"),
        }
    }

    /// Whether the values fit together.
    pub fn is_allowed(&self, nyquist: f64) -> bool {
        let [least, most] = self.bounds;
        let sizes = [
            least,
            self.demod_tau,
            self.least[0],
            self.least[1],
            self.lock_phase,
            self.lock_frequency,
            self.lock_dwell,
            self.unlock_dwell,
            self.timeout,
            self.saturation_dwell,
        ];
        sizes.iter().all(|size| *size >= 0.0)
            && self.dc_tau > 0.0
            && self.unlock_phase >= self.lock_phase
            && least <= self.centre
            && self.centre <= most
            && most < nyquist
            && (-180.0..180.0).contains(&self.target)
    }
}

/// The loop.
#[derive(Debug, Clone)]
pub struct Pll {
    pub state: PllState,
    means: Option<[f64; 2]>,
    /// Cosine and sine parts of excitation and response.
    parts: [[f64; 2]; 2],
    integral: f64,
    /// Frequency of the next sample, Hz.
    pub frequency: f64,
    /// s, since the last reset or reacquisition.
    age: f64,
    /// s, for which the conditions of a lock, or of its loss, or of saturation have held.
    dwell: f64,
    lost: f64,
    saturated: f64,
    /// Lowest and highest frequency during the dwell.
    span: [f64; 2],
    /// Phase of the response less that of the excitation, and less the target, degrees.
    pub phase: [f64; 2],
    /// Amplitudes of excitation and response.
    pub amplitudes: [f64; 2],
}

impl Pll {
    pub fn new() -> Self {
        Self {
            state: PllState::Acquiring,
            means: None,
            parts: [[0.0; 2]; 2],
            integral: 0.0,
            frequency: f64::NAN,
            age: 0.0,
            dwell: 0.0,
            lost: 0.0,
            saturated: 0.0,
            span: [0.0; 2],
            phase: [f64::NAN; 2],
            amplitudes: [0.0; 2],
        }
    }

    /// Searches again from the present frequency; a lost lock stays lost.
    pub fn reacquire(&mut self) {
        if self.state != PllState::LockLost {
            self.state = PllState::Acquiring;
            (self.age, self.dwell, self.lost, self.saturated) = (0.0, 0.0, 0.0, 0.0);
        }
    }

    /// One sample: `phase` of the generator, turns, and the readings of excitation and response.
    pub fn update(&mut self, settings: &PllSettings, phase: f64, readings: [f64; 2], step: f64) {
        let [least, most] = settings.bounds;
        let now = if self.frequency.is_nan() {
            settings.centre
        } else {
            self.frequency
        };
        self.observe(settings, phase, readings, step);
        self.age += step;
        let measured = wrap(self.phase_difference() + 360.0 * now * settings.delay);
        let error = wrap(measured - settings.target);
        self.phase = [measured, error];
        let warm = self.age > WARM_UP * settings.dc_tau.max(settings.demod_tau);
        let valid = warm && error.is_finite() && (0..2).all(|n| self.amplitudes[n] >= settings.least[n]);
        if matches!(self.state, PllState::Fixed | PllState::LockLost) {
            self.frequency = if self.state == PllState::Fixed {
                settings.centre
            } else {
                now
            };
            return;
        }
        let mut wanted = now;
        if valid {
            let candidate = self.integral + settings.gains[1] * error * step;
            wanted = settings.centre + settings.gains[0] * error + candidate;
            // The integral stops at a bound, unless it leads back.
            let outward = (wanted > most && candidate > self.integral) || (wanted < least && candidate < self.integral);
            self.integral = if outward { self.integral } else { candidate };
        }
        let saturated = wanted < least || wanted > most;
        self.frequency = wanted.clamp(least, most);
        self.supervise(settings, (valid, error, saturated), step, warm);
    }

    fn observe(&mut self, settings: &PllSettings, phase: f64, readings: [f64; 2], step: f64) {
        let (sine, cosine) = (TAU * phase).sin_cos();
        let share = |tau: f64| step / (tau + step);
        let means = self.means.get_or_insert(readings);
        for n in 0..2 {
            means[n] += share(settings.dc_tau) * (readings[n] - means[n]);
            let reading = 2.0 * (readings[n] - means[n]);
            for (part, wave) in self.parts[n].iter_mut().zip([cosine, sine]) {
                *part += share(settings.demod_tau) * (reading * wave - *part);
            }
            self.amplitudes[n] = self.parts[n][0].hypot(self.parts[n][1]);
        }
    }

    /// Phase of the response less that of the excitation, degrees.
    fn phase_difference(&self) -> f64 {
        let [excitation, response] = self.parts.map(|[a, b]| f64::atan2(-b, a));
        (response - excitation).to_degrees()
    }

    fn supervise(
        &mut self,
        settings: &PllSettings,
        (valid, error, saturated): (bool, f64, bool),
        step: f64,
        warm: bool,
    ) {
        let counted = |held: bool, time: f64| if held { time + step } else { 0.0 };
        if self.state == PllState::Locked {
            self.lost = counted(!valid || error.abs() > settings.unlock_phase, self.lost);
            self.saturated = counted(saturated, self.saturated);
            if self.lost > settings.unlock_dwell || self.saturated > settings.saturation_dwell {
                self.state = PllState::LockLost;
            }
            return;
        }
        self.dwell = counted(valid && error.abs() < settings.lock_phase, self.dwell);
        let [low, high] = self.span;
        self.span = [low.min(self.frequency), high.max(self.frequency)];
        if self.dwell <= step || self.span[1] - self.span[0] > settings.lock_frequency {
            self.span = [self.frequency; 2];
            self.dwell = self.dwell.min(step);
        }
        if self.dwell > settings.lock_dwell {
            self.state = PllState::Locked;
        } else if warm && self.age > WARM_UP * settings.dc_tau.max(settings.demod_tau) + settings.timeout {
            self.state = PllState::Fixed;
        }
    }
}

/// An angle from -180 to 180 degrees.
fn wrap(angle: f64) -> f64 {
    (angle + 180.0).rem_euclid(360.0) - 180.0
}
