//! Experiments, orbits, theory and regimes. Results are JSON: its numbers keep all bits, and Python names them.

use std::sync::{Arc, atomic::AtomicBool};

use phase_lock::{Input, State};
use pyo3::{
    exceptions::{PyRuntimeError, PyValueError},
    prelude::*,
    types::PyBytes,
};
use serde_json::json;
use vines_bench::{
    backbone::track,
    comparison::{Comparison, TrackedComparison},
    experiment,
    fit::{Known, MeasuredPoint, Measurements, Recording, Selection, decay_in_words, find, requires_sensor},
    identification,
    linear::MeasuredLinear,
    rig::{BuiltIn, Simulated, Stoppable},
    scene::{Scene as Checked, phase_target},
};
use vines_model::{
    Measurand,
    map::CellRun,
    numerics::{Estimate, equally_spaced},
    orbit,
    theory::{SlowFlow, resonant},
};

use crate::{
    files::{ContentsTuple, contents_of},
    number::{Metre, Real},
    saved,
    scene::{Scene, invalid, json},
    wait::wait_apart,
};

/// Why an experiment ended without a result.
type Failure = Box<dyn std::error::Error + Send + Sync>;

/// Runs an experiment on the scene's rig, and returns its result as JSON; its failure is a `RuntimeError`.
fn experiment<T: serde::Serialize>(
    py: Python<'_>,
    scene: &Checked,
    work: impl FnOnce(&mut Stoppable, &Checked) -> Result<T, Failure> + Send + 'static,
) -> PyResult<String> {
    let stop = Arc::new(AtomicBool::new(false));
    let (flag, scene) = (Arc::clone(&stop), scene.clone());
    let run = move || -> Result<String, Failure> {
        let rig = Simulated::of(&scene)?;
        let result = work(&mut Stoppable::around(rig, scene.sample_time(), &flag), &scene)?;
        Ok(serde_json::to_string(&result)?)
    };
    wait_apart(py, &stop, run)?.map_err(|error| PyRuntimeError::new_err(error.to_string()))
}

/// Calculates as [`wait_apart`] does, what only its searches end early.
fn calculate<T: Send + 'static>(py: Python<'_>, work: impl FnOnce() -> T + Send + 'static) -> PyResult<T> {
    wait_apart(py, &Arc::default(), work)
}

#[pyfunction]
pub fn identify(py: Python<'_>, scene: &Scene, decay: bool) -> PyResult<String> {
    let scene = &scene.scene;
    let mut plan = scene.plan();
    if !decay {
        plan.decay = 0;
    }
    let mut controller = BuiltIn::new(&plan.lock).map_err(invalid)?;
    experiment(py, scene, move |rig, scene| {
        let record = experiment::run(&mut Vec::new(), rig, &mut controller, &plan, |_, _| {})?;
        let found = identification::identify(&record, &plan)?;
        Ok(Comparison::of(&found, scene))
    })
}

#[pyfunction]
pub fn backbone(py: Python<'_>, scene: &Scene) -> PyResult<String> {
    let scene = &scene.scene;
    let plan = scene.plan();
    let mut controller = BuiltIn::new(&plan.tracking).map_err(invalid)?;
    experiment(py, scene, move |rig, scene| {
        let tracked = track(&mut Vec::new(), rig, &mut controller, &plan, |_| {})?;
        Ok(TrackedComparison::of(&tracked, scene))
    })
}

/// `points`: response (m), frequency (rad/s) and drive (m, or N of a force), each with its standard uncertainty, and the phase target (degrees; NaN: the scene's);
/// `linear`: linear responses as JSON; `calibration`: standard uncertainty of the gain of the reference, relative.
#[pyfunction]
pub fn fit(
    py: Python<'_>,
    scene: &Scene,
    points: Vec<[f64; 7]>,
    recordings: Vec<RecordingTuple>,
    known: Vec<String>,
    linear: Vec<String>,
    calibration: f64,
) -> PyResult<String> {
    if !(calibration > 0.0 && calibration.is_finite()) {
        return Err(invalid(format!(
            "calibration = {calibration} (relative): a number above 0 is allowed"
        )));
    }
    let structure = scene.scene.structure.as_ref();
    let modes = structure.map_or(1, |structure| structure.modes.len());
    if modes > 1 && !recordings.is_empty() {
        return Err(invalid(format!(
            "a recording is fitted for one oscillator, and the structure has {modes} modes: give the points of a backbone"
        )));
    }
    let units = scene.scene.units();
    let estimate = |value, uncertainty| Estimate { value, uncertainty };
    let point = |[response, u_response, omega, u_omega, drive, u_drive, phase]: [f64; 7]| {
        let phase = if phase.is_nan() {
            scene.scene.controller.phase_target
        } else {
            phase
        };
        phase_target("phase_target_deg", phase).map_err(invalid)?;
        let measured = MeasuredPoint {
            response: estimate(response, u_response),
            omega: estimate(omega, u_omega),
            drive: estimate(drive, u_drive),
            phase: phase.to_radians(),
        };
        Ok::<_, PyErr>(measured.in_metres(&units))
    };
    let known = known.iter().map(|one| one.parse::<Known>().map_err(invalid));
    let linear = linear
        .iter()
        .map(|one| serde_json::from_str::<MeasuredLinear>(one).map_err(invalid));
    let points = points.into_iter().map(point).collect::<PyResult<_>>()?;
    let mut measured = Measurements {
        points,
        recordings: recordings.into_iter().map(recording_of).collect::<PyResult<_>>()?,
        known: known.collect::<PyResult<_>>()?,
        linear: linear.collect::<PyResult<_>>()?,
        calibration,
    };
    let (checked, scene) = (scene.scene.clone(), &scene.scene);
    for foreign in measured.recordings.iter().filter(|one| !one.is_own) {
        requires_sensor(&foreign.origin, scene).map_err(invalid)?;
    }
    let found = calculate(py, move || {
        measured.points = vines_bench::survey::without_other_modes(&checked, measured.points);
        find(&measured, &checked, |_| {})
    })?;
    let found = found.map_err(invalid)?;
    let plant = found.plant(&scene.plant);
    json(&json!({
        "report": found.report(&scene.plant),
        "linear": found.linear,
        "stretches": found.stretches,
        "plant": {
            "M": plant.primary_mass, "k": plant.stiffness, "c": plant.damping,
            "m": plant.particle_mass, "b": plant.half_width, "r": plant.restitution,
        },
    }))
}

/// What a drive measures that is no motion.
const FORCE: &str = "force";

/// A recording: origin, names of the channels, start and step (s), what both measure, response, base, whether `vines` wrote it, and notes.
type RecordingTuple = (
    String,
    [String; 2],
    [f64; 2],
    [String; 2],
    Vec<f64>,
    Vec<f64>,
    bool,
    Vec<String>,
);

/// The recording of two channels of a file. `options`: response, drive and time.
#[pyfunction]
pub fn recording(
    py: Python<'_>,
    path: &str,
    contents: ContentsTuple<'_>,
    options: [Option<String>; 3],
    rate: Option<f64>,
    late: Option<f64>,
) -> PyResult<RecordingTuple> {
    let [response, drive, time] = options;
    let selection = Selection { response, drive, time, rate, late };
    let contents = contents_of(path, contents);
    let read = move || Recording::of(&contents, &selection);
    let Recording {
        origin,
        channels,
        start,
        sample_time,
        measurands,
        of_force,
        response,
        drive,
        is_own,
        notes,
    } = calculate(py, read)?.map_err(invalid)?;
    let [of_response, of_drive] = measurands.map(Measurand::name);
    let measured = [of_response, if of_force { FORCE } else { of_drive }];
    Ok((
        origin,
        channels,
        [start, sample_time],
        measured.map(Into::into),
        response,
        drive,
        is_own,
        notes,
    ))
}

fn recording_of(
    (origin, channels, [start, sample_time], measured, response, drive, is_own, notes): RecordingTuple,
) -> PyResult<Recording> {
    let of_force = measured[1] == FORCE;
    let measurand = |name: &str| {
        let mut every = Measurand::ALL.into_iter();
        every.find(|one| one.name() == name).ok_or_else(|| {
            PyValueError::new_err(format!(
                "{origin}: measured {name} is unknown; displacement, velocity and acceleration are known, and of the drive force"
            ))
        })
    };
    let of_drive = if of_force {
        Measurand::default()
    } else {
        measurand(&measured[1])?
    };
    let measurands = [measurand(&measured[0])?, of_drive];
    Ok(Recording {
        origin,
        channels,
        start,
        sample_time,
        measurands,
        of_force,
        response,
        drive,
        is_own,
        notes,
    })
}

/// f0 (Hz), zeta, their standard uncertainties, and a sentence; `None` if the recording is not a linear decay.
#[pyfunction]
pub fn linear_decay(py: Python<'_>, scene: &Scene, recording: RecordingTuple) -> PyResult<Option<([f64; 4], String)>> {
    let recording = recording_of(recording)?;
    let knowledge = scene.scene.knowledge();
    let decay = calculate(py, move || recording.linear_decay(&knowledge))?.map_err(invalid)?;
    Ok(decay.map(|decay| {
        let MeasuredLinear { f0, u_f0, zeta, u_zeta, .. } = decay;
        ([f0, u_f0, zeta, u_zeta], decay_in_words(&decay))
    }))
}

#[pyfunction]
pub fn orbits(py: Python<'_>, scene: &Scene, sigma: Option<Real>) -> PyResult<String> {
    let sigma = sigma.map(|one| one.0);
    let numbers = scene.scene.dimensionless();
    finite(sigma)?;
    if sigma.is_some() {
        scene.one_oscillator("orbits at a detuning are of")?;
    }
    let scene = scene.scene.clone();
    json(&calculate(py, move || match sigma {
        Some(sigma) => orbit::symmetric_orbits(&numbers, sigma),
        None => vines_bench::survey::phase_resonant(&scene, &numbers),
    })?)
}

#[pyfunction]
pub fn theory(py: Python<'_>, scene: &Scene, points: i64) -> PyResult<String> {
    if !(2..=10_000).contains(&points) {
        return Err(PyValueError::new_err(format!(
            "points = {points}: a number from 2 to 10000 is allowed"
        )));
    }
    let numbers = scene.scene.dimensionless();
    let flow = SlowFlow::new(numbers.lambda, numbers.r);
    let manifold = vines_model::theory::Manifold::new(numbers.r);
    let to = vines_model::theory::B_SYMMETRY_BREAKING;
    json(&calculate(py, move || {
        json!({
            "solutions": resonant(&numbers),
            "backbone": equally_spaced(manifold.b_min(), to, points as usize).map(|b| flow.backbone_at(b)).collect::<Vec<_>>(),
            "B_min": manifold.b_min(),
            "C_min": manifold.c_min(),
        })
    })?)
}

#[pyfunction]
pub fn regime(py: Python<'_>, scene: &Scene, sigma: Option<Real>, periods: i64) -> PyResult<String> {
    let sigma = sigma.map(|one| one.0);
    finite(sigma)?;
    scene.one_oscillator("a regime is of")?;
    if !(100..=100_000).contains(&periods) {
        return Err(PyValueError::new_err(format!(
            "periods = {periods}: a number from 100 to 100000 is allowed"
        )));
    }
    let (numbers, start) = (scene.scene.dimensionless(), scene.scene.dimensionless_start());
    if let Some(sigma) = sigma.filter(|sigma| 1.0 + numbers.epsilon * sigma <= 0.0) {
        return Err(invalid(format!(
            "sigma = {sigma} (dimensionless): a number above {} is allowed, so that the frequency is above 0",
            -1.0 / numbers.epsilon
        )));
    }
    let stop = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&stop);
    let point = wait_apart(py, &stop, move || {
        let sigma = sigma.unwrap_or_else(|| {
            let orbits = orbit::phase_resonant(&numbers);
            orbits
                .iter()
                .find(|orbit| orbit.stable)
                .map_or(0.0, |orbit| orbit.sigma)
        });
        let mut run = CellRun::new(&numbers, sigma, start)?.stopped_by(flag);
        run.decided(0, periods as usize).map(|point| (sigma, point))
    })?;
    let (sigma, point) = point.map_err(|error: lovines::InvalidValue| invalid(error))?;
    json(&json!({ "sigma": sigma, "point": point }))
}

fn finite(sigma: Option<f64>) -> PyResult<()> {
    match sigma.filter(|sigma| !sigma.is_finite()) {
        Some(sigma) => Err(invalid(format!(
            "sigma = {sigma} (dimensionless): a finite number is allowed"
        ))),
        None => Ok(()),
    }
}

/// The controller, sample by sample.
#[pyclass]
#[derive(Clone)]
pub struct PhaseLock {
    lock: phase_lock::PhaseLock,
    state: State,
}

#[pymethods]
impl PhaseLock {
    #[new]
    fn new(scene: &Scene) -> PyResult<Self> {
        let lock = scene.scene.plan().lock.build().map_err(invalid)?;
        Ok(Self { state: lock.start(), lock })
    }

    #[getter]
    fn sample_time(&self) -> f64 {
        self.lock.config().sample_time
    }

    fn copy(&self) -> Self {
        self.clone()
    }

    /// Configuration and state as bytes.
    fn save<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        saved::save(py, &(self.lock, &self.state))
    }

    #[staticmethod]
    fn restore(saved: &[u8]) -> PyResult<Self> {
        let (lock, state) = saved::restore(saved)?;
        Ok(Self { lock, state })
    }

    /// omega, amplitude, drive, phase error, response amplitude, coherence, locked, settled, state, fault.
    #[allow(clippy::type_complexity)]
    fn sample(
        &mut self,
        response: Real<Metre>,
        reference: Option<Real<Metre>>,
        active: bool,
    ) -> (f64, f64, f64, Option<f64>, f64, f64, bool, bool, u8, u8) {
        let (response, reference) = (response.0, reference.map(|one| one.0));
        let output = self
            .lock
            .process(&mut self.state, Input { response, reference, active });
        (
            output.omega,
            output.amplitude,
            output.drive,
            output.phase_error,
            output.response_amplitude,
            output.coherence,
            output.locked,
            output.settled,
            output.state as u8,
            output.fault.map_or(0, |fault| fault as u8),
        )
    }
}
