//! The sections of the report: each computes its results and describes them.

mod curves;
mod experiment;
mod regimes;
mod theory;
mod tracking;

use super::section::Maker;

/// All sections in order, each with the name under which it is cached.
pub const SECTIONS: [(&str, Maker); 5] = [
    ("experiment", experiment::make),
    ("tracking", tracking::make),
    ("theory", theory::make),
    ("curves", curves::make),
    ("regimes", regimes::make),
];
