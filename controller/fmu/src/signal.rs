//! A sensor channel between communication points.
//!
//! A master sets inputs when a step begins, and the samples lie on a grid of their own. Where a sample does not fall on a
//! communication point, the value set there is up to a step old. A phase detector takes samples of irregular age for a
//! modulation of the signal, and the lock moves. So the channel is continued to the instant of the sample: by the
//! derivatives that the master has given, else by the straight line through the last two communication points. The line's
//! error is of second order in the step, and in phase with a harmonic signal, so that it shifts no phase.

/// The highest order of input derivatives that is followed.
pub(crate) const DERIVATIVES: usize = 3;

/// A value with the coefficients of its Taylor polynomial, as the master has set it, and the one before.
#[derive(Clone, Copy, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(crate) struct Signal {
    /// The value at the communication point.
    pub value: f64,
    /// Coefficients of t, t² and t³; they hold for one step.
    coefficients: [f64; DERIVATIVES],
    /// Whether the master has given derivatives for the step to come, be they zero.
    given: bool,
    /// The last communication point before this one, s, and its value.
    before: Option<(f64, f64)>,
}

impl Signal {
    /// Takes the time derivative of that order, from 1 to [`DERIVATIVES`].
    pub fn set_derivative(&mut self, order: usize, value: f64) {
        let factorial: usize = (1..=order).product();
        self.coefficients[order - 1] = value / factorial as f64;
        self.given = true;
    }

    /// Whether the master has said how the signal goes on.
    pub fn is_given(&self) -> bool {
        self.given
    }

    /// Prepares a step of `step` s from `time`, s. Where no derivatives were given and neither this step nor the last one is
    /// longer than `longest` s, the last communication point tells the slope; else the value is held.
    pub fn begin(&mut self, time: f64, step: f64, longest: f64) {
        if let (false, Some((then, value))) = (self.given, self.before) {
            let elapsed = time - then;
            if elapsed > 0.0 && elapsed.max(step) <= longest {
                self.coefficients[0] = (self.value - value) / elapsed;
            }
        }
    }

    /// The signal `elapsed` s after the communication point.
    pub fn at(&self, elapsed: f64) -> f64 {
        let [first, second, third] = self.coefficients;
        self.value + elapsed * (first + elapsed * (second + elapsed * third))
    }

    /// Ends the step from `time`, s.
    pub fn end(&mut self, time: f64) {
        self.before = Some((time, self.value));
        self.coefficients = [0.0; DERIVATIVES];
        self.given = false;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_channel_without_a_past_is_held() {
        let mut signal = Signal {
            value: 2.0,
            ..Signal::default()
        };
        signal.begin(0.0, 0.5, 1.0);
        assert_eq!(signal.at(0.5), 2.0);
    }

    #[test]
    fn two_communication_points_make_a_straight_line() {
        let mut signal = Signal::default();
        signal.begin(0.0, 0.5, 1.0);
        signal.end(0.0);
        signal.value = 1.0;
        signal.begin(0.5, 0.5, 1.0);
        assert_eq!(signal.at(0.25), 1.5);
    }

    #[test]
    fn long_steps_before_or_now_are_no_line() {
        for (time, step) in [(2.0, 0.5), (0.5, 2.0)] {
            let mut signal = Signal::default();
            signal.end(0.0);
            signal.value = 1.0;
            signal.begin(time, step, 1.0);
            assert_eq!(signal.at(0.25), 1.0);
        }
    }

    #[test]
    fn given_derivatives_make_a_polynomial_for_one_step() {
        let mut signal = Signal::default();
        signal.end(0.0);
        signal.value = 1.0;
        for (order, value) in [(1, 2.0), (2, 6.0), (3, 24.0)] {
            signal.set_derivative(order, value);
        }
        signal.begin(0.5, 0.5, 1.0);
        assert_eq!(signal.at(0.5), 1.0 + 1.0 + 0.75 + 0.5);
        signal.end(0.5);
        assert!(!signal.is_given());
        assert_eq!(signal.at(0.5), 1.0);
    }
}
