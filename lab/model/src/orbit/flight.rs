//! The flight of the particle from a wall of its cavity to the next.
//!
//! The first contact is found by steps that a bound of `|w''|` proves free of contact. They become Newton steps near the wall, so no contact
//! is missed and the last is accurate to the last bits.

use std::f64::consts::TAU;

use lovines::Section;
use nalgebra::{Complex, Vector2};

/// A flight in the cavity of a host under a harmonic drive.
pub(super) struct Flight<'a> {
    /// The sections, with (x, v) of their free motion at the start.
    pub sections: &'a [(Section, Vector2<f64>)],
    /// Harmonic of the cavity's displacement from the start on, and its angular frequency.
    pub harmonic: Complex<f64>,
    pub omega: f64,
    /// Displacement and velocity of the particle at the start.
    pub particle: [f64; 2],
}

/// A contact slower than this, over the half-width and the angular frequency of the drive, is a graze, where the motion after it has no derivative.
pub(super) const GRAZING: f64 = 1e-9;
/// Most steps of a flight: far more than any flight needs, except in chatter.
const MOST_FLIGHT_STEPS: usize = 4000;

impl Flight<'_> {
    /// Displacement and velocity of the cavity after the time `t`.
    fn cavity(&self, t: f64) -> Vector2<f64> {
        let z = self.harmonic * Complex::from_polar(1.0, self.omega * t);
        let mut cavity = Vector2::new(z.im, self.omega * z.re);
        for (section, state) in self.sections {
            cavity += section.at(section.cavity, section.propagator(t) * state);
        }
        cavity
    }

    /// Bound of the cavity's acceleration: the energy of the free motion of a section never grows, nor does that of its derivatives.
    fn acceleration(&self) -> f64 {
        let bound = |(section, state): &(Section, Vector2<f64>)| {
            let (delta, omega0) = (section.oscillator.delta, section.oscillator.omega0);
            let ceiling = |state: Vector2<f64>| (2.0 * delta + omega0) * state[1].hypot(omega0 * state[0]);
            section.cavity[0].abs() * ceiling(*state) + section.cavity[1].abs() * ceiling(section.rate(*state))
        };
        let free: f64 = self.sections.iter().map(bound).sum();
        self.harmonic.norm() * self.omega * self.omega + free
    }

    /// Time and wall of the first contact within a period, from (w, w') at the start on: +1 for w = +`half_width`. `None` without a contact, if
    /// it grazes, or if impacts accumulate.
    pub(super) fn contact(&self, [w, dw]: [f64; 2], half_width: f64) -> Option<(f64, f64)> {
        // Lengths over the half-width, and phases instead of times.
        let speed = half_width * self.omega;
        let k = self.acceleration() / (speed * self.omega);
        if !k.is_finite() || k <= 0.0 {
            return None;
        }
        // Phase before which the wall at the distance `gap`, approached at `speed`, cannot be reached.
        let free_for = |gap: f64, speed: f64| {
            let root = (speed * speed + 2.0 * k * gap).sqrt();
            if speed > 0.0 {
                2.0 * gap / (speed + root)
            } else {
                (root - speed) / k
            }
        };
        let (mut w, mut dw) = (w / half_width, dw / speed);
        if w.abs() >= 1.0 && w * dw >= 0.0 {
            return None;
        }
        let mut phase = 0.0;
        for _ in 0..MOST_FLIGHT_STEPS {
            let step = free_for(1.0 - w, dw).min(free_for(1.0 + w, -dw));
            phase += step;
            if phase > TAU {
                return None;
            }
            let t = phase / self.omega;
            let (cavity, [q2, dq2]) = (self.cavity(t), self.particle);
            [w, dw] = [(cavity[0] - q2 - dq2 * t) / half_width, (cavity[1] - dq2) / speed];
            let side = dw.signum();
            let gap = 1.0 - side * w;
            if gap <= 1e-15 || step <= 1e-16 * (1.0 + phase) {
                let fast = dw.abs() > GRAZING;
                // A wall is reached in its own direction; the step over the remaining gap corrects the rounding.
                return fast.then(|| (t + gap / (dw.abs() * self.omega), side));
            }
            // Rounding may place w just beyond the wall behind.
            w = w.clamp(-1.0, 1.0);
        }
        None
    }
}
