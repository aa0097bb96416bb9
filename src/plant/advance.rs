//! From event to event.

use super::contact::Moment;
use super::{Contact, Event, MOST_IMPACTS, Outcome, Plant};
use crate::base_motion::{BaseMotion, Drive};
use crate::crossing::Origin;
use crate::flight::Flight;
use crate::span::Span;

impl Plant {
    /// Advances by `duration` seconds (0 or above) under `drive`, whose values are finite.
    ///
    /// A jump of the base displacement against the end of the last advance gives the primary mass the velocity jump
    /// `c Δe/M` that the equation of motion implies.
    pub fn advance(&mut self, drive: Drive, duration: f64) -> Outcome {
        self.advance_with(drive, duration, |_| {})
    }

    /// As [`Self::advance`], and tells every event as it happens.
    #[inline]
    pub fn advance_with(
        &mut self,
        drive: Drive,
        duration: f64,
        tell: impl FnMut(Event),
    ) -> Outcome {
        if drive != self.base.drive || !self.under_way {
            self.take(drive);
        }
        let until = self.course.lag.plus(duration);
        let outcome = if until.seconds() < self.course.clear {
            self.idle(duration, until);
            Outcome::default()
        } else {
            self.meet(until, duration, tell)
        };
        self.time += duration;
        outcome
    }

    /// Takes over a new drive and the jump of the base that it brings.
    fn take(&mut self, drive: Drive) {
        self.settle();
        let jumps = drive.signal[0] != self.base.drive.signal[0]
            || drive.amplitude != self.base.drive.amplitude;
        if self.under_way && jumps {
            let jump = self.base.with(drive).displacement() - self.base.displacement();
            if jump != 0.0 {
                self.primary.1 += self.parameters.damping / self.parameters.primary_mass * jump;
                // The impulse acts on the primary mass alone; what that means for a particle at the wall is decided anew.
                self.contact = Contact::Free;
            }
        }
        self.base.drive = drive;
        self.under_way = true;
        self.renew_course();
    }

    pub(super) fn renew_course(&mut self) {
        let half_width = self.parameters.half_width;
        self.course
            .renew(&self.alone.oscillator, half_width, &self.base);
    }

    pub(super) fn origin(&self) -> Origin<f64> {
        Origin {
            x: self.primary.0,
            v: self.primary.1,
            w: self.w,
            particle: self.particle_velocity,
            turn: self.course.turn,
        }
    }

    /// The state `t` seconds after the origin, with no regard to walls, and the base then.
    pub(super) fn flown(&self, t: f64) -> (Origin<f64>, BaseMotion) {
        if t == 0.0 {
            return (self.origin(), self.base);
        }
        let mut alone = self.alone;
        let (x, v) = alone
            .motion(&self.base, self.primary)
            .position_and_velocity(t);
        let b = self.parameters.half_width;
        let w = self.w + ((x - self.primary.0) - self.particle_velocity * t);
        let end = Origin {
            x,
            v,
            w: w.clamp(-b, b),
            ..self.origin()
        };
        (end, self.base.after(t))
    }

    /// Brings the state that the plant holds up to date. Nothing that can be asked for changes; asking costs less
    /// afterwards.
    #[inline]
    pub fn settle(&mut self) {
        if self.course.lag != Span::default() {
            self.catch_up();
        }
    }

    fn catch_up(&mut self) {
        let lag = self.course.lag;
        let (end, base) = self.flown(lag.seconds());
        self.base = base;
        self.hold(&end);
        self.course.face(base.phase);
        self.course.lag = Span::default();
        self.course.clear -= lag.seconds();
        if let Some(landing) = &mut self.course.landing {
            landing.at = landing.at.less(lag);
        }
    }

    pub(super) fn hold(&mut self, state: &Origin<f64>) {
        self.primary = (state.x, state.v);
        self.w = state.w;
        self.particle_velocity = state.particle;
    }

    /// A step that no event falls into.
    fn idle(&mut self, duration: f64, until: Span) {
        if self.course.repeats(duration) {
            self.settle();
            let start = self.origin();
            let end = self.course.stride(&start, &mut self.base, duration);
            self.hold(&end);
        } else {
            self.course.lag = until;
        }
    }

    /// A step that an event may fall into; `until` is its end as seen from the origin.
    fn meet(&mut self, until: Span, duration: f64, mut tell: impl FnMut(Event)) -> Outcome {
        let mut outcome = Outcome::default();
        let mut tell = |event: Event| {
            match event {
                Event::Impact { .. } => outcome.impacts += 1,
                Event::Stuck { .. } => outcome.stuck += 1,
                Event::Released { .. } => outcome.released += 1,
            }
            tell(event);
        };
        let mut left = until;
        let moment = |left: Span| Moment {
            now: Span::of(duration).less(left).seconds(),
            left: left.seconds(),
        };
        if self.course.lag == Span::default()
            && self.contact == Contact::Free
            && let Some(wall) = self.wall_touched()
        {
            let dw = self.primary.1 - self.particle_velocity;
            self.touch(wall, dw, moment(left), &mut tell);
        }
        let last_impact = self.tally.impacts + MOST_IMPACTS;
        while left.seconds() > 0.0 && self.tally.impacts < last_impact {
            if let Contact::Stuck(wall) = self.contact {
                let (t, released) = self.stay(wall, left.seconds());
                left = left.plus(-t);
                self.afresh();
                if released {
                    let t = moment(left).now;
                    tell(Event::Released { t, wall });
                }
                continue;
            }
            if self.course.landing.is_none() {
                left = left.less(self.course.lag);
                self.settle();
            }
            if self.contact == Contact::Free {
                let (still_left, resting) = self.cross(duration, left, &mut tell);
                left = still_left;
                if let Some(wall) = resting {
                    let dw = self.primary.1 - self.particle_velocity;
                    self.touch(wall, dw, moment(left), &mut tell);
                    continue;
                }
                if self.course.clear == 0.0 {
                    let start = self.origin();
                    self.course.look_out(&start);
                }
            }
            if left.seconds() < self.course.clear {
                if self.course.lag == Span::default() && left == Span::of(duration) {
                    self.idle(duration, left);
                } else {
                    self.course.lag = left;
                }
                left = Span::default();
                break;
            }
            if left.seconds() > 0.0 {
                left = self.search(left, moment, &mut tell);
            }
        }
        outcome.cut_short = left.seconds() > 0.0;
        outcome
    }

    /// The state has been reached by the general way: nothing is known of what lies ahead.
    fn afresh(&mut self) {
        self.course.leave();
        if self.course.wave.is_some() {
            self.course.face(self.base.phase);
        }
    }

    /// Follows the flight to its first contact by the general search, for at most `left`; returns what is left after it.
    fn search(
        &mut self,
        left: Span,
        moment: impl Fn(Span) -> Moment,
        tell: &mut impl FnMut(Event),
    ) -> Span {
        let released = match self.contact {
            Contact::Released(wall) => Some(wall),
            _ => None,
        };
        let dw = self.primary.1 - self.particle_velocity;
        let motion = self.alone.motion(&self.base, self.primary);
        let landing = Flight::new(motion, (self.w, dw), self.parameters.half_width)
            .first_contact(left.seconds(), released);
        let left = left.plus(-landing.t);
        self.base = self.base.after(landing.t);
        self.primary = landing.primary;
        self.w = landing.relative.0;
        self.contact = Contact::Free;
        self.afresh();
        if let Some(wall) = landing.wall {
            self.touch(wall, landing.relative.1, moment(left), tell);
        }
        left
    }
}
