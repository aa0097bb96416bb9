//! The loop over events.

use core::ops::ControlFlow;

use crate::arithmetic::Sum;
use crate::base_motion::Drive;
use crate::contact::{Resolution, Touch, Wall};
use crate::fast::Next;
use crate::flight::{Flight, FlightEnd, Grip, until_released};
use crate::parameters::InvalidValue;
use crate::plant::{Event, MOST_EVALUATIONS, MOST_IMPACTS, MOST_RELEASES, Outcome, Plant};
use crate::primary::Primary;
use crate::system::{Contact, Masses};

/// A step under way.
pub(crate) struct Step<F> {
    /// Its length, s.
    pub duration: f64,
    /// What is left of it, s.
    pub left: Sum,
    /// What has happened so far.
    pub outcome: Outcome,
    pub on_event: F,
}

impl<F: FnMut(Event) -> ControlFlow<()>> Step<F> {
    /// Time since the step began, s.
    pub fn now(&self) -> f64 {
        Sum::from(self.duration).minus(self.left).value()
    }

    /// Reports an event, which may end the step.
    fn tell(&mut self, event: Event) {
        if (self.on_event)(event).is_break() {
            self.outcome.cut_short = true;
        }
    }

    /// Whether time is left and the step is not to be cut short.
    fn goes_on(&self) -> bool {
        self.left.value() > 0.0 && self.outcome.impacts < MOST_IMPACTS && !self.outcome.cut_short
    }
}

impl<P: Primary> Plant<P> {
    /// Advances by `duration` seconds under `drive`.
    ///
    /// A jump of the base displacement against the end of the last step gives the primary mass the velocity jump
    /// `c Δe/M` that the equation of motion implies.
    ///
    /// # Errors
    /// An invalid drive or duration; the plant stays as it is.
    #[inline]
    pub fn advance(&mut self, drive: Drive, duration: f64) -> Result<Outcome, InvalidValue> {
        self.advance_until(drive, duration, |_| ControlFlow::Continue(()))
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
        mut on_event: impl FnMut(Event),
    ) -> Result<Outcome, InvalidValue> {
        self.advance_until(drive, duration, |event| {
            on_event(event);
            ControlFlow::Continue(())
        })
    }

    /// As [`Self::advance`]; calls `on_event` at every event, which may cut the step short there.
    ///
    /// # Errors
    /// As [`Self::advance`].
    #[inline]
    pub fn advance_until(
        &mut self,
        drive: Drive,
        duration: f64,
        on_event: impl FnMut(Event) -> ControlFlow<()>,
    ) -> Result<Outcome, InvalidValue> {
        if !self.status.begun {
            check_duration(duration)?;
            self.begin(drive)?;
        }
        let before = &self.moving.base.drive;
        // Number by number: code for size would compare arrays in a loop.
        let ([a0, a1, a2, a3], [b0, b1, b2, b3]) = (drive.signal, before.signal);
        if (a0 != b0) | (a1 != b1) | (a2 != b2) | (a3 != b3) | (drive.amplitude != before.amplitude) {
            drive.validate()?;
            check_duration(duration)?;
            self.jump(&drive);
            self.fast
                .drive_changed(&self.moving.system.free, &self.moving.base.drive);
        } else if drive.omega != before.omega {
            drive.validate_frequency()?;
            check_duration(duration)?;
            self.moving.base.drive.omega = drive.omega;
            self.fast
                .drive_changed(&self.moving.system.free, &self.moving.base.drive);
        }
        if P::HAS_FAST_PATH && self.status.contact.is_none() && self.fast.step(&mut self.moving, duration) {
            self.status.time += duration;
            return Ok(Outcome { elapsed: duration, evaluations: 1, ..Outcome::default() });
        }
        check_duration(duration)?;
        let outcome = self.follow(duration, on_event);
        self.status.time += outcome.elapsed;
        Ok(outcome)
    }

    /// Makes signal and amplitude those of `drive`: the base may jump.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    fn jump(&mut self, drive: &Drive) {
        let before = core::mem::replace(&mut self.moving.base.drive, *drive);
        let jump =
            (drive.signal[0] - before.signal[0]) + (drive.amplitude - before.amplitude) * self.fast.state.phasor.1;
        let kick = self.primary.velocity_per_jump(&self.moving) * jump;
        let earlier = (before.amplitude, before.signal[1]);
        if jump != 0.0 && !(self.status.contact).is_some_and(|contact| self.carries(contact, (jump, kick), earlier)) {
            self.moving.masses.primary = self.moving.masses.primary.plus([0.0, kick]);
            self.moving.masses.dw += kick;
            // The impulse acts on the primary mass alone; contact is decided anew.
            self.status.contact = None;
        }
        let oscillator = &self.moving.system.free;
        self.fast.state.contact_free.jump(oscillator, &before, drive, kick);
    }

    /// Whether a jump of the base moves a particle that is at rest on a wall or on the floor together with the primary mass, as one; they are
    /// moved then. `amplitude` and `slope` are those of the drive before.
    ///
    /// A jump within the rounding of the base displacement is none. The sum of a polynomial has this error, and so has what a master
    /// computes at a time that is itself rounded.
    #[inline(never)]
    fn carries(&mut self, contact: Contact, (jump, kick): (f64, f64), (amplitude, slope): (f64, f64)) -> bool {
        let (system, drive) = (&self.moving.system, &self.moving.base.drive);
        let [offset, slope_now, ..] = drive.signal.map(f64::abs);
        let moved = (slope.abs() + slope_now) * self.status.time.abs();
        let size = 2.0 * offset + drive.amplitude.abs() + amplitude.abs() + moved;
        let is_rounding = jump.abs() <= ACCELERATION_ROUNDING * size;
        let acceleration = self.acceleration(self.moving.masses.primary.values[1] + kick);
        let lowest = LOWEST_HOP * system.half_width;
        if !is_rounding && !system.forces.carry(contact.wall(), kick, acceleration, lowest) {
            return false;
        }
        self.primary.carry(&mut self.moving, jump, kick);
        let masses = &mut self.moving.masses;
        masses.particle = masses.primary.values[1];
        true
    }

    /// Follows the motion from event to event to the end of the step. (A call: most steps do not need it, and its code is long.)
    #[inline(never)]
    fn follow(&mut self, duration: f64, on_event: impl FnMut(Event) -> ControlFlow<()>) -> Outcome {
        self.fast.evaluations = 0;
        let mut step = Step {
            duration,
            left: Sum::from(duration),
            outcome: Outcome::default(),
            on_event,
        };
        if self.status.contact.is_none()
            && let Some(wall) = self.wall_touched()
        {
            self.touch(wall, &mut step);
        }
        while step.goes_on() {
            let left = step.left.value();
            if let Some(contact) = self.status.contact {
                self.stay(contact, left, &mut step);
            } else {
                let next = if P::HAS_FAST_PATH {
                    self.fast.next(&mut self.moving, left, duration)
                } else {
                    Next::Search(left)
                };
                match next {
                    Next::ContactFree(t) if t == left => step.left = Sum::default(),
                    Next::ContactFree(t) => step.left = step.left.plus(-t),
                    Next::Contact(t, wall) => {
                        step.left = step.left.minus(t);
                        self.touch(wall, &mut step);
                        continue;
                    }
                    Next::Search(_) if self.moving.system.forces.holding > 0.0 => self.slide(left, None, &mut step),
                    Next::Search(limit) => self.search(limit, None, &mut step),
                }
            }
            step.outcome.cut_short |=
                self.fast.evaluations >= MOST_EVALUATIONS || step.outcome.released >= MOST_RELEASES;
        }
        let left = step.left.value();
        step.outcome.cut_short = left > 0.0;
        step.outcome.elapsed = if left > 0.0 { step.now() } else { duration };
        step.outcome.evaluations = self.fast.evaluations;
        step.outcome
    }

    /// Follows the flight to its first contact by certified search, or for `limit` seconds; `released` names the wall that has
    /// just ceased to push.
    #[inline(never)]
    fn search(&mut self, limit: f64, released: Option<Wall>, step: &mut Step<impl FnMut(Event) -> ControlFlow<()>>) {
        if released.is_none() && self.arrives(limit, 0.0, step) {
            return;
        }
        let (system, masses) = (&self.moving.system, self.moving.masses);
        let motion = self.primary.alone(&self.moving, 0.0);
        let pull = system.forces.gravity;
        let flight = Flight::new(motion, (masses.w.value(), masses.dw), system.half_width, pull);
        let end = flight.first_contact(limit, released);
        self.fly(&flight.motion, &end, pull, step);
    }

    /// Slides to a wall or a reversal, or for `limit` seconds; `slips` is the sign of `w'` where the particle has just been released. A
    /// particle without relative velocity sticks if friction can hold it.
    #[inline(never)]
    fn slide(&mut self, limit: f64, slips: Option<f64>, step: &mut Step<impl FnMut(Event) -> ControlFlow<()>>) {
        let masses = self.moving.masses;
        let direction = match slips {
            Some(direction) => direction,
            None => self.direction(),
        };
        if direction == 0.0 {
            return self.stick(step);
        }
        if slips.is_none() && masses.dw != 0.0 && self.arrives(limit, direction, step) {
            return;
        }
        let system = &self.moving.system;
        let friction = system.friction(direction);
        let motion = self.primary.alone(&self.moving, -friction);
        let pull = system.forces.gravity + friction;
        let flight = Flight::new(motion, (masses.w.value(), masses.dw), system.half_width, pull);
        let flight = flight.with_error(masses.w.error());
        let end = flight.first_wall_or_reversal(limit, direction, slips.is_some() || masses.dw == 0.0);
        let moved = match end.wall {
            Some(wall) => (wall.sign() * system.half_width - masses.w.value()) - masses.w.error(),
            None => end.drifted,
        };
        self.status.totals.friction += system.parameters.particle_mass * system.forces.kinetic * moved.abs();
        self.fly(&flight.motion, &end, pull, step);
        if end.reversed {
            let masses = &mut self.moving.masses;
            (masses.dw, masses.particle) = (0.0, masses.primary.values[1]);
            step.outcome.released += 1;
            let direction = self.direction();
            if direction != 0.0 {
                let t = step.now();
                step.tell(Event::Reversal { t, direction });
            }
        }
    }

    /// The particle sticks to the floor.
    fn stick(&mut self, step: &mut Step<impl FnMut(Event) -> ControlFlow<()>>) {
        self.status.contact = Some(Contact::Floor);
        self.status.totals.sticks += 1;
        let t = step.now();
        step.tell(Event::Sticking { t });
    }

    /// Moves on to the wall ahead, if constant forces act and the fast path finds the contact within `limit` seconds.
    fn arrives(&mut self, limit: f64, direction: f64, step: &mut Step<impl FnMut(Event) -> ControlFlow<()>>) -> bool {
        if !P::HAS_FAST_PATH || !self.moving.system.forces.act() {
            return false;
        }
        let w = self.moving.masses.w;
        let Some((t, wall)) = self.fast.next_with_forces(&mut self.moving, limit, direction) else {
            return false;
        };
        let system = &self.moving.system;
        let moved = (wall.sign() * system.half_width - w.value()) - w.error();
        self.status.totals.friction += system.parameters.particle_mass * system.forces.kinetic * moved.abs();
        step.left = step.left.minus(t);
        self.touch(wall, step);
        true
    }

    /// Moves on to the end of a flight or of a stretch of sliding, in which the particle has the constant acceleration `pull`, m/s².
    fn fly(
        &mut self,
        motion: &P::Motion,
        end: &FlightEnd,
        pull: f64,
        step: &mut Step<impl FnMut(Event) -> ControlFlow<()>>,
    ) {
        let half_width = self.moving.system.half_width;
        self.fast.evaluations += end.evaluations;
        self.primary.fly(&mut self.moving, motion, end);
        let masses = &mut self.moving.masses;
        masses.dw += end.gained - pull * end.t;
        masses.particle += pull * end.t;
        masses.drift(end.drifted, half_width);
        self.base_moves(end.t);
        step.left = step.left.plus(-end.t);
        if let Some(wall) = end.wall {
            self.touch(wall, step);
        }
    }

    /// Sign of the relative velocity `w'` from now on while the particle slides; 0 where static friction holds it, and where there is no
    /// friction.
    pub(crate) fn direction(&self) -> f64 {
        let forces = &self.moving.system.forces;
        let masses = &self.moving.masses;
        if forces.holding == 0.0 {
            return 0.0;
        }
        if masses.dw != 0.0 {
            return 1f64.copysign(masses.dw);
        }
        let velocity = masses.primary.values[1];
        forces.slips((self.acceleration(velocity), self.acceleration_error(velocity)))
    }

    /// Both masses move as one for at most `left` seconds, until the particle is released; then it goes on. The release is not
    /// remembered beyond this call: another drive or other parameters may hold the particle again.
    #[inline(never)]
    fn stay(&mut self, contact: Contact, left: f64, step: &mut Step<impl FnMut(Event) -> ControlFlow<()>>) {
        let system = &self.moving.system;
        let velocity = self.moving.masses.primary.values[1];
        let wall = contact.wall();
        let forces = &system.forces;
        let noise = self.acceleration_error(velocity);
        let motion = self.primary.with_particle(&self.moving);
        let grip = Grip {
            wall,
            gravity: forces.gravity,
            holding: forces.holding,
            noise,
        };
        let stay = until_released(&motion, &grip, left);
        self.fast.evaluations += stay.evaluations;
        self.primary.stay(&mut self.moving, &motion, &stay);
        self.moving.masses.particle = stay.state[1];
        self.moving.masses.dw = 0.0;
        self.base_moves(stay.t);
        step.left = step.left.plus(-stay.t);
        if wall.is_none() {
            self.status.totals.stuck_time += stay.t;
        }
        if let Some(direction) = stay.released {
            self.status.contact = None;
            step.outcome.released += 1;
            let (t, left) = (step.now(), step.left.value());
            step.tell(match wall {
                Some(wall) => Event::Released { t, wall },
                None => Event::Slip { t, direction },
            });
            if self.moving.system.forces.holding > 0.0 {
                self.slide(left, Some(direction), step);
            } else {
                self.search(left, wall, step);
            }
        }
    }

    /// The base has moved on by `t` seconds.
    fn base_moves(&mut self, t: f64) {
        self.moving.base = self.moving.base.after(t);
        self.fast.state_changed(&self.moving.base);
    }
}

#[cfg_attr(not(target_arch = "wasm32"), inline(always))]
fn check_duration(duration: f64) -> Result<(), InvalidValue> {
    match duration {
        0.0..=1e100 => Ok(()),
        _ => refuse_duration(duration),
    }
}

#[cold]
fn refuse_duration(duration: f64) -> Result<(), InvalidValue> {
    let name = "duration (length of the step)";
    InvalidValue::unless(false, name, duration, "s", "a number from 0 to 1e100")
}

// At a wall: impact, then rest if the particle cannot leave.

/// A hop lower than this fraction of the half-width cannot be told from contact in double precision.
const LOWEST_HOP: f64 = 1.0 / (1u64 << 56) as f64;
/// Relative rounding error of an acceleration that is the sum of a few terms.
const ACCELERATION_ROUNDING: f64 = 8.0 * f64::EPSILON;
/// Accelerations this small against `omega0² b` are zero: subnormal values carry no significant digits.
const SMALLEST_ACCELERATION: f64 = 1e-200;

impl<P: Primary> Plant<P> {
    /// The wall that the particle touches.
    #[inline]
    pub(crate) fn wall_touched(&self) -> Option<Wall> {
        let (w, b) = (self.moving.masses.w.value(), self.moving.system.half_width);
        (w.abs() >= b).then(|| Wall::ahead(w))
    }

    /// The particle is at `wall`: impact if it approaches, then rest if it cannot leave.
    #[inline]
    fn touch(&mut self, wall: Wall, step: &mut Step<impl FnMut(Event) -> ControlFlow<()>>) {
        let system = &self.moving.system;
        self.moving.masses.w = Sum::from(wall.sign() * system.half_width);
        let left = step.left.value();
        let touch = if system.is_real {
            self.real_touch(wall, left)
        } else {
            system.law.touch(wall, self.velocities(), |primary, speed| {
                let (largest, resolution) = (self.acceleration_bound(primary), self.resolution(left));
                !system.law.certainly_leaves(speed, largest, &resolution)
                    && system.law.rests(speed, self.pressing(wall, primary), &resolution)
            })
        };
        let hopped = self.moving.masses.dw != 0.0;
        self.primary.kick(&mut self.moving.masses, touch.kick);
        self.moving.masses.particle = touch.particle;
        self.moving.masses.dw = touch.relative;
        let t = step.now();
        self.status.totals.add(&touch, self.status.time + t);
        if let Some(velocity) = touch.impact {
            step.outcome.impacts += 1;
            step.tell(Event::Impact { t, wall, velocity });
        }
        if touch.stuck {
            self.rest(wall, hopped, step);
        }
    }

    /// The particle is at rest at `wall`. If its last hop is ended by friction and not by the wall, it sticks to the floor.
    #[inline(never)]
    fn rest(&mut self, wall: Wall, hopped: bool, step: &mut Step<impl FnMut(Event) -> ControlFlow<()>>) {
        let (forces, velocity) = (&self.moving.system.forces, self.moving.masses.particle);
        if hopped && forces.holding > 0.0 && forces.stop_a_hop(wall, self.pressing(wall, velocity).0) {
            return self.stick(step);
        }
        let t = step.now();
        self.status.contact = Some(Contact::Wall(wall));
        step.outcome.stuck += 1;
        step.tell(Event::Stuck { t, wall });
    }

    /// The same in a cavity with constant forces or a restitution that varies.
    #[inline(never)]
    fn real_touch(&self, wall: Wall, left: f64) -> Touch {
        let (system, velocities) = (&self.moving.system, self.velocities());
        let mut law = system.law;
        if system.varies {
            law =
                law.with_restitution((system.rebound).of_impact(wall, velocities.2.abs(), self.status.totals.impacts));
        }
        let resolution = Resolution { elastic: !system.varies, ..self.resolution(left) };
        law.touch(wall, velocities, |primary, speed| {
            let largest = self.acceleration_bound(primary) + system.forces.joint * system.forces.size();
            !law.resting_with(1.0).certainly_leaves(speed, largest, &resolution)
                && (system.rebound).rests(
                    &law,
                    &system.forces,
                    (wall, speed),
                    self.pressing(wall, primary),
                    &resolution,
                )
        })
    }

    /// Velocities of primary mass and particle, and the relative velocity.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    fn velocities(&self) -> (f64, f64, f64) {
        let Masses { primary, particle, dw, .. } = &self.moving.masses;
        (primary.values[1], *particle, *dw)
    }

    /// What hops can be told from rest, with `left` seconds of the step to come.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    fn resolution(&self, left: f64) -> Resolution {
        Resolution {
            lowest_hop: LOWEST_HOP * self.moving.system.half_width,
            longest_chatter: left,
            fastest: self.moving.system.free.fastest,
            elastic: true,
        }
    }

    /// Acceleration of `wall` towards a particle without acceleration while the primary mass moves alone, and its rounding error, m/s².
    fn pressing(&self, wall: Wall, velocity: f64) -> (f64, f64) {
        (
            wall.sign() * self.acceleration(velocity),
            self.acceleration_error(velocity),
        )
    }

    /// Acceleration of the primary mass at a velocity, while it moves alone and without friction, m/s².
    fn acceleration(&self, velocity: f64) -> f64 {
        self.primary.acceleration(&self.moving, velocity)
    }

    /// An upper bound of the acceleration's magnitude, m/s².
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    fn acceleration_bound(&self, velocity: f64) -> f64 {
        self.primary.acceleration_bound(&self.moving, velocity)
    }

    /// Rounding error of the acceleration, m/s².
    pub(crate) fn acceleration_error(&self, velocity: f64) -> f64 {
        let smallest = SMALLEST_ACCELERATION * self.moving.system.half_width * self.moving.system.free.omega0_squared;
        ACCELERATION_ROUNDING * (self.acceleration_bound(velocity) + self.moving.system.forces.size()) + smallest
    }
}
