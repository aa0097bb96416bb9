//! One cell of a sweep: its results, and the variables that a store has of them.

use std::error::Error;

use Read::{Count, Failure, Number, Regime as Code};
use vines_model::{
    ArgumentError, Dimensionless,
    map::{CellRun, RegimeResult, SteadyResponse},
    orbit::{Orbit, symmetric_orbits},
    regime::Regime,
};
use vines_testbench::{
    experiment,
    identification::{self, Lock},
    rig::{BuiltIn, Simulated},
    scene::Scene,
};

use crate::sweep::Settings;

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
    /// Whether the regime was inferred from the neighbours, not computed.
    pub inferred: bool,
    pub(crate) result: Option<RegimeResult>,
    pub(crate) response: Option<SteadyResponse>,
    pub(crate) orbits: Option<Vec<Orbit>>,
    pub(crate) lock: Option<Lock>,
    /// `k b^2 omega0`, W.
    pub(crate) power: f64,
    /// Why the cell failed; empty if it did not.
    pub failure: String,
}

/// Computes a cell; `numbers` are the scene's dimensionless numbers, with a G that is not rounded.
pub(crate) fn compute(scene: &Scene, sigma: f64, numbers: &Dimensionless, settings: &Settings) -> Cell {
    let results = settings.results;
    let simulated = || {
        let mut run = CellRun::new(numbers, sigma, scene.dimensionless_start())?;
        let result = run.decided(0, settings.periods)?;
        let response = results.response.then(|| run.response(&result)).transpose()?;
        Ok((result, response))
    };
    match simulated() {
        Ok((result, response)) => {
            let (lock, failure) = match results.lock.then(|| locked(scene)).transpose() {
                Ok(lock) => (lock, String::new()),
                Err(error) => (None, format!("no locked point: {error}")),
            };
            Cell {
                regime: Some(result.regime),
                inferred: false,
                result: Some(result),
                response,
                orbits: results.orbits.then(|| symmetric_orbits(numbers, sigma)),
                power: scene.plant.stiffness * numbers.b * numbers.b * numbers.omega0,
                failure,
                lock,
            }
        }
        Err(error) => Cell::failed(lovines::InvalidValue::to_string(&error)),
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

impl Cell {
    pub(crate) fn failed(failure: String) -> Self {
        Self { failure, ..Self::default() }
    }

    /// Whether the cell was computed or inferred.
    pub(crate) fn is_known(&self) -> bool {
        self.regime.is_some() || !self.failure.is_empty()
    }

    pub(crate) fn number(&self, of: impl Fn(&RegimeResult) -> f64) -> f64 {
        self.result.as_ref().map_or(f64::NAN, of)
    }

    pub(crate) fn response(&self, of: impl Fn(&SteadyResponse) -> f64) -> f64 {
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

/// Code of a cell that is not computed.
pub const ABSENT: u8 = 255;
/// Code of a cell that failed.
pub const FAILED: u8 = 254;
/// Count in a cell that is not computed or failed. (No sweep counts as far.)
pub const UNCOUNTED: u32 = u32::MAX;
/// Reason in a cell that is not computed.
const NOT_COMPUTED: &str = "not computed";

/// How a variable is read from a cell.
#[derive(Clone, Copy)]
pub(crate) enum Read {
    Number(fn(&Cell) -> f64),
    Count(fn(&Cell) -> Option<u32>),
    Regime,
    Failure,
}

/// A variable of the store.
#[derive(Clone, Copy)]
pub(crate) struct Variable {
    pub name: &'static str,
    pub unit: &'static str,
    pub meaning: &'static str,
    pub read: Read,
    group: &'static str,
}

const fn variable(
    group: &'static str,
    name: &'static str,
    unit: &'static str,
    meaning: &'static str,
    read: Read,
) -> Variable {
    Variable { name, unit, meaning, read, group }
}

/// All variables, in the order in which their files are written.
#[rustfmt::skip]
const VARIABLES: [Variable; 25] = [
    variable("", "regime", "1", "regime of the response", Code),
    variable("adaptive", "inferred", "1", "1 if the regime is that of the neighbours, 0 if it was computed", Count(|c| c.is_known().then_some(u32::from(c.inferred)))),
    variable("regime", "followed", "1", "periods of the base that were simulated", Count(|c| c.result.map(|p| p.followed as u32))),
    variable("regime", "settling", "1", "periods of the base before the regime began", Number(|c| c.number(|p| p.transient))),
    variable("regime", "impacts_per_period", "1", "impacts per period of the base", Number(|c| c.number(|p| p.impacts_per_period))),
    variable("regime", "sticks_per_period", "1", "how often the particle comes to rest on a wall, per period of the base", Number(|c| c.number(|p| p.sticks_per_period))),
    variable("regime", "impacts", "1", "impacts of one repetition; 0 if nothing repeats", Count(|c| c.result.map(|p| p.impacts as u32))),
    variable("regime", "periods", "1", "periods of the base that a repetition takes; 0 if nothing repeats", Count(|c| c.result.map(|p| p.periods))),
    variable("regime", "recurrence", "1", "largest difference between the state and that one repetition before", Number(|c| c.number(|p| p.recurrence.unwrap_or(f64::NAN)))),
    variable("regime", "exponent", "1", "largest Lyapunov exponent per period of the base", Number(|c| c.number(|p| p.exponent.unwrap_or(f64::NAN)))),
    variable("regime", "exponent_error", "1", "standard error of the exponent", Number(|c| c.number(|p| p.exponent_error.unwrap_or(f64::NAN)))),
    variable("regime", "synchrony", "1", "share of the impacts that belong to captures into 1:1 resonance", Number(|c| c.number(|p| p.synchrony))),
    variable("response", "C", "1", "amplitude of the first harmonic of v over b", Number(|c| c.response(|r| r.c))),
    variable("response", "impact_power", "W", "mean power that the impacts dissipate", Number(|c| c.power * c.response(|r| r.impact_power))),
    variable("response", "damper_power", "W", "mean power that the damper dissipates", Number(|c| c.power * c.response(|r| r.damper_power))),
    variable("orbits", "orbits", "1", "number of exact symmetric 1:1 orbits at this drive", Count(|c| c.orbits(|_| true))),
    variable("orbits", "stable_orbits", "1", "number of those that are stable", Count(|c| c.orbits(|one| one.stable))),
    variable("orbits", "orbit_C", "1", "amplitude of the first harmonic of v over b, on the orbit with the larger B", Number(|c| c.orbit(|one| one.c))),
    variable("orbits", "orbit_B", "1", "speed of the particle over b omega0, on the orbit with the larger B", Number(|c| c.orbit(|one| one.b))),
    variable("orbits", "orbit_multiplier", "1", "largest modulus of the multipliers of that orbit over half a period", Number(|c| c.orbit(|one| one.multipliers[3]))),
    variable("lock", "lock_sigma", "1", "detuning of the locked point", Number(|c| c.lock(|l| l.at.sigma))),
    variable("lock", "lock_C", "1", "amplitude of the first harmonic of v over b at the lock", Number(|c| c.lock(|l| l.at.c))),
    variable("lock", "lock_B", "1", "mean speed of the particle over b omega0 at the lock", Number(|c| c.lock(|l| l.b.unwrap_or(f64::NAN)))),
    variable("lock", "periods_to_lock", "1", "periods from the start to the settled lock", Number(|c| c.lock(|l| l.periods_to_lock))),
    variable("", "failure", "", "why the cell failed; empty if it did not; `not computed` if there is no result yet", Failure),
];

/// The variables of a sweep.
pub(crate) fn variables(settings: &Settings) -> impl Iterator<Item = Variable> {
    let groups = if settings.adaptive.is_some() {
        vec!["adaptive"]
    } else {
        settings.results.names()
    };
    let stored = move |one: &Variable| one.group.is_empty() || groups.contains(&one.group);
    VARIABLES.into_iter().filter(stored)
}

/// A count as it is stored.
pub(crate) fn count(of: fn(&Cell) -> Option<u32>, cell: &Cell) -> u32 {
    of(cell).unwrap_or(UNCOUNTED)
}

/// Code of the regime of a cell.
pub(crate) fn code(cell: &Cell) -> u8 {
    let position = |regime| Regime::SIMULATED.iter().position(|one| *one == regime);
    match cell.regime.and_then(position) {
        Some(code) => code as u8,
        None if cell.is_known() => FAILED,
        None => ABSENT,
    }
}

/// Why a cell has no results, as it is stored.
pub(crate) fn reason(cell: &Cell) -> &str {
    if cell.is_known() { &cell.failure } else { NOT_COMPUTED }
}
