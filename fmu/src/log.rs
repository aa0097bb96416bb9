//! Events as lines for the master's log.

use super::variables::category;
use crate::model_exchange::hybrid::Rest;
use fmi2_component::Log;
use lovines::{Event, Wall};

fn side(wall: Wall) -> &'static str {
    match wall {
        Wall::Plus => "w = b",
        Wall::Minus => "w = -b",
    }
}

fn sign(direction: f64) -> &'static str {
    if direction > 0.0 { "> 0" } else { "< 0" }
}

/// One line for one event of model exchange at `time`.
pub(super) fn tell_exchange(log: &Log, time: f64, event: Event, rest: Option<Rest>) {
    match (event, rest) {
        (Event::Stuck { wall, .. }, Some(Rest { hop, energy })) => log.tell(
            category::logEvents,
            format_args!(
                "the particle came to rest on the wall {} at t = {time} s; left out are hops of at most {hop:e} m, which the \
                 integrator does not resolve, and their {energy:e} J, which count as dissipated",
                side(wall),
            ),
        ),
        _ => tell(log, time, event),
    }
}

/// One line for one event, `time` being when its advance began.
pub(super) fn tell(log: &Log, time: f64, event: Event) {
    match event {
        Event::Impact { t, wall, velocity } => log.tell(
            category::logImpacts,
            format_args!(
                "impact on the wall {} at t = {} s, der(w) = {velocity} m/s",
                side(wall),
                time + t
            ),
        ),
        Event::Stuck { t, wall } => log.tell(
            category::logEvents,
            format_args!(
                "the particle came to rest on the wall {} at t = {} s",
                side(wall),
                time + t
            ),
        ),
        Event::Sticking { t } => log.tell(
            category::logEvents,
            format_args!("the particle stuck to the floor at t = {} s", time + t),
        ),
        Event::Slip { t, direction } => log.tell(
            category::logEvents,
            format_args!("the particle slipped at t = {} s; der(w) {}", time + t, sign(direction)),
        ),
        Event::Reversal { t, direction } => log.tell(
            category::logEvents,
            format_args!(
                "friction changed its direction at t = {} s; der(w) {}",
                time + t,
                sign(direction)
            ),
        ),
        Event::Released { t, wall } => log.tell(
            category::logEvents,
            format_args!("the wall {} released the particle at t = {} s", side(wall), time + t),
        ),
    }
}
