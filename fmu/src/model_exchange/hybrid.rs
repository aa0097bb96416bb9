//! The rig as a hybrid system for an integrator: differential equations ([`crate::model_exchange::equations`]), functions whose zeros
//! are events, and the jumps at events.
//!
//! An integrator stops a little before or behind a zero. A contact is therefore reported [`DEPTH`] half-widths behind the wall, a release
//! slightly beyond the largest force of wall and friction, and a reversal slightly beyond `w' = 0`. A function without a meaning in the
//! present contact state is held above zero.
//!
//! While the particle slides, its direction is kept: friction does not change with the sign of `w'` inside an integrator's step, but at
//! the reversal. There the particle sticks, if static friction holds it, or slides the other way.
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
use lovines::cavity::{Forces, Rebound};
use lovines::contact::{ImpactLaw, Resolution, Wall};
use lovines::parameters::{InvalidValue, Parameters};
use lovines::plant::{Contact, Event, Plant, State, Totals};

/// Number of event functions.
pub const EVENTS: usize = 5;
/// Distance behind a wall at which a contact is reported, as a fraction of the half-width; and likewise for the other event functions.
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

/// What a rest at the end of a chatter leaves out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rest {
    /// Height of the next hop, m.
    pub hop: f64,
    /// Kinetic energy of the relative motion, J; counted as dissipated.
    pub energy: f64,
}

/// The rig between two calls of an integrator.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
pub struct Hybrid {
    parameters: Parameters,
    forces: Forces,
    contact: Option<Contact>,
    /// Sign of `w'` while the particle slides with friction; 0 where there is none, and before the first event.
    direction: f64,
    /// Totals up to the last event, and its time (s) and place `w` (m).
    totals: Totals,
    last_event: (f64, f64),
    /// Where the base was when the event began.
    base_before: Option<f64>,
    /// Time, s: set at any time.
    pub time: f64,
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
            forces: Forces::new(&parameters),
            contact: None,
            direction: 0.0,
            totals: Totals::default(),
            last_event: (0.0, q1 - q2),
            base_before: None,
            time: 0.0,
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
            gravity: self.forces.gravity,
            friction: self.forces.kinetic * self.direction,
            stuck: self.contact.is_some(),
        };
        instant.with_reduced((u1, u2))
    }

    /// What the particle is at rest on.
    pub fn contact(&self) -> Option<Contact> {
        self.contact
    }

    /// What has been counted since the start, up to the present.
    pub fn totals(&self) -> Totals {
        let (time, w) = self.last_event;
        let mut totals = self.totals;
        if self.contact == Some(Contact::Floor) {
            totals.stuck_time += self.time - time;
        }
        // Between two events `w'` keeps its sign, so that the way is the distance.
        let way = (self.states.q1 - self.states.q2 - w).abs();
        totals.friction += self.parameters.particle_mass * self.forces.kinetic * self.direction.abs() * way;
        totals
    }

    /// Typical sizes of displacements (m) and velocities (m/s).
    fn scales(&self) -> (f64, f64) {
        let [plus, minus] = self.parameters.gaps();
        let b = 0.5 * plus + 0.5 * minus;
        (b, b * self.parameters.natural_frequency())
    }

    /// Functions of the state whose change of sign is an event: the gaps to both walls (as a fraction of the half-width); what wall and
    /// friction can still transmit before the particle goes on with `w' > 0` and with `w' < 0` (as a fraction of `omega0² b`); and the
    /// speed of sliding (as a fraction of `omega0 b`).
    pub fn event_functions(&self) -> [f64; EVENTS] {
        let now = self.instant();
        let mut functions = [1.0; EVENTS];
        match self.contact {
            None => {
                [functions[0], functions[1]] = Wall::BOTH.map(|wall| self.gap(wall, &now) + DEPTH);
                if self.direction != 0.0 {
                    functions[4] = self.sliding(&now) + DEPTH;
                }
            }
            Some(contact) => {
                for &direction in releases(contact) {
                    let which = if direction > 0.0 { 2 } else { 3 };
                    functions[which] = self.hold(direction, &now) + DEPTH;
                }
            }
        }
        functions
    }

    /// Whether an integrator has stepped over an event.
    pub fn overdue(&self) -> bool {
        self.event_functions().iter().any(|&value| value <= 0.0)
    }

    /// How far the particle is from the middle of the cavity, in half-widths; above 1 it is behind a wall.
    pub fn behind_wall(&self) -> f64 {
        let now = self.instant();
        1.0 - Wall::BOTH
            .map(|wall| self.gap(wall, &now))
            .into_iter()
            .fold(f64::INFINITY, f64::min)
    }

    /// Begins an event: until [`Self::resolve`] the base may jump.
    pub fn begin_event(&mut self) {
        self.base_before = Some(self.instant().base());
    }

    /// Applies what is due now, at `time`: a jump of the base, an impact, rest, release, reversal; whether states have jumped.
    pub fn resolve(&mut self, time: f64, mut on_event: impl FnMut(Event, Option<Rest>)) -> bool {
        let before = (self.states, self.contact, self.direction);
        self.time = time;
        self.totals = self.totals();
        // After a jump of the base or a release, a particle behind the wall may leave it: that is no hop.
        let hops = self.contact.is_none() && self.base_before == Some(self.instant().base());
        self.base_jump();
        let now = self.instant();
        if let Some(contact) = self.contact {
            let due = |direction: &&f64| self.hold(**direction, &now) < -0.5 * DEPTH;
            if let Some(&direction) = releases(contact).iter().find(due) {
                self.part(None, direction);
                let event = match contact {
                    Contact::Wall(wall) => Event::Released { t: 0.0, wall },
                    Contact::Floor => Event::Slip { t: 0.0, direction },
                };
                on_event(event, None);
            }
        } else {
            let touched = (Wall::BOTH.into_iter()).find(|&wall| self.gap(wall, &now) <= 0.5 * DEPTH);
            if let Some(wall) = touched {
                self.touch(wall, hops, &mut on_event);
            }
            if self.contact.is_none() && self.forces.holding > 0.0 {
                self.slide(&mut on_event);
            }
        }
        // States may jump now, so that the phase can be brought back to one turn.
        self.states.phase = self.states.phase.rem_euclid(core::f64::consts::TAU);
        self.base_before = Some(self.instant().base());
        self.last_event = (time, self.states.q1 - self.states.q2);
        before != (self.states, self.contact, self.direction)
    }

    /// The particle slides: decides on its direction after a jump of `w'`, and whether it sticks at a reversal.
    fn slide(&mut self, on_event: &mut impl FnMut(Event, Option<Rest>)) {
        let now = self.instant();
        let reverses = self.direction != 0.0 && self.sliding(&now) < -0.5 * DEPTH;
        if self.direction != 0.0 && !reverses {
            return;
        }
        if !reverses && now.relative_velocity() != 0.0 {
            return self.part(None, 1f64.copysign(now.relative_velocity()));
        }
        self.part(None, 0.0);
        self.set_velocities(now.dq1, now.dq1);
        let (b, fast) = self.scales();
        let error = 0.5 * DEPTH * fast * fast / b;
        let direction = self.forces.slips((self.instant().acceleration(), error));
        if direction == 0.0 {
            self.totals.sticks += 1;
            self.part(Some(Contact::Floor), 0.0);
            on_event(Event::Sticking { t: 0.0 }, None);
        } else {
            self.part(None, direction);
            if reverses {
                on_event(Event::Reversal { t: 0.0, direction }, None);
            }
        }
    }

    /// Takes over other parameters; displacements and velocities stay.
    ///
    /// # Errors
    /// Parameters that are not allowed; the old ones stay.
    pub fn set_parameters(&mut self, parameters: Parameters) -> Result<(), InvalidValue> {
        parameters.validate()?;
        self.totals = self.totals();
        let Instant { dq1, dq2, q1, q2, .. } = self.instant();
        self.last_event = (self.time, q1 - q2);
        (self.parameters, self.forces) = (parameters, Forces::new(&parameters));
        // The next event decides on it.
        self.direction = 0.0;
        self.set_velocities(dq1, dq2);
        Ok(())
    }

    fn gap(&self, wall: Wall, now: &Instant<f64>) -> f64 {
        (self.parameters.gaps()[wall.index()] - wall.sign() * now.relative_displacement()) / self.scales().0
    }

    /// What is left of the force that keeps the particle from going on with `w'` of the sign `direction`.
    fn hold(&self, direction: f64, now: &Instant<f64>) -> f64 {
        let (b, fast) = self.scales();
        (self.forces.holding - direction * (now.acceleration() - self.forces.gravity)) / (fast * fast / b)
    }

    fn sliding(&self, now: &Instant<f64>) -> f64 {
        self.direction * now.relative_velocity() / self.scales().1
    }

    fn set_velocities(&mut self, dq1: f64, dq2: f64) {
        let now = Instant { dq1, dq2, ..self.instant() };
        (self.states.u1, self.states.u2) = now.reduced_velocities();
    }

    /// Changes contact and direction of sliding; velocities stay.
    fn part(&mut self, contact: Option<Contact>, direction: f64) {
        let Instant { dq1, dq2, .. } = self.instant();
        self.contact = contact;
        self.direction = if self.forces.holding > 0.0 { direction } else { 0.0 };
        self.set_velocities(dq1, dq2);
    }

    /// The impulse of a jump of the base acts on the primary mass alone: a particle at a wall is free to leave it. A jump within the
    /// rounding of the base displacement is none, and one whose hop cannot be resolved moves both masses as one.
    fn base_jump(&mut self) {
        let Some(before) = self.base_before.take() else {
            return;
        };
        let jump = self.instant().base() - before;
        if jump == 0.0 {
            return;
        }
        if let Some(contact) = self.contact {
            let (p, now) = (&self.parameters, self.instant());
            let kick = p.damping / p.primary_mass * jump;
            let both = now.dq1 - p.damping / (p.primary_mass + p.particle_mass) * jump;
            let alone = Instant { dq1: both + kick, stuck: false, friction: 0.0, ..now };
            let is_rounding =
                jump.abs() <= 8.0 * f64::EPSILON * (before.abs() + now.signal.abs() + now.amplitude.abs());
            let lowest = LOWEST_HOP * self.scales().0;
            if is_rounding || (self.forces).carry(contact.wall(), kick, alone.acceleration(), lowest) {
                return;
            }
            self.contact = None;
            self.set_velocities(alone.dq1, both);
        }
        // With the relative velocity, the direction may have changed.
        self.direction = 0.0;
    }

    /// The particle is at `wall`: impact if it approaches, then rest if it cannot leave, or if the integrator cannot resolve that
    /// it leaves. `hops`: it has been free since its last impact.
    fn touch(&mut self, wall: Wall, hops: bool, on_event: &mut impl FnMut(Event, Option<Rest>)) {
        let (now, p) = (self.instant(), &self.parameters);
        let relative = now.relative_velocity();
        let unresolved = hops && self.gap(wall, &now) < -0.5 * DEPTH && wall.sign() * relative < 0.0;
        self.states.q2 = self.states.q1 - wall.sign() * p.gaps()[wall.index()];
        let (mut law, rebound) = (ImpactLaw::new(p), Rebound::new(p));
        if !rebound.is_constant(p.restitution) {
            law = law.with_restitution(rebound.of_impact(wall, relative.abs(), self.totals.impacts));
        }
        let (b, fast) = self.scales();
        let resolution = Resolution {
            lowest_hop: LOWEST_HOP * b,
            longest_chatter: LONGEST_CHATTER * b / fast,
            fastest: p.fastest_rate(),
            elastic: false,
        };
        let (mut contact, mut rest) = (Contact::Wall(wall), Rest { hop: 0.0, energy: 0.0 });
        let touch = law.touch(wall, (now.dq1, now.dq2, relative), |primary, speed| {
            let alone = Instant { dq1: primary, stuck: false, friction: 0.0, ..self.instant() };
            let free = wall.sign() * alone.acceleration();
            let (up, _) = self.forces.pressing(wall, free);
            if speed > 0.0 {
                let energy = 0.5 * p.relative_mass() * speed * speed;
                rest = Rest { hop: 0.5 * speed * speed / up, energy };
            }
            let error = 0.5 * DEPTH * fast * fast / b;
            if speed > 0.0 && self.forces.holding > 0.0 && self.forces.stop_a_hop(wall, free) {
                contact = Contact::Floor;
            }
            unresolved && up > 0.0 || rebound.rests(&law, &self.forces, (wall, speed), (free, error), &resolution)
        });
        self.totals.add(&touch, self.time);
        if touch.impact.is_some() || touch.stuck {
            self.direction = 0.0;
        }
        if let Some(velocity) = touch.impact {
            on_event(Event::Impact { t: 0.0, wall, velocity }, None);
        }
        if touch.stuck {
            self.contact = Some(contact);
            self.totals.sticks += u64::from(contact == Contact::Floor);
            let event = match contact {
                Contact::Wall(wall) => Event::Stuck { t: 0.0, wall },
                Contact::Floor => Event::Sticking { t: 0.0 },
            };
            on_event(event, Some(rest));
        }
        self.set_velocities(touch.primary, touch.particle);
    }
}

/// Signs of `w'` with which the particle can be released.
fn releases(contact: Contact) -> &'static [f64] {
    match contact {
        Contact::Wall(Wall::Plus) => &[-1.0],
        Contact::Wall(Wall::Minus) => &[1.0],
        Contact::Floor => &[1.0, -1.0],
    }
}

#[cfg(test)]
mod tests {
    //! Hops at a wall, and both interfaces of the FMU under a drive that changes at every sample, with the ideal cavity and with friction,
    //! tilt, unequal gaps and all laws of restitution. `scripts/stress --plant` runs more scenes (`SCENES`); validation/stress.csv keeps the
    //! figures.

    use super::*;
    use lovines::{Cavity, Restitution};

    const SPEED: f64 = 1e-4;

    /// A particle `depth` half-widths behind the wall `w = b`, which it leaves; the spring presses the wall towards it.
    fn behind_the_wall(depth: f64) -> Hybrid {
        let parameters = Parameters::dimensionless(0.1, 0.5, 0.5);
        let mut hybrid = Hybrid::new(parameters, State::default(), Drive::default()).unwrap();
        hybrid.states = States { q1: -3.0, q2: -4.0 - depth, u1: 0.0, u2: SPEED, phase: 0.0 };
        hybrid.begin_event();
        hybrid
    }

    fn resolved(hybrid: &mut Hybrid) -> Vec<(Event, Option<Rest>)> {
        let mut events = Vec::new();
        hybrid.resolve(1.0, |event, rest| events.push((event, rest)));
        events
    }

    #[test]
    fn a_hop_that_the_integrator_does_not_resolve_ends_in_contact_and_its_energy_is_dissipated() {
        let mut hybrid = behind_the_wall(1e-9);
        let [(Event::Stuck { wall, .. }, Some(rest))] = resolved(&mut hybrid)[..] else {
            panic!("a rest expected");
        };
        assert_eq!((hybrid.contact(), wall), (Some(Contact::Wall(Wall::Plus)), Wall::Plus));
        let energy = 0.5 * (0.1 / 1.1) * SPEED * SPEED;
        assert!((rest.energy / energy - 1.0).abs() < 1e-9 && (rest.hop / (SPEED * SPEED / 6.0) - 1.0).abs() < 1e-9);
        assert!((hybrid.totals().dissipated / energy - 1.0).abs() < 1e-9);
    }

    #[test]
    fn a_particle_that_leaves_its_wall_without_a_hop_behind_it_goes_on() {
        let mut on_the_wall = behind_the_wall(0.0);
        let mut after_a_jump = behind_the_wall(1e-9);
        after_a_jump.drive.signal[0] = -1e-3;
        for hybrid in [&mut on_the_wall, &mut after_a_jump] {
            assert_eq!(resolved(hybrid), []);
            assert_eq!((hybrid.contact(), hybrid.instant().dq2), (None, SPEED));
        }
    }

    /// Scenes, and how many fewer than in the stress test of the plant.
    const SCENES: u64 = 150;
    const FEWER: u64 = 25;
    const SCENE_SAMPLES: usize = 20;
    /// Step of the integrator, in units of the fastest rate's time: with steps of 0.01 it jumps over low hops.
    const INTEGRATOR_STEP: f64 = 0.002;
    /// Relative change of the start that shows how a sample spreads differences.
    const CHANGE: f64 = 1e-7;

    struct Random(fastrand::Rng);

    impl Random {
        fn next(&mut self) -> f64 {
            self.0.f64()
        }

        fn between(&mut self, from: f64, to: f64) -> f64 {
            from + (to - from) * self.next()
        }

        fn decades(&mut self, from: f64, to: f64) -> f64 {
            10f64.powf(self.between(from, to))
        }
    }

    /// What the particle is at rest on.
    fn held(plant: &Plant) -> Option<Contact> {
        (plant.contact().map(Contact::Wall)).or(plant.sticks().then_some(Contact::Floor))
    }

    /// A master: integration, and bisection for the events.
    struct Master {
        hybrid: Hybrid,
        /// The drive as the sample begins.
        drive: Drive,
        /// How often the particle came to rest on a wall.
        rests: u64,
    }

    impl Master {
        /// The state of the plant at the start of a sample, changed by a relative amount, and the drive then.
        fn new(plant: &Plant, drive: Drive, change: f64) -> Self {
            let mut state = plant.state();
            let before = plant.base();
            let mut hybrid = Hybrid::new(*plant.parameters(), state, before.drive).unwrap();
            (state.dq1, state.dq2) = (state.dq1 * (1.0 + change), state.dq2 * (1.0 + change));
            hybrid.states.phase = before.phase.radians();
            hybrid.contact = held(plant);
            hybrid.totals = *plant.totals();
            hybrid.set_velocities(state.dq1, state.dq2);
            hybrid.begin_event();
            hybrid.drive = drive;
            let mut rests = 0;
            while hybrid.resolve(0.0, |_, rest| rests += u64::from(rest.is_some())) {}
            Self { hybrid, drive, rests }
        }

        /// The rig at `states`, `t` seconds after the sample began.
        fn at(&self, states: States, t: f64) -> Hybrid {
            let mut hybrid = Hybrid { states, ..self.hybrid };
            let [u0, u1, u2, u3] = self.drive.signal;
            hybrid.drive.signal[0] = u0 + t * (u1 + t * (u2 + t * u3));
            hybrid
        }

        /// The classical method of Runge and Kutta.
        fn step(&self, t: f64, h: f64) -> Hybrid {
            let numbers = |s: States| [s.q1, s.u1, s.q2, s.u2, s.phase];
            let states = |[q1, u1, q2, u2, phase]: [f64; 5]| States { q1, u1, q2, u2, phase };
            let start = numbers(self.hybrid.states);
            let after = |rates: [f64; 5], h: f64| states(std::array::from_fn(|n| start[n] + h * rates[n]));
            let rates = |hybrid: Hybrid| {
                let now = hybrid.instant();
                let (u1, u2) = now.reduced_accelerations();
                [now.dq1, u1, now.dq2, u2, now.omega]
            };
            let a = rates(self.at(self.hybrid.states, t));
            let b = rates(self.at(after(a, 0.5 * h), t + 0.5 * h));
            let c = rates(self.at(after(b, 0.5 * h), t + 0.5 * h));
            let d = rates(self.at(after(c, h), t + h));
            let mean = std::array::from_fn(|n| (a[n] + 2.0 * (b[n] + c[n]) + d[n]) / 6.0);
            self.at(after(mean, h), t + h)
        }

        /// Displacement and velocity of the primary mass, relative displacement and velocity after the sample, the totals, and rests on a
        /// wall.
        fn run(mut self, duration: f64) -> ([f64; 4], Totals, u64) {
            let longest = INTEGRATOR_STEP / self.hybrid.parameters.fastest_rate().max(self.drive.omega.abs());
            let mut t = 0.0;
            while t < duration {
                let h = longest.min(duration - t);
                let end = self.step(t, h);
                if !end.overdue() {
                    self.hybrid = end;
                    t += h;
                    continue;
                }
                let (mut before, mut behind) = (0.0, h);
                for _ in 0..60 {
                    let middle = 0.5 * (before + behind);
                    let overdue = self.step(t, middle).overdue();
                    *(if overdue { &mut behind } else { &mut before }) = middle;
                }
                self.hybrid = self.step(t, behind);
                t += behind;
                self.hybrid.begin_event();
                while (self.hybrid).resolve(t, |_, rest| self.rests += u64::from(rest.is_some())) {}
            }
            self.hybrid.time = duration;
            let now = self.hybrid.instant();
            let motion = [now.q1, now.dq1, now.relative_displacement(), now.relative_velocity()];
            (motion, self.hybrid.totals(), self.rests)
        }
    }

    /// Any of the effects, with gravity of the size of the accelerations of the rig and far smaller.
    fn rough(random: &mut Random) -> Cavity {
        let gravity = 1.0 / lovines::cavity::GRAVITY;
        let mut cavity = Cavity { seed: random.0.u64(..), ..Cavity::IDEAL };
        let mut with = |share: f64| random.next() < share;
        let [gaps, tilt, friction, laws, scatter] = [0.5, 0.5, 0.7, 0.5, 0.3].map(&mut with);
        if gaps {
            (cavity.b_plus, cavity.b_minus) = (Some(random.between(0.7, 1.3)), Some(random.between(0.7, 1.3)));
        }
        if tilt {
            cavity.tilt = random.between(-1.0, 1.0) * gravity;
        }
        if friction {
            cavity.kinetic_friction = random.decades(-2.5, 0.5) * gravity;
            cavity.static_friction =
                (random.next() < 0.5).then_some(cavity.kinetic_friction * random.between(1.0, 2.0));
        }
        if laws {
            let viscoelastic = Restitution::Viscoelastic(random.between(0.0, 0.5));
            cavity.restitution = [
                Some(viscoelastic),
                Some(Restitution::Plastic(random.decades(-2.0, 0.0))),
            ];
            cavity.least_restitution = 0.05;
        }
        if scatter {
            cavity.scatter = random.between(0.0, 0.2);
        }
        cavity
    }

    /// Both interfaces sample by sample; prints the figures.
    #[expect(clippy::too_many_lines, reason = "a test")]
    fn compare(name: &str, cavities: fn(&mut Random) -> Cavity) {
        let scenes = std::env::var("SCENES").map_or(SCENES, |n| n.parse::<u64>().expect("a number of scenes") / FEWER);
        // A rebound of the lowest hop has this speed where the wall presses with `8 omega0² b`.
        let allowed = 4.0 * LOWEST_HOP.sqrt();
        let (mut worst, mut held_samples, mut impacts, mut sticks) = (0.0f64, 0u64, 0u64, 0u64);
        for number in 1..=scenes {
            let mut random = Random(fastrand::Rng::with_seed(number));
            let r = random.between(0.05, 0.8);
            let mut parameters = Parameters::dimensionless(random.decades(-2.0, 0.0), 0.0, r);
            // Model exchange does not know the slope of a signal, which matters with damping only.
            let slopes = random.next() < 0.3;
            if !slopes {
                parameters.damping = random.decades(-2.0, 1.0);
            }
            parameters.cavity = cavities(&mut random);
            let q1 = random.between(-1.0, 1.0);
            let wall = if random.next() < 0.5 { Wall::Plus } else { Wall::Minus };
            let w = wall.sign() * parameters.gaps()[wall.index()];
            let mut plant = Plant::new(parameters, State { q1, q2: q1 - w, ..State::default() }).unwrap();
            let drive = Drive::harmonic(random.decades(-1.0, 0.5), random.between(0.0, 3.0));
            plant.begin(drive).unwrap();
            for sample in 0..SCENE_SAMPLES {
                let Drive { mut signal, mut amplitude, .. } = plant.base().drive;
                if slopes {
                    signal[1..].fill_with(|| random.between(-1.0, 1.0));
                }
                // Half of the changes are without a jump.
                if random.next() < 0.5 {
                    signal[0] = random.between(-1.0, 1.0);
                    amplitude = random.decades(-1.0, 0.5);
                }
                let drive = Drive { signal, amplitude, omega: random.between(-1.0, 3.0) };
                let step = random.decades(-2.0, 0.3);
                let [(exchanged, totals, rests), (changed, ..)] =
                    [0.0, CHANGE].map(|change| Master::new(&plant, drive, change).run(step));
                let before = *plant.totals();
                let outcome = plant.advance(drive, step).unwrap();
                held_samples += u64::from(held(&plant).is_some());
                // After a chatter the coefficients of restitution belong to impacts of other numbers.
                if parameters.cavity.scatter > 0.0 && outcome.stuck > 0 {
                    continue;
                }
                let state = plant.state();
                let stepped = [
                    state.q1,
                    state.dq1,
                    plant.relative_displacement(),
                    plant.relative_velocity(),
                ];
                let sizes = [state.q1, state.dq1, state.dq2, amplitude, 1.0];
                let size = sizes.into_iter().fold(0.0f64, |size, x| size.max(x.abs()));
                let difference = |a: &[f64], b: &[f64]| {
                    (a.iter().zip(b)).fold(0.0f64, |most, (a, b)| most.max((a - b).abs())) / size
                };
                let scale = 1.0 + difference(&changed, &exchanged) / CHANGE;
                let figure = difference(&stepped, &exchanged) / scale;
                let place = format!("scene {number}, sample {sample}");
                assert!(
                    figure < allowed,
                    "{place}: {figure:e} {stepped:?} {exchanged:?} {:?}",
                    parameters.cavity
                );
                worst = worst.max(figure);
                let now = *plant.totals();
                let energy = parameters.particle_mass * size;
                // The last hop at a wall, of 1e-10 half-widths, ends on the floor in one and on the wall in the other.
                let rested = outcome.stuck + rests > 0;
                let stuck_time = if rested { now.stuck_time } else { totals.stuck_time };
                for (a, b, unit) in [
                    (now.dissipated, totals.dissipated, energy),
                    (now.friction, totals.friction, energy),
                    (now.stuck_time, stuck_time, 1.0),
                ] {
                    let figure = difference(&[a / unit], &[b / unit]) / scale;
                    assert!(figure < 10.0 * allowed, "{place}: {figure:e} {now:?} {totals:?}");
                }
                impacts += now.impacts - before.impacts;
                sticks += now.sticks - before.sticks;
            }
        }
        println!(
            "| new drive at every sample, {name}: both interfaces of the FMU differ by, relative | {scenes} scenes, {} samples, {held_samples} \
             of them end at rest | {worst:.1e} | {allowed:.1e} |",
            scenes * SCENE_SAMPLES as u64
        );
        let enough = held_samples > scenes / 2 && impacts > scenes || scenes < SCENES;
        assert!(enough, "{held_samples} {impacts} {sticks}");
        println!("{impacts} impacts, {sticks} sticks");
    }

    #[test]
    fn both_interfaces_agree_on_drives_that_change_at_every_sample_with_friction_tilt_gaps_and_every_law_of_restitution()
     {
        compare("ideal cavity", |_| Cavity::IDEAL);
        compare("real cavity", rough);
    }
}
