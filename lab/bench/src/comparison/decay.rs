//! The decay as theory and the exact plant predict it, integrated forward.

use lovines::State;
use vines_model::orbit::Orbit;
use vines_model::theory::{BranchSide, SlowFlow, free_sigma};

use crate::identification::{DecayPoint, decay_points};
use crate::record::{Record, Sample};
use crate::rig::{Command, Drive, Rig, Simulated};
use crate::scene::{Dimensionless, Scene};

/// The decay of the scene's plant from `orbit` on, over `samples` samples, as it would be identified without noise; without points if the plant
/// refuses the scene.
pub(super) fn predicted(orbit: &Orbit, scene: &Scene, samples: usize) -> Vec<DecayPoint> {
    let (d, step) = (scene.dimensionless(), scene.sample_time());
    let start = orbit.start;
    let [q1, q2] = [start.q1, start.q2].map(|length| length * d.b);
    let [dq1, dq2] = [start.dq1, start.dq2].map(|velocity| velocity * d.b * d.omega0);
    let Ok(plant) = Simulated::new(scene.plant, State { q1, dq1, q2, dq2 }) else {
        return Vec::new();
    };
    let mut rig = plant.with_sensors(scene.resonance);
    let mut sample = |n: usize| -> Option<Sample> {
        let sample = Sample {
            time: n as f64 * step,
            sensors: rig.sense().ok()?,
            command: Command {
                drive: Drive { omega: d.omega0 * orbit.omega, ..Drive::default() },
                ..Command::default()
            },
            ground_truth: rig.ground_truth().ok()?,
        };
        rig.advance(Drive::default(), step).ok()?;
        Some(sample)
    };
    // The first sample stands for the hold, which gives the frequency at the release.
    let samples = (0..samples + 1).map_while(&mut sample).collect();
    let record = Record {
        sample_time: step,
        samples,
        settled: 0,
        released: 1,
        held: false,
    };
    decay_points(&record, scene).points
}

/// sigma at the amplitude `c` along falling amplitudes; `None` outside.
pub(super) fn sigma_at(points: &[DecayPoint], c: f64) -> Option<f64> {
    let pair = points
        .windows(2)
        .find(|pair| pair[0].c >= c && c >= pair[1].c && pair[0].c > pair[1].c)?;
    let share = (pair[0].c - c) / (pair[0].c - pair[1].c);
    Some(pair[0].sigma + share * (pair[1].sigma - pair[0].sigma))
}

/// sigma of the slow flow at the amplitude `c` along the free decay: that of the backbone, and of the first order in the rate of the decay;
/// `None` where there is no 1:1 motion.
pub(super) fn by_slow_flow(d: &Dimensionless, c: f64) -> Option<f64> {
    let flow = SlowFlow::new(d.lambda, d.r);
    let g = flow.backbone_at(flow.manifold.b(c, BranchSide::Right)?).g;
    Some(free_sigma(d, c)? - 0.5 * d.epsilon * g * flow.drift(c)?.sigma)
}
