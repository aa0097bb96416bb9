//! An event-detecting simulation that shares no code with the plant: one step from any of its states.
//!
//! It sums the Taylor series of the equation of motion over short panels, and finds contacts and releases as roots of its polynomials
//! in Bernstein form (Descartes' rule of signs). Displacements and velocities at the start alone decide whether the particle rests.

use crate::scenes::Scene;
use lovines::{Drive, Plant, Wall};

/// Degree of the polynomials, and length of a panel in units of the fastest rate's time: the first term left out is below 1e-19.
const DEGREE: usize = 14;
const PANEL: f64 = 0.25;
/// An impact of a particle that lifts off by less than this, in half-widths, and will come to rest within the sample, ends in rest.
const LOWEST_HOP: f64 = 1e-16;
/// The simulation gives up a sample with more impacts.
const MOST_IMPACTS: u32 = 20_000;

type Polynomial = [f64; DEGREE + 1];

/// How the particle is kept from the walls, or held, at the start of a panel.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Hold {
    Flying,
    /// On its way off a wall, from which its distance grows as this power of the time.
    Leaving(Wall, usize),
    Stuck(Wall),
}

/// The simulation: one sample.
#[derive(Clone, Debug)]
pub struct Simulation<'a> {
    scene: &'a Scene,
    drive: Drive,
    phase: f64,
    /// Displacement and velocity of the primary mass, and of the primary mass relative to the particle.
    x: [f64; 2],
    w: [f64; 2],
    hold: Hold,
    impacts: u32,
}

impl<'a> Simulation<'a> {
    /// The state of the plant, and a new drive. `change` is added to it, relative.
    pub fn new(scene: &'a Scene, plant: &Plant, drive: Drive, change: f64) -> Self {
        let (s, up) = (plant.state(), 1.0 + change);
        let phase = plant.base().phase.radians();
        let before = plant.base().drive;
        let jump = (drive.signal[0] - before.signal[0]) + (drive.amplitude - before.amplitude) * phase.sin();
        let kick = scene.parameters.damping / scene.parameters.primary_mass * jump * up;
        let (w, b) = (plant.relative_displacement(), scene.parameters.half_width);
        let w = if w.abs() < b { (w * up).clamp(-b, b) } else { w };
        let mut simulation = Self {
            scene,
            drive: Drive { signal: drive.signal.map(|u| u * up), ..drive },
            phase,
            x: [s.q1, s.dq1 * up + kick],
            w: [w, plant.relative_velocity() * up + kick],
            hold: Hold::Flying,
            impacts: 0,
        };
        if w.abs() >= b {
            simulation.touch(if w > 0.0 { Wall::Plus } else { Wall::Minus }, f64::INFINITY);
        }
        simulation
    }

    /// Taylor coefficients of the base displacement from now on.
    fn base(&self) -> Polynomial {
        let mut base = [0.0; DEGREE + 1];
        base[..4].copy_from_slice(&self.drive.signal);
        let (mut sin, mut cos) = self.phase.sin_cos();
        let mut scale = self.drive.amplitude;
        for (n, b) in base.iter_mut().enumerate() {
            *b += scale * sin;
            (sin, cos) = (cos, -sin);
            scale *= self.drive.omega / (n as f64 + 1.0);
        }
        base
    }

    /// Taylor coefficients of the displacement of a mass (kg) on the spring and damper.
    fn motion(&self, mass: f64) -> Polynomial {
        let p = &self.scene.parameters;
        let base = self.base();
        let mut x = [0.0; DEGREE + 1];
        [x[0], x[1]] = self.x;
        for n in 0..DEGREE - 1 {
            let k = n as f64 + 1.0;
            let force = p.stiffness * (base[n] - x[n]) + p.damping * k * (base[n + 1] - x[n + 1]);
            x[n + 2] = force / (mass * k * (k + 1.0));
        }
        x
    }

    fn mass(&self) -> f64 {
        let p = &self.scene.parameters;
        match self.hold {
            Hold::Stuck(_) => p.primary_mass + p.particle_mass,
            _ => p.primary_mass,
        }
    }

    /// The acceleration of `wall` towards the particle, and its rounding error, m/s².
    pub fn pressing(&self, wall: Wall) -> (f64, f64) {
        let p = &self.scene.parameters;
        let (x, base) = (self.motion(p.primary_mass), self.base());
        let [u0, u1, ..] = self.drive.signal;
        let (a, omega) = (self.drive.amplitude, self.drive.omega);
        let terms = p.stiffness * (x[0].abs() + base[0].abs() + u0.abs() + a)
            + p.damping * (x[1].abs() + base[1].abs() + u1.abs() + (a * omega).abs());
        (wall.sign() * 2.0 * x[2], 16.0 * f64::EPSILON * terms / p.primary_mass)
    }

    /// The particle is at `wall`, with the given time left, s.
    fn touch(&mut self, wall: Wall, left: f64) {
        let p = &self.scene.parameters;
        self.w[0] = wall.sign() * p.half_width;
        let fraction = p.particle_mass / (p.primary_mass + p.particle_mass);
        if wall.sign() * self.w[1] > 0.0 {
            self.x[1] -= (1.0 + p.restitution) * fraction * self.w[1];
            self.w[1] *= -p.restitution;
            self.impacts += 1;
        }
        let (pressing, error) = self.pressing(wall);
        let speed = self.w[1].abs();
        let rests = if speed == 0.0 {
            pressing >= -error
        } else {
            pressing > 0.0
                && 0.5 * speed * speed <= LOWEST_HOP * p.half_width * pressing
                && 2.0 * speed <= left * pressing * (1.0 - p.restitution)
        };
        self.hold = match (rests, speed) {
            (true, _) => {
                self.x[1] -= fraction * self.w[1];
                self.w[1] = 0.0;
                Hold::Stuck(wall)
            }
            (false, 0.0) => Hold::Leaving(wall, 2),
            (false, _) => Hold::Leaving(wall, 1),
        };
    }

    /// Follows the motion for the given time, s; returns `None` if there are too many impacts.
    pub fn run(mut self, duration: f64) -> Option<Self> {
        let p = self.scene.parameters;
        let panel = PANEL / p.fastest_rate().max(self.drive.omega.abs());
        let mut left = duration;
        while left > 0.0 {
            let h = panel.min(left);
            let x = self.motion(self.mass());
            let (event, t) = match self.hold {
                Hold::Stuck(wall) => {
                    // The second derivative of the joint motion.
                    let mut push: Polynomial = std::array::from_fn(|n| {
                        let k = n as f64;
                        x.get(n + 2).map_or(0.0, |c| wall.sign() * (k + 1.0) * (k + 2.0) * c)
                    });
                    push[0] += self.pressing(wall).1;
                    first_root(&push, h).map_or((None, h), |t| (Some(wall), t))
                }
                hold => {
                    let gaps = Wall::BOTH.map(|wall| {
                        let mut gap = x.map(|c| -wall.sign() * c);
                        (gap[0], gap[1]) = (p.half_width - wall.sign() * self.w[0], -wall.sign() * self.w[1]);
                        match hold {
                            // The distance from that wall is 0 now: its other zeros count.
                            Hold::Leaving(from, power) if from == wall => {
                                gap.rotate_left(power);
                                gap[DEGREE + 1 - power..].fill(0.0);
                            }
                            _ => {}
                        }
                        first_root(&gap, h).map_or((None, h), |t| (Some(wall), t))
                    });
                    gaps[usize::from(gaps[0].1 >= gaps[1].1 && gaps[1].0.is_some())]
                }
            };
            self.go(&x, t);
            left -= t;
            match (event, self.hold) {
                (None, Hold::Leaving(..)) => self.hold = Hold::Flying,
                (None, _) => {}
                // A push that has fallen to 0: the distance grows as the third power of the time. One that was below 0: as the second.
                (Some(wall), Hold::Stuck(_)) => self.hold = Hold::Leaving(wall, if t > 0.0 { 3 } else { 2 }),
                (Some(wall), _) => self.touch(wall, left),
            }
            if self.impacts > MOST_IMPACTS {
                return None;
            }
        }
        Some(self)
    }

    /// Moves on by `t` seconds along the motion of the primary mass.
    fn go(&mut self, x: &Polynomial, t: f64) {
        // What the motion departs from its tangent.
        let (mut dx, mut dv) = (0.0, 0.0);
        for n in (2..=DEGREE).rev() {
            dx = dx * t + x[n];
            dv = dv * t + n as f64 * x[n];
        }
        (dx, dv) = (dx * t * t, dv * t);
        if !matches!(self.hold, Hold::Stuck(_)) {
            self.w = [self.w[0] + (self.w[1] * t + dx), self.w[1] + dv];
        }
        self.x = [self.x[0] + (self.x[1] * t + dx), self.x[1] + dv];
        let [u0, u1, u2, u3] = self.drive.signal;
        self.drive.signal = [
            u0 + t * (u1 + t * (u2 + t * u3)),
            u1 + t * (2.0 * u2 + t * 3.0 * u3),
            u2 + 3.0 * t * u3,
            u3,
        ];
        self.phase += self.drive.omega * t;
    }

    /// Displacement and velocity of the primary mass, relative displacement and velocity.
    pub fn result(&self) -> [f64; 4] {
        let ([x, dx], [w, dw]) = (self.x, self.w);
        [x, dx, w, dw]
    }
}

/// The first zero in `[0, h]` of a polynomial in the time.
fn first_root(polynomial: &Polynomial, h: f64) -> Option<f64> {
    // Bernstein coefficients on [0, h]: b_j = sum_i binomial(j, i)/binomial(DEGREE, i) c_i h^i.
    let mut scaled = *polynomial;
    let mut power = 1.0;
    for (n, c) in scaled.iter_mut().enumerate() {
        *c *= power;
        power *= h * (n as f64 + 1.0) / (DEGREE - n).max(1) as f64;
    }
    let mut bernstein = [0.0; DEGREE + 1];
    for (j, b) in bernstein.iter_mut().enumerate() {
        let mut binomial = 1.0;
        for (i, c) in scaled.iter().enumerate().take(j + 1) {
            *b += binomial * c;
            binomial *= (j - i) as f64 / (i as f64 + 1.0);
        }
    }
    root_within(&bernstein, 0.0, h, 60)
}

/// The first zero between `from` and `from + length`, by halving: none where no coefficient changes its sign.
fn root_within(bernstein: &Polynomial, from: f64, length: f64, halvings: u32) -> Option<f64> {
    if bernstein[0] < 0.0 {
        return Some(from);
    }
    if bernstein.iter().all(|b| *b >= 0.0) {
        return None;
    }
    if halvings == 0 {
        return Some(from);
    }
    // De Casteljau's algorithm.
    let (mut left, mut right) = (*bernstein, *bernstein);
    for (round, corner) in left.iter_mut().enumerate().skip(1) {
        for n in 0..=DEGREE - round {
            right[n] = 0.5 * (right[n] + right[n + 1]);
        }
        *corner = right[0];
    }
    let half = 0.5 * length;
    root_within(&left, from, half, halvings - 1).or_else(|| root_within(&right, from + half, half, halvings - 1))
}
