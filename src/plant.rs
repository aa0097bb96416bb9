//! The rig: linear oscillator, particle and walls, advanced from event to event in closed form.

#[cfg(feature = "batch")]
pub(crate) mod abreast;
mod advance;
mod contact;
mod course;
mod cross;
mod hop;
mod reading;
mod strides;
mod written;

use crate::base_motion::{BaseMotion, Drive};
use crate::crossing::Origin;
use crate::forcing::Forcing;
use crate::motion::Motion;
use crate::oscillator::Oscillator;
use crate::parameters::{InvalidValue, Parameters};
use crate::wall::{ImpactLaw, Wall};
use course::Course;
pub use reading::Reading;
use serde::{Deserialize, Serialize};
use written::Written;

/// A rebound that would lift the particle less than this fraction of the half-width off its wall cannot be told from
/// contact in double precision.
pub(crate) const UNRESOLVED: f64 = 1.0 / (1u64 << 56) as f64;

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
#[derive(Clone, Copy, Debug)]
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
#[serde(into = "Written", from = "Written")]
pub struct Plant {
    parameters: Parameters,
    mass_ratio: f64,
    law: ImpactLaw,
    /// The primary mass alone, and with the particle stuck to it.
    alone: Driven,
    joint: Driven,
    contact: Contact,
    /// The state when the flight under way began, or a little later: see [`Course`].
    here: Origin<f64>,
    base: BaseMotion,
    /// Whether the plant has advanced since its start: a drive set before that is where the base is, not a jump.
    under_way: bool,
    time: f64,
    tally: Tally,
    course: Course,
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
        let alone = Driven::new(parameters.primary_mass, &parameters);
        let joint = parameters.primary_mass + parameters.particle_mass;
        Ok(Self {
            parameters,
            mass_ratio: parameters.mass_ratio(),
            law: ImpactLaw::new(&parameters),
            joint: Driven::new(joint, &parameters),
            contact: Contact::Free,
            here: Origin {
                x: start.q1,
                v: start.dq1,
                w: w.clamp(-b, b),
                particle: start.dq2,
                turn: (1.0, 0.0),
            },
            base: BaseMotion::default(),
            under_way: false,
            time: 0.0,
            tally: Tally::default(),
            course: Course::new(&alone.oscillator, b),
            alone,
        })
    }

    /// Says where the base is at the start: what drives it from the first advance on is compared with this.
    pub fn begin(&mut self, drive: Drive) {
        self.base.drive = drive;
        self.under_way = true;
        self.renew_course();
    }

    /// Takes over other parameters from now on; displacements, velocities and counts stay. The masses and the half-width
    /// are meant to stay, too: nothing here says what their change would do.
    ///
    /// # Errors
    /// Parameters that make no sense; the old ones stay.
    pub fn retune(&mut self, parameters: Parameters) -> Result<(), InvalidValue> {
        parameters.validate()?;
        self.catch_up();
        let joint = parameters.primary_mass + parameters.particle_mass;
        self.mass_ratio = parameters.mass_ratio();
        self.law = ImpactLaw::new(&parameters);
        self.alone = Driven::new(parameters.primary_mass, &parameters);
        self.joint = Driven::new(joint, &parameters);
        self.parameters = parameters;
        self.course = Course::new(&self.alone.oscillator, parameters.half_width);
        self.renew_course();
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
    #[inline]
    pub fn state(&self) -> State {
        let now = self.now();
        State {
            q1: now.x,
            dq1: now.v,
            q2: now.x - now.w,
            dq2: now.particle,
        }
    }

    /// Relative displacement `w = q1 - q2`, m.
    pub fn relative_displacement(&self) -> f64 {
        self.now().w
    }

    /// Relative velocity `w'`, m/s.
    pub fn relative_velocity(&self) -> f64 {
        self.now().relative_velocity()
    }

    /// `v = q1 + epsilon q2`, m: the displacement of the centre of mass times `1 + epsilon`.
    #[inline]
    pub fn centre(&self) -> f64 {
        let now = self.now();
        now.x + self.mass_ratio * (now.x - now.w)
    }

    /// The base motion as it stands: drive, and the phase its oscillator has reached.
    pub fn base(&self) -> BaseMotion {
        BaseMotion {
            phase: self.course.phase(self.base.phase),
            ..self.base
        }
    }

    /// Displacement of the base now, m.
    #[inline]
    pub fn base_displacement(&self) -> f64 {
        if self.course.quick {
            self.base.drive.signal[0] + self.base.drive.amplitude * self.now().turn.1
        } else {
            self.base.displacement()
        }
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
        let now = self.now();
        let stretch = now.x - displacement;
        0.5 * (p.primary_mass * now.v * now.v
            + p.particle_mass * now.particle * now.particle
            + p.stiffness * stretch * stretch)
    }
}
