//! The Rust side of scripts/bench: reads a request a line (JSON) from standard input, and answers a line each.
//!
//! ```text
//! {"scene": "steady", "method": "plant", "setting": 0, "checks": [10, 20], "budget": 0.1, "limit": 10}
//! {"growth": "periods", "budget": 0.1, "most": 1e6}
//! {"profile": "chatter"}
//! {"record": 20}
//! {"map_g": 1.2, "sigmas": [-1.0, 0.0], "effort": {"methods": "both", "periods": 200, "brent_periods": 50, "runs": 5}}
//! ```
//!
//! `vines-bench map` prints the map of run time on the terminal, without Python.

#![forbid(unsafe_code)]

mod closed_loop;
mod growth;
mod map;
mod method;
mod methods;
mod profile;
mod scene;
#[path = "../../benches/turns/mod.rs"]
mod turns;

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
            let answer = methods::measure_named(&method, &scene, setting, &checks, budget, limit)?;
            Ok(serde_json::to_value(answer)?)
        }
        Request::Growth { growth, budget, most } => growth::measure(folder, &growth, budget, most),
        Request::Profile { profile } => profile::of(&Scene::load(folder, &profile)?),
        Request::Record { record } => Ok(json!({"drives": closed_loop::record(record)})),
        Request::Loop { closed_loop, budget } => Ok(closed_loop::measure(closed_loop, budget)),
        Request::Map { map_g, sigmas, effort } => Ok(serde_json::to_value(map::row(map_g, &sigmas, &effort)?)?),
        Request::Methods { methods } => Ok(json!(methods.then_some(methods::NAMES))),
    }
}

fn main() -> std::io::Result<()> {
    let arguments: Vec<String> = std::env::args().collect();
    if arguments.get(1).is_some_and(|name| name == "map") {
        match map::terminal::run(&arguments[2..]) {
            Ok(text) => println!("{text}"),
            Err(error) => {
                eprintln!("error: {error:#}");
                std::process::exit(2);
            }
        }
        return Ok(());
    }
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
