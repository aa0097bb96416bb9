//! From event to event.

use super::contact::Moment;
use super::{Contact, Event, MOST_IMPACTS, Outcome, Plant};
use crate::base_motion::Drive;
use crate::crossing::Origin;
use crate::flight::Flight;
use crate::span::Span;

/// An advance ends before its time when the particle has come to rest so often: values so absurd that rounding tears it
/// off its wall again and again are to end, too.
const MOST_PARTINGS: u64 = 2_000_000;

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
        let outcome =
            if drive == self.base.drive && self.under_way && self.course.strides.stride(duration) {
                Outcome::default()
            } else {
                self.adopt(drive);
                self.go(duration, tell)
            };
        self.time += duration;
        outcome
    }

    /// A step that is none of a run of strides, or the first of one.
    fn go(&mut self, duration: f64, tell: impl FnMut(Event)) -> Outcome {
        if self.course.strides.under_way() {
            self.catch_up();
        }
        if !self.course.lags() && self.strides(duration) {
            return Outcome::default();
        }
        self.meet(self.course.lag().plus(duration), duration, tell)
    }

    /// Begins a run of strides of this length with the first one, if they are ready and meet nothing.
    fn strides(&mut self, duration: f64) -> bool {
        let course = &mut self.course;
        let strides = &mut course.strides;
        strides.begin(&course.rig, &self.here, course.clear, duration) && strides.stride(duration)
    }

    /// Goes on to the end of an advance of which so much is left.
    #[cfg(feature = "batch")]
    pub(crate) fn finish(&mut self, left: Span, duration: f64) -> Outcome {
        let outcome = self.meet(left, duration, |_| {});
        self.time += duration;
        outcome
    }

    /// Makes `drive` the one in use.
    #[inline]
    pub(crate) fn adopt(&mut self, drive: Drive) {
        if drive != self.base.drive || !self.under_way {
            self.take(drive);
        } else {
            self.course.restless_drive = false;
        }
    }

    /// Takes over a new drive and the jump of the base that it brings.
    fn take(&mut self, drive: Drive) {
        self.catch_up();
        let jumps = drive.signal[0] != self.base.drive.signal[0]
            || drive.amplitude != self.base.drive.amplitude;
        if self.under_way && jumps {
            let jump = self.base.with(drive).displacement() - self.base.displacement();
            if jump != 0.0 {
                self.here.v += self.parameters.damping / self.parameters.primary_mass * jump;
                // The impulse acts on the primary mass alone; what that means for a particle at the wall is decided anew.
                self.contact = Contact::Free;
            }
        }
        self.base.drive = drive;
        self.under_way = true;
        self.renew_course();
    }

    pub(super) fn renew_course(&mut self) {
        let known = self.course.wave().is_some();
        self.course.renew(&self.base.drive);
        if !known {
            self.course.face(&mut self.here, self.base.phase);
        }
    }

    /// The state now: as held, or worked out from there.
    #[inline(always)]
    pub(super) fn now(&self) -> Origin<f64> {
        self.course.now(&self.alone.oscillator, &self.here)
    }

    /// Brings the state that the plant holds up to date.
    pub(super) fn catch_up(&mut self) {
        if self.course.lags() {
            let oscillator = &self.alone.oscillator;
            (self.course).catch_up(oscillator, &mut self.here, &mut self.base.phase);
        }
    }

    /// A step that an event may fall into; `until` is its end as seen from the origin.
    fn meet(&mut self, until: Span, duration: f64, mut tell: impl FnMut(Event)) -> Outcome {
        if until.seconds() < self.course.clear {
            self.wait(until, duration);
            return Outcome::default();
        }
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
        let mut dw = self.here.relative_velocity();
        if !self.course.lags()
            && self.contact == Contact::Free
            && let Some(wall) = self.wall_touched()
        {
            dw = self.touch(wall, dw, moment(left), &mut tell);
        }
        let last_impact = self.tally.impacts + MOST_IMPACTS;
        let mut partings = 0;
        while left.seconds() > 0.0 && self.tally.impacts < last_impact && partings < MOST_PARTINGS {
            if let Contact::Stuck(wall) = self.contact {
                partings += 1;
                let (t, released) = self.stay(wall, left.seconds());
                left = left.plus(-t);
                self.afresh();
                if released {
                    let t = moment(left).now;
                    tell(Event::Released { t, wall });
                }
                dw = 0.0;
                continue;
            }
            if self.course.landing.is_none() && self.course.lags() {
                left = left.less(self.course.lag());
                self.catch_up();
                // The time it was known to be clear for is over.
                self.course.clear = 0.0;
                dw = self.here.relative_velocity();
            }
            if self.contact == Contact::Free {
                let before = self.tally.impacts;
                let crossed = self.cross(duration, left, &mut tell);
                if let Some(wall) = crossed.resting {
                    dw = self.touch(
                        wall,
                        self.here.relative_velocity(),
                        moment(crossed.left),
                        &mut tell,
                    );
                    left = crossed.left;
                    continue;
                }
                if self.tally.impacts != before {
                    left = crossed.left;
                    dw = self.here.relative_velocity();
                }
                if self.course.clear == 0.0 {
                    self.course.look_out(&self.here, left.seconds());
                }
            }
            if left.seconds() < self.course.clear {
                self.wait(left, duration);
                left = Span::default();
                break;
            }
            if left.seconds() > 0.0 {
                (left, dw) = match self.hop(dw, left, moment, &mut tell) {
                    Some(landed) => landed,
                    None => self.search(dw, left, moment, &mut tell),
                };
            }
        }
        outcome.cut_short = left.seconds() > 0.0;
        outcome
    }

    /// The advance ends `until` after the origin, and meets nothing more.
    fn wait(&mut self, until: Span, duration: f64) {
        let whole = until == Span::of(duration);
        let repeats = (whole || self.course.lags())
            && (self.course).repeats(&self.alone.oscillator, duration);
        if repeats && whole && self.strides(duration) {
            return;
        }
        self.course.wait(&self.alone.oscillator, until);
        if repeats {
            self.catch_up();
        }
    }

    /// The state has been reached by the general way: nothing is known of what lies ahead.
    pub(super) fn afresh(&mut self) {
        self.course.leave();
        self.course.face(&mut self.here, self.base.phase);
    }

    /// Follows the flight to its first contact by the general search, for at most `left`; returns what is left after it,
    /// and the relative velocity then.
    fn search(
        &mut self,
        dw: f64,
        left: Span,
        moment: impl Fn(Span) -> Moment,
        tell: &mut impl FnMut(Event),
    ) -> (Span, f64) {
        let released = match self.contact {
            Contact::Released(wall) => Some(wall),
            _ => None,
        };
        let motion = self.alone.motion(&self.base, self.here.primary());
        let landing = Flight::new(motion, (self.here.w, dw), self.parameters.half_width)
            .first_contact(left.seconds(), released);
        let left = left.plus(-landing.t);
        self.base = self.base.after(landing.t);
        (self.here.x, self.here.v) = landing.primary;
        self.here.w = landing.relative.0;
        self.contact = Contact::Free;
        self.afresh();
        let dw = landing.relative.1;
        let dw = match landing.wall {
            Some(wall) => self.touch(wall, dw, moment(left), tell),
            None => dw,
        };
        (left, dw)
    }
}
