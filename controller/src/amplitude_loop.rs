//! The loop that controls the response amplitude by means of the drive amplitude.
//!
//! Under a constant drive the amplitude of a lightly damped structure takes dozens of periods to settle. At phase resonance
//! it obeys `A' = -delta A + g E` (`g`: `response_gain`, half the frequency for an oscillator excited through its base).
//! This equation has the same form as that of the phase. The same detector and a PI filter therefore form a loop of type 1
//! and order 3. Its gains are those of [`Gains`] divided by `g`; both are positive: a response below its setpoint
//! increases the drive.
//!
//! A move to another amplitude follows a smooth trajectory of a given duration. The feedforward consists of the expected
//! change of the drive, and of `A'/g`, which the change of the amplitude requires. The loop compares the detector's reading
//! with the expected reading on the trajectory, including the detector's lag, and so corrects only the deviations. The
//! drive stays within its limit and its ramp rate. It never falls below a fifth of its integral part: without a drive
//! the phase is undefined.

use crate::real::consts::TAU;

use crate::config::{Config, ConfigError, Range};
use crate::real::{self, Real};

/// Lowest drive, as a share of its integral part.
const MIN_SHARE: Real = 0.2;

/// Coefficients of the loop.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct AmplitudeLoop {
    /// Proportional gain, m of drive per m of response.
    proportional: Real,
    /// Integral gain, m of drive per m of response and sample.
    integral: Real,
    /// Feedforward, m of drive for a growth of the response by 1 m per sample.
    feedforward: Real,
    /// Share of its error that the detector corrects per sample.
    detector_step: Real,
    /// Largest drive amplitude, m.
    amplitude_max: Real,
    /// Largest change of the drive amplitude per sample, m.
    max_change: Real,
    /// s
    pub sample_time: Real,
}

/// A change of the response amplitude's setpoint.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Move {
    /// New setpoint of the response amplitude, m; above 0.
    pub response: Real,
    /// Duration, s; 0: step change.
    pub duration: Real,
    /// Expected change of the drive amplitude, m; 0 if unknown.
    pub amplitude: Real,
    /// Expected change of the frequency, rad/s; 0 if unknown.
    pub omega: Real,
    /// Growth rate of the setpoint at the end of the move and after it, m/s; 0 to hold it.
    pub growth: Real,
}

impl Move {
    /// Checks the values for a controller of this configuration.
    ///
    /// # Errors
    /// An invalid value, or a drive without a limit (`amplitude_max`).
    pub fn check(&self, config: &Config) -> Result<(), ConfigError> {
        let values = [
            (self.response, Range::Positive),
            (self.duration, Range::NotNegative),
            (self.amplitude, Range::Signed),
            (self.omega, Range::Signed),
            (self.growth, Range::Signed),
        ];
        for ((name, unit), (value, range)) in MOVE.into_iter().zip(values) {
            range.check(name, value, unit)?;
        }
        match config.amplitude_max {
            Some(_) => Ok(()),
            None => Err(ConfigError {
                name: "amplitude_max",
                value: None,
                unit: "m",
                allowed: "above 0 to control the response amplitude: the drive needs a limit",
            }),
        }
    }
}

/// The fields of a [`Move`], with their units.
pub const MOVE: [(&str, &str); 5] = [
    ("response", "m"),
    ("duration", "s"),
    ("amplitude", "m"),
    ("omega", "rad/s"),
    ("growth", "m/s"),
];

/// State of the loop while it controls the response.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct AmplitudeState {
    /// The present trajectory.
    trajectory: Move,
    /// Setpoint at the start of the trajectory, m.
    from: Real,
    /// Length of the trajectory, samples.
    samples: u64,
    /// Samples since the start of the trajectory.
    taken: u64,
    /// Growth at the start and at the end, as multiples of the mean growth of the trajectory.
    growths: [Real; 2],
    /// Growth in the last sample, m.
    growth: Real,
    /// Present setpoint of the response amplitude, m.
    pub setpoint: Real,
    /// Reading of the detector that the setpoint leads to, m.
    expected: Real,
    /// Integral part of the drive, m.
    integral: Real,
}

impl AmplitudeState {
    /// A constant setpoint: the present reading `response`, m, at the drive `amplitude`, m.
    pub fn constant(response: Real, amplitude: Real) -> Self {
        Self {
            trajectory: Move { response, ..Move::default() },
            from: response,
            samples: 0,
            taken: 0,
            growths: [0.0; 2],
            growth: 0.0,
            setpoint: response,
            expected: response,
            integral: amplitude,
        }
    }

    /// Starts a trajectory at the present setpoint, with its present growth.
    pub fn start(&mut self, trajectory: Move, sample_time: Real) {
        self.from = self.setpoint;
        self.trajectory = trajectory;
        self.samples = real::ceil(trajectory.duration / sample_time) as u64;
        self.taken = 0;
        let mean = (trajectory.response - self.from) / self.samples as Real;
        // Where the change is only the rounding error of the growth, it has no share in it.
        let relative = |growth: Real| Some(growth / mean).filter(|growth| growth.abs() * Real::EPSILON < 1.0);
        self.growths = [self.growth, trajectory.growth * sample_time].map(|growth| relative(growth).unwrap_or(0.0));
        if self.samples == 0 {
            self.setpoint = trajectory.response;
            self.integral += trajectory.amplitude;
        }
    }

    /// Whether the trajectory has ended.
    pub fn has_arrived(&self) -> bool {
        self.taken == self.samples
    }

    /// Advances the trajectory by one sample. Returns the share of the trajectory in this sample, and the growth of the
    /// setpoint, m.
    fn advance(&mut self, sample_time: Real) -> (Real, Real) {
        if self.has_arrived() {
            self.growth = self.trajectory.growth * sample_time;
            self.setpoint += self.growth;
            return (0.0, self.growth);
        }
        let before = self.setpoint;
        let share = |taken: u64| smooth(taken as Real / self.samples as Real, self.growths);
        let progress = share(self.taken + 1) - share(self.taken);
        self.taken += 1;
        self.setpoint = if self.has_arrived() {
            self.trajectory.response
        } else {
            self.from + (self.trajectory.response - self.from) * share(self.taken)
        };
        self.growth = self.setpoint - before;
        (progress, self.growth)
    }
}

/// Rises from 0 to 1, with the slopes `begin` and `end` at the ends; velocity and, between equal slopes, acceleration are continuous there.
fn smooth(x: Real, [begin, end]: [Real; 2]) -> Real {
    let ramp = begin * x + 0.5 * (end - begin) * x * x;
    ramp + (1.0 - 0.5 * (begin + end)) * (x - real::sin(TAU * x) / TAU)
}

impl AmplitudeLoop {
    /// The loop of a configuration.
    pub fn new(config: &Config) -> Self {
        let gains = config.gains();
        let (gain, sample_time) = (config.response_gain, config.sample_time);
        Self {
            proportional: gains.proportional / gain,
            integral: gains.integral * sample_time / gain,
            feedforward: 1.0 / (gain * sample_time),
            detector_step: config.step(config.bandwidth),
            amplitude_max: config.amplitude_limit(),
            max_change: config.change(config.ramp_rate),
            sample_time,
        }
    }

    /// One sample. `reading` is the measured response amplitude, m, or `None` if it is not valid: then only the feedforward
    /// acts. Returns the drive amplitude, m, which differs from `before` at most by the ramp's rate, and the shift of the
    /// frequency, rad/s.
    pub fn follow(&self, state: &mut AmplitudeState, before: Real, reading: Option<Real>) -> (Real, Real) {
        let (progress, growth) = state.advance(self.sample_time);
        state.expected += self.detector_step * (state.setpoint - state.expected);
        let planned = state.integral + progress * state.trajectory.amplitude;
        state.integral = planned.clamp(0.0, self.amplitude_max);
        let error = reading.map_or(0.0, |reading| state.expected - reading);
        let unlimited = state.integral + self.feedforward * growth + self.proportional * error;
        let lowest = MIN_SHARE * state.integral;
        let limited = unlimited
            .clamp(lowest, self.amplitude_max)
            .clamp(before - self.max_change, before + self.max_change);
        // Anti-windup: no integration in the direction in which the output is already limited.
        if (unlimited - limited) * error <= 0.0 {
            let integral = state.integral + self.integral * error;
            state.integral = integral.clamp(0.0, self.amplitude_max);
        }
        (limited, progress * state.trajectory.omega)
    }
}

#[cfg(all(test, not(feature = "f32")))]
mod tests;
