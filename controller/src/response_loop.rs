//! The loop that holds the response amplitude by moving the drive.
//!
//! Under a constant drive the amplitude of a lightly damped structure relaxes as slowly as the structure forgets, over dozens of
//! periods. At phase resonance it obeys `A' = -delta A + g E` (`g`: `response_gain`, half the frequency where an oscillator is
//! shaken through its base), which has the form of the phase's own equation. The same detector and a PI
//! filter therefore make a loop of type 1 and order 3 whose gains are those of [`Gains`] divided by `g`, from the same
//! knob; both are positive: too small a response asks for more drive.
//!
//! A move to another amplitude takes a stated time along a smooth course. What it needs is fed forward: the stated
//! change of the drive, and `A'/g` to carry the amplitude along. The loop compares what the detector reads with what it should read on
//! that course, lag included, and so only mends what was not foreseen. The drive keeps to its limit and to the rate of its ramp, and
//! never goes below a fifth of what holds the response: without a drive there is no phase to hold.

use core::f64::consts::TAU;

use crate::config::Config;
use crate::drive::Drive;
use crate::gains::Gains;

/// Share of its integral part below which the drive never goes.
const LEAST_SHARE: f64 = 0.2;

/// Coefficients of the loop.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ResponseLoop {
    /// m of drive per m of response.
    proportional: f64,
    /// The same, per sample.
    integral: f64,
    /// m of drive that make the response grow by 1 m in a sample.
    carry: f64,
    /// Share of its error that the detector takes up in a sample.
    detector_step: f64,
    /// Largest drive amplitude, m.
    amplitude_max: f64,
    /// Largest change of it in a sample, m.
    max_change: f64,
    /// s
    sample_time: f64,
}

/// A change of the amplitude at which the response is held.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Move {
    /// Response amplitude to go to, m; above 0.
    pub response: f64,
    /// How long the way there takes, s; 0 to jump.
    pub duration: f64,
    /// By how much the drive amplitude is expected to change, m; 0 where that is not known.
    pub amplitude: f64,
    /// By how much the frequency is expected to change, rad/s; 0 where that is not known.
    pub omega: f64,
}

/// State of the loop while it holds the response.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Hold {
    course: Move,
    /// Response amplitude that the course started from, m.
    from: f64,
    /// Samples that the course takes, and how many of them are over.
    samples: u64,
    taken: u64,
    /// Response amplitude wanted now, m, ...
    wanted: f64,
    /// ... and what the detector should read of it, m.
    expected: f64,
    /// Integral part of the drive, m.
    integral: f64,
}

impl Hold {
    /// Holds the response where it is: reading `response` m, driven by `amplitude` m.
    pub fn at(response: f64, amplitude: f64) -> Self {
        Self {
            course: Move {
                response,
                ..Move::default()
            },
            from: response,
            samples: 0,
            taken: 0,
            wanted: response,
            expected: response,
            integral: amplitude,
        }
    }

    /// Sets out on another course from where the last one has got to.
    pub fn set_out(&mut self, course: Move, sample_time: f64) {
        self.from = self.wanted;
        self.course = course;
        self.samples = libm::ceil(course.duration / sample_time) as u64;
        self.taken = 0;
        if self.samples == 0 {
            self.wanted = course.response;
            self.integral += course.amplitude;
        }
    }

    /// Response amplitude wanted now, m.
    pub fn wanted(&self) -> f64 {
        self.wanted
    }

    /// Whether the course has come to its end.
    pub fn arrived(&self) -> bool {
        self.taken == self.samples
    }

    /// One sample along the course: the share of it gone in this sample, and what the response grows by, m.
    fn go_on(&mut self) -> (f64, f64) {
        if self.arrived() {
            return (0.0, 0.0);
        }
        let before = self.wanted;
        let share = |taken: u64| smooth(taken as f64 / self.samples as f64);
        let gone = share(self.taken + 1) - share(self.taken);
        self.taken += 1;
        self.wanted = if self.arrived() {
            self.course.response
        } else {
            self.from + (self.course.response - self.from) * share(self.taken)
        };
        (gone, self.wanted - before)
    }
}

/// From 0 to 1 with neither a jump of the velocity nor of the acceleration at the ends.
fn smooth(x: f64) -> f64 {
    x - libm::sin(TAU * x) / TAU
}

impl ResponseLoop {
    /// The loop of a configuration.
    pub fn new(config: &Config, gains: Gains, drive: &Drive) -> Self {
        let (gain, sample_time) = (config.response_gain, config.sample_time);
        Self {
            proportional: gains.proportional / gain,
            integral: gains.integral * sample_time / gain,
            carry: 1.0 / (gain * sample_time),
            detector_step: -libm::expm1(-config.bandwidth * sample_time),
            amplitude_max: drive.amplitude_max,
            max_change: drive.ramp_step,
            sample_time,
        }
    }

    /// Time from sample to sample, s.
    pub fn sample_time(&self) -> f64 {
        self.sample_time
    }

    /// One sample: from the amplitude read, m, to the drive amplitude, m, which differs from that `before` by no more than its
    /// rate allows, and by how much the frequency is to be shifted, rad/s. `None` for a reading that cannot be believed: then
    /// only what was foreseen is done.
    pub fn follow(&self, hold: &mut Hold, before: f64, read: Option<f64>) -> (f64, f64) {
        let (gone, growth) = hold.go_on();
        hold.expected += self.detector_step * (hold.wanted - hold.expected);
        let foreseen = hold.integral + gone * hold.course.amplitude;
        hold.integral = foreseen.clamp(0.0, self.amplitude_max);
        let error = read.map_or(0.0, |read| hold.expected - read);
        let asked = hold.integral + self.carry * growth + self.proportional * error;
        let least = LEAST_SHARE * hold.integral;
        let granted = asked
            .clamp(least, self.amplitude_max)
            .clamp(before - self.max_change, before + self.max_change);
        // The integral moves unless a limit already withholds what it would ask more of.
        if (asked - granted) * error <= 0.0 {
            let integral = hold.integral + self.integral * error;
            hold.integral = integral.clamp(0.0, self.amplitude_max);
        }
        (granted, gone * hold.course.omega)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT: f64 = 0.01;
    /// `A' = -delta A + g E`, as a detector reads it.
    struct Structure {
        a: f64,
        read: f64,
    }
    const DELTA: f64 = 0.03;
    const GAIN: f64 = 0.5;
    const BANDWIDTH: f64 = 0.3;

    fn response_loop(amplitude_max: f64) -> ResponseLoop {
        let config = Config {
            bandwidth: BANDWIDTH,
            response_gain: GAIN,
            sample_time: DT,
            ..Config::for_resonance(1.0, 0.0)
        };
        let drive = Drive {
            amplitude_max,
            ramp_step: f64::INFINITY,
            release_step: f64::INFINITY,
            control_step: 0.0,
        };
        ResponseLoop::new(&config, Gains::from_bandwidth(BANDWIDTH, DELTA), &drive)
    }

    impl Structure {
        fn advance(&mut self, drive: f64) {
            self.a += DT * (GAIN * drive - DELTA * self.a);
            self.read += BANDWIDTH * DT * (self.a - self.read);
        }
    }

    fn settled() -> (Structure, Hold) {
        let structure = Structure { a: 1.0, read: 1.0 };
        (structure, Hold::at(1.0, DELTA / GAIN))
    }

    /// Largest distance of the amplitude from the one wanted, after `skipped` samples.
    fn worst(course: Move, skipped: usize) -> f64 {
        let control = response_loop(10.0);
        let (mut structure, mut hold) = settled();
        hold.set_out(course, DT);
        let mut worst = 0.0_f64;
        for n in 0..40_000 {
            let (drive, _) = control.follow(&mut hold, 0.0, Some(structure.read));
            structure.advance(drive);
            if n >= skipped {
                worst = worst.max((structure.a - hold.wanted()).abs());
            }
        }
        assert!(hold.arrived() && (structure.a - course.response).abs() < 1e-9);
        worst
    }

    #[test]
    fn a_move_that_was_foreseen_leaves_next_to_nothing_to_mend() {
        let course = Move {
            response: 0.8,
            duration: 60.0,
            amplitude: -0.2 * DELTA / GAIN,
            omega: 0.0,
        };
        let foreseen = worst(course, 0);
        let unforeseen = worst(
            Move {
                amplitude: 0.0,
                ..course
            },
            0,
        );
        assert!(
            foreseen < 2e-3 && unforeseen > 4.0 * foreseen,
            "{foreseen} {unforeseen}"
        );
    }

    #[test]
    fn a_jump_is_mended_much_faster_than_the_structure_forgets() {
        let course = Move {
            response: 1.2,
            ..Move::default()
        };
        // 1/DELTA is 33 s.
        assert!(worst(course, 6_000) < 1e-2);
    }

    #[test]
    fn the_drive_stays_within_its_limits_and_does_not_wind_up() {
        let control = response_loop(0.1);
        let (mut structure, mut hold) = settled();
        let mut go = |to: f64, samples: u32| {
            hold.set_out(
                Move {
                    response: to,
                    ..Move::default()
                },
                DT,
            );
            for _ in 0..samples {
                let (drive, _) = control.follow(&mut hold, 0.0, Some(structure.read));
                assert!((0.0..=0.1).contains(&drive));
                structure.advance(drive);
            }
            structure.a
        };
        // 0.1 m of drive hold 1.67 at most.
        assert!((go(5.0, 100_000) - 5.0 / 3.0).abs() < 1e-3);
        assert!((go(1.0, 20_000) - 1.0).abs() < 1e-2);
    }

    #[test]
    fn the_frequency_foreseen_is_handed_out_in_full() {
        let control = response_loop(1.0);
        let (_, mut hold) = settled();
        hold.set_out(
            Move {
                response: 1.1,
                duration: 3.0,
                amplitude: 0.0,
                omega: -0.7,
            },
            DT,
        );
        let shifted: f64 = (0..400)
            .map(|_| control.follow(&mut hold, 0.0, Some(1.0)).1)
            .sum();
        assert!((shifted + 0.7).abs() < 1e-12);
    }
}
