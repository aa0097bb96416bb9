//! Numbers that carry their derivative along one direction (forward differentiation: exact, no step to choose).

use core::ops::{Add, Div, Mul, Sub};

/// A number with or without a derivative.
pub trait Scalar:
    Copy + From<f64> + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// The sine.
    fn sine(self) -> Self;
    /// The cosine.
    fn cosine(self) -> Self;
}

impl Scalar for f64 {
    fn sine(self) -> Self {
        libm::sin(self)
    }

    fn cosine(self) -> Self {
        libm::cos(self)
    }
}

/// A number and its derivative.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Dual {
    /// The number.
    pub value: f64,
    /// Its derivative.
    pub slope: f64,
}

impl From<f64> for Dual {
    fn from(value: f64) -> Self {
        Self { value, slope: 0.0 }
    }
}

impl Add for Dual {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self {
            value: self.value + other.value,
            slope: self.slope + other.slope,
        }
    }
}

impl Sub for Dual {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self {
            value: self.value - other.value,
            slope: self.slope - other.slope,
        }
    }
}

impl Mul for Dual {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        Self {
            value: self.value * other.value,
            slope: self.slope * other.value + self.value * other.slope,
        }
    }
}

impl Div for Dual {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let value = self.value / other.value;
        Self {
            value,
            slope: (self.slope - value * other.slope) / other.value,
        }
    }
}

impl Scalar for Dual {
    fn sine(self) -> Self {
        let (value, cosine) = libm::sincos(self.value);
        Self { value, slope: cosine * self.slope }
    }

    fn cosine(self) -> Self {
        let (sine, value) = libm::sincos(self.value);
        Self { value, slope: -sine * self.slope }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_derivative_of_an_expression_is_exact() {
        let x = Dual { value: 0.7, slope: 1.0 };
        let y = (x * x - Dual::from(2.0)) / x.cosine() + x.sine();
        let (sin, cos) = (0.7f64.sin(), 0.7f64.cos());
        let expected = 1.4 / cos + (0.49 - 2.0) * sin / (cos * cos) + cos;
        assert!((y.slope - expected).abs() < 1e-15);
    }
}
