//! The variables that are stored of a cell.

use vines_model::regime::Regime;

use crate::{cell::Cell, settings::Settings};

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

use Read::{Count, Failure, Number, Regime as Code};

/// All variables, in the order in which their files are written.
#[rustfmt::skip]
const VARIABLES: [Variable; 25] = [
    variable("", "regime", "1", "regime of the response", Code),
    variable("adaptive", "inferred", "1", "1 if the regime is that of the neighbours, 0 if it was computed", Count(|c| c.is_known().then_some(u32::from(c.inferred)))),
    variable("regime", "followed", "1", "periods of the base that were simulated", Count(|c| c.point.map(|p| p.followed as u32))),
    variable("regime", "settling", "1", "periods of the base before the regime began", Number(|c| c.number(|p| p.transient))),
    variable("regime", "impacts_per_period", "1", "impacts per period of the base", Number(|c| c.number(|p| p.impacts_per_period))),
    variable("regime", "sticks_per_period", "1", "how often the particle comes to rest on a wall, per period of the base", Number(|c| c.number(|p| p.sticks_per_period))),
    variable("regime", "impacts", "1", "impacts of one repetition; 0 if nothing repeats", Count(|c| c.point.map(|p| p.impacts as u32))),
    variable("regime", "periods", "1", "periods of the base that a repetition takes; 0 if nothing repeats", Count(|c| c.point.map(|p| p.periods))),
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
