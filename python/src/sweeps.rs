//! Sweeps: many cells at once, on all cores.

use std::sync::{
    Arc,
    atomic::{AtomicBool, AtomicUsize, Ordering::Relaxed},
};

use numpy::{IntoPyArray, PyArray1, PyReadonlyArray2};
use phase_lock::Parameter;
use pyo3::prelude::*;
use rayon::prelude::*;
use vines_bench::{
    cells::{self, Cell},
    experiment,
    identification::{self, Lock},
    plan::Plan,
    rig::{BuiltIn, Simulated, Stoppable},
    scene::Scene as CheckedScene,
};
use vines_model::{
    map::{CellRun, RegimeResult, SteadyResponse},
    orbit::{Orbit, symmetric_orbits},
    regime::Regime,
};

use crate::{
    scene::{Scene, invalid},
    wait::{own_threads, wait},
};

/// Groups of results. `regime` is always computed; the motion is followed further for `response`.
const GROUPS: [&str; 4] = ["regime", "response", "orbits", "lock"];

/// Code of the regime in a cell that failed.
const FAILED: u8 = 254;

/// What was computed of a cell. The default is a cell that failed.
#[derive(Default)]
struct Computed {
    result: Option<RegimeResult>,
    response: Option<SteadyResponse>,
    orbits: Option<Vec<Orbit>>,
    lock: Option<Lock>,
    /// `k b^2 omega0`, W.
    power: f64,
}

impl Computed {
    /// The orbit with the larger B, which is the stable one where one is.
    fn orbit(&self) -> Option<&Orbit> {
        let orbits = self.orbits.iter().flatten();
        orbits.max_by(|first, second| first.b.total_cmp(&second.b))
    }
}

/// Group, name, unit and meaning of a variable, and how it is read.
type Variable = (
    &'static str,
    &'static str,
    &'static str,
    &'static str,
    fn(&Computed) -> Option<f64>,
);

/// All results of a cell; what does not exist is NaN.
#[rustfmt::skip]
const VARIABLES: [Variable; 24] = [
    ("regime", "regime", "1", "regime of the response", |c| Some(c.result.map_or(FAILED, |result| result.regime as u8).into())),
    ("regime", "followed", "1", "periods of the base that were simulated", |c| Some(c.result?.followed as f64)),
    ("regime", "settling", "1", "periods of the base before the regime began", |c| Some(c.result?.transient)),
    ("regime", "impacts_per_period", "1", "impacts per period of the base", |c| Some(c.result?.impacts_per_period)),
    ("regime", "sticks_per_period", "1", "how often the particle comes to rest on a wall, per period of the base", |c| Some(c.result?.sticks_per_period)),
    ("regime", "impacts", "1", "impacts of one repetition; 0 if nothing repeats", |c| Some(c.result?.impacts as f64)),
    ("regime", "periods", "1", "periods of the base that a repetition takes; 0 if nothing repeats", |c| Some(c.result?.periods.into())),
    ("regime", "recurrence", "1", "largest difference between the state and that one repetition before", |c| c.result?.recurrence),
    ("regime", "exponent", "1", "largest Lyapunov exponent per period of the base", |c| c.result?.exponent),
    ("regime", "exponent_error", "1", "standard error of the exponent", |c| c.result?.exponent_error),
    ("regime", "synchrony", "1", "share of the impacts that belong to captures into 1:1 resonance", |c| Some(c.result?.synchrony)),
    ("response", "C", "1", "amplitude of the first harmonic of v over b", |c| Some(c.response?.c)),
    ("response", "impact_power", "W", "mean power that the impacts dissipate", |c| Some(c.power * c.response?.impact_power)),
    ("response", "damper_power", "W", "mean power that the damper dissipates", |c| Some(c.power * c.response?.damper_power)),
    ("orbits", "orbits", "1", "number of exact symmetric 1:1 orbits at this drive", |c| Some(c.orbits.as_ref()?.len() as f64)),
    ("orbits", "stable_orbits", "1", "number of those that are stable", |c| Some(c.orbits.as_ref()?.iter().filter(|orbit| orbit.stable).count() as f64)),
    ("orbits", "neutral_orbits", "1", "number of those that are neutral: their largest multiplier is 1 within 1e-7", |c| Some(c.orbits.as_ref()?.iter().filter(|orbit| orbit.neutral).count() as f64)),
    ("orbits", "orbit_C", "1", "amplitude of the first harmonic of v over b, on the orbit with the larger B", |c| Some(c.orbit()?.c)),
    ("orbits", "orbit_B", "1", "speed of the particle over b omega0, on the orbit with the larger B", |c| Some(c.orbit()?.b)),
    ("orbits", "orbit_multiplier", "1", "largest modulus of the multipliers of that orbit over half a period", |c| Some(c.orbit()?.multipliers[3])),
    ("lock", "lock_sigma", "1", "detuning of the locked point", |c| Some(c.lock?.at.sigma)),
    ("lock", "lock_C", "1", "amplitude of the first harmonic of v over b at the lock", |c| Some(c.lock?.at.c)),
    ("lock", "lock_B", "1", "mean speed of the particle over b omega0 at the lock", |c| c.lock?.b),
    ("lock", "periods_to_lock", "1", "periods from the start to the settled lock", |c| Some(c.lock?.periods_to_lock)),
];

/// Cells over numbers of a scene.
#[pyclass(frozen)]
pub struct Cells {
    cells: cells::Cells,
    groups: Vec<&'static str>,
}

#[pymethods]
impl Cells {
    #[new]
    fn new(scene: &Scene, keys: Vec<String>, sigma: Option<f64>, results: Vec<String>, periods: i64) -> PyResult<Self> {
        scene.one_oscillator("a sweep is of")?;
        let periods = usize::try_from(periods)
            .map_err(|_| invalid(format!("{periods} periods: a number of at least 100 is allowed")))?;
        if let Some(name) = results.iter().find(|name| !GROUPS.contains(&name.as_str())) {
            return Err(invalid(format!(
                "unknown results `{name}`; known are regime, response, orbits and lock"
            )));
        }
        let groups = GROUPS.into_iter();
        let groups = groups.filter(|group| *group == GROUPS[0] || results.iter().any(|name| name == group));
        let cells = cells::Cells::new(scene.family.clone(), &keys, sigma, periods).map_err(invalid)?;
        Ok(Self { cells, groups: groups.collect() })
    }

    /// The detuning, unless it varies.
    #[getter]
    fn sigma(&self) -> Option<f64> {
        self.cells.sigma()
    }

    /// Names, units and meanings of the variables.
    #[getter]
    fn variables(&self) -> Vec<(&'static str, &'static str, &'static str)> {
        let variables = self.chosen();
        variables
            .map(|(_, name, unit, meaning, _)| (name, unit, meaning))
            .collect()
    }

    /// Computes the cells with these values, one row each with one value per key. `look` receives the number of cells that are complete.
    /// Returns the variables of all cells, cell by cell, and why they failed: empty for a cell that did not.
    fn compute<'py>(
        &self,
        py: Python<'py>,
        values: PyReadonlyArray2<'py, f64>,
        look: Option<Py<PyAny>>,
    ) -> PyResult<(Bound<'py, PyArray1<f64>>, Vec<String>)> {
        own_threads()?;
        let rows: Vec<Vec<f64>> = values.as_array().rows().into_iter().map(|row| row.to_vec()).collect();
        let read: Vec<_> = self.chosen().map(|(.., read)| read).collect();
        let (mut numbers, mut failures) = (vec![f64::NAN; rows.len() * read.len()], vec![String::new(); rows.len()]);
        let (stop, complete) = (Arc::new(AtomicBool::new(false)), AtomicUsize::new(0));
        let looked = |py: Python<'_>| match &look {
            Some(look) => look.call1(py, (complete.load(Relaxed),)).map(drop),
            None => Ok(()),
        };
        wait(py, &stop, looked, || {
            let results = numbers.par_chunks_mut(read.len()).zip(&mut failures);
            results.zip(&rows).for_each(|((numbers, failure), row)| {
                if stop.load(Relaxed) {
                    return;
                }
                let (computed, reason) = self.cell(row, &stop);
                for (number, read) in numbers.iter_mut().zip(&read) {
                    *number = read(&computed).unwrap_or(f64::NAN);
                }
                *failure = reason;
                complete.fetch_add(1, Relaxed);
            });
        })?;
        looked(py)?;
        Ok((numbers.into_pyarray(py), failures))
    }
}

impl Cells {
    fn chosen(&self) -> impl Iterator<Item = Variable> {
        VARIABLES.into_iter().filter(|(group, ..)| self.groups.contains(group))
    }

    /// Computes one cell; with the reason if something of it failed.
    fn cell(&self, values: &[f64], stop: &Arc<AtomicBool>) -> (Computed, String) {
        let asks = |group| self.groups.contains(&group);
        let computed = self.cells.at(values).and_then(|Cell { scene, sigma, numbers }| {
            let mut run = CellRun::new(&numbers, sigma, scene.dimensionless_start())?.stopped_by(Arc::clone(stop));
            let result = run.decided(0, self.cells.periods)?;
            let response = asks("response").then(|| run.response(&result)).transpose()?;
            let (lock, failure) = match asks("lock").then(|| locked(&scene, stop)).transpose() {
                Ok(lock) => (lock, String::new()),
                Err(error) => (None, format!("no locked point: {error}")),
            };
            let computed = Computed {
                result: Some(result),
                response,
                orbits: asks("orbits").then(|| symmetric_orbits(&numbers, sigma)),
                lock,
                power: scene.plant.stiffness * numbers.b * numbers.b * numbers.omega0,
            };
            Ok((computed, failure))
        });
        computed.unwrap_or_else(|error| (Computed::default(), error.to_string()))
    }
}

/// The locked point of a scene: the experiment of `identify` without its decay.
fn locked(scene: &CheckedScene, stop: &Arc<AtomicBool>) -> Result<Lock, Box<dyn std::error::Error>> {
    let plan = Plan { decay: 0, ..scene.plan() };
    let mut rig = Stoppable::around(Simulated::of(scene)?, scene.sample_time(), stop);
    let mut controller = BuiltIn::new(&plan.lock)?;
    let record = experiment::run(&mut Vec::new(), &mut rig, &mut controller, &plan, |_, _| {})?;
    Ok(identification::identify(&record, &plan)?.lock)
}

/// Unit of a number of a scene that a sweep varies: `1` for a count, and for what a scene states relative to omega0, b or a period. That
/// of noise is the one of its sensor: `1` without a scene.
#[pyfunction]
#[pyo3(signature = (key, scene=None))]
pub fn unit(key: &str, scene: Option<&Scene>) -> &'static str {
    let of_reading = |channel: usize| scene.map_or("1", |scene| scene.scene.reading_units()[channel]);
    match key {
        "plant.M" | "plant.m" => "kg",
        "plant.k" => "N/m",
        "plant.c" => "N s/m",
        "plant.b" | "excitation.E" | "start.q1" | "start.q2" => "m",
        "start.dq1" | "start.dq2" => "m/s",
        "controller.phase_target" => "degree",
        "chain.snr" => "dB",
        "chain.response_noise" => of_reading(0),
        "chain.reference_noise" => of_reading(1),
        key => match key.strip_prefix("phase_lock.").and_then(Parameter::find) {
            Some(parameter) if !parameter.unit.is_empty() => parameter.unit,
            _ => "1",
        },
    }
}

/// Names of the regimes, by their code.
#[pyfunction]
pub fn regimes() -> Vec<&'static str> {
    Regime::SIMULATED.iter().map(|regime| regime.name()).collect()
}
