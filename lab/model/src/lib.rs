//! The dimensionless model of an LO–VI NES: first-order theory, exact periodic orbits, and maps of its regimes.
//!
//! Lengths are over the half-width b of the cavity, times multiplied by omega0 = sqrt(k/M), and
//! `Omega = omega/omega0 = 1 + epsilon sigma`. [`theory`] gives the backbone to first order in the mass
//! ratio, [`orbit`] gives it exactly.

#![forbid(unsafe_code)]

/// An enum, each of whose variants has a word in tables and files.
macro_rules! words {
    ($(#[$of_type:meta])* $type:ident::$word:ident { $($(#[$of_variant:meta])* $variant:ident = $text:literal,)+ }) => {
        $(#[$of_type])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, serde::Serialize)]
        pub enum $type {
            $($(#[$of_variant])* #[serde(rename = $text)] $variant,)+
        }

        impl $type {
            /// All of them.
            pub const ALL: [Self; [$($text),+].len()] = [$(Self::$variant),+];

            /// As in a table and in a file.
            pub fn $word(&self) -> &'static str {
                match self {
                    $(Self::$variant => $text,)+
                }
            }
        }
    };
}

pub mod curves;
mod definition;
mod dimensionless;
pub mod map;
pub mod numerics;
pub mod orbit;
mod oscillator;
pub mod regime;
pub mod theory;

pub use definition::{Definition, Measurand, Reference, Sensor};
pub use dimensionless::Dimensionless;

/// An argument, a setting or a file that cannot be used; the message says what is wrong, and what is expected.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct ArgumentError(String);

impl<T: Into<String>> From<T> for ArgumentError {
    fn from(message: T) -> Self {
        Self(message.into())
    }
}
