//! Two solvers with fixed steps: the classical Runge-Kutta method, and Moreau's time-stepping.

use core::f64::consts::TAU;

use lovines::{Drive, Parameters, State};

use crate::method::{Failure, Method};
use crate::scene::{Scene, Step, numbers, state};

/// Velocities of primary mass and particle after an impact with the velocities `v1` and `v2`.
pub fn rebound(p: &Parameters, v1: f64, v2: f64) -> (f64, f64) {
    let (m1, m2) = (p.primary_mass, p.particle_mass);
    let (momentum, apart) = (m1 * v1 + m2 * v2, p.restitution * (v1 - v2));
    let after = (momentum - m2 * apart) / (m1 + m2);
    (after, after + apart)
}

/// The acceleration of the primary mass under the harmonic part of `drive` at the phase `angle`.
pub fn acceleration(p: &Parameters, drive: &Drive, angle: f64, q1: f64, v1: f64) -> f64 {
    let (sin, cos) = angle.sin_cos();
    let (e, de) = (drive.amplitude * sin, drive.amplitude * drive.omega * cos);
    (p.stiffness * (e - q1) + p.damping * (de - v1)) / p.primary_mass
}

/// How a method fails at the end of a chatter.
pub fn stalled(time: f64, impacts: u64) -> Failure {
    Failure(format!("stalled at t = {time:.3} after {impacts} impacts"))
}

/// So many impacts within one step are a stall.
const MOST_IMPACTS: usize = 1000;

/// The classical Runge-Kutta method; a step that ends beyond a wall is cut by bisection.
///
/// Its setting is the number of steps per period of the faster of drive and free oscillation.
pub struct Rk4 {
    p: Parameters,
    steps_per_period: f64,
    y: [f64; 4],
    angle: f64,
    time: f64,
    impacts: u64,
}

impl Rk4 {
    fn after(&self, step: &Step, h: f64) -> [f64; 4] {
        let [q1, v1, q2, v2] = self.y;
        let a = |t: f64, q: f64, v: f64| acceleration(&self.p, &step.drive, self.angle + step.drive.omega * t, q, v);
        let (k1, l1) = (v1, a(0.0, q1, v1));
        let (k2, l2) = (v1 + 0.5 * h * l1, a(0.5 * h, q1 + 0.5 * h * k1, v1 + 0.5 * h * l1));
        let (k3, l3) = (v1 + 0.5 * h * l2, a(0.5 * h, q1 + 0.5 * h * k2, v1 + 0.5 * h * l2));
        let (k4, l4) = (v1 + h * l3, a(h, q1 + h * k3, v1 + h * l3));
        [
            q1 + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4),
            v1 + h / 6.0 * (l1 + 2.0 * (l2 + l3) + l4),
            q2 + h * v2,
            v2,
        ]
    }

    fn beyond(&self, y: &[f64; 4]) -> bool {
        // Beyond a wall and going on outwards: at the start of a flight from the wall it is neither.
        let w = y[0] - y[2];
        w.abs() > self.p.half_width && w * (y[1] - y[3]) > 0.0
    }

    fn pass(&mut self, step: &Step, h: f64, y: [f64; 4]) {
        self.y = y;
        self.angle += step.drive.omega * h;
        self.time += h;
    }
}

impl Method for Rk4 {
    fn start(scene: &Scene, setting: f64) -> Result<Self, Failure> {
        let (p, y) = (scene.parameters, numbers(scene.start));
        Ok(Self {
            p,
            steps_per_period: setting,
            y,
            angle: 0.0,
            time: 0.0,
            impacts: 0,
        })
    }

    fn step(&mut self, step: &Step) -> Result<(), Failure> {
        let fastest = self.p.natural_frequency().max(step.drive.omega);
        let count = (step.duration * fastest / TAU * self.steps_per_period).round().max(1.0);
        let h = step.duration / count;
        for _ in 0..count as u64 {
            let mut left = h;
            let mut impacts = 0;
            loop {
                let end = self.after(step, left);
                if !self.beyond(&end) {
                    self.pass(step, left, end);
                    break;
                }
                let (mut low, mut high) = (0.0, left);
                for _ in 0..50 {
                    let middle = 0.5 * (low + high);
                    *(if self.beyond(&self.after(step, middle)) {
                        &mut high
                    } else {
                        &mut low
                    }) = middle;
                }
                let y = self.after(step, high);
                self.pass(step, high, y);
                (self.y[1], self.y[3]) = rebound(&self.p, self.y[1], self.y[3]);
                self.impacts += 1;
                impacts += 1;
                if impacts > MOST_IMPACTS {
                    return Err(stalled(self.time, self.impacts));
                }
                left -= high;
            }
        }
        self.angle %= TAU;
        Ok(())
    }

    fn state(&self) -> State {
        state(self.y)
    }

    fn impacts(&self) -> u64 {
        self.impacts
    }
}

/// No events at all: displacements at the middle of a step, velocities and impulses over it, contact by complementarity with Newton's law
/// (J. J. Moreau, "Unilateral contact and dry friction in finite freedom dynamics", in "Nonsmooth Mechanics and Applications", Springer 1988).
/// Chatter and sticking are no difficulty; the order is one.
///
/// Its setting is the number of steps per period of the faster of drive and free oscillation.
pub struct Moreau {
    p: Parameters,
    steps_per_period: f64,
    y: [f64; 4],
    angle: f64,
    impacts: u64,
}

impl Method for Moreau {
    fn start(scene: &Scene, setting: f64) -> Result<Self, Failure> {
        let (p, y) = (scene.parameters, numbers(scene.start));
        Ok(Self { p, steps_per_period: setting, y, angle: 0.0, impacts: 0 })
    }

    fn step(&mut self, step: &Step) -> Result<(), Failure> {
        let p = &self.p;
        let fastest = p
            .natural_frequency()
            .max(step.drive.omega)
            .max(p.damping / p.primary_mass);
        let count = (step.duration * fastest / TAU * self.steps_per_period).round().max(1.0);
        let h = step.duration / count;
        let inverse_mass = 1.0 / p.primary_mass + 1.0 / p.particle_mass;
        let [mut q1, mut v1, mut q2, mut v2] = self.y;
        for _ in 0..count as u64 {
            let (middle1, middle2) = (q1 + 0.5 * h * v1, q2 + 0.5 * h * v2);
            let angle = self.angle + 0.5 * step.drive.omega * h;
            let mut free1 = v1 + h * acceleration(p, &step.drive, angle, middle1, v1);
            let mut free2 = v2;
            let w = middle1 - middle2;
            if w.abs() >= p.half_width {
                let s = w.signum();
                let (before, free) = (s * (v1 - v2), s * (free1 - free2));
                // 0 <= impulse, and free + r before - impulse/mass <= 0, one of them with equality.
                let impulse = (free + p.restitution * before) / inverse_mass;
                if impulse > 0.0 {
                    free1 -= s * impulse / p.primary_mass;
                    free2 += s * impulse / p.particle_mass;
                    self.impacts += u64::from(before > 0.0);
                }
            }
            (q1, q2) = (middle1 + 0.5 * h * free1, middle2 + 0.5 * h * free2);
            (v1, v2) = (free1, free2);
            self.angle += step.drive.omega * h;
        }
        self.y = [q1, v1, q2, v2];
        self.angle %= TAU;
        Ok(())
    }

    fn state(&self) -> State {
        state(self.y)
    }

    fn impacts(&self) -> u64 {
        self.impacts
    }
}
