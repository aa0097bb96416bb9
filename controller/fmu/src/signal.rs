//! A sensor channel between communication points.
//!
//! A master sets inputs when a step begins, and the samples lie on a grid of their own. Where a sample does not fall on a
//! communication point, the value set there is up to a step old. A phase detector takes the irregular age of the samples for
//! a modulation of the signal, and the lock shifts. Therefore the channel is extrapolated to the instant of the sample: by the
//! derivatives that the master has given, else by the parabola through the last three communication points. (A straight
//! line shifts the lock as little, but modulates the amplitude by its error of second order, so that no lock is reported.)

/// The highest order of input derivatives that is followed.
pub(crate) const INPUT_ORDER: usize = 3;

/// A communication point: its time, s, and the value set there.
type CommunicationPoint = (f64, f64);

/// A value with the coefficients of its Taylor polynomial, as the master has set it, and those before.
#[derive(Clone, Copy, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(crate) struct InputSignal {
    /// The value at the communication point.
    pub value: f64,
    /// Coefficients of t, t² and t³; they hold for one step.
    coefficients: [f64; INPUT_ORDER],
    /// Whether the master has given derivatives for the step to come, be they zero.
    given: bool,
    /// The last communication points before this one, the latest first.
    before: [Option<CommunicationPoint>; 2],
}

impl InputSignal {
    /// Takes the time derivative of that order, from 1 to [`INPUT_ORDER`].
    pub fn set_derivative(&mut self, order: usize, value: f64) {
        let factorial: usize = (1..=order).product();
        self.coefficients[order - 1] = value / factorial as f64;
        self.given = true;
    }

    /// Whether the master has given the derivatives of the signal.
    pub fn is_given(&self) -> bool {
        self.given
    }

    /// Prepares a step of `step` s from `time`, s. Where no derivatives were given, they follow from the steps before this one; a
    /// value is held where a step is longer than `longest` s.
    pub fn begin(&mut self, time: f64, step: f64, longest: f64) {
        if self.given || step > longest {
            return;
        }
        let near = |later: f64, earlier: f64| later > earlier && later - earlier <= longest;
        let Some((then, last)) = self.before[0].filter(|&(then, _)| near(time, then)) else {
            return;
        };
        let slope = (self.value - last) / (time - then);
        self.coefficients[0] = slope;
        if let Some((origin, first)) = self.before[1].filter(|&(origin, _)| near(then, origin)) {
            // Divided differences: a slope half a step ago becomes that of now.
            let curvature = (slope - (last - first) / (then - origin)) / (time - origin);
            self.coefficients[0] += curvature * (time - then);
            self.coefficients[1] = curvature;
        }
    }

    /// The signal `elapsed` s after the communication point.
    pub fn at(&self, elapsed: f64) -> f64 {
        let [first, second, third] = self.coefficients;
        self.value + elapsed * (first + elapsed * (second + elapsed * third))
    }

    /// Ends the step from `time`, s.
    pub fn end(&mut self, time: f64) {
        self.before = [Some((time, self.value)), self.before[0]];
        self.coefficients = [0.0; INPUT_ORDER];
        self.given = false;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A channel that has read these values at these times, and reads the last of them for a step of that length; the longest step is 1 s.
    fn read(points: &[CommunicationPoint], step: f64) -> InputSignal {
        let mut signal = InputSignal::default();
        for (n, &(time, value)) in points.iter().enumerate() {
            signal.value = value;
            if n + 1 == points.len() {
                signal.begin(time, step, 1.0);
            } else {
                signal.begin(time, 0.5, 1.0);
                signal.end(time);
            }
        }
        signal
    }

    #[test]
    fn communication_points_make_a_polynomial_and_a_channel_without_a_past_or_with_a_long_step_is_held() {
        let parabola = |t: f64| (t, 1.0 - 2.0 * t + 3.0 * t * t);
        assert_eq!(read(&[(0.0, 2.0)], 0.5).at(0.5), 2.0);
        assert_eq!(read(&[(0.0, 0.0), (0.5, 1.0)], 0.5).at(0.25), 1.5);
        let uneven = read(&[0.0, 0.25, 1.0].map(parabola), 0.5).at(0.5);
        assert!((uneven - parabola(1.5).1).abs() < 1e-12);
        for (time, step) in [(2.0, 0.5), (0.5, 2.0)] {
            assert_eq!(read(&[(0.0, 0.0), (time, 1.0)], step).at(0.25), 1.0);
        }
    }

    #[test]
    fn given_derivatives_make_a_polynomial_for_one_step() {
        let mut signal = read(&[(0.0, 0.0), (0.25, 0.0)], 0.5);
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
