//! The hypotheses about a rig: what its cavity, its suspension or its reference may be.

use lovines::cavity::GRAVITY;
use lovines::{Cavity, Parameters, Restitution};
use vines_model::theory::{B_SYMMETRY_BREAKING, Manifold};
use vines_model::{Definition, Dimensionless, Sensor};

use crate::branch::{self, Branch};
use crate::particle::{Law, Particle};
use crate::quantity::{Quantity, Unknowns};

/// What may be true of a rig. Friction acts beside every other effect: half-width and mass ratio make up for it, so that data rarely exclude it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hypothesis {
    /// An ideal cavity.
    Ideal,
    /// Coulomb friction on the floor.
    Friction,
    /// Gravity along the axis.
    Tilt,
    /// A restitution that falls with the speed as that of viscoelastic spheres. Its r is that at the speed of the impacts in the middle of the range.
    Viscoelastic,
    /// A restitution that falls with the speed as that of plastic impacts.
    Plastic,
    /// A cubic stiffness of the suspension, `k (1 + h (q1/b)²)`. It moves the frequency of a response of the amplitude C b by `3/8 h C²` of itself
    /// (harmonic balance), the more negative the softer. The plant has none: its motions are those of the ideal cavity.
    Cubic,
    /// An ideal cavity whose reference reads a share g too much.
    Reference,
    /// A nonlinear spring without a particle: `3/8 h (A/b)²` as of [`Hypothesis::Cubic`], with the half-width of the scene as the unit of length.
    Spring,
}

/// A typical strength, from which a search begins, over that which gives the particle the acceleration `b omega0²`: a typical friction and tilt are about
/// 0.03 and 2 degrees on the default rig.
pub(crate) const TYPICAL: f64 = 0.01;

impl Hypothesis {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::Ideal,
        Self::Friction,
        Self::Tilt,
        Self::Viscoelastic,
        Self::Plastic,
        Self::Cubic,
        Self::Reference,
        Self::Spring,
    ];

    /// Its name, and symbol and unit of its strength.
    #[must_use]
    pub fn names(self) -> [&'static str; 3] {
        match self {
            Self::Ideal => ["ideal cavity", "", ""],
            Self::Friction => ["friction", "mu", ""],
            Self::Tilt => ["tilt", "theta", "deg"],
            Self::Viscoelastic => ["viscoelastic restitution", "k_r", "(s/m)^(1/5)"],
            Self::Plastic => ["plastic restitution", "v_y", "m/s"],
            Self::Cubic => ["cubic stiffness", "h", ""],
            Self::Reference => ["gain of the reference", "g", ""],
            Self::Spring => ["nonlinear spring, no particle", "h", ""],
        }
    }

    /// Whether it has a particle in a cavity.
    #[must_use]
    pub fn is_cavity(self) -> bool {
        self != Self::Spring
    }

    /// Which unknowns it determines. A law of restitution stands for r.
    pub(crate) fn is_free(self, i: usize) -> bool {
        match i {
            0 | 1 => true,
            2..=4 => self.is_cavity(),
            6 => self.is_cavity() && self != Self::Ideal,
            7 => matches!(self, Self::Tilt | Self::Cubic | Self::Reference | Self::Spring),
            _ => false,
        }
    }

    /// Whether it acts on the particle.
    pub(crate) fn acts_on_particle(self) -> bool {
        matches!(self, Self::Tilt | Self::Viscoelastic | Self::Plastic)
    }

    /// The friction, or of tilt its square in rad², from which a search begins at a share of what gives the particle the acceleration `b omega0²`.
    pub(crate) fn start(self, x: &Unknowns, share: f64) -> f64 {
        let over_gravity = share * x[3].exp() * x[0].exp().powi(2) / GRAVITY;
        match self {
            Self::Friction => over_gravity,
            Self::Tilt => 4.0 * over_gravity * over_gravity,
            _ => 0.0,
        }
    }

    /// The cavity. `friction` is the coefficient, and `strength` the square of the tilt, rad² (the motions are even in it); a law of restitution has the
    /// value `r` at the impact speed `speed`, m/s.
    pub(crate) fn cavity(self, [friction, strength]: [f64; 2], r: f64, speed: f64) -> Cavity {
        let with = Cavity { kinetic_friction: friction.max(0.0), ..Cavity::IDEAL };
        let both = |law| Cavity { restitution: [Some(law); 2], ..with };
        match self {
            Self::Tilt => Cavity { tilt: strength.max(0.0).sqrt(), ..with },
            Self::Viscoelastic => both(Restitution::Viscoelastic(self.strength([friction, strength], r, speed))),
            Self::Plastic => both(Restitution::Plastic(self.strength([friction, strength], r, speed))),
            _ => with,
        }
    }

    /// The strength in the unit of [`Hypothesis::names`].
    pub(crate) fn strength(self, [friction, strength]: [f64; 2], r: f64, speed: f64) -> f64 {
        match self {
            Self::Friction => friction,
            Self::Tilt => strength.max(0.0).sqrt().to_degrees(),
            Self::Viscoelastic => (1.0 - r) / speed.powf(0.2),
            Self::Plastic => speed * r.powi(4),
            _ => strength,
        }
    }

    /// What it changes in a place of the curve, amplitude m, frequency rad/s and drive m, beside the particle.
    pub(crate) fn changed(self, x: &Unknowns, [amplitude, omega, drive]: [f64; 3]) -> [f64; 3] {
        match self {
            Self::Cubic => {
                let ratio = amplitude / x[3].exp();
                [amplitude, omega * (1.0 + 0.375 * x[7] * ratio * ratio), drive]
            }
            _ => [amplitude, omega, drive * (1.0 + self.gain(x))],
        }
    }

    /// The share that the reference reads too much.
    pub(crate) fn gain(self, x: &Unknowns) -> f64 {
        if self == Self::Reference { x[7] } else { 0.0 }
    }

    /// Its particle. A law of restitution has the value r at the impact speed `speed`, m/s.
    pub(crate) fn particle(self, x: &Unknowns, has_friction: bool, speed: f64, sensor: Sensor) -> Particle {
        let (b, omega0) = (x[3].exp(), x[0].exp());
        let friction = if has_friction { x[6].max(0.0) } else { 0.0 };
        let law = match self {
            Self::Viscoelastic => Law::Viscoelastic,
            Self::Plastic => Law::Plastic,
            _ => Law::Constant,
        };
        Particle {
            friction: GRAVITY * friction / (b * omega0 * omega0),
            law,
            speed: speed / (b * omega0),
            ..Particle::ideal([x[4].exp(), b, x[2]], sensor)
        }
    }

    /// Its curve in closed form, without friction.
    pub(crate) fn branch(self, x: &Unknowns, definition: Definition, range: [f64; 2]) -> Option<Branch> {
        match self {
            Self::Spring => branch::spring([x[0].exp(), x[1], x[7], x[3].exp()], definition, range),
            _ => Branch::ideal(&numbers(x, definition), |place| self.changed(x, place)),
        }
    }
}

/// The plant of some unknowns.
pub(crate) fn plant(x: &Unknowns, cavity: Cavity) -> Parameters {
    Parameters {
        primary_mass: Quantity::PrimaryMass.of(x),
        stiffness: Quantity::Stiffness.of(x),
        damping: Quantity::Damping.of(x).max(0.0),
        particle_mass: Quantity::ParticleMass.of(x),
        half_width: Quantity::B.of(x),
        restitution: Quantity::R.of(x),
        cavity,
    }
}

/// The dimensionless numbers of some unknowns.
pub(crate) fn numbers(x: &Unknowns, definition: Definition) -> Dimensionless {
    let epsilon = x[4].exp();
    Dimensionless {
        definition,
        omega0: x[0].exp(),
        b: x[3].exp(),
        ..Dimensionless::new(epsilon, 2.0 * x[1] / epsilon, x[2], 0.0)
    }
}

/// Speed of the particle in the middle of the range of the ideal cavity, over `b omega0`.
fn middle(r: f64) -> f64 {
    0.5 * (Manifold::new(r).b_min() + B_SYMMETRY_BREAKING)
}

/// Speed of the impacts in the middle of the range of the ideal cavity, m/s: there a law of restitution has the value r. The particle turns from -B to
/// B, so that its speed relative to the wall before the impact is `2 B (1 + epsilon)/(1 + r)`.
pub(crate) fn impact_speed(x: &Unknowns) -> f64 {
    2.0 * middle(x[2]) * x[3].exp() * x[0].exp() * (1.0 + x[4].exp()) / (1.0 + x[2])
}
