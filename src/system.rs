//! Coefficients of a system, and what moves in it.

use crate::arithmetic::{Sum, Sums};
use crate::base_motion::{BaseMotion, Drive};
use crate::cavity::{Forces, Rebound};
use crate::contact::{ImpactLaw, Wall};
use crate::oscillator::Oscillator;
use crate::parameters::Parameters;

/// The parameters and what follows from them.
#[derive(Clone, Copy, Debug)]
pub struct System {
    pub parameters: Parameters,
    pub mass_ratio: f64,
    /// Half the distance between the walls, m.
    pub half_width: f64,
    /// The middle between the walls, as a value of `q1 - q2`, m.
    pub middle: f64,
    /// Whether it is not 0: the gaps are unequal.
    pub is_skewed: bool,
    /// The law of impacts, where the coefficient of restitution is constant.
    pub law: ImpactLaw,
    /// The coefficient of restitution, where it `varies`.
    pub rebound: Rebound,
    pub varies: bool,
    pub forces: Forces,
    /// Whether it varies or forces act.
    pub is_real: bool,
    /// The primary mass while the particle is free, and both masses while it is stuck.
    pub free: Oscillator,
    pub stuck: Oscillator,
}

impl From<Parameters> for System {
    fn from(p: Parameters) -> Self {
        let total = p.primary_mass + p.particle_mass;
        let ([plus, minus], rebound, forces) = (p.gaps(), Rebound::new(&p), Forces::new(&p));
        let varies = !rebound.is_constant(p.restitution);
        Self {
            half_width: 0.5 * plus + 0.5 * minus,
            middle: 0.5 * (plus - minus),
            is_skewed: plus != minus,
            varies,
            rebound,
            forces,
            is_real: varies || forces.act(),
            parameters: p,
            mass_ratio: p.mass_ratio(),
            law: ImpactLaw::new(&p),
            free: Oscillator::new(p.primary_mass, p.stiffness, p.damping),
            stuck: Oscillator::new(total, p.stiffness, p.damping),
        }
    }
}

impl System {
    /// Acceleration of the particle by kinetic friction while `w'` has the sign `direction`, m/s².
    pub fn friction(&self, direction: f64) -> f64 {
        self.forces.kinetic * direction
    }

    /// The displacement of the equilibrium, m, by the force that gives the particle the acceleration `acceleration`, m/s².
    pub fn shift(&self, acceleration: f64) -> f64 {
        self.parameters.particle_mass * acceleration / self.parameters.stiffness
    }

    /// The base that moves the primary mass as `base` and that force on it do.
    pub fn pushed(&self, base: BaseMotion, acceleration: f64) -> BaseMotion {
        let shift = self.shift(acceleration);
        let [u0, u1, u2, u3] = base.drive.signal;
        BaseMotion {
            drive: Drive { signal: [u0 + shift, u1, u2, u3], ..base.drive },
            ..base
        }
    }
}

/// What a particle at rest relative to the primary mass is held by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Contact {
    /// A wall, which pushes, and friction.
    Wall(Wall),
    /// Friction alone.
    Floor,
}

impl Contact {
    /// The wall, if it is one.
    pub fn wall(self) -> Option<Wall> {
        match self {
            Self::Wall(wall) => Some(wall),
            Self::Floor => None,
        }
    }
}

/// Displacements and velocities of both masses.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Masses {
    /// Displacement of the primary mass, m, and its velocity, m/s.
    pub primary: Sums,
    /// Relative displacement from the middle of the cavity, `w = q1 - q2 - middle`, m. It is carried itself: in a narrow gap the
    /// difference of two large displacements would have lost it.
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

/// The parts of a plant that move, and the system.
#[derive(Clone, Copy, Debug)]
pub struct Moving {
    pub system: System,
    pub masses: Masses,
    pub base: BaseMotion,
}
