//! What solvers have in common, and two with fixed steps: the classical Runge-Kutta method, and Moreau's time-stepping.

use core::f64::consts::TAU;
use std::marker::PhantomData;

use lovines::{Drive, Parameters, State};

use crate::baseline::rebound;
use crate::method::{Failure, Method};
use crate::scene::{Scene, Step};

/// The acceleration of the primary mass under the harmonic part of `drive` at the phase `angle`.
pub fn acceleration(p: &Parameters, drive: &Drive, angle: f64, q1: f64, v1: f64) -> f64 {
    let (sin, cos) = angle.sin_cos();
    let (e, de) = (drive.amplitude * sin, drive.amplitude * drive.omega * cos);
    (p.stiffness * (e - q1) + p.damping * (de - v1)) / p.primary_mass
}

/// What a solver follows.
pub struct Flight {
    /// The rig.
    pub p: Parameters,
    /// Tolerance, or number of steps per period of the fastest motion.
    pub setting: f64,
    /// q1, q1', q2, q2' now.
    pub y: [f64; 4],
    /// Phase of the drive, rad.
    pub angle: f64,
    /// Time since the start, s.
    pub time: f64,
    /// Impacts since the start.
    pub impacts: u64,
}

impl Flight {
    /// How a solver fails at the end of a chatter.
    pub fn stalled(&self) -> Failure {
        Failure(format!(
            "stalled at t = {:.3} after {} impacts",
            self.time, self.impacts
        ))
    }

    /// Number and length of the fixed steps of a step, where `fastest`, rad/s, is the fastest rate.
    fn fixed_steps(&self, step: &Step, fastest: f64) -> (u64, f64) {
        let count = (step.duration * fastest / TAU * self.setting).round().max(1.0);
        (count as u64, step.duration / count)
    }
}

/// A numerical solution of the equation of motion.
pub trait Solver {
    /// Takes a step.
    ///
    /// # Errors
    /// A step that the solver could not finish.
    fn step(flight: &mut Flight, step: &Step) -> Result<(), Failure>;
}

/// A solver as a method.
pub struct Solved<S>(Flight, PhantomData<S>);

impl<S: Solver> Method for Solved<S> {
    fn start(scene: &Scene, setting: f64) -> Result<Self, Failure> {
        let (p, y) = (scene.parameters, scene.start.into());
        Ok(Self(
            Flight { p, setting, y, angle: 0.0, time: 0.0, impacts: 0 },
            PhantomData,
        ))
    }

    fn step(&mut self, step: &Step) -> Result<(), Failure> {
        S::step(&mut self.0, step)?;
        self.0.angle %= TAU;
        Ok(())
    }

    fn state(&self) -> State {
        self.0.y.into()
    }

    fn impacts(&self) -> u64 {
        self.0.impacts
    }
}

/// Number of impacts within one step from which on it is a stall.
const MOST_IMPACTS: usize = 1000;

/// The classical Runge-Kutta method; a step that ends beyond a wall is cut by bisection.
///
/// Its setting is the number of steps per period of the faster of drive and free oscillation.
pub struct Rk4;

fn after(flight: &Flight, step: &Step, h: f64) -> [f64; 4] {
    let ([q1, v1, q2, v2], drive) = (flight.y, &step.drive);
    let a = |t: f64, q: f64, v: f64| acceleration(&flight.p, drive, flight.angle + drive.omega * t, q, v);
    let (k1, l1) = (v1, a(0.0, q1, v1));
    let (k2, l2) = (v1 + 0.5 * h * l1, a(0.5 * h, q1 + 0.5 * h * k1, v1 + 0.5 * h * l1));
    let (k3, l3) = (v1 + 0.5 * h * l2, a(0.5 * h, q1 + 0.5 * h * k2, v1 + 0.5 * h * l2));
    let (k4, l4) = (v1 + h * l3, a(h, q1 + h * k3, v1 + h * l3));
    let q = q1 + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4);
    [q, v1 + h / 6.0 * (l1 + 2.0 * (l2 + l3) + l4), q2 + h * v2, v2]
}

/// Beyond a wall and going on outwards: at the start of a flight from the wall it is neither.
fn beyond(p: &Parameters, y: &[f64; 4]) -> bool {
    let w = y[0] - y[2];
    w.abs() > p.half_width && w * (y[1] - y[3]) > 0.0
}

impl Solver for Rk4 {
    fn step(flight: &mut Flight, step: &Step) -> Result<(), Failure> {
        let p = flight.p;
        let (count, h) = flight.fixed_steps(step, p.natural_frequency().max(step.drive.omega));
        for _ in 0..count {
            let (mut left, mut impacts) = (h, 0);
            loop {
                let end = after(flight, step, left);
                let hits = beyond(&p, &end);
                let (mut low, mut high) = (0.0, left);
                for _ in 0..if hits { 50 } else { 0 } {
                    let middle = 0.5 * (low + high);
                    let outside = beyond(&p, &after(flight, step, middle));
                    (low, high) = if outside { (low, middle) } else { (middle, high) };
                }
                flight.y = if hits { after(flight, step, high) } else { end };
                flight.angle += step.drive.omega * high;
                flight.time += high;
                if !hits {
                    break;
                }
                (flight.y[1], flight.y[3]) = rebound(&p, flight.y[1], flight.y[3]);
                flight.impacts += 1;
                impacts += 1;
                if impacts > MOST_IMPACTS {
                    return Err(flight.stalled());
                }
                left -= high;
            }
        }
        Ok(())
    }
}

/// No events at all: displacements at the middle of a step, velocities and impulses over it, contact by complementarity with Newton's law
/// (J. J. Moreau, "Unilateral contact and dry friction in finite freedom dynamics", in "Nonsmooth Mechanics and Applications", Springer 1988).
/// Chatter and sticking are no difficulty; the order is one.
///
/// Its setting is the number of steps per period of the faster of drive and free oscillation.
pub struct Moreau;

impl Solver for Moreau {
    fn step(flight: &mut Flight, step: &Step) -> Result<(), Failure> {
        let p = flight.p;
        let fastest = p
            .natural_frequency()
            .max(step.drive.omega)
            .max(p.damping / p.primary_mass);
        let (count, h) = flight.fixed_steps(step, fastest);
        let inverse_mass = 1.0 / p.primary_mass + 1.0 / p.particle_mass;
        let [mut q1, mut v1, mut q2, mut v2] = flight.y;
        for _ in 0..count {
            let (middle1, middle2) = (q1 + 0.5 * h * v1, q2 + 0.5 * h * v2);
            let angle = flight.angle + 0.5 * step.drive.omega * h;
            let mut free1 = v1 + h * acceleration(&p, &step.drive, angle, middle1, v1);
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
                    flight.impacts += u64::from(before > 0.0);
                }
            }
            (q1, q2) = (middle1 + 0.5 * h * free1, middle2 + 0.5 * h * free2);
            (v1, v2) = (free1, free2);
            flight.angle += step.drive.omega * h;
        }
        flight.y = [q1, v1, q2, v2];
        Ok(())
    }
}
