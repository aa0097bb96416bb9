//! Values and ranges of parameters.

use crate::real::consts::PI;

use crate::harmonics::MAX_HARMONICS;
use crate::real::{self, LARGEST, Real};

/// A value of a parameter. The types are those of FMI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    /// A real number.
    Real(Real),
    /// A whole number.
    Integer(i32),
    /// True or false.
    Boolean(bool),
}

impl Value {
    /// The value as a real number, with 1 for true and 0 for false.
    pub(crate) fn number(self) -> Real {
        match self {
            Self::Real(value) => value,
            Self::Integer(value) => value as Real,
            Self::Boolean(value) => u8::from(value).into(),
        }
    }
}

/// The number that means "none" for an optional parameter, where the interface knows only numbers.
pub const NONE: Real = -1.0;

/// The values that a parameter may have, whatever the values of the others are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Range {
    /// Above 0, and neither so small nor so large that products overflow.
    Positive,
    /// 0 or above, and not so large that products overflow.
    NotNegative,
    /// As [`Range::Positive`], or [`NONE`].
    Optional,
    /// Of either sign, and not so large that products overflow.
    Signed,
    /// From -pi to pi.
    Angle,
    /// Above 0 and below 1.
    Share,
    /// 1 (adaptive) or 2 (demodulator).
    Detector,
    /// From 1 to [`MAX_HARMONICS`].
    Harmonics,
    /// From 1 to 1,000,000.
    Dwell,
    /// True or false.
    Boolean,
}

impl Range {
    /// Whether the range contains the number.
    #[must_use]
    pub fn contains(self, number: Real) -> bool {
        number.abs() <= LARGEST
            && match self {
                Self::Positive => number >= 1.0 / LARGEST,
                Self::NotNegative => number >= 0.0,
                Self::Optional => number >= 1.0 / LARGEST || number == NONE,
                Self::Signed => true,
                Self::Angle => number.abs() <= PI,
                Self::Share => number > 0.0 && number < 1.0,
                Self::Detector => number == 1.0 || number == 2.0,
                Self::Harmonics => (1.0..=MAX_HARMONICS as Real).contains(&number),
                Self::Dwell => (1.0..=1e6).contains(&number),
                Self::Boolean => true,
            }
    }

    /// The range in words.
    #[must_use]
    pub fn allowed(self) -> &'static str {
        match self {
            Self::Positive => real::POSITIVE,
            Self::NotNegative => real::NOT_NEGATIVE,
            Self::Optional => real::OPTIONAL,
            Self::Signed => real::SIGNED,
            Self::Angle => "between -pi and pi",
            Self::Share => "above 0 and below 1",
            Self::Detector => "1 (adaptive) or 2 (demodulator)",
            Self::Harmonics => "1 to 8",
            Self::Dwell => "1 to 1000000",
            Self::Boolean => "true or false",
        }
    }
}

const _: () = assert!(MAX_HARMONICS == 8, "Range::allowed says 1 to 8");
