//! From wall to wall, again and again: the loop in which a steady motion spends its life.

use super::course::{Course, Landing, TURNS_KEPT};
use super::{Event, MOST_IMPACTS, Plant};
use crate::crossing::{Origin, Wave};
use crate::span::Span;
use crate::wall::Wall;

/// So many guesses at an arrival before the general search is asked.
pub(super) const MOST_GUESSES: usize = 8;

/// How a run of crossings ended.
pub(super) struct Crossed {
    /// What is left of the advance.
    pub left: Span,
    /// The wall at which the particle may be at rest.
    pub resting: Option<Wall>,
}

impl Plant {
    /// Crosses the cavity for as long as that is certain and time is left.
    ///
    /// Starts with no lag or a known landing. Ends with a landing or a clear time noted where it was time that ran out.
    pub(super) fn cross(
        &mut self,
        duration: f64,
        left: Span,
        tell: &mut impl FnMut(Event),
    ) -> Crossed {
        let mut start = self.here;
        let mut known = self.course.landing.take();
        if known.is_some() {
            self.course.leave();
        }
        let Course {
            rig: wave,
            quick: true,
            anchor,
            stale,
            landing: noted,
            clear,
            turns,
            ..
        } = &mut self.course
        else {
            return Crossed {
                left,
                resting: None,
            };
        };
        let (mut left, mut phase) = (left, self.base.phase);
        let (mut impacts, mut last, mut rest) = (0, None, None);
        let mut dissipated = self.tally.dissipated;
        let mut guesses = 0;
        while impacts < MOST_IMPACTS && left.seconds() > 0.0 {
            let landing = match known.take() {
                Some(landing) => landing,
                None => {
                    let free = wave.free_motion(&start);
                    if !wave.certainly_crosses(&start, &free) {
                        break;
                    }
                    let ahead = Wave::ahead(&start);
                    let distance = wave.half_width - ahead * start.w;
                    // The primary mass is slower than the particle: they close in at less than twice its speed.
                    if 2.0 * start.particle.abs() * left.seconds() < distance {
                        *clear = 0.5 * distance / start.particle.abs();
                        break;
                    }
                    if *stale {
                        *anchor = wave.turned(anchor);
                        *stale = false;
                    }
                    let (arrival, near) = wave.arrival(&start, &free, anchor);
                    if !near {
                        guesses += 1;
                        if guesses > MOST_GUESSES {
                            break;
                        }
                        *anchor = wave.next_anchor(
                            &self.alone.oscillator,
                            &start,
                            &free,
                            (anchor, arrival.beyond),
                        );
                        continue;
                    }
                    guesses = 0;
                    let landing = Landing {
                        at: Span::of_parts((anchor.t, arrival.beyond)),
                        fresh: true,
                        phase: phase.turned(anchor.angle, wave.omega * arrival.beyond),
                        arrival,
                        wall: if ahead > 0.0 { Wall::Plus } else { Wall::Minus },
                    };
                    if left.seconds() < landing.at.seconds() {
                        *clear = landing.at.seconds();
                        *noted = Some(landing);
                        break;
                    }
                    landing
                }
            };
            let Landing {
                at, arrival, wall, ..
            } = landing;
            left = left.less(at);
            phase = landing.phase;
            // What was known of the flight before holds no longer.
            *clear = 0.0;
            *turns += 1;
            let velocity = arrival.v - start.particle;
            let after = self.law.rebound(arrival.v, velocity);
            start = Origin {
                x: arrival.x,
                v: after.primary,
                w: wall.sign() * wave.half_width,
                particle: after.particle,
                turn: arrival.turn,
            };
            if *turns >= TURNS_KEPT {
                let (sin, cos) = libm::sincos(phase.radians());
                start.turn = (cos, sin);
                *turns = 0;
            }
            impacts += 1;
            dissipated += after.dissipated;
            last = Some((left, velocity));
            tell(Event::Impact {
                t: Span::of(duration).less(left).seconds(),
                wall,
                velocity,
            });
            if after.relative * after.relative <= wave.restless {
                rest = Some(wall);
                break;
            }
        }
        if let Some((left, velocity)) = last {
            self.here = start;
            self.base.phase = phase;
            self.tally.impacts += impacts;
            self.tally.impact_time = self.time + Span::of(duration).less(left).seconds();
            self.tally.impact_velocity = velocity;
            self.tally.dissipated = dissipated;
        }
        Crossed {
            left,
            resting: rest,
        }
    }
}
