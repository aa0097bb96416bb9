//! The walls of the cavity: impact, rest and release.

use crate::arithmetic::{plus, split_coefficient, times, two_sum};
use crate::parameters::Parameters;

/// A hop lower than this fraction of the half-width cannot be told from contact in double precision.
pub(crate) const LOWEST_HOP: f64 = 1.0 / (1u64 << 56) as f64;
/// Hops that last less than this fraction of the fastest rate's time are not followed one by one.
const SHORTEST_HOP: f64 = 1e-9;
/// Above this coefficient of restitution a chatter has too many hops to be followed to its end.
const LIVELY: f64 = 0.999;
/// Such a particle stays on the wall once its hops last less than this fraction of the fastest rate's time: its position is
/// then known to 1.3e-13 and its velocity to 5e-7, in units of the wall's acceleration and that time.
const SHORTEST_LIVELY_HOP: f64 = 1e-6;

/// A wall of the cavity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
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

/// How particle and wall touch.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) enum Contact {
    Free,
    Stuck(Wall),
    /// Free, and the wall has ceased to push at this very instant.
    Released(Wall),
}

/// Coefficients of Newton's impact law, derived once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImpactLaw {
    restitution: f64,
    /// Velocity taken from the primary mass per unit of approach, `(1 + r) m/(M + m)`, as the sum of two numbers.
    ///
    /// Its rounding error has the same sign at every impact: as one number, a million elastic impacts would gain energy by it.
    primary_share: (f64, f64),
    /// `m/(M + m)`.
    particle_fraction: f64,
    /// Half the effective mass, kg.
    half_relative_mass: f64,
}

/// Velocities right after an impact, m/s, and the energy it dissipated, J.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rebound {
    /// Velocity of the primary mass.
    pub primary: f64,
    /// Velocity of the particle.
    pub particle: f64,
    /// Relative velocity `w'`.
    pub relative: f64,
    /// Energy dissipated.
    pub dissipated: f64,
}

/// What decides whether a particle that leaves a wall is in truth at rest on it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Departure {
    /// Speed away from the wall, 0 or above.
    pub speed: f64,
    /// Acceleration of the wall towards the particle, and its rounding error, m/s².
    pub pressing: (f64, f64),
    /// The fastest rate of the oscillator, 1/s.
    pub fastest: f64,
    /// Half-width of the cavity, m.
    pub half_width: f64,
    /// Time left in the step, s.
    pub left: f64,
}

impl ImpactLaw {
    /// The law for these masses and this coefficient of restitution.
    pub fn new(p: &Parameters) -> Self {
        let total = two_sum(p.primary_mass, p.particle_mass);
        let factor = two_sum(1.0, p.restitution);
        let share = factor.0 * (p.particle_mass / total.0);
        // `factor m - share total`, to first order in the rounding errors.
        let wanted = times(factor, (p.particle_mass, 0.0));
        let got = times((share, 0.0), total);
        let (lost, error) = plus(wanted, (-got.0, -got.1));
        Self {
            restitution: p.restitution,
            primary_share: split_coefficient((share, (lost + error) / total.0)),
            particle_fraction: p.particle_mass / total.0,
            half_relative_mass: 0.5 * p.relative_mass(),
        }
    }

    /// Newton's law: the relative velocity is reversed and reduced by `r`, momentum is conserved.
    #[inline(always)]
    pub fn rebound(&self, primary: f64, relative: f64) -> Rebound {
        let r = self.restitution;
        let (head, tail) = self.primary_share;
        let primary = primary - (head * relative + tail * relative);
        let after = -r * relative;
        Rebound {
            primary,
            particle: primary - after,
            relative: after,
            dissipated: self.half_relative_mass * ((1.0 - r) * (1.0 + r)) * (relative * relative),
        }
    }

    /// Both masses go on as one: the velocity that conserves momentum, and the energy that is lost.
    pub fn join(&self, primary: f64, relative: f64) -> (f64, f64) {
        (
            primary - self.particle_fraction * relative,
            self.half_relative_mass * relative * relative,
        )
    }

    /// Duration of infinitely many impacts that begin with this rebound speed under a constant pressing acceleration:
    /// `2 u/a (1 + r + r² + ...)`, s; infinite for `r = 1`.
    pub fn chatter_duration(&self, speed: f64, pressing: f64) -> f64 {
        2.0 * speed / (pressing * (1.0 - self.restitution))
    }

    /// Whether a rebound at `speed` is certainly not at rest, whatever the acceleration up to `largest`.
    #[inline(always)]
    pub(crate) fn certainly_leaves(
        &self,
        speed: f64,
        largest: f64,
        (fastest, half_width): (f64, f64),
    ) -> bool {
        speed * speed > 2.0 * LOWEST_HOP * half_width * largest
            && (self.restitution <= LIVELY || 2.0 * speed * fastest > SHORTEST_LIVELY_HOP * largest)
    }

    /// Whether the particle is at rest on the wall it leaves.
    ///
    /// Its hops are then below resolution (height `u²/(2a)`), and they die out within `2u/(a (1 - r))`. Letting both masses
    /// move as one from now on conserves momentum exactly; what is neglected is the stiffness force on a gap of at most
    /// that height for that time, which is of third order in `u` (docs/accuracy.md). With hardly any loss they would last too
    /// long: such a particle stays once its hops are shorter than [`SHORTEST_LIVELY_HOP`]. Without loss they never die out, and
    /// only a particle with no relative velocity at all is at rest.
    pub(crate) fn rests(&self, d: &Departure) -> bool {
        let (pressing, noise) = d.pressing;
        if d.speed == 0.0 {
            return pressing >= -noise;
        }
        if pressing <= 0.0 || self.restitution == 1.0 {
            return false;
        }
        let height = 0.5 * d.speed * d.speed / pressing;
        let dies_out = height <= LOWEST_HOP * d.half_width
            && (self.chatter_duration(d.speed, pressing) <= d.left
                || d.speed * d.fastest <= SHORTEST_HOP * pressing);
        let lively = self.restitution > LIVELY;
        dies_out || (lively && 2.0 * d.speed * d.fastest <= SHORTEST_LIVELY_HOP * pressing)
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
