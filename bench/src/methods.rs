//! The methods, one a file.

mod brent;
mod c_interface;
#[cfg(feature = "diffsol")]
mod diffsol;
mod impact;
mod moreau;
mod plant;
mod rk4;

pub use brent::Baseline as BrentBaseline;
pub use plant::{AsAsked, begin};

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
/// An unknown name; [`NAMES`] has the known ones.
pub fn measure_named(
    name: &str,
    scene: &Scene,
    setting: f64,
    checks: &[usize],
    budget: Duration,
    limit: Duration,
) -> anyhow::Result<Answer> {
    let measure = match name {
        "plant" => measure::<AsAsked, plant::AsAsked>,
        "plant-one-step" => measure::<AsAsked, plant::OneStep>,
        "plant-100" => measure::<AsAsked, plant::Sampled>,
        "plant-general" => measure::<AsAsked, plant::General>,
        "c-interface" => measure::<AsAsked, c_interface::Shell>,
        "brent" => measure::<AsAsked, brent::Brent>,
        "rk4" => measure::<AsAsked, rk4::Rk4>,
        "moreau" => measure::<AsAsked, moreau::Moreau>,
        #[cfg(feature = "diffsol")]
        "diffsol-tsit45" => measure::<AsAsked, diffsol::Tsit45>,
        #[cfg(feature = "diffsol")]
        "diffsol-bdf" => measure::<AsAsked, diffsol::Bdf>,
        _ => anyhow::bail!("there is no method {name}; there are {}", NAMES.join(", ")),
    };
    Ok(measure(scene, setting, checks, budget, limit))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    /// Largest error of a method at the end of a scene.
    fn error_at_the_end(scene: &str, method: &str, setting: f64) -> f64 {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
        let text = std::fs::read_to_string(folder.join("truth.json")).expect("the truth");
        let truth: serde_json::Value = serde_json::from_str(&text).expect("JSON");
        let last = truth[scene]["rows"].as_array().and_then(|rows| rows.last());
        let last = last.expect("a last row");
        let loaded = Scene::load(folder, scene).expect("a scene");
        let (once, limit) = (Duration::ZERO, Duration::from_secs(60));
        let answer = measure_named(method, &loaded, setting, &[], once, limit).expect("a method");
        assert_eq!(answer.failure, None, "{method} in {scene}");
        let states = answer.states.last().expect("the state at the end");
        let error = |(n, x): (usize, &f64)| {
            let truth: f64 = last[n + 1].as_str().and_then(|x| x.parse().ok()).expect("a number");
            (x - truth).abs()
        };
        states.iter().enumerate().map(error).fold(0.0, f64::max)
    }

    #[test]
    fn the_methods_lead_where_40_digit_arithmetic_does() {
        let scenes = [
            "decay",
            "grazing",
            "damped",
            "resonance",
            "centre",
            "asymmetric",
            "three",
            "chaotic",
        ];
        for scene in scenes {
            // In the chaotic scene a disturbance grows by 1e5.
            let growth = if scene == "chaotic" { 1e2 } else { 1.0 };
            for (method, setting, limit) in [("plant", 0.0, 1e-11), ("brent", 1e-12, 1e-9)] {
                let error = error_at_the_end(scene, method, setting);
                assert!(error < growth * limit, "{scene}, {method}: {error:e}");
            }
        }
        assert!(error_at_the_end("decay", "rk4", 1000.0) < 1e-7);
        assert!(error_at_the_end("chatter", "moreau", 10_000.0) < 1e-2);
    }
}
