//! Sums and products that keep their rounding error.

/// A rounded value and its rounding error, which is smaller than half a unit in the last place of the value.
///
/// Adding many small increments to a plain number loses up to half a unit in its last place at every addition. Here the loss is kept and
/// added again (compensated summation: Kahan, "Further remarks on reducing truncation errors", CACM 8 (1965) 40).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Sum {
    pub(crate) value: f64,
    pub(crate) error: f64,
}

impl Sum {
    /// The sum of two numbers.
    #[inline(always)]
    pub fn of(a: f64, b: f64) -> Self {
        let (value, error) = two_sum(a, b);
        Self { value, error }
    }

    /// The rounded value.
    #[inline(always)]
    pub fn value(self) -> f64 {
        self.value
    }

    /// The rounding error.
    pub fn error(self) -> f64 {
        self.error
    }

    /// The sum of this and a number that is not much larger.
    #[must_use]
    #[inline(always)]
    pub fn plus(self, number: f64) -> Self {
        let number = number + self.error;
        let value = self.value + number;
        Self { value, error: number - (value - self.value) }
    }

    /// This less another sum.
    #[must_use]
    #[inline(always)]
    pub fn minus(self, other: Self) -> Self {
        let (value, error) = two_sum(self.value, -other.value);
        Self::of(value, error + (self.error - other.error))
    }
}

/// Two sums side by side: one instruction adds to both.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[repr(C, align(16))]
pub struct Sums {
    pub(crate) values: [f64; 2],
    pub(crate) errors: [f64; 2],
}

impl Sums {
    /// The sums of these and numbers that are not much larger.
    #[must_use]
    #[inline(always)]
    pub fn plus(self, [x, y]: [f64; 2]) -> Self {
        let Self { values: [a, b], errors: [c, d] } = self;
        let (a, b) = (Sum { value: a, error: c }.plus(x), Sum { value: b, error: d }.plus(y));
        Self { values: [a.value, b.value], errors: [a.error, b.error] }
    }
}

impl From<f64> for Sum {
    #[inline(always)]
    fn from(value: f64) -> Self {
        Self { value, error: 0.0 }
    }
}

/// `a + b` as a rounded sum and its rounding error (Knuth).
#[inline(always)]
pub(crate) fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let part = sum - a;
    (sum, (a - (sum - part)) + (b - part))
}

/// The leading half of the digits, and the rest (Veltkamp).
#[inline(always)]
pub(crate) const fn halves(x: f64) -> (f64, f64) {
    let scaled = 134_217_729.0 * x; // 2^27 + 1
    let high = scaled - (scaled - x);
    (high, x - high)
}

/// `a b` as a rounded product and its rounding error (Dekker, with Veltkamp's splitting: no FMA instruction needed). Above 1e300 the
/// splitting overflows; valid parameters and drives lead to no such values.
#[inline(always)]
pub(crate) const fn product(a: f64, b: f64) -> (f64, f64) {
    product_with(a, (b, halves(b)))
}

/// The same; the second factor comes with its halves.
#[inline(always)]
pub(crate) const fn product_with(a: f64, (b, (b1, b2)): (f64, (f64, f64))) -> (f64, f64) {
    // The leading 26 bits: the rest has 27, and every product below is exact.
    let a1 = f64::from_bits(a.to_bits() & (u64::MAX << 27));
    let a2 = a - a1;
    let rounded = a * b;
    (rounded, ((a1 * b1 - rounded) + a1 * b2 + a2 * b1) + a2 * b2)
}

/// `a / b` as a rounded quotient and its rounding error.
pub(crate) const fn quotient(a: f64, b: f64) -> (f64, f64) {
    let rounded = a / b;
    let (got, got_error) = product(rounded, b);
    (rounded, ((a - got) - got_error) / b)
}

/// A number with its rounding error, divided by a number.
pub(crate) const fn divided((value, error): (f64, f64), by: f64) -> (f64, f64) {
    let (rounded, lost) = quotient(value, by);
    (rounded, lost + error / by)
}

/// Splits a coefficient that is used many times, given with its rounding error, into two parts: the sum of the products with
/// both parts has no error that is the same every time.
///
/// Added to a product that has been rounded already, a number as small as the rounding error would be lost each time.
/// The first part is short, so that the second is large enough to count.
pub(crate) fn split_coefficient((coefficient, error): (f64, f64)) -> (f64, f64) {
    let (head, rest) = halves(coefficient);
    (head, rest + error)
}

/// Sine and cosine of `omega t`, exact to the last digits even after millions of turns; `omega` is a frequency and its rounding error.
pub(crate) fn sincos_of_product((omega, omega_error): (f64, f64), t: f64) -> (f64, f64) {
    let (angle, error) = product(omega, t);
    let error = error + omega_error * t;
    let (sin, cos) = libm::sincos(angle);
    (sin + error * cos, cos - error * sin)
}

/// The product of two pairs, each a number and its rounding error.
#[inline(always)]
pub(crate) fn times(a: (f64, f64), b: (f64, f64)) -> (f64, f64) {
    let (value, error) = product(a.0, b.0);
    (value, error + (a.0 * b.1 + a.1 * b.0))
}

/// The sum of two pairs, each a number and its rounding error.
#[inline(always)]
pub(crate) fn plus(a: (f64, f64), b: (f64, f64)) -> (f64, f64) {
    let (value, error) = two_sum(a.0, b.0);
    (value, error + (a.1 + b.1))
}
