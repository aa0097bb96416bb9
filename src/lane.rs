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
    type Mask = [bool; N];

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
    fn below(self, other: Self) -> [bool; N] {
        from_fn(|n| self.0[n] < other.0[n])
    }

    #[inline(always)]
    fn both(a: [bool; N], b: [bool; N]) -> [bool; N] {
        from_fn(|n| a[n] & b[n])
    }

    #[inline(always)]
    fn choose(mask: [bool; N], a: Self, b: Self) -> Self {
        Self(from_fn(|n| if mask[n] { a.0[n] } else { b.0[n] }))
    }
}
