//! The scenes, as scenes.json and loop.json have them.

use anyhow::Context;
use std::path::Path;

use lovines::{Drive, Parameters, State};
use serde::Deserialize;

/// What the base does during one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Amplitude of the base motion, m.
    pub amplitude: f64,
    /// Its frequency, rad/s.
    pub omega: f64,
    /// The signal on top of it and its derivatives, m, m/s, m/s², m/s³; only the plant takes one.
    pub signal: [f64; 4],
    /// Length of the step, s.
    pub duration: f64,
}

impl Step {
    /// As the plant takes it.
    #[must_use]
    pub fn drive(&self) -> Drive {
        Drive {
            signal: self.signal,
            amplitude: self.amplitude,
            omega: self.omega,
        }
    }
}

#[derive(Deserialize)]
struct Written {
    #[serde(rename = "M")]
    primary_mass: f64,
    k: f64,
    c: f64,
    m: f64,
    b: f64,
    r: f64,
    start: [f64; 4],
    amplitude: f64,
    omega: f64,
    step: f64,
    steps: usize,
    #[serde(default)]
    drives: Option<String>,
}

/// A rig, its start, and the steps that it is asked for.
#[derive(Clone, Debug)]
pub struct Scene {
    /// The rig.
    pub parameters: Parameters,
    /// q1, q1', q2, q2' at the start, SI units.
    pub start: [f64; 4],
    /// One after the other.
    pub steps: Vec<Step>,
}

impl Scene {
    /// The scene of that name in the folder's scenes.json.
    ///
    /// # Errors
    /// A file that cannot be read, or a scene that is not in it.
    pub fn load(folder: &Path, name: &str) -> anyhow::Result<Self> {
        let read = |file: &str| {
            let path = folder.join(file);
            std::fs::read_to_string(&path).with_context(|| path.display().to_string())
        };
        let wrong = || format!("scene {name}");
        let all: serde_json::Value = serde_json::from_str(&read("scenes.json")?).with_context(wrong)?;
        let written = all.get(name).with_context(|| format!("there is no scene {name}"))?;
        let scene: Written = serde_json::from_value(written.clone()).with_context(wrong)?;
        let steps = match &scene.drives {
            None => {
                let step = Step {
                    amplitude: scene.amplitude,
                    omega: scene.omega,
                    signal: [0.0; 4],
                    duration: scene.step,
                };
                vec![step; scene.steps]
            }
            Some(file) => {
                let drives: Vec<[f64; 2]> = serde_json::from_str(&read(file)?).with_context(wrong)?;
                let step =
                    |[amplitude, omega]: [f64; 2]| Step { amplitude, omega, signal: [0.0; 4], duration: scene.step };
                drives.into_iter().map(step).collect()
            }
        };
        Ok(Self {
            parameters: Parameters {
                primary_mass: scene.primary_mass,
                stiffness: scene.k,
                damping: scene.c,
                particle_mass: scene.m,
                half_width: scene.b,
                restitution: scene.r,
                cavity: lovines::Cavity::IDEAL,
            },
            start: scene.start,
            steps,
        })
    }

    /// The start as the plant takes it.
    #[must_use]
    pub fn state(&self) -> State {
        let [q1, dq1, q2, dq2] = self.start;
        State { q1, dq1, q2, dq2 }
    }
}
