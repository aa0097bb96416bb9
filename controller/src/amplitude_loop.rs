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

/// Lowest drive, as a share of its integral part. A base sensor with a signal-to-noise ratio of 25 (14 dB) is then still valid: 25 times 0.2 squared
/// is 1, a coherence of 0.5, the initial `coherence_min`.
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

#[cfg(test)]
#[cfg(not(feature = "f32"))]
mod tests {
    use super::*;

    const DT: f64 = 0.01;
    /// `A' = -delta A + g E` with a first-order detector.
    struct Structure {
        a: f64,
        reading: f64,
    }
    const DELTA: f64 = 0.03;
    const GAIN: f64 = 0.5;
    const BANDWIDTH: f64 = 0.3;

    fn amplitude_loop(amplitude_max: f64) -> AmplitudeLoop {
        let config = Config {
            bandwidth: BANDWIDTH,
            damping_rate: Some(DELTA),
            response_gain: GAIN,
            sample_time: DT,
            amplitude_max: Some(amplitude_max),
            ramp_rate: None,
            ..Config::for_resonance(1.0, 0.0)
        };
        AmplitudeLoop::new(&config)
    }

    impl Structure {
        fn advance(&mut self, drive: f64) {
            self.a += DT * (GAIN * drive - DELTA * self.a);
            self.reading += BANDWIDTH * DT * (self.a - self.reading);
        }
    }

    fn settled() -> (Structure, AmplitudeState) {
        let structure = Structure { a: 1.0, reading: 1.0 };
        (structure, AmplitudeState::constant(1.0, DELTA / GAIN))
    }

    /// Largest control error of the amplitude.
    fn worst(to: Move) -> f64 {
        let control = amplitude_loop(10.0);
        let (mut structure, mut state) = settled();
        state.start(to, DT);
        let mut worst = 0.0_f64;
        for _ in 0..40_000 {
            let (drive, _) = control.follow(&mut state, 0.0, Some(structure.reading));
            structure.advance(drive);
            worst = worst.max((structure.a - state.setpoint).abs());
        }
        assert!(state.has_arrived() && (structure.a - to.response).abs() < 1e-9);
        worst
    }

    #[test]
    fn an_expected_change_of_the_drive_reduces_the_control_error() {
        let to = Move {
            response: 0.8,
            duration: 60.0,
            amplitude: -0.2 * DELTA / GAIN,
            ..Move::default()
        };
        let expected = worst(to);
        let unexpected = worst(Move { amplitude: 0.0, ..to });
        assert!(
            expected < 2e-3 && unexpected > 4.0 * expected,
            "{expected} {unexpected}"
        );
    }

    #[test]
    fn the_drive_stays_within_its_limits_without_windup() {
        let control = amplitude_loop(0.1);
        let (mut structure, mut state) = settled();
        let mut go = |to: f64, samples: u32| {
            state.start(Move { response: to, ..Move::default() }, DT);
            for _ in 0..samples {
                let (drive, _) = control.follow(&mut state, 0.0, Some(structure.reading));
                assert!((0.0..=0.1).contains(&drive));
                structure.advance(drive);
            }
            structure.a
        };
        // 0.1 m of drive lead to a response of at most 1.67 m.
        assert!((go(5.0, 100_000) - 5.0 / 3.0).abs() < 1e-3);
        assert!((go(1.0, 20_000) - 1.0).abs() < 1e-2);
    }

    #[test]
    fn a_move_with_a_growth_goes_on_at_that_rate_until_the_next_one() {
        let control = amplitude_loop(1.0);
        let (_, mut state) = settled();
        // Largest and smallest rate after some samples of a move.
        let mut go = |to: Move, skipped: usize, samples: usize| {
            state.start(to, DT);
            let mut rates = [f64::INFINITY, f64::NEG_INFINITY];
            for n in 0..samples {
                let before = state.setpoint;
                control.follow(&mut state, 0.0, Some(1.0));
                let rate = (state.setpoint - before) / DT;
                if n >= skipped {
                    rates = [rates[0].min(rate), rates[1].max(rate)];
                }
            }
            rates
        };
        let is = |rates: [f64; 2], rate: f64| rates.iter().all(|value| (value - rate).abs() < 1e-9);
        let crossing = Move {
            response: 0.9,
            duration: 1.0,
            growth: -0.1,
            ..Move::default()
        };
        assert!(is(go(crossing, 100, 120), -0.1));
        assert!(is(go(Move { response: 0.78, ..crossing }, 0, 100), -0.1));
        assert!(is(
            go(Move { response: 0.75, duration: 1.0, ..Move::default() }, 101, 110),
            0.0
        ));
    }

    #[test]
    fn the_shifts_of_the_frequency_add_up_to_the_expected_change() {
        let control = amplitude_loop(1.0);
        let (_, mut state) = settled();
        state.start(
            Move { response: 1.1, duration: 3.0, omega: -0.7, ..Move::default() },
            DT,
        );
        let shifted: f64 = (0..400).map(|_| control.follow(&mut state, 0.0, Some(1.0)).1).sum();
        assert!((shifted + 0.7).abs() < 1e-12);
    }
}
