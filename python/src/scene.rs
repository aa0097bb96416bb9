//! Scenes.

use std::fmt::Display;

use pyo3::{exceptions::PyValueError, prelude::*};
use vines_bench::{
    fit::requires_sensor,
    scene::{Family, Override, SceneError},
};

/// A `ValueError`, whose message has the value, its unit and what is allowed.
pub fn invalid(error: impl Display) -> PyErr {
    PyValueError::new_err(error.to_string())
}

pub fn json(value: &impl serde::Serialize) -> PyResult<String> {
    serde_json::to_string(value).map_err(invalid)
}

/// A checked scene.
#[pyclass(frozen)]
#[derive(Clone)]
pub struct Scene {
    pub family: Family,
    pub scene: vines_bench::scene::Scene,
}

impl Scene {
    /// Refuses a structure where there is one oscillator only.
    pub fn one_oscillator(&self, what: &str) -> PyResult<()> {
        let refusal = |structure: &vines_bench::scene::Structure| {
            let section = structure.section();
            invalid(format!(
                "{what} one oscillator: the scene has a {section}; drop it, and give M, k and c"
            ))
        };
        self.scene
            .structure
            .as_ref()
            .map_or(Ok(()), |structure| Err(refusal(structure)))
    }
}

#[pymethods]
impl Scene {
    #[new]
    #[pyo3(signature = (text, origin, overrides))]
    fn new(text: Option<&str>, origin: &str, overrides: Vec<String>) -> PyResult<Self> {
        let overrides = overrides
            .iter()
            .map(|one| {
                one.parse::<Override>()
                    .map_err(|error| invalid(format!("{one}: {error}")))
            })
            .collect::<PyResult<Vec<_>>>()?;
        let family = Family::parse(origin, text, &overrides).map_err(|error| match error {
            // The message of the program has its option.
            SceneError::Override { argument, message } => invalid(format!("{argument}: {message}")),
            other => invalid(other),
        })?;
        let scene = family.scene(&[]).map_err(invalid)?;
        Ok(Self { family, scene })
    }

    /// All settings, as JSON.
    fn settings(&self) -> PyResult<String> {
        json(&self.scene)
    }

    /// epsilon, lambda, r, G, omega0 and b, as JSON.
    fn dimensionless(&self) -> PyResult<String> {
        json(&self.scene.dimensionless())
    }

    /// Refuses what `vines` has not measured, unless the scene says what the sensor of the response reads.
    fn requires_sensor(&self, origin: &str) -> PyResult<()> {
        requires_sensor(origin, &self.scene).map_err(invalid)
    }

    /// The unit in which the drive of the scene is measured: m of a base, N of a force.
    fn drive_unit(&self) -> &'static str {
        self.scene.units().reference.symbol
    }
}
