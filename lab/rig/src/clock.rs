//! The time of a simulated rig.

/// Time of a simulation in steps: their number times their length since that has changed. A sum of steps would carry a rounding error of
/// each, and a component with a clock of its own would now and then make no step, or two.
#[derive(Clone, Copy, Debug, Default)]
pub struct Clock {
    origin: f64,
    count: u32,
    step: f64,
}

impl Clock {
    /// The time, s.
    pub fn time(&self) -> f64 {
        self.origin + f64::from(self.count) * self.step
    }

    /// Goes on by a step, s.
    pub fn advance(&mut self, step: f64) {
        if step != self.step {
            *self = Self { origin: self.time(), count: 0, step };
        }
        self.count += 1;
    }
}
