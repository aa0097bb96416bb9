//! Time derivatives of everything that moves, at one instant between events: from the second on they follow from the
//! equation of motion, differentiated again and again.

use lovines::base_motion::BaseMotion;
use lovines::parameters::Parameters;
use lovines::plant::Plant;

/// A quantity and its first four time derivatives.
pub type Rates = [f64; 5];

/// Base, primary mass and particle with their time derivatives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Movement {
    /// Displacement of the base.
    pub base: Rates,
    /// Displacement of the primary mass.
    pub primary: Rates,
    /// Displacement of the particle.
    pub particle: Rates,
    /// Acceleration of the particle by gravity along the axis, m/s².
    pub gravity: f64,
}

impl Movement {
    /// The motion of `plant` at the end of an advance.
    pub fn of(plant: &Plant) -> Self {
        let (p, state) = (plant.parameters(), plant.state());
        let base = rates_of(&plant.base());
        let stuck = plant.contact().is_some() || plant.sticks();
        let (gravity, friction) = plant.constant_accelerations();
        // What is constant acts on the primary mass too: friction while the particle slides, its weight while it does not.
        let force = p.particle_mass * if stuck { gravity } else { -friction };
        let moved = p.primary_mass + if stuck { p.particle_mass } else { 0.0 };
        let mut primary = [state.q1, state.dq1, 0.0, 0.0, 0.0];
        for n in 2..primary.len() {
            let damper = p.damping * (base[n - 1] - primary[n - 1]);
            let spring = p.stiffness * (base[n - 2] - primary[n - 2]);
            primary[n] = (damper + spring + if n == 2 { force } else { 0.0 }) / moved;
        }
        let mut particle = [state.q2, state.dq2, gravity + friction, 0.0, 0.0];
        if stuck {
            particle[2..].copy_from_slice(&primary[2..]);
        }
        Self { base, primary, particle, gravity }
    }

    /// The `order`-th time derivative (0 to 3) of the mechanical energy.
    pub fn energy(&self, p: &Parameters, order: usize) -> f64 {
        let stretch = core::array::from_fn(|n| self.primary[n] - self.base[n]);
        let weight = p.particle_mass * self.gravity * self.particle[order];
        let moving = |mass: f64, x: &Rates| mass * squared([x[1], x[2], x[3], x[4], 0.0], order);
        let spring = p.stiffness * squared(stretch, order);
        0.5 * (moving(p.primary_mass, &self.primary) + moving(p.particle_mass, &self.particle) + spring) - weight
    }
}

/// Leibniz's rule for the `order`-th derivative of `x²`.
fn squared(x: Rates, order: usize) -> f64 {
    let mut binomial = 1.0;
    let mut sum = 0.0;
    for n in 0..=order {
        sum += binomial * x[n] * x[order - n];
        binomial = binomial * (order - n) as f64 / (n as f64 + 1.0);
    }
    sum
}

fn rates_of(base: &BaseMotion) -> Rates {
    let [u0, u1, u2, u3] = base.drive.signal;
    let omega = base.drive.omega;
    let (sin, cos) = libm::sincos(base.phase.radians());
    let (sin, cos) = (base.drive.amplitude * sin, base.drive.amplitude * cos);
    let turning = [sin, cos, -sin, -cos, sin];
    let signal = [u0, u1, 2.0 * u2, 6.0 * u3, 0.0];
    let mut power = 1.0;
    core::array::from_fn(|n| {
        let rate = signal[n] + power * turning[n];
        power *= omega;
        rate
    })
}
