//! Plants: one, or many at once.

use std::{
    panic::{AssertUnwindSafe, catch_unwind, resume_unwind},
    sync::{
        OnceLock,
        atomic::{AtomicBool, Ordering::Relaxed},
    },
    thread,
};

use lovines::{Drive, Event, InvalidValue, Parameters, Plant, State, Wall};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2, ndarray::Array2};
use pyo3::{
    exceptions::{PyKeyboardInterrupt, PyMemoryError},
    prelude::*,
    types::PyBytes,
};
use rayon::prelude::*;

use crate::{saved, scene::invalid, wait::wait};

/// Plants that advance independently of each other.
#[pyclass]
pub struct Plants {
    plants: Vec<Plant>,
    /// Where they advance to, so that all of them stay as they are if one fails. It is kept: a plant has 8 kB, and new memory for every
    /// advance takes as long as 50 periods.
    next: Vec<Plant>,
}

/// What ends a plant's motion at an event, by unwinding.
struct Stopped;

/// Events of a single plant between two looks at the signals: some milliseconds.
const LOOK: u32 = 1 << 14;

/// Memory for `n` plants, or a `MemoryError`: without this, a batch that does not fit would end the interpreter.
fn reserve(plants: &mut Vec<Plant>, n: usize) -> PyResult<()> {
    plants.try_reserve_exact(n).map_err(|_| {
        let bytes = n as f64 * size_of::<Plant>() as f64;
        PyMemoryError::new_err(format!("{n} plants need {:.1} GB", bytes / 1e9))
    })
}

/// Number of the plant, time, kind (0 impact, 1 stuck, 2 released), wall, relative velocity.
#[derive(Default)]
struct Events {
    plant: Vec<u64>,
    time: Vec<f64>,
    kind: Vec<u8>,
    wall: Vec<i8>,
    velocity: Vec<f64>,
}

impl Events {
    #[inline(never)]
    fn push(&mut self, plant: usize, time: f64, event: Event) {
        let (kind, t, wall, velocity) = match event {
            Event::Impact { t, wall, velocity } => (0, t, wall, velocity),
            Event::Stuck { t, wall } => (1, t, wall, f64::NAN),
            Event::Released { t, wall } => (2, t, wall, f64::NAN),
        };
        self.plant.push(plant as u64);
        self.time.push(time + t);
        self.kind.push(kind);
        self.wall.push(if wall == Wall::Plus { 1 } else { -1 });
        self.velocity.push(velocity);
    }

    fn into_arrays(self, py: Python<'_>) -> EventArrays<'_> {
        (
            self.plant.into_pyarray(py),
            self.time.into_pyarray(py),
            self.kind.into_pyarray(py),
            self.wall.into_pyarray(py),
            self.velocity.into_pyarray(py),
        )
    }

    fn append(&mut self, mut other: Self) {
        self.plant.append(&mut other.plant);
        self.time.append(&mut other.time);
        self.kind.append(&mut other.kind);
        self.wall.append(&mut other.wall);
        self.velocity.append(&mut other.velocity);
    }
}

type EventArrays<'py> = (
    Bound<'py, PyArray1<u64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<u8>>,
    Bound<'py, PyArray1<i8>>,
    Bound<'py, PyArray1<f64>>,
);

/// How the motion of the n-th plant ended; without an error if it was stopped.
fn ended<T>(advanced: thread::Result<Result<T, InvalidValue>>, n: usize) -> Result<(), Option<(usize, InvalidValue)>> {
    match advanced {
        Ok(advanced) => advanced.map(drop).map_err(|error| Some((n, error))),
        Err(payload) if payload.is::<Stopped>() => Err(None),
        Err(panic) => resume_unwind(panic),
    }
}

#[pymethods]
impl Plants {
    /// Rows of M, k, c, m, b, r and of q1, dq1, q2, dq2.
    #[new]
    fn new(parameters: PyReadonlyArray2<'_, f64>, starts: PyReadonlyArray2<'_, f64>) -> PyResult<Self> {
        let (parameters, starts) = (parameters.as_array(), starts.as_array());
        let rows = parameters.rows().into_iter().zip(starts.rows());
        let mut plants = Vec::new();
        reserve(&mut plants, parameters.nrows())?;
        for (n, (p, s)) in rows.enumerate() {
            let parameters = Parameters {
                primary_mass: p[0],
                stiffness: p[1],
                damping: p[2],
                particle_mass: p[3],
                half_width: p[4],
                restitution: p[5],
            };
            let start = State { q1: s[0], dq1: s[1], q2: s[2], dq2: s[3] };
            plants.push(Plant::new(parameters, start).map_err(|error| invalid(format!("plant {n}: {error}")))?);
        }
        Ok(Self { plants, next: Vec::new() })
    }

    fn __len__(&self) -> usize {
        self.plants.len()
    }

    fn copy(&self) -> PyResult<Self> {
        let mut plants = Vec::new();
        reserve(&mut plants, self.plants.len())?;
        plants.extend_from_slice(&self.plants);
        Ok(Self { plants, next: Vec::new() })
    }

    /// The plants as bytes.
    fn save<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        saved::save(py, &self.plants)
    }

    #[staticmethod]
    fn restore(saved: &[u8]) -> PyResult<Self> {
        Ok(Self { plants: saved::restore(saved)?, next: Vec::new() })
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
        let (durations, amplitudes, omegas) = (durations.as_array(), amplitudes.as_array(), omegas.as_array());
        let Self { plants, next } = self;
        next.clear();
        reserve(next, plants.len())?;
        let (stop, mut signal, single) = (AtomicBool::new(false), OnceLock::new(), plants.len() == 1);
        // The error of a plant with its number, or none after a signal.
        let one = |(n, plant): (usize, &Plant)| -> (Plant, Result<Events, Option<(usize, InvalidValue)>>) {
            let (mut plant, mut found) = (*plant, Events::default());
            if stop.load(Relaxed) {
                return (plant, Err(None));
            }
            let (drive, start) = (Drive::harmonic(amplitudes[n], omegas[n]), plant.time());
            // One loop over events for both cases: of two, the compiler leaves parts as calls, and each is slower.
            let mut seen = 0_u32;
            let record = |event| {
                seen = seen.wrapping_add(1);
                if single
                    && seen.is_multiple_of(LOOK)
                    && let Err(error) = Python::attach(|py| py.check_signals())
                {
                    stop.store(true, Relaxed);
                    let _ = signal.set(error);
                }
                if stop.load(Relaxed) {
                    resume_unwind(Box::new(Stopped));
                }
                if events {
                    found.push(n, start, event);
                }
            };
            // The plant is a copy, which is dropped if its motion is stopped.
            let advanced = catch_unwind(AssertUnwindSafe(|| plant.advance_with(drive, durations[n], record)));
            (plant, ended(advanced, n).map(|()| found))
        };
        let mut all = Vec::new();
        if let [plant] = plants[..] {
            // A thread would take longer than most steps.
            let (plant, found) = py.detach(|| one((0, &plant)));
            next.push(plant);
            all.push(found);
        } else {
            let work = || plants.par_iter().enumerate().map(one).unzip_into_vecs(next, &mut all);
            wait(py, &stop, |_| Ok(()), work)?;
        }
        let mut merged = Events::default();
        for found in all {
            merged.append(found.map_err(|error| match (error, signal.take()) {
                (None, Some(raised)) => raised,
                (None, None) => PyKeyboardInterrupt::new_err(()),
                (Some((n, error)), _) => invalid(format!("plant {n}: {error}")),
            })?);
        }
        std::mem::swap(plants, next);
        Ok(events.then(|| merged.into_arrays(py)))
    }

    /// Rows of q1, dq1, q2, dq2.
    fn states<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let mut states = Array2::zeros((self.plants.len(), 4));
        for (mut row, plant) in states.rows_mut().into_iter().zip(&self.plants) {
            let State { q1, dq1, q2, dq2 } = plant.state();
            row.assign(&numpy::ndarray::arr1(&[q1, dq1, q2, dq2]));
        }
        states.into_pyarray(py)
    }

    /// Time, s.
    fn times<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.plants.iter().map(Plant::time).collect::<Vec<_>>().into_pyarray(py)
    }

    /// Wall that the particle is stuck to: 1, -1, or 0.
    fn walls<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i8>> {
        let wall = |plant: &Plant| {
            plant
                .contact()
                .map_or(0, |wall| if wall == Wall::Plus { 1 } else { -1 })
        };
        self.plants.iter().map(wall).collect::<Vec<i8>>().into_pyarray(py)
    }

    /// Impacts, and the energy that they dissipated, J.
    fn totals<'py>(&self, py: Python<'py>) -> (Bound<'py, PyArray1<u64>>, Bound<'py, PyArray1<f64>>) {
        let totals = || self.plants.iter().map(Plant::totals);
        (
            totals().map(|one| one.impacts).collect::<Vec<_>>().into_pyarray(py),
            totals().map(|one| one.dissipated).collect::<Vec<_>>().into_pyarray(py),
        )
    }
}
