//! What moves: the rig, its two masses, and its base.

use crate::arithmetic::{Sum, Sums};
use crate::base_motion::BaseMotion;
use crate::contact::ImpactLaw;
use crate::oscillator::Oscillator;
use crate::parameters::Parameters;

/// The parameters and what follows from them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rig {
    pub parameters: Parameters,
    pub mass_ratio: f64,
    pub law: ImpactLaw,
    /// The primary mass while the particle is free, and both masses while it is stuck.
    pub free: Oscillator,
    pub stuck: Oscillator,
}

impl From<Parameters> for Rig {
    fn from(p: Parameters) -> Self {
        let total = p.primary_mass + p.particle_mass;
        Self {
            parameters: p,
            mass_ratio: p.mass_ratio(),
            law: ImpactLaw::new(&p),
            free: Oscillator::new(p.primary_mass, p.stiffness, p.damping),
            stuck: Oscillator::new(total, p.stiffness, p.damping),
        }
    }
}

/// Displacements and velocities of both masses.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Masses {
    /// Displacement of the primary mass, m, and its velocity, m/s.
    pub primary: Sums,
    /// Relative displacement `w = q1 - q2`, m. It is carried itself: in a narrow gap the difference of two large
    /// displacements would have lost it.
    pub w: Sum,
    /// Relative velocity `w'`, m/s. After an impact it has more digits than the difference of two large velocities.
    pub dw: f64,
    /// Velocity of the particle, m/s.
    pub particle: f64,
}

impl Masses {
    /// Adds `dw` to the relative displacement, in which no wall is met.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn drift(&mut self, dw: f64, half_width: f64) {
        self.w = self.w.plus(dw);
        if self.w.value().abs() > half_width {
            self.w = Sum::from(half_width.copysign(self.w.value()));
        }
    }
}

/// The parts of a plant that move, and the rig.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Moving {
    pub rig: Rig,
    pub masses: Masses,
    pub base: BaseMotion,
}
