//! Events as lines for the master's log.

use super::category;
use fmi2_component::Log;
use lovines::{Event, Wall};

/// One line for one event, `time` being when its advance began.
pub(super) fn tell(log: &Log, time: f64, event: Event) {
    let side = |wall: Wall| match wall {
        Wall::Plus => "w = b",
        Wall::Minus => "w = -b",
    };
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
        Event::Released { t, wall } => log.tell(
            category::logEvents,
            format_args!("the wall {} released the particle at t = {} s", side(wall), time + t),
        ),
    }
}
