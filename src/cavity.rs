//! What a real cavity does: the forces of tilt and friction, and a restitution that depends on the speed, on the wall and on chance.
//!
//! With `theta` the tilt, `a_g = g sin(theta)` and `g_n = g cos(theta)`, the particle obeys
//!
//! - sliding: `m q2'' = m a_g + mu_k m g_n sign(w')`, and the opposite friction acts on the primary mass;
//! - sticking to the floor, at `w' = 0`, while `|q'' - a_g| <= mu_s g_n`: both masses move as one under the force `m a_g`;
//! - resting on the wall of sign `s` while `s (q'' - a_g) >= -mu_s g_n`: the wall pushes without limit, friction holds either way.
//!
//! All these forces are constant between events. A constant force `F` on the oscillator moves its equilibrium by `F/k`, as a base
//! displaced by `F/k` does; the particle's flight is a parabola. The closed form therefore stays.

use crate::contact::{ImpactLaw, Resolution, Wall};
use crate::parameters::{Cavity, Parameters, Restitution};

/// Standard gravity, m/s².
pub const GRAVITY: f64 = 9.80665;

/// Constant accelerations of the particle, m/s².
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Forces {
    /// By gravity along the axis, `a_g`.
    pub gravity: f64,
    /// By kinetic friction, `mu_k g_n`.
    pub kinetic: f64,
    /// The largest by static friction, `mu_s g_n`; 0 where there is no friction.
    pub holding: f64,
    /// Relative acceleration per acceleration of the particle by friction, `1 + m/M`: the opposite force acts on the primary mass.
    pub joint: f64,
}

impl Forces {
    /// The accelerations that follow from the parameters.
    pub fn new(p: &Parameters) -> Self {
        let (sin, cos) = libm::sincos(p.cavity.tilt);
        // A vertical floor carries nothing: the cosine of the nearest double to pi/2 is 6e-17.
        let normal = if cos < f64::EPSILON { 0.0 } else { GRAVITY * cos };
        let held = p.cavity.static_friction.unwrap_or(p.cavity.kinetic_friction);
        Self {
            gravity: GRAVITY * sin,
            kinetic: p.cavity.kinetic_friction * normal,
            holding: held * normal,
            joint: 1.0 + p.mass_ratio(),
        }
    }

    /// Whether any acts: then the particle does not fly straight.
    #[inline]
    pub fn act(&self) -> bool {
        self.gravity != 0.0 || self.holding != 0.0
    }

    /// The size of all.
    #[inline]
    pub fn size(&self) -> f64 {
        self.gravity.abs() + self.holding
    }

    /// Sign of the relative velocity `w'` of a particle that slides from `w' = 0` on; 0 where static friction holds it. `acceleration`
    /// is that of the primary mass while it moves alone and without friction, with its rounding error, m/s².
    pub fn slips(&self, (acceleration, error): (f64, f64)) -> f64 {
        let needed = acceleration - self.gravity;
        if needed.abs() <= self.joint * (self.holding + error) {
            0.0
        } else {
            1f64.copysign(needed)
        }
    }

    /// Whether a kick, which gives the primary mass alone the velocity `kick` (m/s), carries a particle along that is at rest on `wall`, or
    /// on the floor: the hop would stay below `lowest`, m. `acceleration` is that of the primary mass while it moves alone and without
    /// friction, m/s².
    pub fn carry(&self, wall: Option<Wall>, kick: f64, acceleration: f64, lowest: f64) -> bool {
        let towards = wall.map_or(-kick.signum(), Wall::sign);
        let against = towards * (acceleration - self.gravity) + self.joint * self.kinetic;
        kick == 0.0 || kick * kick <= 2.0 * lowest * against
    }

    /// Whether friction holds a particle that has hopped off `wall`, which then sticks to the floor beside it; `free` as in
    /// [`Self::pressing`].
    pub fn stop_a_hop(&self, wall: Wall, free: f64) -> bool {
        free - wall.sign() * self.gravity <= self.joint * self.holding
    }

    /// Accelerations of `wall` towards a particle that moves away from it, and towards one that comes back, m/s²: friction adds to the
    /// first and takes from the second. `free` is the acceleration towards a particle without any.
    pub fn pressing(&self, wall: Wall, free: f64) -> (f64, f64) {
        let pressing = free - wall.sign() * self.gravity;
        (
            pressing + self.joint * self.kinetic,
            pressing - self.joint * self.kinetic,
        )
    }
}

/// The coefficient of restitution of every impact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rebound {
    laws: [Restitution; 2],
    least: f64,
    scatter: f64,
    seed: u64,
}

impl Rebound {
    /// The coefficients that follow from the parameters.
    pub fn new(p: &Parameters) -> Self {
        let Cavity { restitution, least_restitution, scatter, seed, .. } = p.cavity;
        let laws = restitution.map(|law| law.unwrap_or(Restitution::Constant(p.restitution)));
        Self { laws, least: least_restitution, scatter, seed }
    }

    /// Whether the coefficient is the same at every impact, and equal to `r`.
    pub fn is_constant(&self, r: f64) -> bool {
        self.laws == [Restitution::Constant(r); 2] && self.scatter == 0.0 && self.least <= r
    }

    /// The coefficient at a speed of approach (m/s) without scatter.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn mean(&self, wall: Wall, speed: f64) -> f64 {
        coefficient(self.laws[wall.index()], speed).clamp(self.least, 1.0)
    }

    /// The coefficient of impact number `number` at a speed of approach, m/s.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn of_impact(&self, wall: Wall, speed: f64, number: u64) -> f64 {
        let mean = self.mean(wall, speed);
        if self.scatter == 0.0 {
            return mean;
        }
        (mean * (1.0 + self.scatter * deviate(self.seed, number))).clamp(self.least, 1.0)
    }

    /// The coefficient `r` of impact number `number` at the speed of approach `v`, m/s, and the derivative of the rebound's speed `r v` by `v`.
    pub fn with_slope(&self, wall: Wall, v: f64, number: u64) -> (f64, f64) {
        let r = self.of_impact(wall, v, number);
        let law = self.laws[wall.index()];
        // `v r'(v)` over r, where the law is not limited.
        let steepness = match law {
            _ if r == self.least || r == 1.0 => 0.0,
            Restitution::Constant(_) => 0.0,
            Restitution::Viscoelastic(k) => -0.2 * k * fifth_root(v) / coefficient(law, v),
            Restitution::Plastic(_) => -0.25,
        };
        (r, r * (1.0 + steepness))
    }

    /// Whether a particle that leaves a wall at a speed (m/s) is in truth at rest on it, as [`ImpactLaw::rests`] has it for one constant
    /// acceleration. `free` is the acceleration of the wall towards a particle without any, with its rounding error, m/s².
    ///
    /// A hop up under one acceleration and down under another lasts `u/up + u/sqrt(up down)`, and the particle comes back at
    /// `u sqrt(down/up)`. Hops therefore die out as those under the mean acceleration and a smaller coefficient of restitution do.
    /// Where friction stops the particle before it comes back, there is one hop only.
    pub fn rests(
        &self,
        law: &ImpactLaw,
        forces: &Forces,
        (wall, speed): (Wall, f64),
        (free, error): (f64, f64),
        resolution: &Resolution,
    ) -> bool {
        let (up, down) = forces.pressing(wall, free);
        if speed == 0.0 {
            let pressing = free - wall.sign() * forces.gravity;
            return pressing + forces.joint * forces.holding >= -error;
        }
        if up <= 0.0 {
            return false;
        }
        let (mean, back) = if down > 0.0 && !forces.stop_a_hop(wall, free) {
            (2.0 / (1.0 / up + 1.0 / libm::sqrt(up * down)), libm::sqrt(down / up))
        } else {
            (up, 0.0)
        };
        law.resting_with(back * self.mean(wall, speed * back))
            .rests(speed, (mean, error), resolution)
    }
}

/// The coefficient of restitution at the speed of approach `v`, m/s, before limits.
#[cfg_attr(not(target_arch = "wasm32"), inline)]
fn coefficient(law: Restitution, v: f64) -> f64 {
    match law {
        Restitution::Constant(r) => r,
        Restitution::Viscoelastic(k) => 1.0 - k * fifth_root(v),
        Restitution::Plastic(yield_speed) => libm::sqrt(libm::sqrt(yield_speed / v)).min(1.0),
    }
}

/// The fifth root of a positive number, a third of the work of `pow`: by Halley's method from a fifth of the exponent, which is off by
/// 4 % at most. Every step cubes the error and doubles it.
fn fifth_root(v: f64) -> f64 {
    const FOUR_FIFTHS_OF_ONE: u64 = 1f64.to_bits() / 5 * 4;
    let mut x = f64::from_bits(v.to_bits() / 5 + FOUR_FIFTHS_OF_ONE);
    for _ in 0..3 {
        let square = x * x;
        let fifth = square * square * x;
        x += x * ((v - fifth) / (3.0 * fifth + 2.0 * v));
    }
    x
}

/// A random number with mean 0 and standard deviation 1 that depends on `seed` and `counter` alone, on every platform alike.
///
/// The sum of eight uniform numbers of 16 bits is nearly normal: the excess of the fourth moment is -0.15, and the largest deviate is 4.9.
/// They come from two outputs of SplitMix64 (Steele, Lea and Flood, OOPSLA 2014), whose state is a counter. The mixed seed keeps the
/// streams of neighbouring seeds apart.
#[cfg_attr(not(target_arch = "wasm32"), inline)]
pub fn deviate(seed: u64, counter: u64) -> f64 {
    const GAMMA: u64 = 0x9E37_79B9_7F4A_7C15;
    /// Every other number of 16 bits.
    const LANES: u64 = 0x0000_FFFF_0000_FFFF;
    /// Standard deviation of the sum: eight uniform numbers of `n` values have the variance `8 (n² - 1)/12`.
    const DEVIATION: f64 = 53_509.919_921_450_08;
    let mix = |z: u64| {
        let z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    };
    let start = mix(seed.wrapping_add(GAMMA));
    let output = |n: u64| mix(start.wrapping_add(GAMMA.wrapping_mul(n)));
    let first = counter.wrapping_mul(2);
    let [a, b] = [1, 2].map(|n| output(first.wrapping_add(n)));
    let pairs = (a & LANES) + ((a >> 16) & LANES) + (b & LANES) + ((b >> 16) & LANES);
    let sum = (pairs & 0xFFFF_FFFF) + (pairs >> 32);
    (sum as f64 - 4.0 * 65_535.0) / DEVIATION
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fifth_root_is_exact_to_rounding() {
        for n in -3000..3000 {
            let v = 1.07f64.powi(n);
            let x = fifth_root(v);
            assert!((x.powi(5) / v - 1.0).abs() < 1e-14, "{v:e}");
            let times_32 = fifth_root(32.0 * v) / x;
            assert!((times_32 - 2.0).abs() < 8.0 * f64::EPSILON, "{v:e}: {times_32}");
        }
    }

    #[test]
    fn the_deviates_have_the_moments_of_a_nearly_normal_distribution() {
        for seed in [0, 1, 2, u64::MAX] {
            let n = 200_000;
            let x: Vec<f64> = (0..n).map(|k| deviate(seed, k)).collect();
            let moment = |power: i32| x.iter().map(|x| x.powi(power)).sum::<f64>() / n as f64;
            // Five standard errors.
            let error = 5.0 / (n as f64).sqrt();
            assert!(moment(1).abs() < error, "{seed}");
            assert!((moment(2) - 1.0).abs() < error * 2f64.sqrt(), "{seed}");
            assert!(moment(3).abs() < error * 15f64.sqrt(), "{seed}");
            assert!((moment(4) - 2.85).abs() < error * 96f64.sqrt(), "{seed}");
            let next = x.windows(2).map(|x| x[0] * x[1]).sum::<f64>() / n as f64;
            assert!(next.abs() < error, "{seed}");
        }
    }

    #[test]
    fn every_law_is_limited_to_the_allowed_range() {
        let cavity = Cavity {
            restitution: [Some(Restitution::Viscoelastic(0.5)), Some(Restitution::Plastic(0.1))],
            least_restitution: 0.3,
            ..Cavity::IDEAL
        };
        let rebound = Rebound::new(&Parameters { cavity, ..Parameters::dimensionless(0.01, 1.0, 0.6) });
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-15, "{a} {b}");
        let (plus, minus) = (Wall::Plus, Wall::Minus);
        for (wall, speed, r) in [
            (plus, 1.0, 0.5),
            (plus, 1e3, 0.3),
            (minus, 0.05, 1.0),
            (minus, 1.6, 0.5),
            (minus, 1e6, 0.3),
        ] {
            near(rebound.mean(wall, speed), r);
        }
        for scatter in [0.1, 1.0] {
            let rebound = Rebound { scatter, ..rebound };
            for n in 0..1000 {
                let r = rebound.of_impact(Wall::Plus, 0.2, n);
                assert!((0.3..=1.0).contains(&r), "{r}");
            }
        }
    }
}
