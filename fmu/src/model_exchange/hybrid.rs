//! The rig as a hybrid system for an integrator: differential equations ([`crate::model_exchange::equations`]), functions whose zeros
//! are events, and the jumps at events.
//!
//! An integrator stops a little before or behind a zero. A contact is therefore reported [`DEPTH`] half-widths behind the wall, and a release
//! slightly below a contact force of zero. A function without a meaning in the present contact state is held above zero.
//!
//! An integrator cannot follow a chatter to its accumulation point. It ends in contact where the integrator no longer resolves the
//! hops. That shows by itself: the integrator reports a contact while the particle, free since its last impact, still moves away from
//! the wall that presses towards it. Such a hop is shorter than a step at the integrator's tolerance, which most masters do not state.
//! A tighter tolerance resolves lower hops. An integrator that resolves every hop is stopped by a limit: a rebound that would lift
//! the particle less than [`LOWEST_HOP`] half-widths off its wall, and whose chatter is over within [`LONGEST_CHATTER`] of the rig's
//! time, ends in contact at once. What a rest neglects is of third order in the rebound's speed, 1e-15 at that limit; the kinetic
//! energy of the relative motion counts as dissipated, as it would at the end of the chatter ([`Rest`]).
//!
//! The contact force depends on the velocity of the base. That of the built-in oscillator is known while its amplitude is
//! held; that of a signal is unknown, and taken for zero; the plant in closed form ([`lovines::plant`]) has no such limit.

use crate::model_exchange::equations::Instant;
use lovines::base_motion::Drive;
use lovines::contact::{ImpactLaw, Resolution, Wall};
use lovines::parameters::{InvalidValue, Parameters};
use lovines::plant::{Event, Plant, State, Totals};

/// Distance behind a wall at which a contact is reported, as a fraction of the half-width.
pub const DEPTH: f64 = 1e-12;
/// The lowest hop that is followed with any integrator, as a fraction of the half-width.
pub const LOWEST_HOP: f64 = 1e-10;
/// The longest chatter that is cut short, as a fraction of the time `1/omega0`.
pub const LONGEST_CHATTER: f64 = 1e-2;

/// What is integrated.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct States {
    /// Displacement of the primary mass, m.
    pub q1: f64,
    /// Its reduced velocity, m/s.
    pub u1: f64,
    /// Displacement of the particle, m.
    pub q2: f64,
    /// Its reduced velocity, m/s.
    pub u2: f64,
    /// Phase of the base oscillator, rad.
    pub phase: f64,
}

/// The end of a chatter, and what the rest leaves out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rest {
    /// The wall that the particle rests on.
    pub wall: Wall,
    /// Height of the next hop, m.
    pub hop: f64,
    /// Kinetic energy of the relative motion, J; counted as dissipated.
    pub energy: f64,
}

/// An event that is logged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Happening {
    /// An impact or a release, as in the plant in closed form.
    Event(Event),
    /// The particle came to rest on a wall.
    Rest(Rest),
}

/// The rig between two calls of an integrator.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
pub struct Hybrid {
    parameters: Parameters,
    contact: Option<Wall>,
    totals: Totals,
    /// Where the base was when the event began.
    base_before: Option<f64>,
    /// What moves the base now: set at any time.
    pub drive: Drive,
    /// What is integrated: set at any time between events.
    pub states: States,
}

impl Hybrid {
    /// The rig at `start`; [`Self::resolve`] determines its contact state.
    ///
    /// # Errors
    /// As for [`Plant::new`].
    pub fn new(parameters: Parameters, start: State, drive: Drive) -> Result<Self, InvalidValue> {
        let State { q1, dq1, q2, dq2 } = Plant::new(parameters, start)?.state();
        let mut hybrid = Self {
            parameters,
            contact: None,
            totals: Totals::default(),
            base_before: None,
            drive,
            states: States { q1, q2, ..States::default() },
        };
        hybrid.set_velocities(dq1, dq2);
        Ok(hybrid)
    }

    /// The present rig.
    pub fn instant(&self) -> Instant<f64> {
        let p = &self.parameters;
        let States { q1, u1, q2, u2, phase } = self.states;
        let instant = Instant {
            primary_mass: p.primary_mass,
            stiffness: p.stiffness,
            damping: p.damping,
            particle_mass: p.particle_mass,
            signal: self.drive.signal[0],
            slope: 0.0,
            amplitude: self.drive.amplitude,
            omega: self.drive.omega,
            phase,
            q1,
            dq1: 0.0,
            q2,
            dq2: 0.0,
            gravity: 0.0,
            friction: 0.0,
            stuck: self.contact.is_some(),
        };
        instant.with_reduced((u1, u2))
    }

    /// The wall that the particle is stuck to.
    pub fn contact(&self) -> Option<Wall> {
        self.contact
    }

    /// What has been counted since the start.
    pub fn totals(&self) -> &Totals {
        &self.totals
    }

    /// Typical sizes of displacements (m) and velocities (m/s).
    pub fn scales(&self) -> (f64, f64) {
        let b = self.parameters.half_width;
        (b, b * self.parameters.natural_frequency())
    }

    /// Functions of the state whose change of sign is an event: the gaps to both walls (as a fraction of the half-width)
    /// and the push of the wall that the particle is stuck to (as a fraction of `omega0² b`).
    pub fn event_functions(&self) -> [f64; 3] {
        let now = self.instant();
        match self.contact {
            None => {
                let [plus, minus] = Wall::BOTH.map(|wall| self.gap(wall, &now));
                [plus + DEPTH, minus + DEPTH, 1.0]
            }
            Some(wall) => [1.0, 1.0, self.push(wall, &now) + DEPTH],
        }
    }

    /// Whether an integrator has stepped over an event.
    pub fn overdue(&self) -> bool {
        self.event_functions().iter().any(|&value| value <= 0.0)
    }

    /// Begins an event: until [`Self::resolve`] the base may jump.
    pub fn begin_event(&mut self) {
        self.base_before = Some(self.instant().base());
    }

    /// Applies what is due now, at `time`: a jump of the base, an impact, rest, release; whether states have jumped.
    pub fn resolve(&mut self, time: f64, mut on_event: impl FnMut(Happening)) -> bool {
        let before = (self.states, self.contact);
        // After a jump of the base or a release, a particle behind the wall may leave it: that is no hop.
        let hops = self.contact.is_none() && self.base_before == Some(self.instant().base());
        self.base_jump();
        if let Some(wall) = self.contact
            && self.push(wall, &self.instant()) < -0.5 * DEPTH
        {
            self.part(None);
            on_event(Happening::Event(Event::Released { t: 0.0, wall }));
        } else if self.contact.is_none() {
            let now = self.instant();
            let touched = (Wall::BOTH.into_iter()).find(|&wall| self.gap(wall, &now) <= 0.5 * DEPTH);
            if let Some(wall) = touched {
                self.touch(wall, time, hops, &mut on_event);
            }
        }
        // States may jump now, so that the phase can be brought back to one turn.
        self.states.phase = self.states.phase.rem_euclid(core::f64::consts::TAU);
        self.base_before = Some(self.instant().base());
        before != (self.states, self.contact)
    }

    /// Takes over other parameters; displacements and velocities stay.
    ///
    /// # Errors
    /// Parameters that are not allowed; the old ones stay.
    pub fn set_parameters(&mut self, parameters: Parameters) -> Result<(), InvalidValue> {
        parameters.validate()?;
        let Instant { dq1, dq2, .. } = self.instant();
        self.parameters = parameters;
        self.set_velocities(dq1, dq2);
        Ok(())
    }

    fn gap(&self, wall: Wall, now: &Instant<f64>) -> f64 {
        1.0 - wall.sign() * now.relative_displacement() / self.parameters.half_width
    }

    fn push(&self, wall: Wall, now: &Instant<f64>) -> f64 {
        let omega0_squared = self.parameters.stiffness / self.parameters.primary_mass;
        wall.sign() * now.acceleration() / (omega0_squared * self.parameters.half_width)
    }

    fn set_velocities(&mut self, dq1: f64, dq2: f64) {
        let now = Instant { dq1, dq2, ..self.instant() };
        (self.states.u1, self.states.u2) = now.reduced_velocities();
    }

    /// Changes the contact; velocities stay.
    fn part(&mut self, contact: Option<Wall>) {
        let Instant { dq1, dq2, .. } = self.instant();
        self.contact = contact;
        self.set_velocities(dq1, dq2);
    }

    /// The impulse of a jump of the base acts on the primary mass alone: a particle at a wall is free to leave it.
    fn base_jump(&mut self) {
        let Some(before) = self.base_before.take() else {
            return;
        };
        let jump = self.instant().base() - before;
        if jump != 0.0 && self.contact.is_some() {
            let joint = self.parameters.primary_mass + self.parameters.particle_mass;
            let both = self.instant().dq1 - self.parameters.damping / joint * jump;
            self.contact = None;
            let alone = both + self.parameters.damping / self.parameters.primary_mass * jump;
            self.set_velocities(alone, both);
        }
    }

    /// The particle is at `wall`: impact if it approaches, then rest if it cannot leave, or if the integrator cannot resolve that
    /// it leaves. `hops`: it has been free since its last impact.
    fn touch(&mut self, wall: Wall, time: f64, hops: bool, on_event: &mut impl FnMut(Happening)) {
        let now = self.instant();
        let unresolved = hops && self.gap(wall, &now) < -0.5 * DEPTH && wall.sign() * now.relative_velocity() < 0.0;
        self.states.q2 = self.states.q1 - wall.sign() * self.parameters.half_width;
        let law = ImpactLaw::new(&self.parameters);
        let velocities = (now.dq1, now.dq2, now.dq1 - now.dq2);
        let (mut hop, mut energy) = (0.0, 0.0);
        let touch = law.touch(wall, velocities, |primary, speed| {
            let pressing = self.pressing(wall, primary);
            if speed > 0.0 {
                hop = 0.5 * speed * speed / pressing;
                energy = 0.5 * self.parameters.relative_mass() * speed * speed;
            }
            unresolved && pressing > 0.0 || self.rests(&law, speed, pressing)
        });
        self.totals.add(&touch, time);
        if let Some(velocity) = touch.impact {
            on_event(Happening::Event(Event::Impact { t: 0.0, wall, velocity }));
        }
        if touch.stuck {
            self.contact = Some(wall);
            on_event(Happening::Rest(Rest { wall, hop, energy }));
        }
        self.set_velocities(touch.primary, touch.particle);
    }

    /// Acceleration, m/s², of `wall` towards a free particle on it, at this velocity of the primary mass, m/s.
    fn pressing(&self, wall: Wall, primary: f64) -> f64 {
        let now = Instant { dq1: primary, ..self.instant() };
        wall.sign() * now.acceleration()
    }

    /// Whether a particle that leaves a wall at `speed` counts as at rest on it, however accurate the integrator is.
    fn rests(&self, law: &ImpactLaw, speed: f64, pressing: f64) -> bool {
        let (b, fast) = self.scales();
        let resolution = Resolution {
            lowest_hop: LOWEST_HOP * b,
            longest_chatter: LONGEST_CHATTER * b / fast,
            fastest: self.parameters.fastest_rate(),
            elastic: false,
        };
        law.rests(speed, (pressing, 0.5 * DEPTH * fast * fast / b), &resolution)
    }
}

#[cfg(test)]
#[path = "../../tests/unit/hybrid.rs"]
mod tests;
