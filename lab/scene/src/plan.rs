//! What an experiment does, in SI units: made from a scene, and from what was measured on the rig before. A scene does not change.

use lovines::Section;
use phase_lock::Config;

use crate::knowledge::Knowledge;
use crate::scene::{Scene, Structure};

/// An experiment on a rig: what is known of it, and what is done.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// What is known of the rig.
    pub knowledge: Knowledge,
    /// What a structure adds to the response of its driven mode: all sections, and this mode with the opposite sign, each with the weights of its state
    /// in the response per unit of the base. Empty for one oscillator, and behind a shaker.
    pub beside: Vec<(Section, [f64; 2])>,
    /// Requested amplitude of the base, m.
    pub amplitude: f64,
    /// Configuration of the controller for the lock; its limits guard the rig whatever controls it.
    pub lock: Config,
    /// Configuration of the controller for the tracked backbone.
    pub tracking: Config,
    /// Samples of the hold.
    pub hold: usize,
    /// Longest ramp of the drive after the controller was asked to release it, samples: in this time the response of the linear rig falls to
    /// 5 % (where a decay counts as over), so that after a longer ramp nothing is left to decay.
    pub ramp: usize,
    /// Samples of the recorded decay.
    pub decay: usize,
    /// Levels of the tracked backbone, amplitudes of the response, m, in the order in which they are visited.
    pub levels: Vec<f64>,
    /// Largest relative uncertainty of a level, as in [`BackboneSettings`](crate::scene::BackboneSettings).
    pub precision: f64,
}

impl Plan {
    /// Requested amplitude of the base, m, as it moves with the frequency `omega`, rad/s: a held base moves a little less than its samples.
    pub fn requested(&self, omega: f64) -> f64 {
        self.amplitude * self.knowledge.target.base_per_sample(omega, self.knowledge.sample_time)
    }
}

/// Share of its amplitude to which the response of the linear rig falls in the recorded decay. The 1:1 motion has a smaller range, from symmetry
/// breaking to the fold, and impacts make the decay faster.
pub const DECAYED: f64 = 0.05;
/// Longest recorded decay, natural periods, unless the scene asks for a longer one: a bound for rigs with little damping.
const LONGEST_DECAY: f64 = 5000.0;

impl Scene {
    /// The experiment on a rig that is as the scene says.
    pub fn plan(&self) -> Plan {
        self.plan_on(self.knowledge())
    }

    /// The experiment on a rig of which this is known.
    pub fn plan_on(&self, mut knowledge: Knowledge) -> Plan {
        // The decay lasts as long as the linear rig takes to fall to the share that is recorded.
        let relaxed = (-DECAYED.ln() * knowledge.linear.relaxation_periods()).min(LONGEST_DECAY);
        let decay = self.record.decay_periods.unwrap_or(relaxed);
        let structure = self.structure.as_ref().filter(|one| one.shaker.is_none());
        let lock = self.lock_config(&knowledge);
        knowledge.target.delay = lock.delay;
        Plan {
            knowledge,
            beside: structure.map_or(Vec::new(), Structure::beside_driven_mode),
            amplitude: self.amplitude,
            lock,
            tracking: self.tracking_config(&knowledge),
            hold: knowledge.samples(self.record.hold_periods),
            ramp: knowledge.samples(relaxed),
            decay: knowledge.samples(decay),
            levels: self.backbone.levels(self.plant.half_width),
            precision: self.backbone.precision,
        }
    }
}
