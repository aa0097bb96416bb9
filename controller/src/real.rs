//! The floating-point type of the core and its functions: `f64`, or `f32` for processors without double precision.
//!
//! Both precisions give the same bits on every processor: no function of the system, no fused multiply-add.

pub use precision::*;

/// The larger of two numbers that are no NaN. (`max` has to look for NaN: WebAssembly takes ten instructions for that.)
pub fn larger(x: Real, y: Real) -> Real {
    if x > y { x } else { y }
}

/// The smaller of two numbers that are no NaN.
pub fn smaller(x: Real, y: Real) -> Real {
    if x < y { x } else { y }
}

/// `x` within limits. (`clamp` also tests the limits, which takes longer than the rest.)
pub fn limited(x: Real, low: Real, high: Real) -> Real {
    let x = if x < low { low } else { x };
    if x > high { high } else { x }
}

#[cfg(not(feature = "f32"))]
mod precision {
    pub use core::f64::consts;

    pub use libm::{atan2, ceil, expm1, hypot, rint, sin, sincos, sqrt};

    /// The floating-point type.
    pub type Real = f64;

    /// Largest valid reading, m. The squares of smaller readings cause no overflow.
    pub const READING_MAX: Real = 1e100;

    /// Largest magnitude of a parameter; the smallest one above 0 is its inverse. Products of parameters with each other and with readings,
    /// as the gains and the loops form them, cause no overflow.
    pub const LARGEST: Real = 1e30;

    /// Allowed magnitudes in words.
    pub const POSITIVE: &str = "above 0 (1e-30 to 1e30)";
    pub const NOT_NEGATIVE: &str = "0 or above, at most 1e30";
    pub const OPTIONAL: &str = "above 0 (1e-30 to 1e30), or -1 for none";
    pub const SIGNED: &str = "-1e30 to 1e30";

    /// A sum of many small terms.
    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
    pub struct Sum(Real);

    impl Sum {
        /// A sum that is this number.
        pub const fn new(value: Real) -> Self {
            Self(value)
        }

        /// The sum.
        pub const fn get(self) -> Real {
            self.0
        }

        /// Adds a term.
        pub fn add(&mut self, term: Real) {
            self.0 += term;
        }
    }
}

#[cfg(feature = "f32")]
mod precision {
    pub use core::f32::consts;

    pub use libm::{atan2f as atan2, ceilf as ceil, expm1f as expm1, rintf as rint, sqrtf as sqrt};

    /// The floating-point type.
    pub type Real = f32;

    /// Largest valid reading, m. The squares of smaller readings cause no overflow.
    pub const READING_MAX: Real = 1e15;

    /// Largest magnitude of a parameter; the smallest one above 0 is its inverse. Products of parameters with each other and with readings,
    /// as the gains and the loops form them, cause no overflow.
    pub const LARGEST: Real = 1e9;

    /// Allowed magnitudes in words.
    pub const POSITIVE: &str = "above 0 (1e-9 to 1e9)";
    pub const NOT_NEGATIVE: &str = "0 or above, at most 1e9";
    pub const OPTIONAL: &str = "above 0 (1e-9 to 1e9), or -1 for none";
    pub const SIGNED: &str = "-1e9 to 1e9";

    /// A sum of many small terms, with the rounding error of the last one: in single precision, terms below 6e-8 of the sum
    /// would otherwise be lost (Kahan's algorithm).
    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
    pub struct Sum {
        value: Real,
        missing: Real,
    }

    impl Sum {
        /// A sum that is this number.
        pub const fn new(value: Real) -> Self {
            Self { value, missing: 0.0 }
        }

        /// The sum.
        pub const fn get(self) -> Real {
            self.value
        }

        /// Adds a term.
        pub fn add(&mut self, term: Real) {
            let term = term + self.missing;
            let sum = self.value + term;
            self.missing = term - (sum - self.value);
            self.value = sum;
        }
    }

    // The functions below take the place of those of libm, which compute in double precision inside.

    /// Length of a vector of components below 1e19.
    pub fn hypot(x: Real, y: Real) -> Real {
        sqrt(x * x + y * y)
    }

    /// Sine and cosine of a few turns, to 2e-7: polynomials up to pi/4 (S. Moshier, Cephes, sinf.c).
    pub fn sincos(x: Real) -> (Real, Real) {
        // pi/2 in two parts, so that the product with a small whole number is exact in the first one.
        const HALF_PI: [Real; 2] = [1.570_312_5, 4.838_268e-4];
        let quarter = rint(x * consts::FRAC_2_PI);
        let x = (x - quarter * HALF_PI[0]) - quarter * HALF_PI[1];
        let z = x * x;
        let sine = ((-1.951_529_6e-4 * z + 8.332_161e-3) * z - 0.166_666_55) * z * x + x;
        let cosine = ((2.443_315_7e-5 * z - 1.388_731_6e-3) * z + 4.166_664_6e-2) * z * z - 0.5 * z + 1.0;
        match quarter as i32 & 3 {
            0 => (sine, cosine),
            1 => (cosine, -sine),
            2 => (-sine, -cosine),
            _ => (-cosine, sine),
        }
    }

    /// Sine of a few turns.
    pub fn sin(x: Real) -> Real {
        sincos(x).0
    }
}

#[cfg(test)]
#[cfg(feature = "f32")]
mod tests {
    use super::*;

    #[test]
    fn sine_and_cosine_of_two_turns_are_right_to_2e_7_and_a_length_is_exact_where_it_can_be() {
        for n in -1000..=1000_i16 {
            let x = Real::from(n) * 0.0126;
            let (sine, cosine) = sincos(x);
            let errors = [(sine, libm::sin(x.into())), (cosine, libm::cos(x.into()))];
            assert!(
                errors.iter().all(|(a, b)| (f64::from(*a) - b).abs() < 2e-7),
                "{x}: {errors:?}"
            );
            assert_eq!(sin(x), sine);
        }
        assert_eq!(hypot(3.0, -4.0), 5.0);
    }
}
