//! The Rust side of scripts/bench: reads a request a line (JSON) from standard input, and answers a line each.
//!
//! ```text
//! {"scene": "steady", "method": "plant", "setting": 0, "checks": [10, 20], "budget": 0.1, "limit": 10}
//! {"growth": "periods", "budget": 0.1, "most": 1e6}
//! {"profile": "chatter"}
//! {"record": 20}
//! {"map_g": 1.2, "sigmas": [-1.0, 0.0], "effort": {"periods": 200, "brent_periods": 50, "runs": 5}}
//! ```

#![forbid(unsafe_code)]

#[path = "../../benches/baseline/mod.rs"]
mod baseline;
mod cost;
#[cfg(feature = "diffsol")]
mod diffsol;
mod map;
mod method;
mod scene;
mod solvers;

use std::io::{BufRead, Write};
use std::path::Path;
use std::time::Duration;

use scene::Scene;
use serde::Deserialize;
use serde_json::json;

#[derive(Deserialize)]
#[serde(untagged)]
enum Request {
    Run {
        scene: String,
        method: String,
        setting: f64,
        checks: Vec<usize>,
        budget: f64,
        limit: f64,
    },
    Growth {
        growth: String,
        budget: f64,
        most: f64,
    },
    Profile {
        profile: String,
    },
    Record {
        record: usize,
    },
    Loop {
        closed_loop: usize,
        budget: f64,
    },
    Methods {
        methods: bool,
    },
    Map {
        map_g: f64,
        sigmas: Vec<f64>,
        effort: map::Effort,
    },
}

fn answer(folder: &Path, request: &str) -> anyhow::Result<serde_json::Value> {
    match serde_json::from_str(request)? {
        Request::Run { scene, method, setting, checks, budget, limit } => {
            let scene = Scene::load(folder, &scene)?;
            let (budget, limit) = (Duration::from_secs_f64(budget), Duration::from_secs_f64(limit));
            let answer = method::named(&method)?(&scene, setting, &checks, budget, limit);
            Ok(serde_json::to_value(answer)?)
        }
        Request::Growth { growth, budget, most } => cost::growth(folder, &growth, budget, most),
        Request::Profile { profile } => cost::profile(&Scene::load(folder, &profile)?),
        Request::Record { record } => Ok(json!({"drives": cost::record(record)})),
        Request::Loop { closed_loop, budget } => Ok(cost::closed_loop(closed_loop, budget)),
        Request::Map { map_g, sigmas, effort } => Ok(serde_json::to_value(map::row(map_g, &sigmas, &effort)?)?),
        Request::Methods { methods } => Ok(json!(methods.then(method::names))),
    }
}

fn main() -> std::io::Result<()> {
    let folder = std::env::args_os()
        .nth(1)
        .unwrap_or_else(|| env!("CARGO_MANIFEST_DIR").into());
    for line in std::io::stdin().lock().lines() {
        let line = line?;
        let answer = answer(Path::new(&folder), &line).unwrap_or_else(|error| json!({"error": format!("{error:#}")}));
        let mut out = std::io::stdout().lock();
        writeln!(out, "{answer}")?;
        out.flush()?;
    }
    Ok(())
}
