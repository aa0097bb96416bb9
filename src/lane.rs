//! Numbers that are computed with one by one or several abreast, by the same lines of code.
//!
//! [`Lanes`] is a plain array whose operations the compiler turns into the vector instructions of the machine it is
//! compiled or dispatched for. No fused operation is used, so that every width and every machine gives the same bits.

use core::array::from_fn;
use core::ops::{Add, Mul, Neg, Sub};

/// A number, or several abreast.
pub trait Lane:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Neg<Output = Self>
{
    /// A yes or no for each of them.
    type Mask: Copy;

    /// The same number in every lane.
    fn splat(value: f64) -> Self;
    /// `1/self`.
    fn inverse(self) -> Self;
    /// `|self|`.
    fn abs(self) -> Self;
    /// +1 or -1, with the sign of `self`.
    fn sign(self) -> Self;
    /// `self < other`.
    fn below(self, other: Self) -> Self::Mask;
    /// Both.
    fn both(a: Self::Mask, b: Self::Mask) -> Self::Mask;
    /// The other way round.
    fn not(mask: Self::Mask) -> Self::Mask;
    /// `a` where the mask says yes, else `b`.
    fn choose(mask: Self::Mask, a: Self, b: Self) -> Self;
}

impl Lane for f64 {
    type Mask = bool;

    #[inline(always)]
    fn splat(value: f64) -> Self {
        value
    }

    #[inline(always)]
    fn inverse(self) -> Self {
        1.0 / self
    }

    #[inline(always)]
    fn abs(self) -> Self {
        f64::abs(self)
    }

    #[inline(always)]
    fn sign(self) -> Self {
        f64::copysign(1.0, self)
    }

    #[inline(always)]
    fn below(self, other: Self) -> bool {
        self < other
    }

    #[inline(always)]
    fn both(a: bool, b: bool) -> bool {
        a & b
    }

    #[inline(always)]
    fn not(mask: bool) -> bool {
        !mask
    }

    #[inline(always)]
    fn choose(mask: bool, a: Self, b: Self) -> Self {
        if mask { a } else { b }
    }
}

/// `N` numbers abreast.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(64))]
pub struct Lanes<const N: usize>(pub [f64; N]);

impl<const N: usize> Lanes<N> {
    #[inline(always)]
    fn each(self, f: impl Fn(f64) -> f64) -> Self {
        Self(from_fn(|n| f(self.0[n])))
    }

    #[inline(always)]
    fn pair(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        Self(from_fn(|n| f(self.0[n], other.0[n])))
    }
}

impl<const N: usize> Add for Lanes<N> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.pair(other, |a, b| a + b)
    }
}

impl<const N: usize> Sub for Lanes<N> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.pair(other, |a, b| a - b)
    }
}

impl<const N: usize> Mul for Lanes<N> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.pair(other, |a, b| a * b)
    }
}

impl<const N: usize> Neg for Lanes<N> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.each(|a| -a)
    }
}

impl<const N: usize> Lane for Lanes<N> {
    /// All bits of a lane, or none: what vector instructions compare and choose by.
    type Mask = [u64; N];

    #[inline(always)]
    fn splat(value: f64) -> Self {
        Self([value; N])
    }

    #[inline(always)]
    fn inverse(self) -> Self {
        self.each(|a| 1.0 / a)
    }

    #[inline(always)]
    fn abs(self) -> Self {
        self.each(f64::abs)
    }

    #[inline(always)]
    fn sign(self) -> Self {
        self.each(|a| f64::copysign(1.0, a))
    }

    #[inline(always)]
    fn below(self, other: Self) -> [u64; N] {
        from_fn(|n| u64::from(self.0[n] < other.0[n]).wrapping_neg())
    }

    #[inline(always)]
    fn both(a: [u64; N], b: [u64; N]) -> [u64; N] {
        from_fn(|n| a[n] & b[n])
    }

    #[inline(always)]
    fn not(mask: [u64; N]) -> [u64; N] {
        mask.map(|bits| !bits)
    }

    #[inline(always)]
    fn choose(mask: [u64; N], a: Self, b: Self) -> Self {
        Self(from_fn(|n| if mask[n] != 0 { a.0[n] } else { b.0[n] }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lanes_do_what_single_numbers_do() {
        let (a, b) = ([1.5, -2.0, 0.1, -0.0], [0.3, -2.0, 7.0, 1.0]);
        let (x, y) = (Lanes(a), Lanes(b));
        let sum = x * y - x + y.inverse() * x.abs() + -x.sign();
        let chosen = Lane::choose(Lanes::both(x.below(y), x.below(Lanes::splat(0.05))), x, y);
        for n in 0..4 {
            let single = a[n] * b[n] - a[n] + b[n].inverse() * a[n].abs() + -a[n].sign();
            assert_eq!(sum.0[n].to_bits(), single.to_bits());
            let yes = f64::both(a[n].below(b[n]), a[n].below(0.05));
            assert_eq!(
                chosen.0[n].to_bits(),
                f64::choose(yes, a[n], b[n]).to_bits()
            );
        }
    }
}
