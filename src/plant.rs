//! The rig: linear oscillator, particle and walls, advanced from event to event in closed form.

use crate::base_motion::{BaseMotion, Drive, two_sum};
use crate::flight::{Flight, Landing};
use crate::forcing::Forcing;
use crate::motion::Motion;
use crate::oscillator::Oscillator;
use crate::parameters::{InvalidValue, Parameters};
use crate::sticking::until_released;
use crate::wall::{ImpactLaw, Wall};
use serde::{Deserialize, Serialize};

/// A rebound that would lift the particle less than this fraction of the half-width off its wall cannot be told from
/// contact in double precision.
const UNRESOLVED: f64 = 1.0 / (1u64 << 56) as f64;
/// Rebounds that last less than this fraction of the fastest rate's time are not followed one by one.
const SHORTEST_HOP: f64 = 1e-9;
/// Relative rounding of an acceleration put together from a few terms.
const ROUNDING: f64 = 8.0 * f64::EPSILON;

/// An advance ends before its time at this many impacts, so that no value, however absurd, makes it endless.
pub const MOST_IMPACTS: u64 = 10_000_000;

/// Positions (m) and velocities (m/s) of both masses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// Displacement of the primary mass.
    pub q1: f64,
    /// Velocity of the primary mass.
    pub dq1: f64,
    /// Displacement of the particle.
    pub q2: f64,
    /// Velocity of the particle.
    pub dq2: f64,
}

/// Something that happened while the plant advanced; times are in seconds since the advance began.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event {
    /// The particle hit a wall; `velocity` is w' just before, m/s.
    Impact {
        /// When, s.
        t: f64,
        /// Which wall.
        wall: Wall,
        /// Relative velocity just before, m/s.
        velocity: f64,
    },
    /// The particle came to rest on a wall.
    Stuck {
        /// When, s.
        t: f64,
        /// Which wall.
        wall: Wall,
    },
    /// The wall ceased to push and let the particle go.
    Released {
        /// When, s.
        t: f64,
        /// Which wall.
        wall: Wall,
    },
}

/// What an advance met on its way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Outcome {
    /// Impacts followed one by one.
    pub impacts: u64,
    /// How often the particle came to rest on a wall.
    pub stuck: u64,
    /// How often a wall let it go.
    pub released: u64,
    /// Whether it has ended before its time, at [`MOST_IMPACTS`].
    pub cut_short: bool,
}

/// What has been counted since the start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Tally {
    /// Impacts followed one by one. A chatter is followed until its hops can no longer be resolved.
    pub impacts: u64,
    /// Time of the last impact, s; 0 before the first.
    pub impact_time: f64,
    /// Relative velocity w' just before the last impact, m/s; 0 before the first.
    pub impact_velocity: f64,
    /// Energy dissipated by impacts, J.
    pub dissipated: f64,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
enum Contact {
    Free,
    Stuck(Wall),
    /// Free, and the wall has ceased to push at this very instant.
    Released(Wall),
}

/// An oscillator and its answer to the frequency in use: coefficients are kept while the frequency stays.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Driven {
    oscillator: Oscillator,
    forcing: Forcing,
}

impl Driven {
    fn new(mass: f64, p: &Parameters) -> Self {
        let oscillator = Oscillator::new(mass, p.stiffness, p.damping);
        Self {
            forcing: Forcing::new(&oscillator, 0.0),
            oscillator,
        }
    }

    fn motion(&mut self, base: &BaseMotion, start: (f64, f64)) -> Motion<'_> {
        let omega = base.drive.omega.abs();
        if self.forcing.omega != omega && base.drive.amplitude != 0.0 {
            self.forcing = Forcing::new(&self.oscillator, omega);
        }
        Motion::new(&self.oscillator, &self.forcing, *base, start)
    }
}

/// The plant: parameters, what follows from them, and the state.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Plant {
    parameters: Parameters,
    law: ImpactLaw,
    /// The primary mass alone, and with the particle stuck to it.
    alone: Driven,
    joint: Driven,
    contact: Contact,
    primary: (f64, f64),
    /// `w = q1 - q2`, carried itself: in a narrow gap the difference of two large displacements would have lost it.
    w: f64,
    particle_velocity: f64,
    base: BaseMotion,
    /// Whether the plant has advanced since its start: a drive set before that is where the base is, not a jump.
    under_way: bool,
    time: f64,
    tally: Tally,
}

impl Plant {
    /// A plant at `start`; refuses parameters that make no sense and a particle outside its cavity.
    pub fn new(parameters: Parameters, start: State) -> Result<Self, InvalidValue> {
        parameters.validate()?;
        let finite = |name, value: f64, unit| {
            InvalidValue::unless(value.is_finite(), name, value, unit, "a finite number")
        };
        finite("q1 (displacement of the primary mass)", start.q1, "m")?;
        finite("der(q1) (velocity of the primary mass)", start.dq1, "m/s")?;
        finite("q2 (displacement of the particle)", start.q2, "m")?;
        finite("der(q2) (velocity of the particle)", start.dq2, "m/s")?;
        let (w, b) = (start.q1 - start.q2, parameters.half_width);
        // The difference of two displacements carries their rounding; a start on the wall means on the wall.
        let slack = 4.0 * f64::EPSILON * (b + start.q1.abs().max(start.q2.abs()));
        InvalidValue::unless(
            w.abs() <= b + slack,
            "w = q1 - q2 (particle outside its cavity at the start)",
            w,
            "m",
            "a number from -b to b",
        )?;
        Ok(Self {
            parameters,
            law: ImpactLaw::new(&parameters),
            alone: Driven::new(parameters.primary_mass, &parameters),
            joint: Driven::new(
                parameters.primary_mass + parameters.particle_mass,
                &parameters,
            ),
            contact: Contact::Free,
            primary: (start.q1, start.dq1),
            w: w.clamp(-b, b),
            particle_velocity: start.dq2,
            base: BaseMotion::default(),
            under_way: false,
            time: 0.0,
            tally: Tally::default(),
        })
    }

    /// Advances by `duration` seconds (0 or above) under `drive`, whose values are finite.
    ///
    /// A jump of the base displacement against the end of the last advance gives the primary mass the velocity jump
    /// `c Δe/M` that the equation of motion implies.
    pub fn advance(&mut self, drive: Drive, duration: f64) -> Outcome {
        self.advance_with(drive, duration, |_| {})
    }

    /// As [`Self::advance`], and tells every event as it happens.
    pub fn advance_with(
        &mut self,
        drive: Drive,
        duration: f64,
        mut tell: impl FnMut(Event),
    ) -> Outcome {
        let mut outcome = Outcome::default();
        let mut tell = |event: Event| {
            match event {
                Event::Impact { .. } => outcome.impacts += 1,
                Event::Stuck { .. } => outcome.stuck += 1,
                Event::Released { .. } => outcome.released += 1,
            }
            tell(event);
        };
        self.take(drive);
        let mut dw = self.relative_velocity();
        let mut clock = Clock::new(duration);
        if let (Contact::Free, Some(wall)) = (self.contact, self.wall_touched()) {
            dw = self.touch(wall, dw, &clock, &mut tell);
        }
        let last_impact = self.tally.impacts + MOST_IMPACTS;
        while clock.left() > 0.0 && self.tally.impacts < last_impact {
            if let Contact::Stuck(wall) = self.contact {
                self.stay(wall, &mut clock, &mut tell);
                dw = 0.0;
                continue;
            }
            let landing = self.fly(dw, clock.left());
            clock.pass(landing.t);
            self.base = self.base.after(landing.t);
            self.primary = landing.primary;
            (self.w, dw) = landing.relative;
            self.contact = Contact::Free;
            if let Some(wall) = landing.wall {
                dw = self.touch(wall, dw, &clock, &mut tell);
            }
        }
        self.time += duration;
        outcome.cut_short = clock.left() > 0.0;
        outcome
    }

    /// Says where the base is at the start: what drives it from the first advance on is compared with this.
    pub fn begin(&mut self, drive: Drive) {
        self.base.drive = drive;
        self.under_way = true;
    }

    /// Takes over a new drive and the jump of the base that it brings.
    fn take(&mut self, drive: Drive) {
        let before = self.base.displacement();
        self.base.drive = drive;
        if self.under_way {
            let jump = self.base.displacement() - before;
            if jump != 0.0 {
                self.primary.1 += self.parameters.damping / self.parameters.primary_mass * jump;
                // The impulse acts on the primary mass alone; what that means for a particle at the wall is decided anew.
                self.contact = Contact::Free;
            }
        }
        self.under_way = true;
    }

    fn wall_touched(&self) -> Option<Wall> {
        Wall::BOTH
            .into_iter()
            .find(|wall| wall.sign() * self.w >= self.parameters.half_width)
    }

    fn fly(&mut self, dw: f64, limit: f64) -> Landing {
        let released = match self.contact {
            Contact::Released(wall) => Some(wall),
            _ => None,
        };
        let motion = self.alone.motion(&self.base, self.primary);
        Flight::new(motion, (self.w, dw), self.parameters.half_width).first_contact(limit, released)
    }

    /// The particle is at `wall` with relative velocity `dw`: impact if it approaches, then rest if it cannot leave.
    /// Returns the relative velocity after that.
    fn touch(&mut self, wall: Wall, dw: f64, clock: &Clock, tell: &mut impl FnMut(Event)) -> f64 {
        let s = wall.sign();
        let mut dw = dw;
        self.w = s * self.parameters.half_width;
        if s * dw > 0.0 {
            let after = self.law.rebound(self.primary.1, self.particle_velocity, dw);
            let t = clock.now();
            self.tally.impacts += 1;
            self.tally.impact_time = self.time + t;
            self.tally.impact_velocity = dw;
            self.tally.dissipated += after.dissipated;
            tell(Event::Impact {
                t,
                wall,
                velocity: dw,
            });
            self.primary.1 = after.primary;
            self.particle_velocity = after.particle;
            dw = after.relative;
        }
        if self.rests(wall, dw, clock.left()) {
            let (velocity, lost) = self.law.join(self.primary.1, dw);
            self.primary.1 = velocity;
            self.particle_velocity = velocity;
            self.tally.dissipated += lost;
            self.contact = Contact::Stuck(wall);
            tell(Event::Stuck {
                t: clock.now(),
                wall,
            });
            dw = 0.0;
        }
        dw
    }

    /// Whether a particle that leaves `wall` with relative velocity `dw` is in truth at rest on it.
    ///
    /// Its hops are then below resolution (height `u²/(2a)`), and they die out within `2u/(a (1 - r))`. Letting both masses
    /// move as one from now on conserves momentum exactly; what is neglected is the stiffness force on a gap of at most
    /// that height for that time, which is of third order in `u` (docs/accuracy.md).
    fn rests(&mut self, wall: Wall, dw: f64, left: f64) -> bool {
        let s = wall.sign();
        let speed = -s * dw;
        let motion = self.alone.motion(&self.base, self.primary);
        let pressing = s * motion.derivatives_at_start()[2];
        if speed == 0.0 {
            return pressing >= -self.acceleration_noise();
        }
        let height = 0.5 * speed * speed / pressing;
        pressing > 0.0
            && height <= UNRESOLVED * self.parameters.half_width
            && (self.law.chatter_duration(speed, pressing) <= left
                || speed * self.alone.oscillator.fastest <= SHORTEST_HOP * pressing)
    }

    /// Rounding of an acceleration here, m/s².
    fn acceleration_noise(&self) -> f64 {
        let Oscillator {
            delta,
            omega0_squared,
            ..
        } = self.alone.oscillator;
        let drive = &self.base.drive;
        let position = self.primary.0.abs() + drive.signal[0].abs() + drive.amplitude.abs();
        let velocity =
            self.primary.1.abs() + drive.signal[1].abs() + (drive.amplitude * drive.omega).abs();
        ROUNDING * (omega0_squared * position + 2.0 * delta * velocity)
    }

    fn stay(&mut self, wall: Wall, clock: &mut Clock, tell: &mut impl FnMut(Event)) {
        let noise = self.acceleration_noise();
        let motion = self.joint.motion(&self.base, self.primary);
        let parting = until_released(&motion, wall, clock.left(), noise);
        clock.pass(parting.t);
        self.base = self.base.after(parting.t);
        self.primary = parting.joint;
        self.particle_velocity = parting.joint.1;
        if parting.released {
            self.contact = Contact::Released(wall);
            tell(Event::Released {
                t: clock.now(),
                wall,
            });
        }
    }

    /// Takes over other parameters from now on; displacements, velocities and counts stay. The masses and the half-width
    /// are meant to stay, too: nothing here says what their change would do.
    ///
    /// # Errors
    /// Parameters that make no sense; the old ones stay.
    pub fn retune(&mut self, parameters: Parameters) -> Result<(), InvalidValue> {
        parameters.validate()?;
        let joint = parameters.primary_mass + parameters.particle_mass;
        self.law = ImpactLaw::new(&parameters);
        self.alone = Driven::new(parameters.primary_mass, &parameters);
        self.joint = Driven::new(joint, &parameters);
        self.parameters = parameters;
        Ok(())
    }

    /// The parameters.
    pub fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// Time since the start, s, or as [`Self::set_time`] set it. Only impact times depend on it.
    pub fn time(&self) -> f64 {
        self.time
    }

    /// Sets the clock that impact times are told by.
    pub fn set_time(&mut self, time: f64) {
        self.time = time;
    }

    /// Positions and velocities now.
    pub fn state(&self) -> State {
        State {
            q1: self.primary.0,
            dq1: self.primary.1,
            q2: self.primary.0 - self.w,
            dq2: self.particle_velocity,
        }
    }

    /// Relative displacement `w = q1 - q2`, m.
    pub fn relative_displacement(&self) -> f64 {
        self.w
    }

    /// Relative velocity `w'`, m/s.
    pub fn relative_velocity(&self) -> f64 {
        self.primary.1 - self.particle_velocity
    }

    /// `v = q1 + epsilon q2`, m: the displacement of the centre of mass times `1 + epsilon`.
    pub fn centre(&self) -> f64 {
        self.primary.0 + self.parameters.mass_ratio() * (self.primary.0 - self.w)
    }

    /// The base motion as it stands: drive, and the phase its oscillator has reached.
    pub fn base(&self) -> &BaseMotion {
        &self.base
    }

    /// The wall the particle is stuck to, if it is.
    pub fn contact(&self) -> Option<Wall> {
        match self.contact {
            Contact::Stuck(wall) => Some(wall),
            Contact::Free | Contact::Released(_) => None,
        }
    }

    /// What has been counted since the start.
    pub fn tally(&self) -> &Tally {
        &self.tally
    }

    /// Mechanical energy, J: of both masses' motion, and of the spring between the primary mass and a base at
    /// `displacement`, m.
    pub fn energy(&self, displacement: f64) -> f64 {
        let p = &self.parameters;
        let stretch = self.primary.0 - displacement;
        0.5 * (p.primary_mass * self.primary.1 * self.primary.1
            + p.particle_mass * self.particle_velocity * self.particle_velocity
            + p.stiffness * stretch * stretch)
    }
}

/// Time within an advance, summed without losing digits to its length.
struct Clock {
    duration: f64,
    elapsed: f64,
    /// What rounding has kept out of `elapsed`.
    missed: f64,
}

impl Clock {
    fn new(duration: f64) -> Self {
        Self {
            duration,
            elapsed: 0.0,
            missed: 0.0,
        }
    }

    fn now(&self) -> f64 {
        self.elapsed
    }

    fn left(&self) -> f64 {
        (self.duration - self.elapsed) - self.missed
    }

    fn pass(&mut self, t: f64) {
        let (sum, missed) = two_sum(self.elapsed, t);
        self.elapsed = sum;
        self.missed += missed;
    }
}
