//! The closed form with Brent's method: the baseline of benches/.

#[path = "../../../benches/baseline/mod.rs"]
mod baseline;

pub use baseline::Baseline;
use baseline::Rig;
use lovines::Parameters;

use crate::method::{Failure, Method};
use crate::scene::{Scene, Step};

/// The baseline for a rig and a start (q1, q1', q2, q2').
pub fn baseline_of(p: Parameters, start: [f64; 4], tolerance: f64) -> Baseline {
    let rig = Rig {
        primary_mass: p.primary_mass,
        stiffness: p.stiffness,
        damping: p.damping,
        particle_mass: p.particle_mass,
        half_width: p.half_width,
        restitution: p.restitution,
    };
    Baseline::new(rig, start, tolerance)
}

/// The baseline; its setting is the tolerance of the root search, s.
pub struct Brent(Baseline);

impl Method for Brent {
    fn start(scene: &Scene, setting: f64) -> Result<Self, Failure> {
        Ok(Self(baseline_of(scene.parameters, scene.start, setting)))
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
