//! The derivative of the motion: how a neighbouring start, frequency or amplitude of the base changes the state later.
//!
//! Between events the motion is linear, and so is its derivative (the variational equation). At an event a neighbouring motion is a little
//! early or late, by `dt = -dh/h'` for the function `h` that is zero at the event. With the velocities and accelerations `f` before and
//! after, and the map `R` of the event, `after = DR (before + f_before dt) - f_after dt` (saltation; di Bernardo, Budd, Champneys and
//! Kowalczyk, Piecewise-smooth Dynamical Systems, section 2.5).
//!
//! The events are those that [`Plant::advance_with`] reports for the motion itself.

use crate::forcing::Forcing;
use crate::oscillator::Oscillator;
use crate::plant::{Event, Plant, State};
use crate::segment::{Derivatives, Motion, Segment};
use crate::system::{Contact, Moving};
use crate::{BaseMotion, Drive};

/// Number of parameters: the state at the start (q1, q1', q2, q2'), and angular frequency (rad/s) and amplitude (m) of the base.
pub const PARAMETERS: usize = 6;
/// Columns of the frequency and of the amplitude.
const OMEGA: usize = 4;
const AMPLITUDE: usize = 5;
/// Angle, rad, by which the central difference over the frequency turns the base: rounding and curvature then contribute 1e-10.
const ANGLE: f64 = 1e-5;

/// The derivative of one number by the parameters.
pub type Row = [f64; PARAMETERS];

/// A motion with its derivative, from a start on. It is led from event to event.
#[derive(Clone, Copy, Debug)]
pub struct Variation {
    moving: Moving,
    contact: Option<Contact>,
    /// Sign of `w'` while the particle slides.
    direction: f64,
    impacts: u64,
    /// Time since the start, s.
    elapsed: f64,
    /// Derivatives of q1, q1', q2 and q2'.
    by: [Row; 4],
}

impl Variation {
    /// The motion of a plant from now on, under its present drive: a harmonic one with a positive frequency, where derivatives by the
    /// drive are needed.
    pub fn of(plant: &Plant) -> Self {
        let unit = |n: usize| core::array::from_fn(|column| if column == n { 1.0 } else { 0.0 });
        Self {
            moving: plant.moving,
            contact: plant.status.contact,
            direction: plant.direction(),
            impacts: plant.status.totals.impacts,
            elapsed: 0.0,
            by: [0, 1, 2, 3].map(unit),
        }
    }

    /// Derivatives of q1, q1', q2 and q2' by the parameters.
    pub fn derivatives(&self) -> &[Row; 4] {
        &self.by
    }

    /// Velocity and acceleration of both masses: the derivative of the state by time.
    pub fn rates(&self) -> [f64; 4] {
        let [_, velocity, acceleration, ..] = self.primary();
        let particle = match self.contact {
            Some(_) => acceleration,
            None => self.pull(),
        };
        [velocity, acceleration, self.moving.masses.particle, particle]
    }

    /// Positions and velocities.
    pub fn state(&self) -> State {
        let masses = &self.moving.masses;
        let [q1, dq1] = masses.primary.values;
        let q2 = q1 - (masses.w.value() + self.moving.system.middle);
        State { q1, dq1, q2, dq2: masses.particle }
    }

    /// Whether the particle flies or slides with a constant acceleration.
    pub fn is_flight(&self) -> bool {
        self.contact.is_none()
    }

    /// Time since the start, s.
    pub fn elapsed(&self) -> f64 {
        self.elapsed
    }

    /// Acceleration of a particle that flies or slides, m/s².
    fn pull(&self) -> f64 {
        let system = &self.moving.system;
        system.forces.gravity + system.friction(self.direction)
    }

    /// The oscillator, and the base that moves it as base, gravity and friction do.
    fn oscillator(&self) -> (&Oscillator, BaseMotion) {
        let (system, base) = (&self.moving.system, self.moving.base);
        match self.contact {
            Some(_) => (&system.stuck, system.pushed(base, system.forces.gravity)),
            None => (&system.free, system.pushed(base, -system.friction(self.direction))),
        }
    }

    /// The primary mass and its derivatives by time.
    fn primary(&self) -> Derivatives {
        let (oscillator, base) = self.oscillator();
        Segment::new(oscillator, base, self.moving.masses.primary.values.into()).derivatives_at_start()
    }

    /// Moves on by `t` seconds, in which there is no event.
    pub fn advance(&mut self, t: f64) {
        let (oscillator, base) = self.oscillator();
        let free = oscillator.flow(t).0;
        let driven = driven(oscillator, &self.moving.base, self.elapsed, t);
        let segment = Segment::new(oscillator, base, self.moving.masses.primary.values.into());
        let [x, v, ..] = segment.derivatives(t);

        let [q1, dq1, q2, dq2] = self.by;
        let mut by = self.by;
        for n in 0..PARAMETERS {
            (by[0][n], by[1][n]) = free.of(q1[n], dq1[n]);
        }
        for (column, (x, v)) in [OMEGA, AMPLITUDE].into_iter().zip(driven) {
            by[0][column] += x;
            by[1][column] += v;
        }
        let masses = &mut self.moving.masses;
        let [x0, _] = masses.primary.values;
        let moved = if self.contact.is_some() {
            masses.particle = v;
            (by[2], by[3]) = (sum(&by[0], &difference(&q2, &q1)), by[1]);
            x - x0
        } else {
            let pull = self.moving.system.forces.gravity + self.moving.system.friction(self.direction);
            by[2] = sum(&q2, &dq2.map(|dq2| dq2 * t));
            let before = masses.particle;
            masses.particle += pull * t;
            0.5 * (before + masses.particle) * t
        };
        masses.w = masses.w.plus((x - x0) - moved);
        masses.primary.values = [x, v];
        masses.dw = v - masses.particle;
        self.by = by;
        self.moving.base = self.moving.base.after(t);
        self.elapsed += t;
    }

    /// Moves on to an event, and past it. `since` is the time of the start on the event's clock, s.
    pub fn pass(&mut self, event: &Event, since: f64) {
        self.advance((event.time() - since - self.elapsed).max(0.0));
        let [_, _, acceleration, jerk, ..] = self.primary();
        let before = self.rates();
        let [q1, dq1, q2, dq2] = self.by;
        // The derivative of the function that is zero at the event, and its rate.
        let (by, rate) = match *event {
            Event::Impact { wall, velocity, .. } => {
                let system = &self.moving.system;
                self.moving.masses.w = (wall.sign() * system.half_width).into();
                self.moving.masses.dw = velocity;
                (difference(&q1, &q2), velocity)
            }
            // The particle has lost its relative velocity in impacts that accumulate: there is no single instant.
            Event::Stuck { .. } => ([0.0; PARAMETERS], 1.0),
            Event::Sticking { .. } | Event::Reversal { .. } => (difference(&dq1, &dq2), acceleration - before[3]),
            // The acceleration of both masses reaches a limit.
            Event::Slip { .. } | Event::Released { .. } => (self.acceleration_by(), jerk),
        };
        let early = by.map(|by| if by == 0.0 { 0.0 } else { -by / rate });
        self.by = shifted(&self.by, &before, &early, 1.0);
        self.apply(event);
        self.by = shifted(&self.by, &self.rates(), &early, -1.0);
    }

    /// What an event does to the state and, at the instant of the event, to its derivative.
    fn apply(&mut self, event: &Event) {
        let system = self.moving.system;
        let masses = &mut self.moving.masses;
        let fraction = system.mass_ratio / (1.0 + system.mass_ratio);
        match *event {
            Event::Impact { wall, velocity, .. } => {
                let (r, slope) = system.rebound.with_slope(wall, velocity.abs(), self.impacts);
                self.impacts += 1;
                let kick = -fraction * (1.0 + r) * velocity;
                masses.primary.values[1] += kick;
                masses.dw = -r * velocity;
                masses.particle = masses.primary.values[1] - masses.dw;
                self.direction = if system.forces.holding > 0.0 { -wall.sign() } else { 0.0 };
                for n in 0..PARAMETERS {
                    let by = self.by[1][n] - self.by[3][n];
                    self.by[1][n] -= fraction * (1.0 + slope) * by;
                    self.by[3][n] = self.by[1][n] + slope * by;
                }
            }
            Event::Stuck { wall, .. } => {
                self.contact = Some(Contact::Wall(wall));
                masses.primary.values[1] -= fraction * masses.dw;
                // The walls' pushes keep the centre of mass.
                for n in 0..PARAMETERS {
                    let centre =
                        |one: usize, other: usize| self.by[one][n] + fraction * (self.by[other][n] - self.by[one][n]);
                    let [position, velocity] = [centre(0, 2), centre(1, 3)];
                    for (row, value) in [position, velocity, position, velocity].into_iter().enumerate() {
                        self.by[row][n] = value;
                    }
                }
            }
            Event::Sticking { .. } => self.contact = Some(Contact::Floor),
            Event::Slip { direction, .. } | Event::Reversal { direction, .. } => {
                (self.contact, self.direction) = (None, direction);
            }
            Event::Released { wall, .. } => {
                self.contact = None;
                self.direction = if system.forces.holding > 0.0 { -wall.sign() } else { 0.0 };
            }
        }
        if self.contact.is_some() || matches!(event, Event::Reversal { .. }) {
            let masses = &mut self.moving.masses;
            (masses.dw, masses.particle) = (0.0, masses.primary.values[1]);
        }
    }

    /// Derivative of the acceleration of both masses while they move as one.
    fn acceleration_by(&self) -> Row {
        let Oscillator { delta, omega0_squared, .. } = self.moving.system.stuck;
        let mut by: Row = core::array::from_fn(|n| -omega0_squared * self.by[0][n] - 2.0 * delta * self.by[1][n]);
        let BaseMotion { drive: Drive { omega, amplitude, .. }, phase } = self.moving.base;
        let (sin, cos) = libm::sincos(phase.radians());
        by[AMPLITUDE] += omega0_squared * sin + 2.0 * delta * omega * cos;
        let turned = self.elapsed * (omega0_squared * cos - 2.0 * delta * omega * sin) + 2.0 * delta * cos;
        by[OMEGA] += amplitude * turned;
        by
    }
}

/// Derivatives of the response to the base within `t` seconds, from rest, by frequency and by amplitude: position and velocity. The phase of the
/// base was fixed `elapsed` seconds before.
fn driven(oscillator: &Oscillator, base: &BaseMotion, elapsed: f64, t: f64) -> [(f64, f64); 2] {
    let Drive { omega, amplitude, .. } = base.drive;
    if t == 0.0 || omega == 0.0 {
        return [(0.0, 0.0); 2];
    }
    let (sin, cos) = libm::sincos(base.phase.radians());
    let phasor = num_complex::Complex64::new(cos, sin);
    let (free, decayed) = oscillator.flow(t);
    let response = |omega: f64| {
        let response = Forcing::new(oscillator, omega).response(t, &free, decayed);
        [response.position, response.velocity].map(|z| z * phasor)
    };
    let [position, velocity] = response(omega);
    // The response is an entire function of the frequency, also at an undamped resonance, where a formula would divide by zero.
    let step = (ANGLE / t).min(0.5 * omega);
    let [above, below] = [response(omega + step), response(omega - step)];
    let slope = |n: usize, now: num_complex::Complex64| {
        amplitude * ((above[n] - below[n]).im / (2.0 * step) + elapsed * now.re)
    };
    [(slope(0, position), slope(1, velocity)), (position.im, velocity.im)]
}

fn sum(a: &Row, b: &Row) -> Row {
    core::array::from_fn(|n| a[n] + b[n])
}

fn difference(a: &Row, b: &Row) -> Row {
    core::array::from_fn(|n| a[n] - b[n])
}

/// The derivatives of a motion that is `early`, with the rates `rates` meanwhile.
fn shifted(by: &[Row; 4], rates: &[f64; 4], early: &Row, sign: f64) -> [Row; 4] {
    core::array::from_fn(|row| core::array::from_fn(|n| by[row][n] + sign * rates[row] * early[n]))
}
