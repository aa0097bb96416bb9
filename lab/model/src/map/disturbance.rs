//! A simulated motion between the events of its plant, and a small disturbance along it (docs/theory.md, eq. 25): what the events do
//! not contain. The plant runs through long steps, which cost it less than short ones.
//!
//! An impact is where the particle's straight flight has ended, and the primary mass is a half-width away: an event and the state
//! before it give the state after it. Between impacts a disturbance obeys the free equations whatever the motion is. Only an impact
//! needs the motion itself: its relative velocity, and the acceleration of the primary mass.

use std::f64::consts::TAU;

use lovines::{Event, State, Wall};
use nalgebra::{Complex, Matrix2, Vector2};

use crate::Dimensionless;
use crate::orbit::oscillator::{Oscillator, rough_sin_cos};

/// The primary mass, alone or with the particle on its wall, and its steady response to the base.
#[derive(Debug, Clone, Copy)]
struct Mode {
    oscillator: Oscillator,
    /// Time is slower by this factor: the root of 1 + epsilon if both masses move as one.
    slow: f64,
    omega: f64,
    steady: Complex<f64>,
}

impl Mode {
    fn new(scene: &Dimensionless, omega: f64, slow: f64) -> Self {
        let zeta = scene.epsilon * scene.lambda / 2.0;
        let oscillator = Oscillator::new(zeta / slow);
        let force = Oscillator::new(zeta).base_force(omega) * (scene.epsilon * scene.g);
        // Without excitation the response is zero, even at an undamped resonance.
        let steady = if scene.g == 0.0 {
            Complex::default()
        } else {
            oscillator.compliance(omega * slow) * force
        };
        Self { oscillator, slow, omega, steady }
    }

    fn propagator(&self, t: f64) -> Matrix2<f64> {
        let mut matrix = self.oscillator.propagator(t / self.slow);
        matrix[(0, 1)] *= self.slow;
        matrix[(1, 0)] /= self.slow;
        matrix
    }

    /// Steady (q1, q1') at a phase of the base.
    fn steady(&self, phase: f64) -> Vector2<f64> {
        let z = self.steady * Complex::from_polar(1.0, phase);
        Vector2::new(z.im, self.omega * z.re)
    }
}

/// A motion just after an event.
#[derive(Debug, Clone, Copy)]
pub struct Moment {
    /// Phase of the base, rad.
    pub(crate) phase: f64,
    /// (q1, q1') and (q2, q2').
    primary: Vector2<f64>,
    particle: Vector2<f64>,
    /// The wall on which the particle rests, as the sign of w; 0 if it flies.
    wall: f64,
    /// Relative velocity before the impact; 0 if there was none.
    velocity: f64,
    /// The particle has rested since the state was that of the plant.
    rested: bool,
}

/// Relative velocity over b omega0 from which on a disturbance passes an impact without loss of digits.
const FAST: f64 = 1e-3;

impl Moment {
    fn is_fast(&self) -> bool {
        self.velocity.abs() > FAST
    }
}

/// The equations of a motion that is known from the events of a plant.
#[derive(Debug, Clone)]
pub struct Driven {
    modes: [Mode; 2],
    epsilon: f64,
    /// Jump of the particle's velocity over the relative velocity before an impact.
    kick: f64,
    zeta: f64,
    force: Complex<f64>,
}

impl Driven {
    /// The motion of a plant of `scene` at the frequency `omega` over omega0.
    pub fn new(scene: &Dimensionless, omega: f64) -> Self {
        let zeta = scene.epsilon * scene.lambda / 2.0;
        Self {
            modes: [1.0, (1.0 + scene.epsilon).sqrt()].map(|slow| Mode::new(scene, omega, slow)),
            epsilon: scene.epsilon,
            kick: (1.0 + scene.r) / (1.0 + scene.epsilon),
            zeta,
            force: Oscillator::new(zeta).base_force(omega) * (scene.epsilon * scene.g),
        }
    }

    /// The motion in this state of the plant where the base has the phase `phase`, rad.
    pub fn moment(&self, phase: f64, state: State, wall: Option<Wall>) -> Moment {
        Moment {
            phase,
            primary: Vector2::new(state.q1, state.dq1),
            particle: Vector2::new(state.q2, state.dq2),
            wall: wall.map_or(0.0, Wall::sign),
            velocity: 0.0,
            rested: wall.is_some(),
        }
    }

    /// The motion after an event at the phase `phase`, which is the first after `from`.
    pub fn after(&self, from: &Moment, phase: f64, event: &Event) -> Moment {
        match *event {
            Event::Impact { wall, velocity, .. } => {
                let [mut q2, mut dq2] = from.particle.into();
                q2 += dq2 * self.elapsed(from, phase);
                if from.rested {
                    // Errors of the particle would grow from rest to rest; those of the primary mass do not.
                    let [q1, dq1, ..] = self.state(from, phase);
                    [q2, dq2] = [q1 - wall.sign(), dq1 - velocity];
                }
                let kick = self.kick * velocity;
                Moment {
                    phase,
                    primary: Vector2::new(q2 + wall.sign(), dq2 + velocity - self.epsilon * kick),
                    particle: Vector2::new(q2, dq2 + kick),
                    wall: 0.0,
                    velocity,
                    rested: from.rested,
                }
            }
            Event::Stuck { wall, .. } => {
                let [q1, dq1, q2, dq2] = self.state(from, phase);
                let both = (dq1 + self.epsilon * dq2) / (1.0 + self.epsilon);
                self.moment(phase, State { q1, dq1: both, q2, dq2: both }, Some(wall))
            }
            Event::Released { .. } => {
                let [q1, dq1, q2, dq2] = self.state(from, phase);
                let moment = self.moment(phase, State { q1, dq1, q2, dq2 }, None);
                Moment { rested: true, ..moment }
            }
            Event::Sticking { .. } | Event::Slip { .. } | Event::Reversal { .. } => {
                unreachable!("the ideal cavity has no friction")
            }
        }
    }

    /// (q1, q1', q2, q2') where the base has the phase `phase`, rad, if nothing happens between `from` and then.
    pub fn state(&self, from: &Moment, phase: f64) -> [f64; 4] {
        let (mode, t) = (self.mode(from.wall), self.elapsed(from, phase));
        let free = from.primary - mode.steady(from.phase);
        let [q1, dq1] = (mode.propagator(t) * free + mode.steady(phase)).into();
        let [q2, dq2] = from.particle.into();
        if from.wall == 0.0 {
            [q1, dq1, q2 + dq2 * t, dq2]
        } else {
            [q1, dq1, q1 - from.wall, dq1]
        }
    }

    /// Bound of `|q1|` from (q1, q1') at the phase `phase` on, without impacts.
    pub fn reach(&self, phase: f64, state: [f64; 2]) -> f64 {
        let mode = &self.modes[0];
        (Vector2::from(state) - mode.steady(phase)).norm() + mode.steady.norm()
    }

    fn mode(&self, wall: f64) -> &Mode {
        &self.modes[usize::from(wall != 0.0)]
    }

    fn elapsed(&self, from: &Moment, phase: f64) -> f64 {
        (phase - from.phase) / self.modes[0].omega
    }

    /// Acceleration of the primary mass just before an impact.
    fn acceleration(&self, impact: &Moment) -> f64 {
        let before = impact.primary[1] + self.epsilon * self.kick * impact.velocity;
        let angle = impact.phase - TAU * (impact.phase / TAU).trunc();
        let (sine, cosine) = if impact.is_fast() {
            rough_sin_cos(angle)
        } else {
            angle.sin_cos()
        };
        let force = self.force.re * sine + self.force.im * cosine;
        force + self.modes[0].oscillator.free_acceleration(impact.primary[0], before)
    }
}

/// A small disturbance of (q1, q1') and (q2, q2') along a motion. Its growth over a period needs three digits: it is followed with
/// functions of single precision.
#[derive(Debug, Clone, Copy)]
pub struct Disturbance {
    primary: Vector2<f64>,
    particle: Vector2<f64>,
}

impl Default for Disturbance {
    fn default() -> Self {
        Self {
            primary: Vector2::new(0.5, 0.5),
            particle: Vector2::new(0.5, -0.5),
        }
    }
}

impl Disturbance {
    /// Moves on from `from` to just before the next event, `to`.
    pub fn flow(&mut self, driven: &Driven, from: &Moment, to: &Moment) {
        let t = driven.elapsed(from, to.phase);
        let mode = driven.mode(from.wall);
        let propagator = if to.is_fast() && from.wall == 0.0 {
            mode.oscillator.rough_propagator(t)
        } else {
            mode.propagator(t)
        };
        self.primary = propagator * self.primary;
        if from.wall == 0.0 {
            self.particle[0] += self.particle[1] * t;
        } else {
            self.particle = self.primary;
        }
    }

    /// Passes an event.
    pub fn jump(&mut self, driven: &Driven, event: &Moment) {
        let epsilon = driven.epsilon;
        if event.wall != 0.0 {
            // A disturbed motion sticks a little earlier or later, with other velocities until then; only the common centre of mass
            // has no jump.
            self.primary = (self.primary + self.particle * epsilon) / (1.0 + epsilon);
            self.particle = self.primary;
        } else if event.velocity != 0.0 {
            // The disturbed motion reaches the wall later by this.
            let later = (self.particle[0] - self.primary[0]) / event.velocity;
            let shift = event.velocity * later;
            let change = self.primary[1] - self.particle[1] + driven.acceleration(event) * later;
            let (particle, impulse) = (driven.kick, -epsilon * driven.kick);
            self.primary += Vector2::new(-impulse * shift, impulse * (change + 2.0 * driven.zeta * shift));
            self.particle += Vector2::new(-particle * shift, particle * change);
        }
    }

    /// The natural logarithm of the growth since the last call.
    pub fn growth(&mut self) -> f64 {
        let size = (self.primary.norm_squared() + self.particle.norm_squared()).sqrt();
        self.primary /= size;
        self.particle /= size;
        size.ln()
    }
}
