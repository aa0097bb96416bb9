//! The closed form with Brent's method: the baseline of benches/.

#[path = "../../../benches/baseline/mod.rs"]
mod baseline;

pub use baseline::Baseline;

use crate::method::{Failure, Method};
use crate::scene::{Scene, Step};

/// The baseline; its setting is the tolerance of the root search, s.
pub struct Brent(Baseline);

impl Method for Brent {
    fn start(scene: &Scene, setting: f64) -> Result<Self, Failure> {
        Ok(Self(Baseline::new(scene.parameters, scene.start, setting)))
    }

    fn step(&mut self, step: &Step) -> Result<(), Failure> {
        let ended = self.0.advance(step.amplitude, step.omega, step.duration);
        ended.map_err(|_| {
            let (t, n) = (self.0.elapsed, self.0.impacts);
            Failure(format!("stalled in the step from t = {t:.3} on, after {n} impacts"))
        })
    }

    fn state(&self) -> [f64; 4] {
        [self.0.q1, self.0.dq1, self.0.q2, self.0.dq2]
    }

    fn impacts(&self) -> u64 {
        self.0.impacts
    }
}
