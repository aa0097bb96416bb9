//! The two walls of the cavity, and what happens at an impact.

use crate::base_motion::{evenly, product, two_sum};
use crate::lane::Lane;
#[cfg(feature = "batch")]
use crate::lane::Lanes;
use crate::parameters::Parameters;
use serde::{Deserialize, Serialize};

/// A wall of the cavity.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Wall {
    /// The wall touched at `w = +b`; it pushes the particle towards +q2.
    Plus,
    /// The wall touched at `w = -b`; it pushes the particle towards -q2.
    Minus,
}

impl Wall {
    /// Both walls.
    pub const BOTH: [Wall; 2] = [Wall::Plus, Wall::Minus];

    /// +1 or -1.
    pub fn sign(self) -> f64 {
        match self {
            Wall::Plus => 1.0,
            Wall::Minus => -1.0,
        }
    }

    /// The wall on the other side.
    pub fn other(self) -> Self {
        match self {
            Wall::Plus => Wall::Minus,
            Wall::Minus => Wall::Plus,
        }
    }
}

/// Coefficients of Newton's impact law, derived once.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ImpactLaw<T = f64> {
    restitution: T,
    /// Velocity taken from the primary mass per unit of approach, `(1 + r) m/(M + m)`, as the sum of two numbers.
    ///
    /// Its rounding has the same sign at every impact: as one number, a million elastic ones would gain energy by it.
    primary_share: (T, T),
    /// `m/(M + m)`.
    particle_fraction: T,
    /// Half the effective mass, kg.
    half_relative_mass: T,
}

/// Velocities right after an impact, m/s, and what it dissipated, J.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rebound<T = f64> {
    /// Velocity of the primary mass.
    pub primary: T,
    /// Velocity of the particle.
    pub particle: T,
    /// Relative velocity `w'`.
    pub relative: T,
    /// Energy dissipated.
    pub dissipated: T,
}

impl ImpactLaw {
    /// The law for these masses and this coefficient of restitution.
    pub fn new(p: &Parameters) -> Self {
        let (total, total_missed) = two_sum(p.primary_mass, p.particle_mass);
        let (factor, factor_missed) = two_sum(1.0, p.restitution);
        let share = factor * (p.particle_mass / total);
        // `factor m - share total`, to first order in what has been lost.
        let (wanted, wanted_missed) = product(factor, p.particle_mass);
        let (got, got_missed) = product(share, total);
        let lost = (wanted - got)
            + (wanted_missed - got_missed + factor_missed * p.particle_mass - share * total_missed);
        Self {
            restitution: p.restitution,
            primary_share: evenly(share, lost / total),
            particle_fraction: p.particle_mass / total,
            half_relative_mass: 0.5 * p.relative_mass(),
        }
    }

    /// Both masses go on as one: the velocity that conserves momentum, and the energy that is lost.
    pub fn join(&self, primary: f64, relative: f64) -> (f64, f64) {
        (
            primary - self.particle_fraction * relative,
            self.half_relative_mass * relative * relative,
        )
    }

    /// How long infinitely many impacts take that begin with this rebound speed under a constant pressing acceleration:
    /// `2 u/a (1 + r + r² + ...)`, s; infinite without loss.
    pub fn chatter_duration(&self, speed: f64, pressing: f64) -> f64 {
        2.0 * speed / (pressing * (1.0 - self.restitution))
    }
}

impl<T: Lane> ImpactLaw<T> {
    /// Newton's law: the relative velocity turns round and shrinks by `r`, momentum is conserved.
    #[inline(always)]
    pub fn rebound(&self, primary: T, relative: T) -> Rebound<T> {
        let (r, one) = (self.restitution, T::splat(1.0));
        let (head, tail) = self.primary_share;
        let primary = primary - (head * relative + tail * relative);
        let after = -r * relative;
        Rebound {
            primary,
            particle: primary - after,
            relative: after,
            dissipated: self.half_relative_mass * ((one - r) * (one + r)) * (relative * relative),
        }
    }
}

#[cfg(feature = "batch")]
impl<const N: usize> ImpactLaw<Lanes<N>> {
    /// Several laws abreast.
    pub(crate) fn abreast(laws: [&ImpactLaw; N]) -> Self {
        let all = |f: fn(&ImpactLaw) -> f64| Lanes(laws.map(f));
        Self {
            restitution: all(|law| law.restitution),
            primary_share: (
                all(|law| law.primary_share.0),
                all(|law| law.primary_share.1),
            ),
            particle_fraction: all(|law| law.particle_fraction),
            half_relative_mass: all(|law| law.half_relative_mass),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn an_impact_keeps_momentum_and_dissipates_what_it_says(
            epsilon in 1e-6..1.0f64, r in 1e-3..=1.0f64, v1 in -2.0..2.0f64, v2 in -2.0..2.0f64,
        ) {
            let p = Parameters::dimensionless(epsilon, 1.0, r);
            let after = ImpactLaw::new(&p).rebound(v1, v1 - v2);
            prop_assert!((after.primary + epsilon * after.particle - v1 - epsilon * v2).abs() < 4e-15);
            prop_assert!((after.primary - after.particle - after.relative).abs() < 4e-15);
            let energy = |v1: f64, v2: f64| 0.5 * (v1 * v1 + epsilon * v2 * v2);
            let lost = energy(v1, v2) - energy(after.primary, after.particle);
            prop_assert!((lost - after.dissipated).abs() < 2e-14);
            prop_assert!(after.dissipated >= 0.0);
        }
    }
}
