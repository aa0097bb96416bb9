//! One cell of a sweep: its result, and the variables that are stored of it.

use std::error::Error;

use vines_model::{
    ArgumentError,
    map::{Point, Response, Run},
    orbit::{Orbit, symmetric_orbits},
    regime::Regime,
};
use vines_testbench::{
    experiment,
    identification::{self, Lock},
    rig::{BuiltIn, Simulated},
    scene::{Dimensionless, Scene},
};

/// What is computed of every cell besides its regime.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Results {
    /// Amplitude, and the powers that impacts and damper dissipate. The motion is followed further for them.
    pub response: bool,
    /// The exact symmetric 1:1 orbits at the drive of the cell, and their stability.
    pub orbits: bool,
    /// The locked point: the experiment of `vines identify` without its decay.
    pub lock: bool,
}

impl Results {
    /// The names of the groups, in the order of the store.
    #[must_use]
    pub fn names(&self) -> Vec<&'static str> {
        let all = [
            (true, "regime"),
            (self.response, "response"),
            (self.orbits, "orbits"),
            (self.lock, "lock"),
        ];
        all.into_iter().filter_map(|(is, name)| is.then_some(name)).collect()
    }

    /// From the names of groups; `regime` is always there.
    ///
    /// # Errors
    /// An unknown name.
    pub fn parse<'a>(names: impl IntoIterator<Item = &'a str>) -> Result<Self, ArgumentError> {
        let mut results = Self::default();
        for name in names {
            match name.trim() {
                "regime" => {}
                "response" => results.response = true,
                "orbits" => results.orbits = true,
                "lock" => results.lock = true,
                other => {
                    return Err(
                        format!("unknown results `{other}`; known are regime, response, orbits and lock").into(),
                    );
                }
            }
        }
        Ok(results)
    }
}

/// Result of a cell; all is absent in a cell that failed. The default is a cell that is not computed.
#[derive(Debug, Clone, Default)]
pub struct Cell {
    /// The regime, unless the cell failed.
    pub regime: Option<Regime>,
    /// Whether the regime is that of the neighbours, not computed.
    pub inferred: bool,
    pub(crate) point: Option<Point>,
    pub(crate) response: Option<Response>,
    pub(crate) orbits: Option<Vec<Orbit>>,
    pub(crate) lock: Option<Lock>,
    /// `k b^2 omega0`, W.
    pub(crate) power: f64,
    /// Why the cell failed; empty if it did not.
    pub failure: String,
}

/// Computes a cell at the detuning `sigma`; `g` replaces the scene's G without rounding.
pub(crate) fn compute(scene: &Scene, sigma: f64, g: Option<f64>, periods: usize, results: Results) -> Cell {
    let mut numbers = scene.dimensionless();
    numbers.g = g.unwrap_or(numbers.g);
    let omega = 1.0 + numbers.epsilon * sigma;
    if omega <= 0.0 {
        return Cell::failed(format!(
            "sigma = {sigma} (dimensionless) gives the frequency {omega} omega0, which must be above 0"
        ));
    }
    match simulated(&numbers, sigma, scene.dimensionless_start(), periods, results.response) {
        Ok((point, response)) => {
            let (lock, failure) = match results.lock.then(|| locked(scene)).transpose() {
                Ok(lock) => (lock, String::new()),
                Err(error) => (None, format!("no locked point: {error}")),
            };
            Cell {
                regime: Some(point.regime),
                inferred: false,
                point: Some(point),
                response,
                orbits: results.orbits.then(|| symmetric_orbits(&numbers, sigma)),
                power: scene.plant.stiffness * numbers.b * numbers.b * numbers.omega0,
                failure,
                lock,
            }
        }
        Err(error) => Cell::failed(error.to_string()),
    }
}

/// The locked point of the scene.
fn locked(scene: &Scene) -> Result<Lock, Box<dyn Error>> {
    let plan = experiment::Plan { decay: 0, ..experiment::Plan::of(scene) };
    let mut rig = Simulated::of(scene)?;
    let mut controller = BuiltIn::new(&scene.controller_config())?;
    let record = experiment::run(rig.as_mut(), &mut controller, &plan, |_, _, _| {})?;
    Ok(identification::identify(&record, scene)?.lock)
}

fn simulated(
    numbers: &Dimensionless,
    sigma: f64,
    start: [f64; 4],
    periods: usize,
    response: bool,
) -> Result<(Point, Option<Response>), lovines::InvalidValue> {
    let mut run = Run::new(numbers, sigma, start)?;
    let point = run.decided(0, periods)?;
    let response = response.then(|| run.response(&point)).transpose()?;
    Ok((point, response))
}

impl Cell {
    pub(crate) fn failed(failure: String) -> Self {
        Self { failure, ..Self::default() }
    }

    /// Whether the cell was computed or inferred.
    pub(crate) fn is_known(&self) -> bool {
        self.regime.is_some() || !self.failure.is_empty()
    }

    pub(crate) fn number(&self, of: impl Fn(&Point) -> f64) -> f64 {
        self.point.as_ref().map_or(f64::NAN, of)
    }

    pub(crate) fn response(&self, of: impl Fn(&Response) -> f64) -> f64 {
        self.response.as_ref().map_or(f64::NAN, of)
    }

    pub(crate) fn lock(&self, of: impl Fn(&Lock) -> f64) -> f64 {
        self.lock.as_ref().map_or(f64::NAN, of)
    }

    /// The orbit with the larger B, which is the stable one where one is.
    pub(crate) fn orbit(&self, of: impl Fn(&Orbit) -> f64) -> f64 {
        let orbits = self.orbits.iter().flatten();
        orbits
            .max_by(|one, other| one.b.total_cmp(&other.b))
            .map_or(f64::NAN, of)
    }

    pub(crate) fn orbits(&self, counted: impl Fn(&&Orbit) -> bool) -> Option<u32> {
        let orbits = self.orbits.as_ref()?;
        Some(orbits.iter().filter(counted).count() as u32)
    }
}
