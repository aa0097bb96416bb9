//! The classical Runge-Kutta method with fixed steps; a step that ends beyond a wall is cut by bisection.

use core::f64::consts::TAU;

use lovines::Parameters;

use super::impact::{acceleration, rebound};
use crate::method::{Failure, Method};
use crate::scene::{Scene, Step};

/// So many impacts within one step are a stall.
const MOST_IMPACTS: usize = 1000;

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
        let a = |t: f64, q: f64, v: f64| {
            acceleration(&self.p, step.amplitude, step.omega, self.angle + step.omega * t, q, v)
        };
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
        self.angle += step.omega * h;
        self.time += h;
    }
}

impl Method for Rk4 {
    fn start(scene: &Scene, setting: f64) -> Result<Self, Failure> {
        let (p, y) = (scene.parameters, scene.start);
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
        let fastest = self.p.natural_frequency().max(step.omega);
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
                    if self.beyond(&self.after(step, middle)) {
                        high = middle;
                    } else {
                        low = middle;
                    }
                }
                let y = self.after(step, high);
                self.pass(step, high, y);
                (self.y[1], self.y[3]) = rebound(&self.p, self.y[1], self.y[3]);
                self.impacts += 1;
                impacts += 1;
                if impacts > MOST_IMPACTS {
                    return Err(Failure(format!(
                        "stalled at t = {:.3} after {} impacts",
                        self.time, self.impacts
                    )));
                }
                left -= high;
            }
        }
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
