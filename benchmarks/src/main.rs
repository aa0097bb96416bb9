//! The Rust side of scripts/bench: reads a request a line (JSON) from standard input, and answers a line each.
//!
//! ```text
//! {"scene": "steady", "method": "plant", "setting": 0, "checks": [10, 20], "budget": 0.1, "limit": 10}
//! {"growth": "periods", "budget": 0.1, "most": 1e6}
//! {"record": 20}
//! {"structure": 3, "pairs": 50}
//! {"map_g": 1.2, "sigmas": [-1.0, 0.0], "effort": {"periods": 200, "brent_periods": 50, "runs": 5}}
//! ```

#![forbid(unsafe_code)]

use std::io::{BufRead, Write};
use std::path::Path;
use std::time::Duration;

use anyhow::Context;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use vines_benchmarks::baseline::Baseline;
use vines_benchmarks::method::{Answer, Shell, Stepped, measure};
use vines_benchmarks::scene::Scene;
use vines_benchmarks::solvers::{Moreau, Rk4, Solved};
use vines_benchmarks::{cost, map, structures};

/// The methods by name.
const METHODS: &[(&str, Measure)] = &[
    ("plant", measure::<Stepped>),
    ("plant-one-step", measure::<Stepped<true, 1, true>>),
    ("plant-100", measure::<Stepped<true, 100>>),
    ("plant-general", measure::<Stepped<false>>),
    ("c-interface", measure::<Shell>),
    ("brent", measure::<Baseline>),
    ("rk4", measure::<Solved<Rk4>>),
    ("moreau", measure::<Solved<Moreau>>),
    #[cfg(feature = "diffsol")]
    ("diffsol-tsit45", measure::<Solved<vines_benchmarks::diffsol::Tsit45>>),
    #[cfg(feature = "diffsol")]
    ("diffsol-bdf", measure::<Solved<vines_benchmarks::diffsol::Bdf>>),
];

/// [`measure`] for one method.
type Measure = fn(&Scene, f64, &[usize], Duration, Duration) -> Answer;

/// Names of the methods.
fn names() -> Vec<&'static str> {
    METHODS.iter().map(|(name, _)| *name).collect()
}

/// A field of a request.
fn field<T: DeserializeOwned>(request: &Value, name: &str) -> anyhow::Result<T> {
    let value = request
        .get(name)
        .with_context(|| format!("the request has no {name}"))?;
    serde_json::from_value(value.clone()).with_context(|| format!("{name} of the request"))
}

fn answer(folder: &Path, request: &str) -> anyhow::Result<Value> {
    let r: &Value = &serde_json::from_str(request)?;
    let asks = |name| r.get(name).is_some();
    Ok(if asks("scene") {
        let (scene, name): (String, String) = (field(r, "scene")?, field(r, "method")?);
        let unknown = || format!("there is no method {name}; there are {}", names().join(", "));
        let (_, measure) = METHODS
            .iter()
            .find(|(method, _)| *method == name)
            .with_context(unknown)?;
        let (scene, checks): (_, Vec<usize>) = (Scene::load(folder, &scene)?, field(r, "checks")?);
        let [budget, limit] = [field(r, "budget")?, field(r, "limit")?].map(Duration::from_secs_f64);
        serde_json::to_value(measure(&scene, field(r, "setting")?, &checks, budget, limit))?
    } else if asks("growth") {
        let what: String = field(r, "growth")?;
        cost::growth(folder, &what, field(r, "budget")?, field(r, "most")?)?
    } else if asks("record") {
        json!({"drives": cost::record(field(r, "record")?)})
    } else if asks("structure") {
        let family: String = field(r, "family")?;
        structures::compare(&family, field(r, "structure")?, field(r, "pairs")?)?
    } else if asks("closed_loop") {
        cost::closed_loop(field(r, "closed_loop")?, field(r, "budget")?)
    } else if asks("map_g") {
        let (sigmas, effort): (Vec<f64>, map::Effort) = (field(r, "sigmas")?, field(r, "effort")?);
        serde_json::to_value(map::row(field(r, "map_g")?, &sigmas, &effort)?)?
    } else if asks("methods") {
        json!(names())
    } else {
        anyhow::bail!("unknown request")
    })
}

fn main() -> std::io::Result<()> {
    let folder = std::env::args_os().nth(1);
    let folder = folder.unwrap_or_else(|| env!("CARGO_MANIFEST_DIR").into());
    for line in std::io::stdin().lock().lines() {
        let line = line?;
        let answer = answer(Path::new(&folder), &line).unwrap_or_else(|error| json!({"error": format!("{error:#}")}));
        let mut out = std::io::stdout().lock();
        writeln!(out, "{answer}")?;
        out.flush()?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_methods_lead_where_40_digit_arithmetic_does() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
        let text = std::fs::read_to_string(folder.join("truth.json")).expect("the truth");
        let truth: Value = serde_json::from_str(&text).expect("JSON");
        // Largest error at the end of a scene.
        let error = |scene: &str, method: &str, setting: f64| {
            let last = truth[scene]["rows"]
                .as_array()
                .and_then(|rows| rows.last())
                .expect("a last row");
            let request = json!({
                "scene": scene, "method": method, "setting": setting, "checks": [], "budget": 0.0, "limit": 60.0
            });
            let answer = answer(folder, &request.to_string()).expect("an answer");
            assert_eq!(answer["failure"], Value::Null, "{method} in {scene}");
            let error = |n: usize| {
                let truth: f64 = last[n + 1].as_str().and_then(|x| x.parse().ok()).expect("a number");
                (answer["states"][0][n].as_f64().expect("a number") - truth).abs()
            };
            (0..4).map(error).fold(0.0, f64::max)
        };
        for scene in [
            "decay",
            "grazing",
            "damped",
            "resonance",
            "centre",
            "asymmetric",
            "three",
            "chaotic",
        ] {
            // In the chaotic scene a disturbance grows by 1e5.
            let growth = if scene == "chaotic" { 1e2 } else { 1.0 };
            for (method, setting, limit) in [("plant", 0.0, 1e-11), ("brent", 1e-12, 1e-9)] {
                let error = error(scene, method, setting);
                assert!(error < growth * limit, "{scene}, {method}: {error:e}");
            }
        }
        assert!(error("decay", "rk4", 1000.0) < 1e-7);
        assert!(error("chatter", "moreau", 10_000.0) < 1e-2);
    }
}
