//! Spans of time that are added and taken off by the million without losing digits to their length.

use crate::base_motion::two_sum;
use crate::lane::Lane;
use serde::{Deserialize, Serialize};

/// A time, s: a number, and a small one that is to be added.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Span(f64, f64);

impl Span {
    /// A span of `t` seconds.
    pub fn of(t: f64) -> Self {
        Self(t, 0.0)
    }

    /// Its length, s.
    #[inline]
    pub fn seconds(self) -> f64 {
        self.0 + self.1
    }

    /// The span of these parts.
    pub(crate) fn of_parts((seconds, missed): (f64, f64)) -> Self {
        Self(seconds, missed)
    }

    /// The number and the small one.
    pub(crate) fn parts(self) -> (f64, f64) {
        (self.0, self.1)
    }

    /// Longer by `t` seconds.
    #[must_use]
    pub fn plus(self, t: f64) -> Self {
        Self::of_parts(longer(self.parts(), t))
    }

    /// Shorter by another span.
    #[must_use]
    #[inline]
    pub fn less(self, other: Self) -> Self {
        Self::of_parts(shorter(self.parts(), other.parts()))
    }
}

/// [`Span::plus`] for the parts of a span, or of several abreast.
#[inline(always)]
pub(crate) fn longer<T: Lane>(span: (T, T), t: T) -> (T, T) {
    let (sum, missed) = two_sum(span.0, t);
    (sum, span.1 + missed)
}

/// A span shorter by a time and a small part of it.
#[inline(always)]
pub(crate) fn shorter<T: Lane>(span: (T, T), (t, more): (T, T)) -> (T, T) {
    let whole = t + more;
    let (left, missed) = longer(span, -whole);
    (left, missed - (more - (whole - t)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_million_parts_taken_off_leave_nothing() {
        let part = 0.1;
        let mut left = Span::default();
        for _ in 0..1_000_000 {
            left = left.plus(part);
        }
        for _ in 0..1_000_000 {
            left = left.less(Span::of(part));
        }
        assert!(left.seconds().abs() < 1e-18, "{left:?}");
    }
}
