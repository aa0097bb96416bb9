//! The walls of the cavity: impact, rest and release.

use crate::arithmetic::{plus, split_coefficient, times, two_sum};
use crate::parameters::Parameters;

/// Hops that last less than this fraction of the fastest rate's time are not followed one by one.
const SHORTEST_HOP: f64 = 1e-9;
/// Above this coefficient of restitution a chatter has too many hops to be followed to its end.
const NEARLY_ELASTIC: f64 = 0.999;
/// Such a particle stays on the wall once its hops last less than this fraction of the fastest rate's time: its position is
/// then known to 1.3e-13 and its velocity to 5e-7, in units of the wall's acceleration and that time.
const SHORTEST_ELASTIC_HOP: f64 = 1e-6;

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
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn sign(self) -> f64 {
        match self {
            Wall::Plus => 1.0,
            Wall::Minus => -1.0,
        }
    }

    /// 0 or 1.
    pub fn index(self) -> usize {
        match self {
            Wall::Plus => 0,
            Wall::Minus => 1,
        }
    }

    /// The wall that `w` approaches with this velocity, or lies beyond.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn ahead(w: f64) -> Self {
        if w > 0.0 { Wall::Plus } else { Wall::Minus }
    }
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

/// The particle at a wall: velocities after an impact, if it approached, and after coming to rest, if it did.
#[derive(Clone, Copy, Debug, Default)]
pub struct Touch {
    /// Velocity of the primary mass, m/s.
    pub primary: f64,
    /// What was added to it, m/s: the sum of many small changes needs all their digits.
    pub kick: f64,
    /// Velocity of the particle, m/s.
    pub particle: f64,
    /// Relative velocity `w'`, m/s.
    pub relative: f64,
    /// Relative velocity before the impact, m/s.
    pub impact: Option<f64>,
    /// Whether the particle is at rest now.
    pub stuck: bool,
    /// Energy dissipated, J.
    pub dissipated: f64,
}

/// What hops can be told from rest.
#[derive(Clone, Copy, Debug)]
pub struct Resolution {
    /// The lowest hop that is followed, m.
    pub lowest_hop: f64,
    /// The longest chatter of lower hops that is skipped, s.
    pub longest_chatter: f64,
    /// The fastest rate of the oscillator, 1/s.
    pub fastest: f64,
    /// Whether hops without loss, which never die out, are followed however low they are.
    pub elastic: bool,
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

    /// The law for another coefficient of restitution. Its share has one rounding error only: that of a coefficient which changes from
    /// impact to impact does not add up.
    #[inline]
    pub fn with_restitution(&self, r: f64) -> Self {
        let primary_share = ((1.0 + r) * self.particle_fraction, 0.0);
        Self { restitution: r, primary_share, ..*self }
    }

    /// The particle is at `wall` with velocities of primary mass and particle and a relative velocity. If it approaches, Newton's
    /// law reverses the relative velocity and reduces it by `r`. If then `rests` holds for the velocity of the primary mass and
    /// the speed away from the wall, both go on as one mass. Momentum is conserved.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn touch(
        &self,
        wall: Wall,
        (primary, particle, relative): (f64, f64, f64),
        rests: impl FnOnce(f64, f64) -> bool,
    ) -> Touch {
        let mut touch = Touch { primary, particle, relative, ..Touch::default() };
        if wall.sign() * relative > 0.0 {
            let (r, (head, tail)) = (self.restitution, self.primary_share);
            touch.impact = Some(relative);
            touch.kick = -(head * relative + tail * relative);
            touch.primary = primary + touch.kick;
            touch.relative = -r * relative;
            touch.particle = touch.primary - touch.relative;
            touch.dissipated = self.half_relative_mass * ((1.0 - r) * (1.0 + r)) * (relative * relative);
        }
        if rests(touch.primary, -wall.sign() * touch.relative) {
            touch.dissipated += self.half_relative_mass * touch.relative * touch.relative;
            let share = self.particle_fraction * touch.relative;
            touch.kick -= share;
            touch.primary -= share;
            touch.particle = touch.primary;
            touch.relative = 0.0;
            touch.stuck = true;
        }
        touch
    }

    /// This law with another coefficient of restitution in the question whether the particle rests.
    #[inline]
    pub(crate) fn resting_with(&self, restitution: f64) -> Self {
        Self { restitution, ..*self }
    }

    /// Whether a rebound at `speed` is certainly not at rest, whatever the acceleration up to `largest`.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub(crate) fn certainly_leaves(&self, speed: f64, largest: f64, r: &Resolution) -> bool {
        speed * speed > 2.0 * r.lowest_hop * largest
            && (self.restitution <= NEARLY_ELASTIC || 2.0 * speed * r.fastest > SHORTEST_ELASTIC_HOP * largest)
    }

    /// Whether the particle that leaves a wall at `speed` is in truth at rest on it; the wall accelerates towards it with
    /// `pressing`, known but for `error`.
    ///
    /// Its hops are then below resolution (height `u²/(2a)`), and they die out within `2u/(a (1 - r))`. Letting both masses
    /// move as one from now on conserves momentum exactly; what is neglected is the stiffness force on a gap of at most
    /// that height for that time, which is of third order in `u` (docs/plant.md). With hardly any loss they would last too
    /// long: such a particle stays once its hops are shorter than `SHORTEST_ELASTIC_HOP`. Without loss they never die out, and
    /// only a particle with no relative velocity at all is at rest.
    pub fn rests(&self, speed: f64, (pressing, error): (f64, f64), r: &Resolution) -> bool {
        if speed == 0.0 {
            return pressing >= -error;
        }
        if pressing <= 0.0 || (self.restitution == 1.0 && r.elastic) {
            return false;
        }
        let low = 0.5 * speed * speed <= r.lowest_hop * pressing;
        let over_soon = 2.0 * speed / (pressing * (1.0 - self.restitution)) <= r.longest_chatter
            || speed * r.fastest <= SHORTEST_HOP * pressing
            || self.restitution == 1.0;
        let elastic = self.restitution > NEARLY_ELASTIC && 2.0 * speed * r.fastest <= SHORTEST_ELASTIC_HOP * pressing;
        elastic || (low && over_soon)
    }
}
