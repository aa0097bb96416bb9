//! One cell of a sweep: its results, and the variables that a store has of them.

use std::error::Error;

use Read::{Count, Failure, Number, Regime};
use vines_model::{
    ArgumentError, Dimensionless,
    map::{CellRun, RegimeResult, SteadyResponse},
    orbit::{Orbit, symmetric_orbits},
    regime,
};
use vines_testbench::{
    experiment,
    identification::{self, Lock},
    rig::{BuiltIn, Simulated},
    scene::Scene,
};

/// Groups of results, in the order of the store. `regime` is always there; the motion is followed further for `response`, the amplitude and
/// the powers that impacts and damper dissipate; `orbits` are the exact symmetric 1:1 orbits at the drive of the cell, and their stability;
/// `lock` is the locked point, from the experiment of `vines identify` without its decay.
const GROUPS: [&str; 4] = ["regime", "response", "orbits", "lock"];

/// What is computed of every cell: the names of groups of results. Default: `regime`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Results(Vec<&'static str>);

impl Default for Results {
    fn default() -> Self {
        Self(vec!["regime"])
    }
}

impl Results {
    /// From the names of groups; `regime` is always there.
    ///
    /// # Errors
    /// An unknown name.
    pub fn parse<'a>(names: impl IntoIterator<Item = &'a str>) -> Result<Self, ArgumentError> {
        let names: Vec<&str> = names.into_iter().map(str::trim).collect();
        if let Some(name) = names.iter().find(|name| !GROUPS.contains(name)) {
            return Err(format!("unknown results `{name}`; known are regime, response, orbits and lock").into());
        }
        let asked = |group: &&str| *group == "regime" || names.contains(group);
        Ok(Self(GROUPS.into_iter().filter(asked).collect()))
    }

    /// The names of the groups, in the order of the store.
    #[must_use]
    pub fn names(&self) -> &[&'static str] {
        &self.0
    }

    fn has(&self, group: &str) -> bool {
        self.0.contains(&group)
    }
}

/// Result of a cell; all is absent in a cell that failed. The default is a cell that is not computed.
#[derive(Debug, Clone, Default)]
pub(crate) struct Cell {
    /// The regime, unless the cell failed.
    pub regime: Option<regime::Regime>,
    /// Whether the regime was inferred from the neighbours, not computed.
    pub inferred: bool,
    pub result: Option<RegimeResult>,
    pub response: Option<SteadyResponse>,
    pub orbits: Option<Vec<Orbit>>,
    pub lock: Option<Lock>,
    /// `k b^2 omega0`, W.
    pub power: f64,
    /// Why the cell failed; empty if it did not.
    pub failure: String,
}

impl Cell {
    /// Computes a cell, followed for at most `periods`; `numbers` are the scene's dimensionless numbers, with a G that is not rounded.
    pub(crate) fn compute(
        scene: &Scene,
        sigma: f64,
        numbers: &Dimensionless,
        results: &Results,
        periods: usize,
    ) -> Result<Self, lovines::InvalidValue> {
        let mut run = CellRun::new(numbers, sigma, scene.dimensionless_start())?;
        let result = run.decided(0, periods)?;
        let response = results.has("response").then(|| run.response(&result)).transpose()?;
        let (lock, failure) = match results.has("lock").then(|| locked(scene)).transpose() {
            Ok(lock) => (lock, String::new()),
            Err(error) => (None, format!("no locked point: {error}")),
        };
        Ok(Self {
            regime: Some(result.regime),
            inferred: false,
            result: Some(result),
            response,
            orbits: results.has("orbits").then(|| symmetric_orbits(numbers, sigma)),
            power: scene.plant.stiffness * numbers.b * numbers.b * numbers.omega0,
            failure,
            lock,
        })
    }

    /// Whether the cell was computed or inferred.
    pub(crate) fn is_known(&self) -> bool {
        self.regime.is_some() || !self.failure.is_empty()
    }

    /// The orbit with the larger B, which is the stable one where one is.
    fn orbit(&self) -> Option<&Orbit> {
        self.orbits
            .iter()
            .flatten()
            .max_by(|first, second| first.b.total_cmp(&second.b))
    }

    /// The regime as it is stored.
    pub(crate) fn code(&self) -> u8 {
        match self.regime {
            Some(regime) => regime as u8,
            None if self.is_known() => FAILED,
            None => ABSENT,
        }
    }
}

/// The locked point of the scene.
fn locked(scene: &Scene) -> Result<Lock, Box<dyn Error>> {
    // Without a decay.
    let mut scene = scene.clone();
    scene.record.decay_periods = Some(0.0);
    let mut rig = Simulated::of(&scene)?;
    let mut controller = BuiltIn::new(&scene.controller_config())?;
    let record = experiment::run(rig.as_mut(), &mut controller, &scene, |_, _, _| {})?;
    Ok(identification::identify(&record, &scene)?.lock)
}

/// Code of a cell that is not computed.
pub const ABSENT: u8 = 255;
/// Code of a cell that failed.
pub const FAILED: u8 = 254;
/// Count in a cell that is not computed or failed. (No sweep counts as far.)
pub const UNCOUNTED: u32 = u32::MAX;
/// Reason in a cell that is not computed.
pub(crate) const NOT_COMPUTED: &str = "not computed";

/// How a variable is read from a cell, and its type: a 64-bit float, a 32-bit count, a code of 8 bits, or text.
#[derive(Clone, Copy)]
pub(crate) enum Read {
    /// Absent numbers are NaN.
    Number(fn(&Cell) -> Option<f64>),
    /// Absent counts are [`UNCOUNTED`].
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
    variable("", "regime", "1", "regime of the response", Regime),
    variable("adaptive", "inferred", "1", "1 if the regime is that of the neighbours, 0 if it was computed", Count(|c| c.is_known().then_some(c.inferred.into()))),
    variable("regime", "followed", "1", "periods of the base that were simulated", Count(|c| Some(c.result?.followed as u32))),
    variable("regime", "settling", "1", "periods of the base before the regime began", Number(|c| Some(c.result?.transient))),
    variable("regime", "impacts_per_period", "1", "impacts per period of the base", Number(|c| Some(c.result?.impacts_per_period))),
    variable("regime", "sticks_per_period", "1", "how often the particle comes to rest on a wall, per period of the base", Number(|c| Some(c.result?.sticks_per_period))),
    variable("regime", "impacts", "1", "impacts of one repetition; 0 if nothing repeats", Count(|c| Some(c.result?.impacts as u32))),
    variable("regime", "periods", "1", "periods of the base that a repetition takes; 0 if nothing repeats", Count(|c| Some(c.result?.periods))),
    variable("regime", "recurrence", "1", "largest difference between the state and that one repetition before", Number(|c| c.result?.recurrence)),
    variable("regime", "exponent", "1", "largest Lyapunov exponent per period of the base", Number(|c| c.result?.exponent)),
    variable("regime", "exponent_error", "1", "standard error of the exponent", Number(|c| c.result?.exponent_error)),
    variable("regime", "synchrony", "1", "share of the impacts that belong to captures into 1:1 resonance", Number(|c| Some(c.result?.synchrony))),
    variable("response", "C", "1", "amplitude of the first harmonic of v over b", Number(|c| Some(c.response?.c))),
    variable("response", "impact_power", "W", "mean power that the impacts dissipate", Number(|c| Some(c.power * c.response?.impact_power))),
    variable("response", "damper_power", "W", "mean power that the damper dissipates", Number(|c| Some(c.power * c.response?.damper_power))),
    variable("orbits", "orbits", "1", "number of exact symmetric 1:1 orbits at this drive", Count(|c| Some(c.orbits.as_ref()?.len() as u32))),
    variable("orbits", "stable_orbits", "1", "number of those that are stable", Count(|c| Some(c.orbits.as_ref()?.iter().filter(|orbit| orbit.stable).count() as u32))),
    variable("orbits", "orbit_C", "1", "amplitude of the first harmonic of v over b, on the orbit with the larger B", Number(|c| Some(c.orbit()?.c))),
    variable("orbits", "orbit_B", "1", "speed of the particle over b omega0, on the orbit with the larger B", Number(|c| Some(c.orbit()?.b))),
    variable("orbits", "orbit_multiplier", "1", "largest modulus of the multipliers of that orbit over half a period", Number(|c| Some(c.orbit()?.multipliers[3]))),
    variable("lock", "lock_sigma", "1", "detuning of the locked point", Number(|c| Some(c.lock?.at.sigma))),
    variable("lock", "lock_C", "1", "amplitude of the first harmonic of v over b at the lock", Number(|c| Some(c.lock?.at.c))),
    variable("lock", "lock_B", "1", "mean speed of the particle over b omega0 at the lock", Number(|c| c.lock?.b)),
    variable("lock", "periods_to_lock", "1", "periods from the start to the settled lock", Number(|c| Some(c.lock?.periods_to_lock))),
    variable("", "failure", "", "why the cell failed; empty if it did not; `not computed` if there is no result yet", Failure),
];

/// The variables of a sweep.
pub(crate) fn variables(results: &Results, is_adaptive: bool) -> impl Iterator<Item = Variable> {
    let is_asked = move |group: &str| {
        if is_adaptive {
            group == "adaptive"
        } else {
            results.has(group)
        }
    };
    let variables = VARIABLES.into_iter();
    variables.filter(move |variable| variable.group.is_empty() || is_asked(variable.group))
}
