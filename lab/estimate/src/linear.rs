//! The linear response of one mode to the motion of its base.

use num_complex::Complex64;

/// One mode, driven by its base: `y'' + 2 zeta omega0 (y' - x') + omega0² (y - x) = 0`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Linear {
    /// Natural frequency without damping, rad/s.
    pub omega0: f64,
    /// Damping ratio, below 1.
    pub zeta: f64,
}

impl Linear {
    /// The pole with positive frequency, 1/s.
    pub fn pole(&self) -> Complex64 {
        self.omega0 * Complex64::new(-self.zeta, (1.0 - self.zeta * self.zeta).sqrt())
    }

    /// Residue of `omega0²/(s² + 2 zeta omega0 s + omega0²)` at the pole: by it a force, as a displacement of the base, moves the envelope.
    pub fn gain(&self) -> Complex64 {
        let pole = self.pole();
        self.omega0 * self.omega0 / (pole - pole.conj())
    }

    /// Part of the other pole in the response to a force of this frequency.
    pub fn far(&self, omega: f64) -> Complex64 {
        -self.gain() / (Complex64::new(0.0, omega) - self.pole().conj())
    }

    /// Force of the spring and the damper on the mass per displacement of the base, over the stiffness.
    pub fn base(&self, omega: f64) -> Complex64 {
        Complex64::new(1.0, 2.0 * self.zeta * omega / self.omega0)
    }

    /// What the response of amplitude one at this frequency takes, as a force over the stiffness.
    pub fn taken(&self, omega: f64) -> Complex64 {
        let ratio = omega / self.omega0;
        Complex64::new(1.0 - ratio * ratio, 2.0 * self.zeta * ratio)
    }

    /// The force at phase resonance, relative to the response, from the amplitude of the response, m, that of the base, m, and the frequency, rad/s.
    /// It is over the power of the frequency, over omega0, by which it grows.
    pub fn force_at_resonance(&self, [amplitude, drive, omega]: [f64; 3], power: i32) -> Complex64 {
        let base = Complex64::new(0.0, drive) * self.base(omega);
        (amplitude * self.taken(omega) - base) / (omega / self.omega0).powi(power)
    }

    /// The response, sample by sample, to a base that moves in straight lines between its samples, from rest: exact.
    pub fn response(&self, base: &[f64], sample_time: f64) -> Vec<f64> {
        let (pole, h) = (self.pole(), sample_time);
        let residue = -pole * pole / (pole - pole.conj());
        let decay = (pole * h).exp();
        // Responses of the mode to a constant of one, and to a line from zero to one, in a sample.
        let constant = residue * (decay - 1.0) / pole;
        let line = residue * (decay - 1.0 - pole * h) / (pole * pole * h);
        let (mut mode, mut before) = (Complex64::ZERO, 0.0);
        let follow = |x: &f64| {
            mode = decay * mode + (constant - line) * before + line * *x;
            before = *x;
            2.0 * mode.re
        };
        base.iter().map(follow).collect()
    }
}
