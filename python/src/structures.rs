//! A structure with its particle and its shaker.

use std::sync::{
    Arc,
    atomic::{AtomicBool, Ordering::Relaxed},
};

use lovines::Drive;
use numpy::{IntoPyArray, PyArray2, ndarray::Array2};
use pyo3::{
    exceptions::{PyKeyboardInterrupt, PyRuntimeError},
    prelude::*,
};
use vines_bench::{
    rig::{RigError, SimulatedStructure},
    scene::Structure,
};

use crate::{
    number::{RadPerSecond, Real, Second},
    plants::SHORT_ADVANCE,
    scene::{Scene, invalid},
    wait::wait_apart,
};

/// The plant, and what is measured on it.
#[pyclass(subclass)]
pub struct StructurePlant {
    structure: Structure,
    plant: SimulatedStructure,
    /// Longest time between two checks of the shaker's limits, s; infinite without limits.
    check_interval: f64,
}

/// Columns before those of the channels: time, drive, q2, impacts.
const COLUMNS_BEFORE_CHANNELS: usize = 4;

/// A row; the channels are those of the present structure, whose stinger may have been cut.
fn row(rig: &SimulatedStructure) -> Vec<f64> {
    let plant = rig.plant();
    let first = [
        plant.time(),
        plant.base_displacement(),
        plant.state().q2,
        plant.totals().impacts as f64,
    ];
    let channels = rig.structure().channels();
    first
        .into_iter()
        .chain(channels.iter().map(|channel| channel.read(plant)))
        .collect()
}

#[pymethods]
impl StructurePlant {
    #[new]
    fn new(scene: &Scene) -> PyResult<Self> {
        let Scene { scene, .. } = scene;
        let structure = scene.structure.clone().ok_or_else(|| {
            invalid("the scene has no [structure] and no [shaker]: its oscillator is vines.Plant(scene)")
        })?;
        let plant = SimulatedStructure::new(&structure, scene.plant, scene.start).map_err(invalid)?;
        let is_limited = structure.channels().iter().any(|channel| channel.limit.is_some());
        let check_interval = if is_limited { scene.sample_time() } else { f64::INFINITY };
        Ok(Self { structure, plant, check_interval })
    }

    /// Names and units of the channels; the first is the drive.
    fn _channels(&self) -> Vec<(String, &'static str)> {
        let drive = match &self.structure.shaker {
            Some(_) => "V",
            None => self.structure.excitation.unit(),
        };
        let channels = self.structure.channels();
        let channels = channels.iter().map(|channel| (channel.name.to_owned(), channel.unit));
        [("drive".to_owned(), drive)].into_iter().chain(channels).collect()
    }

    /// Advances it in equal steps. Returns rows of time, drive, q2, impacts and channels; after a failure it is as before.
    fn _trajectory<'py>(
        &mut self,
        py: Python<'py>,
        duration: Real<Second>,
        steps: usize,
        drive: (Real, Real, Real<RadPerSecond>),
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (held, amplitude, omega) = drive;
        let drive = Drive {
            signal: [held.0, 0.0, 0.0, 0.0],
            ..Drive::harmonic(amplitude.0, omega.0)
        };
        let (step, interval) = (duration.0 / steps as f64, self.check_interval);
        let channels = self.structure.channels().len();
        let stop = Arc::new(AtomicBool::new(false));
        let (mut plant, flag) = (self.plant.clone(), Arc::clone(&stop));
        let run = move || -> Result<_, Option<RigError>> {
            let mut rows = row(&plant);
            for _ in 0..steps {
                for (drive, part) in drive.parts(step, interval) {
                    plant.step(drive, part).map_err(Some)?;
                    if flag.load(Relaxed) {
                        return Err(None);
                    }
                }
                rows.extend(row(&plant));
            }
            Ok((plant, rows))
        };
        let omegas = self.structure.modes.iter().map(|mode| mode.omega);
        let fastest = omegas.fold(omega.0.abs(), f64::max);
        // A thread costs more than a short motion.
        let result = if duration.0 * fastest < SHORT_ADVANCE {
            run()
        } else {
            wait_apart(py, &stop, run)?
        };
        let (plant, rows) = result.map_err(|failure| match failure {
            None => PyKeyboardInterrupt::new_err(()),
            Some(error @ RigError::ShakerLimit { .. }) => PyRuntimeError::new_err(error.to_string()),
            Some(error) => invalid(error),
        })?;
        self.plant = plant;
        let shape = (steps + 1, COLUMNS_BEFORE_CHANNELS + channels);
        Ok(Array2::from_shape_vec(shape, rows).map_err(invalid)?.into_pyarray(py))
    }
}
