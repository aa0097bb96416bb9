//! The loop over events.

use super::{Event, MOST_IMPACTS, Outcome, Plant};
use crate::arithmetic::Sum;
use crate::base_motion::Drive;
use crate::contact::{Contact, Wall};
use crate::fast::Next;
use crate::flight::Flight;
use crate::parameters::InvalidValue;
use crate::segment::Segment;
use crate::sticking::until_released;

/// Largest number of releases per step: rounding can tear a particle off its wall again and again where values are extreme.
const MOST_RELEASES: u64 = 2_000_000;

/// A step under way.
pub(super) struct Step<F> {
    /// Its length, s.
    pub duration: f64,
    /// What is left of it, s.
    pub left: Sum,
    /// What has happened so far.
    pub outcome: Outcome,
    pub on_event: F,
}

impl<F: FnMut(Event)> Step<F> {
    /// Time since the step began, s.
    pub fn now(&self) -> f64 {
        Sum::from(self.duration).minus(self.left).value()
    }

    /// Whether time is left and the step is not to be cut short.
    fn goes_on(&self) -> bool {
        let done = &self.outcome;
        self.left.value() > 0.0 && done.impacts < MOST_IMPACTS && done.released < MOST_RELEASES
    }
}

impl Plant {
    /// Advances by `duration` seconds under `drive`.
    ///
    /// A jump of the base displacement against the end of the last step gives the primary mass the velocity jump
    /// `c Δe/M` that the equation of motion implies.
    ///
    /// # Errors
    /// An invalid drive or duration; the plant stays as it is.
    #[inline]
    pub fn advance(&mut self, drive: Drive, duration: f64) -> Result<Outcome, InvalidValue> {
        self.advance_with(drive, duration, |_| {})
    }

    /// As [`Self::advance`]; calls `on_event` at every event.
    ///
    /// # Errors
    /// As [`Self::advance`].
    #[inline]
    pub fn advance_with(
        &mut self,
        drive: Drive,
        duration: f64,
        on_event: impl FnMut(Event),
    ) -> Result<Outcome, InvalidValue> {
        if drive != self.moving.base.drive || !self.begun {
            drive.validate()?;
            self.check_duration(duration)?;
            self.set_drive(drive);
        }
        if self.contact == Contact::Free && self.fast.step(&mut self.moving, duration) {
            self.time += duration;
            self.fast.evaluations += 1;
            return Ok(Outcome { elapsed: duration, evaluations: 1, ..Outcome::default() });
        }
        self.check_duration(duration)?;
        let outcome = self.follow(duration, on_event);
        self.time += outcome.elapsed;
        Ok(outcome)
    }

    #[inline]
    fn check_duration(&self, duration: f64) -> Result<(), InvalidValue> {
        InvalidValue::unless(
            (0.0..=1e100).contains(&duration),
            "duration (length of the step)",
            duration,
            "s",
            "a number from 0 to 1e100",
        )
    }

    /// Makes `drive` the current one; the base may jump.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    fn set_drive(&mut self, drive: Drive) {
        let before = self.moving.base.drive;
        self.moving.base.drive = drive;
        if !self.begun {
            self.begun = true;
            self.fast.state_changed(&self.moving.base);
            return;
        }
        let sin = self.fast.phasor.1;
        let jump = (drive.signal[0] - before.signal[0]) + (drive.amplitude - before.amplitude) * sin;
        let kick = 2.0 * self.moving.rig.alone.delta * jump;
        if jump != 0.0 {
            self.moving.masses.v = self.moving.masses.v.plus(kick);
            self.moving.masses.dw += kick;
            // The impulse acts on the primary mass alone; contact is decided anew.
            self.contact = Contact::Free;
        }
        self.fast.drive_changed(&self.moving.rig.alone, &before, &drive, kick);
    }

    /// Follows the motion from event to event to the end of the step.
    fn follow(&mut self, duration: f64, on_event: impl FnMut(Event)) -> Outcome {
        let evaluations = self.fast.evaluations;
        let mut step = Step {
            duration,
            left: Sum::from(duration),
            outcome: Outcome::default(),
            on_event,
        };
        if self.contact == Contact::Free
            && let Some(wall) = self.wall_touched()
        {
            self.touch(wall, &mut step);
        }
        while step.goes_on() {
            let left = step.left.value();
            if let Contact::Stuck(wall) = self.contact {
                self.stay(wall, left, &mut step);
                continue;
            }
            let next = match self.contact {
                Contact::Free => self.fast.next(&mut self.moving, left, duration),
                _ => Next::Search(left),
            };
            match next {
                Next::ContactFree(t) if t == left => step.left = Sum::default(),
                Next::ContactFree(t) => step.left = step.left.plus(-t),
                Next::Contact(t, wall) => {
                    step.left = step.left.minus(t);
                    self.touch(wall, &mut step);
                }
                Next::Search(limit) => self.search(limit, &mut step),
            }
        }
        let left = step.left.value();
        step.outcome.cut_short = left > 0.0;
        step.outcome.elapsed = if left > 0.0 { step.now() } else { duration };
        step.outcome.evaluations = self.fast.evaluations - evaluations;
        step.outcome
    }

    /// Follows the flight to its first contact by certified search, or for `limit` seconds.
    #[inline(never)]
    fn search(&mut self, limit: f64, step: &mut Step<impl FnMut(Event)>) {
        let released = match self.contact {
            Contact::Released(wall) => Some(wall),
            _ => None,
        };
        let masses = self.moving.masses;
        let start = (masses.x.value(), masses.v.value());
        let motion = Segment::new(&self.moving.rig.alone, self.moving.base, start);
        let half_width = self.moving.rig.parameters.half_width;
        let flight = Flight::new(motion, (masses.w.value(), masses.dw), half_width);
        let landing = flight.first_contact(limit, released);
        self.fast.evaluations += landing.evaluations;
        self.moving.masses.x = masses.x.plus(landing.moved);
        self.moving.masses.v = masses.v.plus(landing.gained);
        self.moving.masses.dw += landing.gained;
        let w = masses.w.plus(landing.drifted);
        let outside = w.value().abs() > half_width;
        self.moving.masses.w = if outside {
            Sum::from(half_width.copysign(w.value()))
        } else {
            w
        };
        self.contact = Contact::Free;
        self.base_moves(landing.t);
        step.left = step.left.plus(-landing.t);
        if let Some(wall) = landing.wall {
            self.touch(wall, step);
        }
    }

    /// Both masses move as one for at most `left` seconds, until the wall ceases to push.
    fn stay(&mut self, wall: Wall, left: f64, step: &mut Step<impl FnMut(Event)>) {
        let noise = self.acceleration_error(self.moving.masses.v.value());
        let start = (self.moving.masses.x.value(), self.moving.masses.v.value());
        let motion = Segment::new(&self.moving.rig.joint, self.moving.base, start);
        let stay = until_released(&motion, wall, left, noise);
        self.fast.evaluations += stay.evaluations;
        self.moving.masses.x = Sum::from(stay.joint.0);
        self.moving.masses.v = Sum::from(stay.joint.1);
        self.moving.masses.particle = stay.joint.1;
        self.moving.masses.dw = 0.0;
        self.base_moves(stay.t);
        step.left = step.left.plus(-stay.t);
        if stay.released {
            self.contact = Contact::Released(wall);
            step.outcome.released += 1;
            let t = step.now();
            (step.on_event)(Event::Released { t, wall });
        }
    }

    /// The base has moved on by `t` seconds.
    fn base_moves(&mut self, t: f64) {
        self.moving.base = self.moving.base.after(t);
        self.fast.state_changed(&self.moving.base);
    }
}
