//! The rig's differential equations between events, and the outputs at one instant: written once, for numbers and for dual
//! numbers, so that partial derivatives follow from the same lines.
//!
//! The damper force contains the velocity of the base, which is unknown for a signal that is given by values. The states are therefore
//! *reduced* velocities: velocities less the contribution of the base through the damper:
//!
//! ```text
//! free:   u1 = q1' - (c/M) base       u1' = (k (base - q1) - c q1')/M        u2 = q2'            u2' = 0
//! stuck:  u1 = q' - c/(M + m) base    u1' = (k (base - q) - c q')/(M + m)    u2, u2' the same
//! ```
//!
//! No derivative of the base displacement is needed. Where the base jumps, `u1` does not: the velocity jump `c Δe/M` follows.

pub use super::dual::{Dual, Scalar};

/// Parameters, drive and state of the rig at one instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Instant<T> {
    /// Primary mass, kg.
    pub primary_mass: T,
    /// Stiffness, N/m.
    pub stiffness: T,
    /// Damping, N·s/m.
    pub damping: T,
    /// Particle mass, kg.
    pub particle_mass: T,
    /// Base displacement signal, m.
    pub signal: T,
    /// Slope of that signal, m/s, where it is known.
    pub slope: T,
    /// Amplitude of the base oscillator, m.
    pub amplitude: T,
    /// Frequency of the base oscillator, rad/s.
    pub omega: T,
    /// Phase of the base oscillator, rad.
    pub phase: T,
    /// Displacement of the primary mass, m.
    pub q1: T,
    /// Velocity of the primary mass, m/s.
    pub dq1: T,
    /// Displacement of the particle, m.
    pub q2: T,
    /// Velocity of the particle, m/s.
    pub dq2: T,
    /// Acceleration of the particle by gravity along the axis, m/s².
    pub gravity: T,
    /// Acceleration of the particle by kinetic friction, m/s²; 0 while it does not slide.
    pub friction: T,
    /// Whether both masses move as one.
    pub stuck: bool,
}

impl<T: Scalar> Instant<T> {
    /// Displacement of the base, m.
    pub fn base(&self) -> T {
        self.signal + self.amplitude * self.phase.sine()
    }

    /// Velocity of the base as far as it is known, m/s.
    pub fn base_velocity(&self) -> T {
        self.slope + self.amplitude * self.omega * self.phase.cosine()
    }

    /// `v = q1 + (m/M) q2`, m.
    pub fn centre(&self) -> T {
        self.q1 + self.particle_mass / self.primary_mass * self.q2
    }

    /// `w = q1 - q2`, m.
    pub fn relative_displacement(&self) -> T {
        self.q1 - self.q2
    }

    /// `w'`, m/s.
    pub fn relative_velocity(&self) -> T {
        self.dq1 - self.dq2
    }

    /// Mechanical energy of both masses, the spring and the particle's weight on a tilted axis, J.
    pub fn energy(&self) -> T {
        let stretch = self.q1 - self.base();
        T::from(0.5)
            * (self.primary_mass * self.dq1 * self.dq1
                + self.particle_mass * self.dq2 * self.dq2
                + self.stiffness * stretch * stretch)
            - self.particle_mass * self.gravity * self.q2
    }

    /// The mass that the spring moves: the primary one alone, or both.
    fn moved_mass(&self) -> T {
        if self.stuck {
            self.primary_mass + self.particle_mass
        } else {
            self.primary_mass
        }
    }

    /// Contributions of the base displacement to the velocities of the primary mass and of the particle.
    fn reductions(&self) -> (T, T) {
        let passed_on = self.damping / self.moved_mass() * self.base();
        (passed_on, if self.stuck { passed_on } else { T::from(0.0) })
    }

    /// The reduced velocities `u1` and `u2`, m/s.
    pub fn reduced_velocities(&self) -> (T, T) {
        let (of_primary, of_particle) = self.reductions();
        (self.dq1 - of_primary, self.dq2 - of_particle)
    }

    /// The same instant with velocities that belong to these reduced ones.
    pub fn with_reduced(mut self, (u1, u2): (T, T)) -> Self {
        let (of_primary, of_particle) = self.reductions();
        self.dq1 = u1 + of_primary;
        self.dq2 = u2 + of_particle;
        self
    }

    /// The derivatives of `u1` and `u2`, m/s².
    pub fn reduced_accelerations(&self) -> (T, T) {
        let force = self.stiffness * (self.base() - self.q1) - self.damping * self.dq1;
        let transmitted = if self.stuck {
            self.gravity
        } else {
            T::from(0.0) - self.friction
        };
        let acceleration = (force + self.particle_mass * transmitted) / self.moved_mass();
        let of_particle = if self.stuck {
            acceleration
        } else {
            self.gravity + self.friction
        };
        (acceleration, of_particle)
    }

    /// Acceleration of the primary mass, or of both, m/s²; contains the derivative of the signal as far as it is known.
    pub fn acceleration(&self) -> T {
        let passed_on = self.damping / self.moved_mass() * self.base_velocity();
        self.reduced_accelerations().0 + passed_on
    }
}
