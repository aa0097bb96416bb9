//! The plant: linear oscillator, particle and walls, advanced from event to event in closed form.
//!
//! `advance` holds the loop over events. What comes next is either found by the plain solver, a certified search along one
//! [`crate::segment::Segment`], or predicted and verified by the fast path (`crate::fast`).

use crate::arithmetic::{Sum, Sums};
use crate::base_motion::{BaseMotion, Drive};
use crate::contact::{Touch, Wall};
use crate::fast::{FastPath, Predictions};
use crate::parameters::{InvalidValue, Parameters};
use crate::primary::{Primary, Single};
pub use crate::system::Contact;
use crate::system::{Masses, Moving, System};

/// Largest number of impacts per step.
pub const MOST_IMPACTS: u64 = 10_000_000;
/// Largest number of releases and reversals per step: rounding can tear a particle off its wall again and again where values are extreme, and on a
/// tilted floor each hop of a particle that loses little at its wall has a reversal.
pub const MOST_RELEASES: u64 = 2_000_000;
/// Largest number of evaluations of the motion per step: bounds the work of any input. [`MOST_IMPACTS`] impacts need fewer.
pub const MOST_EVALUATIONS: u64 = 500_000_000;

/// The plant. Its coefficients follow from the parameters; its state is what [`Plant::save`] saves, 0.6 kB; the rest of its 8 kB is a
/// workspace.
///
/// Its primary structure is one oscillator, or a [`crate::Structure`].
#[derive(Clone, Copy, Debug)]
pub struct Plant<P = Single> {
    pub(crate) primary: P,
    pub(crate) moving: Moving,
    pub(crate) status: Status,
    pub(crate) fast: FastPath,
}

/// State beside what moves.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Status {
    /// What the particle is at rest on.
    pub contact: Option<Contact>,
    /// Whether the base has a position: the first drive sets it, later ones may make it jump.
    pub begun: bool,
    pub time: f64,
    pub totals: Totals,
}

impl Plant {
    /// A plant at `start`.
    ///
    /// # Errors
    /// Invalid parameters, a state that is not finite, a particle outside its cavity.
    pub fn new(parameters: Parameters, start: State) -> Result<Self, InvalidValue> {
        parameters.validate()?;
        let system = System::from(parameters);
        Ok(Self {
            primary: Single,
            moving: Moving {
                system,
                masses: masses(&system, start)?,
                base: BaseMotion::default(),
            },
            status: Status::default(),
            fast: FastPath::new(&system),
        })
    }

    /// Sets displacements and velocities; contact is decided anew. Base, time and totals stay.
    ///
    /// # Errors
    /// A state that is not finite, a particle outside its cavity; the plant stays as it is.
    pub fn set_state(&mut self, state: State) -> Result<(), InvalidValue> {
        self.set_state_at_cavity(state)
    }
}

impl<P: Primary> Plant<P> {
    /// A plant that is at rest, with the particle in the middle of the cavity, without the fast path.
    pub(crate) fn of(primary: P, parameters: Parameters) -> Self {
        Self {
            primary,
            moving: Moving {
                system: System::from(parameters),
                masses: Masses::default(),
                base: BaseMotion::default(),
            },
            status: Status::default(),
            fast: FastPath::default(),
        }
    }

    /// Sets displacements and velocities at the cavity; contact is decided anew.
    pub(crate) fn set_state_at_cavity(&mut self, state: State) -> Result<(), InvalidValue> {
        self.moving.masses = masses(&self.moving.system, state)?;
        self.status.contact = None;
        self.fast.state_changed(&self.moving.base);
        Ok(())
    }
}

impl Plant {
    /// Switches the fast path on (default) or off. Without it every contact is found by the plain solver's certified search:
    /// the test oracle of the fast path.
    pub fn set_fast_path(&mut self, on: bool) {
        self.fast.state.disabled = !on;
        self.fast.choose(&self.moving.system);
    }

    /// Changes the parameters from now on; displacements, velocities and totals stay. A change of masses or half-width has
    /// no physical meaning here.
    ///
    /// # Errors
    /// Invalid parameters; the old ones stay.
    pub fn set_parameters(&mut self, parameters: Parameters) -> Result<(), InvalidValue> {
        parameters.validate()?;
        self.moving.system = System::from(parameters);
        self.fast.parameters_changed(&self.moving.base);
        self.fast.choose(&self.moving.system);
        Ok(())
    }

    /// Mechanical energy, J: of both masses' motion, of the spring between the primary mass and a base at `displacement`, m, and of the
    /// particle's weight on a tilted axis (0 at `q2 = 0`).
    pub fn energy(&self, displacement: f64) -> f64 {
        let p = &self.moving.system.parameters;
        let State { q1, dq1, q2, dq2 } = self.state();
        let stretch = q1 - displacement;
        0.5 * (p.primary_mass * dq1 * dq1 + p.particle_mass * dq2 * dq2 + p.stiffness * stretch * stretch)
            - p.particle_mass * self.moving.system.forces.gravity * q2
    }
}

impl<P: Primary> Plant<P> {
    /// Sets the base motion at the start: a drive that is set later is compared with it.
    ///
    /// # Errors
    /// An invalid drive.
    pub fn begin(&mut self, drive: Drive) -> Result<(), InvalidValue> {
        drive.validate()?;
        let before = self.base_displacement();
        self.moving.base.drive = drive;
        self.status.begun = true;
        self.fast.state_changed(&self.moving.base);
        self.primary.begin(self.base_displacement() - before);
        Ok(())
    }

    /// The parameters.
    pub fn parameters(&self) -> &Parameters {
        &self.moving.system.parameters
    }

    /// Time since the start, s, or as [`Self::set_time`] set it. Only impact times depend on it.
    pub fn time(&self) -> f64 {
        self.status.time
    }

    /// Sets the clock, s: impact times refer to it.
    pub fn set_time(&mut self, time: f64) {
        self.status.time = time;
    }

    /// Positions and velocities now.
    #[inline]
    pub fn state(&self) -> State {
        let masses = &self.moving.masses;
        let [q1, dq1] = masses.primary.values;
        State {
            q1,
            dq1,
            q2: q1 - self.relative_displacement(),
            dq2: masses.particle,
        }
    }

    /// Relative displacement `w = q1 - q2`, m.
    #[inline]
    pub fn relative_displacement(&self) -> f64 {
        let w = self.moving.masses.w.value();
        if self.moving.system.is_skewed {
            return skewed(w, &self.moving.system);
        }
        w
    }

    /// Relative velocity `w'`, m/s.
    #[inline]
    pub fn relative_velocity(&self) -> f64 {
        self.moving.masses.dw
    }

    /// `v = q1 + epsilon q2`, m: the displacement of the centre of mass times `1 + epsilon`.
    #[inline]
    pub fn centre(&self) -> f64 {
        let q1 = self.moving.masses.primary.values[0];
        q1 + self.moving.system.mass_ratio * (q1 - self.relative_displacement())
    }

    /// The base motion now: drive, and the phase of its oscillator.
    #[inline]
    pub fn base(&self) -> BaseMotion {
        self.moving.base
    }

    /// Displacement of the base now, m.
    #[inline]
    pub fn base_displacement(&self) -> f64 {
        self.moving.base.drive.signal[0] + self.moving.base.drive.amplitude * self.fast.state.phasor.1
    }

    /// The wall the particle is stuck to, if it is.
    pub fn contact(&self) -> Option<Wall> {
        self.status.contact.and_then(Contact::wall)
    }

    /// Whether the particle sticks to the floor inside the cavity.
    pub fn sticks(&self) -> bool {
        self.status.contact == Some(Contact::Floor)
    }

    /// Constant accelerations of the particle now, m/s²: by gravity along the axis, and by kinetic friction while it slides.
    pub fn constant_accelerations(&self) -> (f64, f64) {
        let forces = &self.moving.system.forces;
        let direction = if self.status.contact.is_some() {
            0.0
        } else {
            self.direction()
        };
        (forces.gravity, forces.kinetic * direction)
    }

    /// Totals since the start.
    pub fn totals(&self) -> &Totals {
        &self.status.totals
    }
}

/// `q1 - q2` for unequal gaps, m, `w` from the middle. On a wall the sum with the middle would miss the gap by its rounding.
#[cold]
#[inline(never)]
fn skewed(w: f64, system: &System) -> f64 {
    let [plus, minus] = system.parameters.gaps();
    if w >= system.half_width {
        plus
    } else if w <= -system.half_width {
        -minus
    } else {
        w + system.middle
    }
}

/// The masses at `start`, checked.
fn masses(system: &System, start: State) -> Result<Masses, InvalidValue> {
    let b = system.half_width;
    let finite = |name, value: f64, unit| {
        let allowed = "a finite number from -1e100 to 1e100";
        InvalidValue::unless(value.abs() <= 1e100, name, value, unit, allowed)
    };
    finite("q1 (displacement of the primary mass)", start.q1, "m")?;
    finite("der(q1) (velocity of the primary mass)", start.dq1, "m/s")?;
    finite("q2 (displacement of the particle)", start.q2, "m")?;
    finite("der(q2) (velocity of the particle)", start.dq2, "m/s")?;
    let w = (start.q1 - start.q2) - system.middle;
    // The difference of two displacements carries their rounding; a start on the wall means on the wall.
    let farthest = start.q1.abs().max(start.q2.abs());
    let slack = 4.0 * f64::EPSILON * (b + farthest);
    let on_wall = w.abs() >= b - f64::EPSILON * (2.0 * b + 0.5 * farthest);
    let name = "w = q1 - q2 (particle outside its cavity)";
    let allowed = "a number from -b_minus to b_plus, which are b unless set";
    InvalidValue::unless(w.abs() <= b + slack, name, w + system.middle, "m", allowed)?;
    Ok(Masses {
        primary: Sums { values: [start.q1, start.dq1], errors: [0.0; 2] },
        w: Sum::from(if on_wall { b.copysign(w) } else { w }),
        dw: start.dq1 - start.dq2,
        particle: start.dq2,
    })
}

// What a plant tells: state, events, totals

/// Positions (m) and velocities (m/s) of both masses.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
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

impl From<[f64; 4]> for State {
    fn from([q1, dq1, q2, dq2]: [f64; 4]) -> Self {
        Self { q1, dq1, q2, dq2 }
    }
}

impl From<State> for [f64; 4] {
    fn from(State { q1, dq1, q2, dq2 }: State) -> Self {
        [q1, dq1, q2, dq2]
    }
}

/// An event of a step; times are in seconds since the step began.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event {
    /// The particle hit a wall.
    Impact {
        /// When, s.
        t: f64,
        /// Which wall.
        wall: Wall,
        /// Relative velocity `w'` just before, m/s.
        velocity: f64,
    },
    /// The particle came to rest on a wall.
    Stuck {
        /// When, s.
        t: f64,
        /// Which wall.
        wall: Wall,
    },
    /// The particle came to rest on the floor inside the cavity, and sticks to it.
    Sticking {
        /// When, s.
        t: f64,
    },
    /// The force needed exceeded static friction: the particle slides again.
    Slip {
        /// When, s.
        t: f64,
        /// Sign of the relative velocity `w'` from now on.
        direction: f64,
    },
    /// The relative velocity `w'` changed its sign inside the cavity without sticking, and friction its direction.
    Reversal {
        /// When, s.
        t: f64,
        /// Sign of the relative velocity `w'` from now on.
        direction: f64,
    },
    /// The wall ceased to push and released the particle.
    Released {
        /// When, s.
        t: f64,
        /// Which wall.
        wall: Wall,
    },
}

impl Event {
    /// When the event happened, s after the step began.
    pub fn time(&self) -> f64 {
        match *self {
            Self::Impact { t, .. }
            | Self::Stuck { t, .. }
            | Self::Sticking { t }
            | Self::Slip { t, .. }
            | Self::Reversal { t, .. }
            | Self::Released { t, .. } => t,
        }
    }
}

/// The events of a step, counted, and how far the step came.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Outcome {
    /// Impacts followed one by one.
    pub impacts: u64,
    /// How often the particle came to rest on a wall.
    pub stuck: u64,
    /// How often a wall or the floor released it, and how often it turned round on the floor.
    pub released: u64,
    /// Time by which the plant advanced, s: less than the step where it was cut short.
    pub elapsed: f64,
    /// Whether the step ended early, at the largest number of impacts, releases or evaluations, or where an event ended it.
    pub cut_short: bool,
    /// Evaluations of the motion (closed form, propagator or series).
    pub evaluations: u64,
}

/// Totals since the start.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Totals {
    /// Impacts followed one by one. A chatter is followed until its hops can no longer be resolved.
    pub impacts: u64,
    /// Time of the last impact, s; 0 before the first.
    pub impact_time: f64,
    /// Relative velocity `w'` just before the last impact, m/s; 0 before the first.
    pub impact_velocity: f64,
    /// Energy dissipated by impacts, J.
    pub dissipated: f64,
    /// Energy dissipated by friction, J.
    pub friction: f64,
    /// How often the particle stuck to the floor inside the cavity.
    pub sticks: u64,
    /// How long it stuck there, s.
    pub stuck_time: f64,
}

impl Totals {
    /// Counts an impact, if `touch` is one, and what it dissipated.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn add(&mut self, touch: &Touch, time: f64) {
        if let Some(velocity) = touch.impact {
            self.impacts += 1;
            self.impact_time = time;
            self.impact_velocity = velocity;
        }
        self.dissipated += touch.dissipated;
    }
}

// Saving

/// The state of a plant and its parameters. The motion continues with the same bits, whatever workspace it continues in.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Saved<S = ()> {
    parameters: Parameters,
    masses: Masses,
    base: BaseMotion,
    status: Status,
    fast: Predictions,
    primary: S,
}

impl<P: Primary> Plant<P> {
    /// The plant without what can be computed again.
    pub fn save(&self) -> Saved<P::State> {
        let Moving { system, masses, base } = self.moving;
        let (parameters, fast) = (system.parameters, self.fast.save());
        let primary = self.primary.state();
        Saved { parameters, masses, base, status: self.status, fast, primary }
    }

    /// Makes this plant the one that was saved. One plant can take the place of many in turn: what it has computed for the last one is
    /// used again as far as it serves. A structure must be the same one.
    pub fn restore(&mut self, saved: &Saved<P::State>) {
        if self.moving.system.parameters != saved.parameters {
            let system = System::from(saved.parameters);
            if self.moving.system.free != system.free {
                self.fast = FastPath::default();
            }
            self.moving.system = system;
        }
        (self.moving.masses, self.moving.base, self.status) = (saved.masses, saved.base, saved.status);
        self.primary.restore(&saved.primary);
        self.fast.restore(&saved.fast, &self.moving.system);
    }
}

impl From<&Saved> for Plant {
    fn from(saved: &Saved) -> Self {
        let system = System::from(saved.parameters);
        let mut fast = FastPath::default();
        fast.restore(&saved.fast, &system);
        let Saved { masses, base, status, .. } = *saved;
        Self {
            primary: Single,
            moving: Moving { system, masses, base },
            status,
            fast,
        }
    }
}

impl From<Saved> for Plant {
    fn from(saved: Saved) -> Self {
        Self::from(&saved)
    }
}

#[cfg(feature = "serde")]
impl serde::Serialize for Plant {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.save().serialize(serializer)
    }
}

#[cfg(feature = "serde")]
impl<'de> serde::Deserialize<'de> for Plant {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Saved::deserialize(deserializer).map(|saved: Saved| Self::from(&saved))
    }
}

#[cfg(feature = "serde")]
#[cfg(test)]
mod tests {
    use crate::plant::Saved;
    use crate::{Cavity, Drive, Parameters, Plant, State};
    use proptest::prelude::*;

    /// A start near the 1:1 motion of the default rig.
    const LOCK: State = State { q1: -0.42, dq1: 0.01, q2: -0.99, dq2: -0.86 };

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        /// Steps of few lengths, so that all caches are used, under a drive that stays, changes or has a slope, in an ideal or a real cavity.
        #[test]
        fn a_workspace_dropped_at_any_time_changes_no_bit(
            steps in prop::collection::vec((0usize..5, any::<bool>()), 300),
            wobble in prop_oneof![Just(0.0), 1e-6..1e-2f64],
            slope in prop_oneof![3 => Just(0.0), 1 => 0.0..1e-3f64],
            g in 0.5..3.0f64,
            real in any::<bool>(),
            (mu, tilt, scatter) in (0.0..0.003f64, -0.002..0.002f64, 0.0..0.1f64),
        ) {
            let mut parameters = Parameters::dimensionless(0.0084, 1.43, 0.65);
            if real {
                parameters.cavity = Cavity { kinetic_friction: mu, tilt, scatter, ..Cavity::IDEAL };
            }
            let mut plant = Plant::new(parameters, LOCK).unwrap();
            let mut other = plant;
            let mut n = 0;
            for (length, drop) in steps {
                let step = [0.063, 0.3, 1.7, 6.3, 6.344][length];
                // Equal steps in a row, as masters make them.
                for _ in 0..3 {
                    n += 1;
                    let omega = 0.990_417 + wobble * f64::from(n % 7);
                    let drive = Drive { signal: [0.0, slope, 0.0, 0.0], ..Drive::harmonic(0.0084 * g, omega) };
                    if drop {
                        // All that is not state is lost on the way.
                        let saved = postcard::to_stdvec(&other).unwrap();
                        other = postcard::from_bytes(&saved).unwrap();
                    }
                    prop_assert_eq!(plant.advance(drive, step), other.advance(drive, step));
                    prop_assert_eq!(plant.state(), other.state(), "step {}", n);
                }
            }
            prop_assert!(plant.totals().impacts > 10);
            prop_assert_eq!(plant.totals(), other.totals());
        }
    }

    #[test]
    fn plants_that_take_turns_in_one_workspace_have_the_bits_of_plants_of_their_own() {
        let plant = |n: u32| {
            let parameters = Parameters::dimensionless(0.0084, 1.43 + f64::from(n / 4), 0.5 + 0.04 * f64::from(n));
            Plant::new(parameters, LOCK).unwrap()
        };
        let mut plants: Vec<Plant> = (0..12).map(plant).collect();
        let mut saved: Vec<Saved> = plants.iter().map(Plant::save).collect();
        let mut workspace = plants[0];
        for step in 0..400 {
            let duration = [0.063, 0.063, 0.063, 6.3, 1.7][step % 5];
            for (n, (plant, saved)) in plants.iter_mut().zip(&mut saved).enumerate() {
                let omega = 0.99 + 0.03 * (step / 50 * (n % 3)) as f64;
                let drive = Drive::harmonic(0.0084 * (1.0 + 0.2 * n as f64), omega);
                workspace.restore(saved);
                assert_eq!(plant.advance(drive, duration), workspace.advance(drive, duration));
                *saved = workspace.save();
                assert_eq!(plant.state(), workspace.state(), "plant {n}, step {step}");
            }
        }
        assert!(plants.iter().all(|plant| plant.totals().impacts > 10));
        assert!(size_of::<Saved>() <= 704, "{}", size_of::<Saved>());
    }

    #[test]
    fn a_state_that_was_set_has_the_bits_of_a_start_from_it() {
        let drive = Drive::held(0.0);
        let start = State { q1: 0.3, dq1: -0.4, q2: -0.7, dq2: 0.2 };
        let parameters = Parameters::dimensionless(0.0084, 1.43, 0.65);
        let mut plant = Plant::new(parameters, State { dq2: 0.5, ..State::default() }).unwrap();
        for step in [0.063, 6.3, 100.0] {
            plant.advance(drive, 50.0).unwrap();
            plant.set_state(start).unwrap();
            let mut other = Plant::new(parameters, start).unwrap();
            plant.advance(drive, step).unwrap();
            other.advance(drive, step).unwrap();
            assert_eq!(plant.state(), other.state());
        }
        let before = plant.state();
        assert!(plant.set_state(State { q1: 3.0, ..State::default() }).is_err());
        assert_eq!(plant.state(), before);
    }
}
