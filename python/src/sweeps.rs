//! Sweeps.

use std::{
    ffi::CString,
    path::PathBuf,
    sync::atomic::{AtomicBool, Ordering::Relaxed},
};

use pyo3::{
    exceptions::{PyOSError, PyOverflowError, PyRuntimeWarning, PyValueError},
    prelude::*,
    types::PyDict,
};
use vines_sweep::{self as sweeps, Axis, Grid, Monitor, Results, Settings, Shard, StoreError, Values, estimate, run};

use crate::{
    scene::{Scene, invalid},
    wait::{own_threads, wait},
};

/// The values of an axis: first, last and number; an interval with the name of a design; paired values, alone in a tuple; or a list.
#[derive(FromPyObject)]
enum Given {
    Grid(f64, f64, u64),
    Design(String, f64, f64),
    Paired((Vec<f64>,)),
    List(Vec<f64>),
}

fn checked(scene: &Scene, axes: &Bound<'_, PyDict>, settings: &Bound<'_, PyDict>) -> PyResult<sweeps::Sweep> {
    let axes = axes
        .iter()
        .map(|(name, values)| {
            let name: String = name.extract()?;
            let values = match values.extract()? {
                Given::Grid(from, to, points) => Values::Grid(Grid { from, to, points }),
                Given::List(list) => Values::List(list),
                Given::Paired((list,)) => Values::Paired(list),
                Given::Design(design, from, to) => match design.as_str() {
                    "random" => Values::Random([from, to]),
                    other => {
                        return Err(invalid(format!("{name}: unknown design `{other}`; known is random")));
                    }
                },
            };
            Axis::new(&name, values).map_err(invalid)
        })
        .collect::<PyResult<Vec<_>>>()?;
    let get = |key: &str| {
        settings
            .get_item(key)?
            .ok_or_else(|| PyValueError::new_err(key.to_string()))
    };
    let whole = |key: &str| {
        let value = get(key)?;
        let number = value.extract::<Option<u64>>();
        number.map_err(|error| match error.is_instance_of::<PyOverflowError>(value.py()) {
            true => invalid(format!("{key} = {value}: a whole number from 0 to 2^64 - 1 is allowed")),
            false => error,
        })
    };
    let results: Vec<String> = get("results")?.extract()?;
    let settings = Settings {
        axes,
        sigma: get("sigma")?.extract()?,
        samples: whole("samples")?,
        seed: whole("seed")?.unwrap_or_default(),
        periods: whole("periods")?.unwrap_or_default() as usize,
        results: Results::parse(results.iter().map(String::as_str)).map_err(invalid)?,
        chunk: whole("chunk")?.unwrap_or_default(),
        adaptive: whole("adaptive")?,
    };
    sweeps::Sweep::new(scene.family.clone(), settings).map_err(invalid)
}

/// An `OSError` with the number of the system's error, if it is one.
fn system(error: &StoreError) -> PyErr {
    match error.os_error() {
        Some(number) => PyOSError::new_err((number, error.to_string())),
        None => PyOSError::new_err(error.to_string()),
    }
}

/// A checked sweep.
#[pyclass(frozen)]
pub struct Sweep(sweeps::Sweep);

#[pymethods]
impl Sweep {
    #[new]
    fn new(scene: &Scene, axes: &Bound<'_, PyDict>, settings: &Bound<'_, PyDict>) -> PyResult<Self> {
        checked(scene, axes, settings).map(Self)
    }

    #[getter]
    fn cells(&self) -> u64 {
        self.0.cells()
    }

    #[getter]
    fn chunks(&self) -> u64 {
        self.0.chunks()
    }

    /// Estimated hours and bytes, and whether these must be confirmed.
    fn estimate(&self, py: Python<'_>) -> PyResult<(f64, f64, bool)> {
        own_threads()?;
        let stop = AtomicBool::new(false);
        let cost = wait(py, &stop, |_| Ok(()), || estimate(&self.0, &stop))?.map_err(invalid)?;
        Ok((cost.hours, cost.bytes, cost.is_large()))
    }

    /// Computes a part of it; `look` receives the number of cells that are complete. Returns the numbers of cells computed and failed.
    fn run(&self, py: Python<'_>, out: PathBuf, shard: (u64, u64), look: Option<Py<PyAny>>) -> PyResult<(u64, u64)> {
        let (number, of) = shard;
        if number >= of {
            return Err(invalid(format!(
                "shard ({number}, {of}): the number counts from 0 to {of} - 1"
            )));
        }
        own_threads()?;
        let monitor = Monitor::default();
        let looked = |py: Python<'_>| match &look {
            Some(look) => {
                let complete = monitor.found.load(Relaxed) + monitor.computed.load(Relaxed);
                look.call1(py, (complete,)).map(drop)
            }
            None => Ok(()),
        };
        let result = wait(py, &monitor.stop, looked, || {
            run(&self.0, &out, Shard { number, of }, &monitor)
        })?;
        result.map_err(|error| match error {
            StoreError::Write { .. } => system(&error),
            _ => invalid(error),
        })?;
        looked(py)?;
        if let Some(damage) = monitor.damage() {
            let message = CString::new(format!("{damage}. They were replaced"))?;
            PyErr::warn(py, &py.get_type::<PyRuntimeWarning>(), &message, 2)?;
        }
        Ok((monitor.computed.load(Relaxed), monitor.failed.load(Relaxed)))
    }
}

/// Names of the regimes, by their code.
#[pyfunction]
pub fn regimes() -> Vec<&'static str> {
    vines_model::regime::Regime::SIMULATED
        .iter()
        .map(|regime| regime.name())
        .collect()
}
