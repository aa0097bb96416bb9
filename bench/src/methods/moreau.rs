//! Moreau's time-stepping: no events at all. Displacements at the middle of a step, velocities and impulses over it, contact
//! by complementarity with Newton's law (J. J. Moreau, "Unilateral contact and dry friction in finite freedom dynamics", in
//! "Nonsmooth Mechanics and Applications", Springer 1988). Chatter and sticking are no difficulty; the order is one.

use core::f64::consts::TAU;

use lovines::Parameters;

use super::impact::acceleration;
use crate::method::{Failure, Method};
use crate::scene::{Scene, Step};

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
        let (p, y) = (scene.parameters, scene.start);
        Ok(Self { p, steps_per_period: setting, y, angle: 0.0, impacts: 0 })
    }

    fn step(&mut self, step: &Step) -> Result<(), Failure> {
        let p = &self.p;
        let fastest = p.natural_frequency().max(step.omega).max(p.damping / p.primary_mass);
        let count = (step.duration * fastest / TAU * self.steps_per_period).round().max(1.0);
        let h = step.duration / count;
        let inverse_mass = 1.0 / p.primary_mass + 1.0 / p.particle_mass;
        let [mut q1, mut v1, mut q2, mut v2] = self.y;
        for _ in 0..count as u64 {
            let (middle1, middle2) = (q1 + 0.5 * h * v1, q2 + 0.5 * h * v2);
            let angle = self.angle + 0.5 * step.omega * h;
            let mut free1 = v1 + h * acceleration(p, step.amplitude, step.omega, angle, middle1, v1);
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
            self.angle += step.omega * h;
        }
        self.y = [q1, v1, q2, v2];
        self.angle %= TAU;
        Ok(())
    }

    fn state(&self) -> [f64; 4] {
        self.y
    }

    fn impacts(&self) -> u64 {
        self.impacts
    }
}
