//! The scenes, as scenes.json and loop.json have them.

use std::path::Path;

use anyhow::Context;
use lovines::{Cavity, Drive, Parameters, State};
use serde_json::Value;

/// What the base does during one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Its motion, SI units; only the plant takes a signal on top of the harmonic one.
    pub drive: Drive,
    /// Length of the step, s.
    pub duration: f64,
}

/// A rig, its start, and the steps that it is asked for.
#[derive(Clone, Debug)]
pub struct Scene {
    /// The rig.
    pub parameters: Parameters,
    /// The start, SI units.
    pub start: State,
    /// One after the other.
    pub steps: Vec<Step>,
}

impl Scene {
    /// The scene of that name in the folder's scenes.json.
    ///
    /// # Errors
    /// A file that cannot be read, or a scene that is not in it.
    pub fn load(folder: &Path, name: &str) -> anyhow::Result<Self> {
        let read = |file: &str| -> anyhow::Result<Value> {
            let path = folder.join(file);
            let text = std::fs::read_to_string(&path).with_context(|| path.display().to_string())?;
            serde_json::from_str(&text).with_context(|| path.display().to_string())
        };
        let mut all = read("scenes.json")?;
        let scene = all.get_mut(name).with_context(|| format!("there is no scene {name}"))?;
        let at = |key: &str| {
            scene[key]
                .as_f64()
                .with_context(|| format!("scene {name}: no number {key}"))
        };
        let parameters = Parameters {
            primary_mass: at("M")?,
            stiffness: at("k")?,
            damping: at("c")?,
            particle_mass: at("m")?,
            half_width: at("b")?,
            restitution: at("r")?,
            cavity: Cavity::IDEAL,
        };
        let duration = at("step")?;
        let drives: Vec<[f64; 2]> = match scene["drives"].as_str() {
            Some(file) => serde_json::from_value(read(file)?)?,
            None => vec![[at("amplitude")?, at("omega")?]; at("steps")? as usize],
        };
        let step = |[amplitude, omega]: [f64; 2]| Step { drive: Drive::harmonic(amplitude, omega), duration };
        let start: [f64; 4] = serde_json::from_value(scene["start"].take())?;
        Ok(Self {
            parameters,
            start: start.into(),
            steps: drives.into_iter().map(step).collect(),
        })
    }
}
