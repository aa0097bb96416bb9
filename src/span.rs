//! Spans of time that are added and taken off by the million without losing digits to their length.

use crate::base_motion::two_sum;
use serde::{Deserialize, Serialize};

/// A time, s: the nearest number, and what it misses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Span(f64, f64);

impl Span {
    /// A span of `t` seconds.
    pub fn of(t: f64) -> Self {
        Self(t, 0.0)
    }

    /// Its length, s.
    pub fn seconds(self) -> f64 {
        self.0
    }

    /// Longer by `t` seconds.
    #[must_use]
    pub fn plus(self, t: f64) -> Self {
        let (sum, missed) = two_sum(self.0, t);
        let (sum, missed) = two_sum(sum, missed + self.1);
        Self(sum, missed)
    }

    /// Shorter by another span.
    #[must_use]
    pub fn less(self, other: Self) -> Self {
        self.plus(-other.0).plus(-other.1)
    }
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
