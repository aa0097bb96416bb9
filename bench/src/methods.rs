//! The methods, one a file.

mod brent;
mod c_interface;
#[cfg(feature = "diffsol")]
mod diffsol;
mod impact;
mod moreau;
mod plant;
mod rk4;

use std::time::Duration;

use crate::method::{Answer, measure};
use crate::scene::Scene;

/// Their names.
pub const NAMES: &[&str] = &[
    "plant",
    "plant-one-step",
    "plant-100",
    "plant-general",
    "c-interface",
    "brent",
    "rk4",
    "moreau",
    #[cfg(feature = "diffsol")]
    "diffsol-tsit45",
    #[cfg(feature = "diffsol")]
    "diffsol-bdf",
];

/// Measures the method of that name.
///
/// # Errors
/// A name that is none of [`NAMES`].
pub fn measure_named(
    name: &str,
    scene: &Scene,
    setting: f64,
    checks: &[usize],
    budget: Duration,
    limit: Duration,
) -> Result<Answer, String> {
    let measure = match name {
        "plant" => measure::<plant::AsAsked>,
        "plant-one-step" => measure::<plant::OneStep>,
        "plant-100" => measure::<plant::Sampled>,
        "plant-general" => measure::<plant::General>,
        "c-interface" => measure::<c_interface::Shell>,
        "brent" => measure::<brent::Brent>,
        "rk4" => measure::<rk4::Rk4>,
        "moreau" => measure::<moreau::Moreau>,
        #[cfg(feature = "diffsol")]
        "diffsol-tsit45" => measure::<diffsol::Tsit45>,
        #[cfg(feature = "diffsol")]
        "diffsol-bdf" => measure::<diffsol::Bdf>,
        _ => {
            return Err(format!(
                "there is no method {name}; there are {}",
                NAMES.join(", ")
            ));
        }
    };
    Ok(measure(scene, setting, checks, budget, limit))
}
