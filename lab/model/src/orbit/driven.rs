//! A simulated motion between the events of its plant, and a small disturbance along it (docs/theory.md, eq. 25): what the events do
//! not contain. The plant runs through long steps, which cost it less than short ones.
//!
//! Between impacts a disturbance obeys the free equations whatever the motion is. Only an impact needs the motion itself: its
//! relative velocity, and the jump of the velocity and acceleration of the primary mass.

use lovines::{Event, State, Wall};
use nalgebra::{Complex, Matrix2, Vector2};

use super::oscillator::Oscillator;
use crate::Dimensionless;

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

    /// Steady (q1, q1', q1'') at a phase of the base.
    fn steady(&self, phase: f64) -> (Vector2<f64>, f64) {
        let z = self.steady * Complex::from_polar(1.0, phase);
        (Vector2::new(z.im, self.omega * z.re), -self.omega * self.omega * z.im)
    }
}

/// A motion just after an event.
#[derive(Debug, Clone, Copy)]
pub struct Moment {
    /// Phase of the base, rad.
    pub(crate) phase: f64,
    /// (q1, q1') less the steady response.
    free: Vector2<f64>,
    /// (q2, q2') at the event.
    particle: [f64; 2],
    /// The wall on which the particle rests, as the sign of w; 0 if it flies.
    wall: f64,
}

/// A motion that follows the events of a plant.
#[derive(Debug, Clone)]
pub struct Driven {
    modes: [Mode; 2],
    epsilon: f64,
    r: f64,
    zeta: f64,
    now: Moment,
    /// The disturbance of (q1, q1') and (q2, q2').
    primary: Vector2<f64>,
    particle: Vector2<f64>,
}

impl Driven {
    /// The motion of a plant of `scene` at rest, at the frequency `omega` over omega0, with a disturbance of all four variables.
    #[must_use]
    pub fn new(scene: &Dimensionless, omega: f64) -> Self {
        Self {
            modes: [1.0, (1.0 + scene.epsilon).sqrt()].map(|slow| Mode::new(scene, omega, slow)),
            epsilon: scene.epsilon,
            r: scene.r,
            zeta: scene.epsilon * scene.lambda / 2.0,
            now: Moment {
                phase: 0.0,
                free: Vector2::zeros(),
                particle: [0.0; 2],
                wall: 0.0,
            },
            primary: Vector2::new(0.5, 0.5),
            particle: Vector2::new(0.5, -0.5),
        }
    }

    /// The motion goes on from this state of the plant where the base has the phase `phase`, rad. The disturbance stays.
    pub fn begin(&mut self, phase: f64, state: State, wall: Option<Wall>) -> Moment {
        let wall = wall.map_or(0.0, Wall::sign);
        self.now = Moment {
            phase,
            free: Vector2::new(state.q1, state.dq1) - self.mode(wall).steady(phase).0,
            particle: [state.q2, state.dq2],
            wall,
        };
        self.now
    }

    /// Passes an event; [`Self::flow`] has led to it.
    pub fn jump(&mut self, event: &Event) -> Moment {
        let phase = self.now.phase;
        let (steady, acceleration) = self.mode(self.now.wall).steady(phase);
        let motion = self.now.free + steady;
        match *event {
            Event::Impact { wall, velocity, .. } => {
                let particle = (1.0 + self.r) / (1.0 + self.epsilon);
                let free = self.modes[0]
                    .oscillator
                    .free_acceleration(self.now.free[0], self.now.free[1]);
                self.disturbed_impact(velocity, free + acceleration);
                self.now.particle = [motion[0] - wall.sign(), motion[1] - velocity + particle * velocity];
                self.now.free[1] -= self.epsilon * particle * velocity;
            }
            // A disturbed motion sticks a little earlier or later, with other velocities until then; only the common centre of mass
            // has no jump.
            Event::Stuck { wall, .. } => {
                self.now.wall = wall.sign();
                self.now.free = motion - self.modes[1].steady(phase).0;
                self.primary = (self.primary + self.particle * self.epsilon) / (1.0 + self.epsilon);
                self.particle = self.primary;
            }
            // The relative acceleration is zero there.
            Event::Released { wall, .. } => {
                self.now.wall = 0.0;
                self.now.free = motion - self.modes[0].steady(phase).0;
                self.now.particle = [motion[0] - wall.sign(), motion[1]];
            }
        }
        self.now
    }

    /// The natural logarithm of the growth of the disturbance since the last call.
    pub fn growth(&mut self) -> f64 {
        let size = self.primary.norm().hypot(self.particle.norm());
        self.primary /= size;
        self.particle /= size;
        size.ln()
    }

    /// (q1, q1', q2, q2') where the base has the phase `phase`, rad, if nothing happens between `from` and then.
    #[must_use]
    pub fn state(&self, from: &Moment, phase: f64) -> [f64; 4] {
        let (mode, t) = (self.mode(from.wall), self.elapsed(from, phase));
        let [q1, dq1] = (mode.propagator(t) * from.free + mode.steady(phase).0).into();
        let [q2, dq2] = from.particle;
        if from.wall == 0.0 {
            [q1, dq1, q2 + dq2 * t, dq2]
        } else {
            [q1, dq1, q1 - from.wall, dq1]
        }
    }

    /// Bound of `|q1|` from (q1, q1') at the phase `phase` on, without impacts.
    #[must_use]
    pub fn reach(&self, phase: f64, state: [f64; 2]) -> f64 {
        let mode = &self.modes[0];
        (Vector2::from(state) - mode.steady(phase).0).norm() + mode.steady.norm()
    }

    fn mode(&self, wall: f64) -> &Mode {
        &self.modes[usize::from(wall != 0.0)]
    }

    fn elapsed(&self, from: &Moment, phase: f64) -> f64 {
        (phase - from.phase) / self.modes[0].omega
    }

    /// Moves motion and disturbance on to where the base has the phase `phase`, rad; there is no event before.
    pub fn flow(&mut self, phase: f64) {
        let t = self.elapsed(&self.now, phase);
        let stuck = self.now.wall != 0.0;
        let propagator = self.mode(self.now.wall).propagator(t);
        self.primary = propagator * self.primary;
        if stuck {
            self.particle = self.primary;
        } else {
            self.particle[0] += self.particle[1] * t;
            self.now.particle[0] += self.now.particle[1] * t;
        }
        self.now.free = propagator * self.now.free;
        self.now.phase = phase;
    }

    /// The disturbance passes an impact with the relative velocity `dw` before it, where the relative acceleration is `ddw`.
    fn disturbed_impact(&mut self, dw: f64, ddw: f64) {
        // The disturbed motion reaches the wall later by this.
        let later = -(self.primary[0] - self.particle[0]) / dw;
        let change = self.primary[1] - self.particle[1] + ddw * later;
        let particle = (1.0 + self.r) / (1.0 + self.epsilon);
        let impulse = -self.epsilon * particle;
        self.primary += Vector2::new(-impulse * dw * later, impulse * (change + 2.0 * self.zeta * dw * later));
        self.particle += Vector2::new(-particle * dw * later, particle * change);
    }
}
