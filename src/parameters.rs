//! What the system is made of, in SI units. Its values are checked by the rows of `table.rs`.

use core::fmt;

/// Fastest rate that is accepted, rad/s: the series of the motion contain its powers, up to the fifteenth.
pub(crate) const FASTEST: f64 = 1e12;

/// The physical parameters of the linear oscillator and its vibro-impact particle.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Parameters {
    /// Primary mass `M`, kg.
    pub primary_mass: f64,
    /// Stiffness `k` between base and primary mass, N/m.
    pub stiffness: f64,
    /// Viscous damping `c` between base and primary mass, N·s/m.
    pub damping: f64,
    /// Particle mass `m`, kg.
    pub particle_mass: f64,
    /// Half-width `b` of the cavity, m: the particle is free while `|q1 - q2| < b`.
    pub half_width: f64,
    /// Newton's coefficient of restitution `r`.
    pub restitution: f64,
    /// Unequal gaps, tilt, friction and other restitution; off by default.
    pub cavity: Cavity,
}

impl Parameters {
    /// The dimensionless system: `M = k = b = 1`, `m = epsilon`, `c = epsilon lambda`.
    pub fn dimensionless(epsilon: f64, lambda: f64, restitution: f64) -> Self {
        Self {
            primary_mass: 1.0,
            stiffness: 1.0,
            damping: epsilon * lambda,
            particle_mass: epsilon,
            half_width: 1.0,
            restitution,
            cavity: Cavity::IDEAL,
        }
    }

    /// Natural frequency `omega0 = sqrt(k/M)`, rad/s.
    pub fn natural_frequency(&self) -> f64 {
        libm::sqrt(self.stiffness / self.primary_mass)
    }

    /// The fastest rate that the free motion can have, 1/s: of oscillation, or of creep where damping is heavy.
    pub fn fastest_rate(&self) -> f64 {
        self.natural_frequency().max(self.damping / self.primary_mass)
    }

    /// Mass ratio `epsilon = m/M`.
    pub fn mass_ratio(&self) -> f64 {
        self.particle_mass / self.primary_mass
    }

    /// Effective mass of the relative motion, `M m/(M + m)`, kg.
    pub fn relative_mass(&self) -> f64 {
        self.primary_mass * (self.particle_mass / (self.primary_mass + self.particle_mass))
    }

    /// Gaps to the walls at `w = b_plus` and at `w = -b_minus`, m.
    pub fn gaps(&self) -> [f64; 2] {
        [self.cavity.b_plus, self.cavity.b_minus].map(|gap| gap.unwrap_or(self.half_width))
    }

    /// Whether a motion has a mirror image, half a period later, as in an ideal cavity: neither tilt nor walls of different restitution. Where it has
    /// none, the 1:1 motion is asymmetric. (Unequal gaps move the middle of the cavity only.)
    pub fn has_mirror_images(&self) -> bool {
        let r = Restitution::Constant(self.restitution);
        let [plus, minus] = self.cavity.restitution.map(|law| law.unwrap_or(r));
        self.cavity.tilt == 0.0 && plus == minus
    }
}

/// How a wall returns the particle: the coefficient of restitution `r` at the speed of approach `v`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Restitution {
    /// `r`, whatever the speed.
    Constant(f64),
    /// `r = 1 - k v^(1/5)`, with `k` in (s/m)^(1/5): viscoelastic spheres (Ramírez et al., Phys. Rev. E 60 (1999) 4465).
    Viscoelastic(f64),
    /// `r = min(1, (v/v_y)^(-1/4))`, with the yield speed `v_y` in m/s: plastic impact (Johnson, "Contact Mechanics", 1985, chapter 11).
    Plastic(f64),
}

/// What distinguishes a real cavity from the ideal one. The default is the ideal one.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Cavity {
    /// Gap `b_plus` to the wall at `w = b_plus`, m; `None`: the half-width `b`.
    pub b_plus: Option<f64>,
    /// Gap `b_minus` to the wall at `w = -b_minus`, m; `None`: the half-width `b`.
    pub b_minus: Option<f64>,
    /// Tilt `theta` of the axis, rad: gravity accelerates the particle by `g sin(theta)` along the axis.
    pub tilt: f64,
    /// Coefficient `mu_k` of kinetic friction between particle and floor.
    pub kinetic_friction: f64,
    /// Coefficient `mu_s` of static friction, at least `mu_k`; `None`: `mu_k`.
    pub static_friction: Option<f64>,
    /// Restitution of the walls at `w = b_plus` and at `w = -b_minus`; `None`: the constant of the parameters.
    pub restitution: [Option<Restitution>; 2],
    /// Least coefficient of restitution `r_min`.
    pub least_restitution: f64,
    /// Relative standard deviation of the coefficient of restitution from impact to impact.
    pub scatter: f64,
    /// Seed of the scatter.
    pub seed: u64,
}

impl Cavity {
    /// The ideal cavity.
    pub const IDEAL: Self = Self {
        b_plus: None,
        b_minus: None,
        tilt: 0.0,
        kinetic_friction: 0.0,
        static_friction: None,
        restitution: [None; 2],
        least_restitution: 0.0,
        scatter: 0.0,
        seed: 0,
    };
}

impl Default for Cavity {
    fn default() -> Self {
        Self::IDEAL
    }
}

/// An invalid value: its name, its unit, and what is allowed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InvalidValue {
    /// Symbol and meaning of the quantity.
    pub name: &'static str,
    /// The value refused.
    pub value: f64,
    /// Its unit.
    pub unit: &'static str,
    /// What is allowed.
    pub allowed: &'static str,
}

impl InvalidValue {
    /// Refuses a value that is not valid.
    pub fn unless(
        valid: bool,
        name: &'static str,
        value: f64,
        unit: &'static str,
        allowed: &'static str,
    ) -> Result<(), Self> {
        valid.then_some(()).ok_or(Self { name, value, unit, allowed })
    }
}

impl fmt::Display for InvalidValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (Self { name, unit, allowed, .. }, value) = (self, format!("{:?}", self.value));
        let (space, value) = (if unit.is_empty() { "" } else { " " }, value.trim_end_matches(".0"));
        write!(f, "{name} = {value}{space}{unit} is refused; allowed is {allowed}")
    }
}

impl core::error::Error for InvalidValue {}
