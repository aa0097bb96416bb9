//! Angles and small complex numbers.

use crate::real::consts::{PI, TAU};
use crate::real::{self, Real};

/// The angle `x` modulo 2 pi, rad, in [-pi, pi].
pub fn wrap(x: Real) -> Real {
    (x - TAU * real::rint(x / TAU)).clamp(-PI, PI)
}

/// A complex number. A rotor is `exp(i phase)`.
///
/// Not `num-complex`: whether that takes `hypot` and `atan2` from libm or from the system depends on the features that
/// other crates of the same build enable, and the controller must give the same bits in every build.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Complex {
    pub re: Real,
    pub im: Real,
}

impl Complex {
    /// `exp(i angle)`, angle in rad.
    pub fn unit(angle: Real) -> Self {
        let (im, re) = real::sincos(angle);
        Self { re, im }
    }

    pub fn times(self, other: Self) -> Self {
        Self {
            re: self.re * other.re - self.im * other.im,
            im: self.re * other.im + self.im * other.re,
        }
    }

    pub fn magnitude(self) -> Real {
        real::hypot(self.re, self.im)
    }

    pub fn argument(self) -> Real {
        real::atan2(self.im, self.re)
    }
}

#[cfg(all(test, not(feature = "f32")))]
mod tests {
    use super::*;

    #[test]
    fn an_angle_wraps_into_the_range_from_minus_pi_to_pi() {
        for (x, expected) in [(0.3, 0.3), (PI + 0.5, 0.5 - PI), (-5.0, TAU - 5.0)] {
            assert!((wrap(x) - expected).abs() < 1e-15, "{x}");
        }
        assert!(wrap(1e9).abs() <= PI);
    }
}
