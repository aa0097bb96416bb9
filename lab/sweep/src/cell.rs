//! One cell of a sweep: its result, and the variables that are stored of it.

use vines_model::{
    map::{Point, Response, observe, observe_response},
    orbit::{Orbit, symmetric_orbits},
    regime::Regime,
};
use vines_testbench::scene::{Dimensionless, Scene};

/// What is computed of every cell besides its regime.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Results {
    /// Amplitude, and the powers that impacts and damper dissipate. The motion is followed further for them.
    pub response: bool,
    /// The exact symmetric 1:1 orbits at the drive of the cell, and their stability.
    pub orbits: bool,
}

impl Results {
    /// The names of the groups, in the order of the store.
    #[must_use]
    pub fn names(&self) -> Vec<&'static str> {
        let all = [(true, "regime"), (self.response, "response"), (self.orbits, "orbits")];
        all.into_iter().filter_map(|(is, name)| is.then_some(name)).collect()
    }

    /// From the names of groups; `regime` is always there.
    ///
    /// # Errors
    /// An unknown name.
    pub fn parse<'a>(names: impl IntoIterator<Item = &'a str>) -> Result<Self, String> {
        let mut results = Self::default();
        for name in names {
            match name.trim() {
                "regime" => {}
                "response" => results.response = true,
                "orbits" => results.orbits = true,
                other => {
                    return Err(format!(
                        "unknown results `{other}`; known are regime, response and orbits"
                    ));
                }
            }
        }
        Ok(results)
    }
}

/// Result of a cell; all is absent in a cell that failed.
#[derive(Debug, Clone, Default)]
pub struct Cell {
    point: Option<Point>,
    response: Option<Response>,
    orbits: Option<Vec<Orbit>>,
    /// `k b^2 omega0`, W.
    power: f64,
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
        Ok((point, response)) => Cell {
            point: Some(point),
            response,
            orbits: results.orbits.then(|| symmetric_orbits(&numbers, sigma)),
            power: scene.plant.stiffness * numbers.b * numbers.b * numbers.omega0,
            failure: String::new(),
        },
        Err(error) => Cell::failed(error.to_string()),
    }
}

fn simulated(
    numbers: &Dimensionless,
    sigma: f64,
    start: [f64; 4],
    periods: usize,
    response: bool,
) -> Result<(Point, Option<Response>), lovines::InvalidValue> {
    if response {
        observe_response(numbers, sigma, start, periods).map(|(point, response)| (point, Some(response)))
    } else {
        observe(numbers, sigma, start, periods).map(|point| (point, None))
    }
}

impl Cell {
    pub(crate) fn failed(failure: String) -> Self {
        Self { failure, ..Self::default() }
    }

    /// The regime, unless the cell failed.
    #[must_use]
    pub fn regime(&self) -> Option<Regime> {
        self.point.map(|point| point.regime)
    }

    fn number(&self, of: impl Fn(&Point) -> f64) -> f64 {
        self.point.as_ref().map_or(f64::NAN, of)
    }

    fn response(&self, of: impl Fn(&Response) -> f64) -> f64 {
        self.response.as_ref().map_or(f64::NAN, of)
    }

    /// The orbit with the larger B, which is the stable one where one is.
    fn orbit(&self, of: impl Fn(&Orbit) -> f64) -> f64 {
        let orbits = self.orbits.iter().flatten();
        orbits
            .max_by(|one, other| one.b.total_cmp(&other.b))
            .map_or(f64::NAN, of)
    }

    fn orbits(&self, counted: impl Fn(&&Orbit) -> bool) -> u32 {
        self.orbits.iter().flatten().filter(counted).count() as u32
    }
}

/// Code of a cell without a regime: not computed yet, or failed.
pub const ABSENT: u8 = 255;

/// How a variable is read from a cell.
#[derive(Clone, Copy)]
pub(crate) enum Read {
    Number(fn(&Cell) -> f64),
    Count(fn(&Cell) -> u32),
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

use Read::{Count, Failure, Number, Regime as Code};

/// All variables. The last one is written last: where its chunk is, all others are.
const VARIABLES: [Variable; 20] = [
    variable("regime", "regime", "1", "regime of the response", Code),
    variable(
        "regime",
        "followed",
        "1",
        "periods of the base that were simulated",
        Count(|c| c.point.map_or(0, |p| p.followed as u32)),
    ),
    variable(
        "regime",
        "settling",
        "1",
        "periods of the base before the regime began",
        Number(|c| c.number(|p| p.transient)),
    ),
    variable(
        "regime",
        "impacts_per_period",
        "1",
        "impacts per period of the base",
        Number(|c| c.number(|p| p.impacts_per_period)),
    ),
    variable(
        "regime",
        "sticks_per_period",
        "1",
        "how often the particle comes to rest on a wall, per period of the base",
        Number(|c| c.number(|p| p.sticks_per_period)),
    ),
    variable(
        "regime",
        "impacts",
        "1",
        "impacts of one repetition; 0 if nothing repeats",
        Count(|c| c.point.map_or(0, |p| p.impacts as u32)),
    ),
    variable(
        "regime",
        "periods",
        "1",
        "periods of the base that a repetition takes; 0 if nothing repeats",
        Count(|c| c.point.map_or(0, |p| p.periods)),
    ),
    variable(
        "regime",
        "recurrence",
        "1",
        "largest difference between the state and that one repetition before",
        Number(|c| c.number(|p| p.recurrence.unwrap_or(f64::NAN))),
    ),
    variable(
        "regime",
        "exponent",
        "1",
        "largest Lyapunov exponent per period of the base",
        Number(|c| c.number(|p| p.exponent.unwrap_or(f64::NAN))),
    ),
    variable(
        "regime",
        "exponent_error",
        "1",
        "standard error of the exponent",
        Number(|c| c.number(|p| p.exponent_error.unwrap_or(f64::NAN))),
    ),
    variable(
        "regime",
        "synchrony",
        "1",
        "share of the impacts that belong to captures into 1:1 resonance",
        Number(|c| c.number(|p| p.synchrony)),
    ),
    variable(
        "response",
        "C",
        "1",
        "amplitude of the first harmonic of v over b",
        Number(|c| c.response(|r| r.c)),
    ),
    variable(
        "response",
        "impact_power",
        "W",
        "mean power that the impacts dissipate",
        Number(|c| c.power * c.response(|r| r.impact_power)),
    ),
    variable(
        "response",
        "damper_power",
        "W",
        "mean power that the damper dissipates",
        Number(|c| c.power * c.response(|r| r.damper_power)),
    ),
    variable(
        "orbits",
        "orbits",
        "1",
        "number of exact symmetric 1:1 orbits at this drive",
        Count(|c| c.orbits(|_| true)),
    ),
    variable(
        "orbits",
        "stable_orbits",
        "1",
        "number of those that are stable",
        Count(|c| c.orbits(|one| one.stable)),
    ),
    variable(
        "orbits",
        "orbit_C",
        "1",
        "amplitude of the first harmonic of v over b, on the orbit with the larger B",
        Number(|c| c.orbit(|one| one.c)),
    ),
    variable(
        "orbits",
        "orbit_B",
        "1",
        "speed of the particle over b omega0, on the orbit with the larger B",
        Number(|c| c.orbit(|one| one.b)),
    ),
    variable(
        "orbits",
        "orbit_multiplier",
        "1",
        "largest modulus of the multipliers of that orbit over half a period",
        Number(|c| c.orbit(|one| one.multipliers[3])),
    ),
    variable(
        "regime",
        "failure",
        "",
        "why the cell failed; empty if it did not",
        Failure,
    ),
];

/// The variables of these results.
pub(crate) fn variables(results: Results) -> impl Iterator<Item = Variable> {
    let groups = results.names();
    VARIABLES.into_iter().filter(move |one| groups.contains(&one.group))
}
