//! Plants: one, or many at once.

use std::{
    ops::ControlFlow,
    sync::atomic::{AtomicBool, Ordering::Relaxed},
};

use lovines::{
    Drive, Event, InvalidValue, Parameters, Plant as OnePlant, State, Wall,
    plant::Saved,
    table::{COUNT, LAWS, PARAMETERS, Parameter, Values},
};
use numpy::{Element, IntoPyArray, PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2, ndarray::Array2};
use pyo3::{
    exceptions::{PyKeyboardInterrupt, PyMemoryError},
    prelude::*,
    types::PyBytes,
};
use rayon::prelude::*;

use crate::{
    number::{Metre, RadPerSecond, Real, Second},
    saved,
    scene::invalid,
    wait::{own_threads, wait},
};

/// Number of the plant, time, kind (its position in `KINDS` of plants.py), wall, relative velocity.
#[derive(Default)]
struct Events(Vec<(u64, f64, u8, i8, f64)>);

impl Events {
    #[inline(never)]
    fn push(&mut self, plant: usize, time: f64, event: Event) {
        let (kind, t, at, velocity) = match event {
            Event::Impact { t, wall, velocity } => (0, t, Some(wall), velocity),
            Event::Stuck { t, wall } => (1, t, Some(wall), f64::NAN),
            Event::Released { t, wall } => (2, t, Some(wall), f64::NAN),
            Event::Sticking { t } => (3, t, None, f64::NAN),
            Event::Slip { t, .. } => (4, t, None, f64::NAN),
            Event::Reversal { t, .. } => (5, t, None, f64::NAN),
        };
        self.0.push((plant as u64, time + t, kind, sign(at), velocity));
    }

    fn into_arrays(self, py: Python<'_>) -> EventArrays<'_> {
        (
            column(py, self.0.iter().map(|event| event.0)),
            column(py, self.0.iter().map(|event| event.1)),
            column(py, self.0.iter().map(|event| event.2)),
            column(py, self.0.iter().map(|event| event.3)),
            column(py, self.0.iter().map(|event| event.4)),
        )
    }
}

/// 1 or -1 for a wall, 0 for none.
fn sign(wall: Option<Wall>) -> i8 {
    wall.map_or(0, |wall| if wall == Wall::Plus { 1 } else { -1 })
}

type Column<'py, T> = Bound<'py, PyArray1<T>>;
type EventArrays<'py> = (
    Column<'py, u64>,
    Column<'py, f64>,
    Column<'py, u8>,
    Column<'py, i8>,
    Column<'py, f64>,
);
type Totals<'py> = (
    Column<'py, u64>,
    Column<'py, f64>,
    Column<'py, u64>,
    Column<'py, f64>,
    Column<'py, f64>,
);

fn column<'py, T: Element>(py: Python<'py>, all: impl Iterator<Item = T>) -> Column<'py, T> {
    all.collect::<Vec<T>>().into_pyarray(py)
}

/// Why a plant did not advance: without an error if it was stopped.
type Failure = Option<InvalidValue>;

/// Oscillations of a plant or of its drive, in radians, that take some ten milliseconds at most where there is no impact.
const STRETCH: f64 = 1e4;

/// Fastest rate of the motion between impacts, rad/s, or above.
fn fastest(plant: &OnePlant, drive: Drive) -> f64 {
    let p = plant.parameters();
    (p.stiffness / p.primary_mass).sqrt() + p.damping / p.primary_mass + drive.omega.abs()
}

/// Advances a plant, in stretches if it takes long; `stop` ends its motion after a stretch, or at an event. The number `n` is that of its
/// events.
fn advance(
    plant: &mut OnePlant,
    (drive, duration): (Drive, f64),
    n: usize,
    mut found: Option<&mut Events>,
    stop: &AtomicBool,
) -> Result<(), Failure> {
    let stretches = (duration * fastest(plant, drive) / STRETCH).ceil();
    let (stretches, step) = if stretches > 1.0 && stretches.is_finite() {
        (stretches, duration / stretches)
    } else {
        (1.0, duration)
    };
    for _ in 0..stretches as u64 {
        let start = plant.time();
        let record = |event| {
            if let Some(found) = &mut found {
                found.push(n, start, event);
            }
            match stop.load(Relaxed) {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            }
        };
        plant.advance_until(drive, step, record).map_err(Some)?;
        if stop.load(Relaxed) {
            return Err(None);
        }
    }
    Ok(())
}

/// Symbol and unit of a parameter.
type Symbol = (&'static str, &'static str);

/// The symbols of the parameters with their units, those that must be given first, and the laws of restitution by their codes.
#[pyfunction]
pub fn plant_table() -> (Vec<Symbol>, Vec<Symbol>, Vec<&'static str>) {
    let (needed, cavity): (Vec<_>, Vec<_>) = PARAMETERS.iter().partition(|row| row.default.is_none());
    let names = |rows: Vec<&Parameter>| rows.into_iter().map(|row| (row.symbol, row.unit)).collect();
    (names(needed), names(cavity), LAWS.to_vec())
}

/// Parameters from numbers in the order of the plant's table; NaN where the cavity has its default.
fn parameters(values: [f64; COUNT]) -> Result<Parameters, InvalidValue> {
    let values = Values(values.map(|value| Some(value).filter(|value| !value.is_nan())));
    values.given().try_for_each(|(row, value)| row.check(value))?;
    Ok(values.parameters())
}

fn wall(plant: &OnePlant) -> i8 {
    sign(plant.contact())
}

/// One plant, with all that makes a single step fast.
#[pyclass(subclass)]
pub struct Plant {
    plant: Box<OnePlant>,
}

/// Oscillations (in radians, of the fastest mode or the drive) and crossings of the cavity that take about a millisecond. A longer advance is computed in a thread, so that
/// Ctrl-C ends it.
pub(crate) const SHORT_ADVANCE: f64 = 1e3;

impl Plant {
    fn of(plant: OnePlant) -> Self {
        Self { plant: Box::new(plant) }
    }

    /// Runs `work` on the plant; it stays as it is if that fails. With a long duration it runs in a thread.
    fn run<T: Send>(
        &mut self,
        py: Python<'_>,
        (drive, duration): (Drive, f64),
        work: impl FnOnce(&mut OnePlant, &AtomicBool) -> Result<T, Failure> + Send,
    ) -> PyResult<T> {
        let state = self.plant.state();
        let speed = state.dq1.abs() + state.dq2.abs() + (drive.amplitude * drive.omega).abs();
        let crossings = speed / self.plant.parameters().half_width;
        let (before, stop) = (self.plant.save(), AtomicBool::new(false));
        let result = if duration * (fastest(&self.plant, drive) + crossings) < SHORT_ADVANCE {
            Ok(work(&mut self.plant, &stop))
        } else {
            wait(py, &stop, |_| Ok(()), || work(&mut self.plant, &stop))
        };
        let result = result.and_then(|result| {
            result.map_err(|failure| failure.map_or_else(|| PyKeyboardInterrupt::new_err(()), invalid))
        });
        if result.is_err() {
            self.plant.restore(&before);
        }
        result
    }
}

#[pymethods]
impl Plant {
    /// Parameters, and q1, dq1, q2, dq2.
    #[new]
    fn new(values: [Real; COUNT], start: [Real; 4]) -> PyResult<Self> {
        let parameters = parameters(values.map(|one| one.0));
        let plant = parameters.and_then(|parameters| OnePlant::new(parameters, start.map(|one| one.0).into()));
        plant.map(Self::of).map_err(invalid)
    }

    /// The plant as bytes.
    fn _save<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        saved::save(py, &self.plant.save())
    }

    fn _restore(&mut self, saved: &[u8]) -> PyResult<()> {
        *self = Self::of(saved::restore::<OnePlant>(saved)?);
        Ok(())
    }

    /// Advances it. Returns the events, or None without any.
    fn _advance<'py>(
        &mut self,
        py: Python<'py>,
        duration: Real<Second>,
        amplitude: Real<Metre>,
        omega: Real<RadPerSecond>,
    ) -> PyResult<Option<EventArrays<'py>>> {
        let motion = (Drive::harmonic(amplitude.0, omega.0), duration.0);
        let found = self.run(py, motion, move |plant, stop| {
            let mut found = Events::default();
            advance(plant, motion, 0, Some(&mut found), stop).map(|()| found)
        })?;
        Ok((!found.0.is_empty()).then(|| found.into_arrays(py)))
    }

    /// Advances it in equal steps. Returns rows of time, q1, dq1, q2, dq2 and base displacement, and the events.
    #[allow(clippy::type_complexity)]
    fn _trajectory<'py>(
        &mut self,
        py: Python<'py>,
        duration: Real<Second>,
        steps: usize,
        amplitude: Real<Metre>,
        omega: Real<RadPerSecond>,
    ) -> PyResult<(Bound<'py, PyArray2<f64>>, EventArrays<'py>)> {
        let drive = Drive::harmonic(amplitude.0, omega.0);
        let step = duration.0 / steps as f64;
        let mut rows: Vec<[f64; 6]> = Vec::new();
        rows.try_reserve_exact(steps + 1)
            .map_err(|_| PyMemoryError::new_err(format!("{} states need too much memory", steps + 1)))?;
        let (rows, found) = self.run(py, (drive, duration.0), move |plant, stop| {
            let row = |plant: &OnePlant| {
                let (State { q1, dq1, q2, dq2 }, phase) = (plant.state(), plant.base().phase.radians());
                [plant.time(), q1, dq1, q2, dq2, drive.amplitude * phase.sin()]
            };
            let mut found = Events::default();
            rows.push(row(plant));
            for _ in 0..steps {
                if stop.load(Relaxed) {
                    return Err(None);
                }
                advance(plant, (drive, step), 0, Some(&mut found), stop)?;
                rows.push(row(plant));
            }
            Ok((rows, found))
        })?;
        let rows = Array2::from(rows).into_pyarray(py);
        Ok((rows, found.into_arrays(py)))
    }

    fn _set_state(&mut self, values: [Real; 4]) -> PyResult<()> {
        self.plant.set_state(values.map(|one| one.0).into()).map_err(invalid)
    }

    /// Displacement of the primary mass, m.
    #[getter]
    fn q1(&self) -> f64 {
        self.plant.state().q1
    }

    /// Velocity of the primary mass, m/s.
    #[getter]
    fn dq1(&self) -> f64 {
        self.plant.state().dq1
    }

    /// Displacement of the particle, m.
    #[getter]
    fn q2(&self) -> f64 {
        self.plant.state().q2
    }

    /// Velocity of the particle, m/s.
    #[getter]
    fn dq2(&self) -> f64 {
        self.plant.state().dq2
    }

    /// v = q1 + epsilon q2, m: displacement of the centre of mass times 1 + epsilon.
    #[getter]
    fn v(&self) -> f64 {
        self.plant.centre()
    }

    /// Relative displacement w = q1 - q2, m.
    #[getter]
    fn w(&self) -> f64 {
        self.plant.relative_displacement()
    }

    /// Relative velocity w', m/s.
    #[getter]
    fn dw(&self) -> f64 {
        self.plant.relative_velocity()
    }

    /// Displacement of the base, m: E sin(phase), with the E of the last advance.
    #[getter]
    fn base(&self) -> f64 {
        self.plant.base_displacement()
    }

    /// Phase of the base, rad, in [0, 2 pi).
    #[getter]
    fn phase(&self) -> f64 {
        self.plant.base().phase.radians()
    }

    /// Time since the start, s.
    #[getter]
    fn time(&self) -> f64 {
        self.plant.time()
    }

    /// Wall that the particle is stuck to: 1 at w = b, -1 at w = -b, 0 if it is free.
    #[getter]
    fn wall(&self) -> i8 {
        wall(&self.plant)
    }

    /// Impacts since the start.
    #[getter]
    fn impacts(&self) -> u64 {
        self.plant.totals().impacts
    }

    /// Energy dissipated by impacts since the start, J.
    #[getter]
    fn dissipated(&self) -> f64 {
        self.plant.totals().dissipated
    }

    /// Whether the particle sticks to the floor inside the cavity.
    #[getter]
    fn sticking(&self) -> bool {
        self.plant.sticks()
    }

    /// How often the particle has stuck to the floor inside the cavity since the start.
    #[getter]
    fn sticks(&self) -> u64 {
        self.plant.totals().sticks
    }

    /// How long it has stuck there, s.
    #[getter]
    fn stuck_time(&self) -> f64 {
        self.plant.totals().stuck_time
    }

    /// Energy lost to friction in the cavity since the start, J.
    #[getter]
    fn friction_loss(&self) -> f64 {
        self.plant.totals().friction
    }

    /// q1 (m), q1' (m/s), q2 (m) and q2' (m/s) as an array of shape (1, 4), as of a `Batch`.
    #[getter]
    fn states<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        Array2::from(vec![<[f64; 4]>::from(self.plant.state())]).into_pyarray(py)
    }
}

/// Plants that advance independently of each other. Each is its saved form; a thread has one plant that takes their place in turn.
#[pyclass]
pub struct Plants {
    plants: Vec<Saved>,
}

/// Parts of a batch per thread: plants differ in their cost.
const PARTS_PER_THREAD: usize = 64;

/// Memory for `n` plants, or a `MemoryError`: without this, a batch that does not fit would end the interpreter.
fn reserve(plants: &mut Vec<Saved>, n: usize) -> PyResult<()> {
    plants.try_reserve_exact(n).map_err(|_| {
        let bytes = n as f64 * size_of::<Saved>() as f64;
        PyMemoryError::new_err(format!("{n} plants need {:.1} GB", bytes / 1e9))
    })
}

impl Plants {
    fn of(plants: Vec<Saved>) -> Self {
        Self { plants }
    }

    /// What `read` finds in every plant.
    fn each<T>(&self, read: impl Fn(&OnePlant) -> T) -> Vec<T> {
        let mut workspace = None;
        self.plants
            .iter()
            .map(|saved| read(restored(&mut workspace, saved)))
            .collect()
    }
}

/// The plant in a workspace.
fn restored<'a>(workspace: &'a mut Option<OnePlant>, saved: &Saved) -> &'a mut OnePlant {
    match workspace {
        Some(plant) => {
            plant.restore(saved);
            plant
        }
        None => workspace.insert(OnePlant::from(saved)),
    }
}

#[pymethods]
impl Plants {
    /// Rows of parameters, those of the cavity absent where it is ideal, and of q1, dq1, q2, dq2.
    #[new]
    fn new(values: PyReadonlyArray2<'_, f64>, starts: PyReadonlyArray2<'_, f64>) -> PyResult<Self> {
        let (values, starts) = (values.as_array(), starts.as_array());
        let mut plants = Vec::new();
        reserve(&mut plants, values.nrows())?;
        for (n, (p, s)) in values.rows().into_iter().zip(starts.rows()).enumerate() {
            let (parameters, start) = (
                parameters(std::array::from_fn(|i| p.get(i).copied().unwrap_or(f64::NAN))),
                State::from(std::array::from_fn(|i| s[i])),
            );
            let plant = parameters.and_then(|parameters| OnePlant::new(parameters, start));
            let plant = plant.map_err(|error| invalid(format!("plant {n}: {error}")))?;
            plants.push(plant.save());
        }
        Ok(Self::of(plants))
    }

    fn __len__(&self) -> usize {
        self.plants.len()
    }

    fn copy(&self) -> PyResult<Self> {
        let mut plants = Vec::new();
        reserve(&mut plants, self.plants.len())?;
        plants.extend_from_slice(&self.plants);
        Ok(Self::of(plants))
    }

    /// The plants as bytes.
    fn save<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        saved::save(py, &self.plants)
    }

    #[staticmethod]
    fn restore(saved: &[u8]) -> PyResult<Self> {
        saved::restore(saved).map(Self::of)
    }

    /// Advances all plants, or none if a value is refused or a signal arrives. Returns the events, if they are wanted.
    fn advance<'py>(
        &mut self,
        py: Python<'py>,
        durations: PyReadonlyArray1<'py, f64>,
        amplitudes: PyReadonlyArray1<'py, f64>,
        omegas: PyReadonlyArray1<'py, f64>,
        events: bool,
    ) -> PyResult<Option<EventArrays<'py>>> {
        own_threads()?;
        let [durations, amplitudes, omegas] = [durations, amplitudes, omegas].map(|one| one.as_array().to_vec());
        let plants = &self.plants;
        // All plants stay as they are if one fails.
        let mut next = Vec::new();
        reserve(&mut next, plants.len())?;
        let stop = AtomicBool::new(false);
        let found = wait(
            py,
            &stop,
            |_| Ok(()),
            || {
                next.extend_from_slice(plants);
                let part = plants
                    .len()
                    .div_ceil(PARTS_PER_THREAD * rayon::current_num_threads())
                    .max(1);
                let parts = next.par_chunks_mut(part).enumerate();
                parts
                    .map_init(
                        || None,
                        |workspace, (number, part_of_all)| {
                            let mut found = Events::default();
                            for (n, saved) in (number * part..).zip(part_of_all) {
                                if stop.load(Relaxed) {
                                    return Err((n, None));
                                }
                                let plant = restored(workspace, saved);
                                let motion = (Drive::harmonic(amplitudes[n], omegas[n]), durations[n]);
                                advance(plant, motion, n, events.then_some(&mut found), &stop)
                                    .map_err(|error| (n, error))?;
                                *saved = plant.save();
                            }
                            Ok(found)
                        },
                    )
                    .collect::<Vec<Result<Events, (usize, Failure)>>>()
            },
        )?;
        let mut merged = Events::default();
        for found in found {
            merged.0.append(
                &mut found
                    .map_err(|(n, failure)| match failure {
                        Some(error) => invalid(format!("plant {n}: {error}")),
                        None => PyKeyboardInterrupt::new_err(()),
                    })?
                    .0,
            );
        }
        self.plants = next;
        Ok(events.then(|| merged.into_arrays(py)))
    }

    /// Rows of q1, dq1, q2, dq2.
    fn states<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        Array2::from(self.each(|plant| <[f64; 4]>::from(plant.state()))).into_pyarray(py)
    }

    /// Time, s.
    fn times<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.each(OnePlant::time).into_pyarray(py)
    }

    /// Wall that the particle is stuck to: 1, -1, or 0.
    fn walls<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i8>> {
        self.each(wall).into_pyarray(py)
    }

    /// Impacts, the energy that they dissipated, J, how often the particle stuck to the floor, how long, s, and the energy lost to friction, J.
    fn totals<'py>(&self, py: Python<'py>) -> Totals<'py> {
        let all = self.each(|plant| *plant.totals());
        (
            column(py, all.iter().map(|totals| totals.impacts)),
            column(py, all.iter().map(|totals| totals.dissipated)),
            column(py, all.iter().map(|totals| totals.sticks)),
            column(py, all.iter().map(|totals| totals.stuck_time)),
            column(py, all.iter().map(|totals| totals.friction)),
        )
    }
}
