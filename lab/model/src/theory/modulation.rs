//! Modulation off the manifold: from impact to impact, towards the manifold and along it.
//!
//! Between impacts B and psi are constant, and `Z = C exp(i gamma)` obeys a linear equation, so the sequence has a closed form except for
//! the times of the impacts. It shows the fast approach to the manifold and the end of the slow flow.
//!
//! The end of this file has amplitudes that drift along the manifold: how far a slowly changing motion differs from the steady one of the same
//! amplitude.
//!
//! While C changes by `d = pi dC/dtau` from impact to impact, B and the phase x of v at an impact
//! follow late:
//!
//! ```text
//! B+ = r B- + (1 + r) (C cos x + (d/pi) sin x),      2 - C sin x - B+ (x+ + pi - x) - (C + d) sin x+ = 0
//! ```
//!
//! Steady drift, `B+ - B- = d dB/dC` and `x+ - x = d dx/dC`, makes this two linear equations for the deviations of B and x. The mean of the
//! particle's force on v over the flight gives the change of sigma per unit of `C' = dC/dtau`. Over many flights it differs from the change of
//! one flight, because the force grows within a flight: by `m d(R B^2/C)/dC / C` in sigma, with the mean `m = pi/2 - 4/pi` of `s^2 cos s` over
//! half a period. Three terms of the same order follow from the oscillator: `lambda C'/(2C)`, `lambda C'/C` and `-C' G_R'(C)/(4C)`.
//! The map of the impacts, iterated at a constant rate, confirms all of this (tests/unit/modulation.rs).

use std::f64::consts::{FRAC_2_PI, FRAC_PI_2, PI, TAU};

use nalgebra::Complex;
use serde::Serialize;

use super::slow_flow::{BranchSide, SlowFlow};
use crate::numerics::bisection;

/// Amplitudes and phases just after an impact; on or off the manifold.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Modulation {
    /// Fast time `omega0 t` of the impact.
    pub tau: f64,
    /// Amplitude of v over b.
    #[serde(rename = "C")]
    pub c: f64,
    /// Phase of v relative to the base, rad.
    pub gamma: f64,
    /// Particle speed over `b omega0`, once it has left the wall.
    #[serde(rename = "B")]
    pub b: f64,
    /// Phase of the triangle wave, rad.
    pub psi: f64,
}

impl SlowFlow {
    /// Phase psi of the triangle wave on the manifold at the particle speed `b` and the phase `gamma` of v, rad:
    /// `C cos(pi/2 - psi + gamma) = R B`, `C sin(pi/2 - psi + gamma) = 1 - pi B/2` (docs/theory.md, eq. 4).
    pub fn psi(&self, b: f64, gamma: f64) -> f64 {
        let impact = (1.0 - FRAC_PI_2 * b).atan2(self.manifold.dissipation * b);
        gamma + FRAC_PI_2 - impact
    }

    /// The impacts that follow from the amplitude `c` and phase `gamma` (rad) of v and the speed `b` and phase `psi` (rad)
    /// of the particle's triangle wave, begun where that rises through zero (`Omega tau = -psi`), at the mass ratio `epsilon`
    /// (0 keeps C and gamma: the fast map alone), the excitation `g` and the detuning `sigma` (docs/theory.md, eqs. 7 and 8).
    ///
    /// Ends when the impacts stop alternating between the walls or B is no longer positive: without two impacts per period these
    /// variables have no meaning.
    pub fn modulation(
        &self,
        epsilon: f64,
        (g, sigma): (f64, f64),
        (c, gamma): (f64, f64),
        (b, psi): (f64, f64),
    ) -> impl Iterator<Item = Modulation> {
        let start = Walk {
            rate: Complex::new(self.lambda / 2.0, sigma),
            restitution: (1.0 - self.manifold.dissipation) / (1.0 + self.manifold.dissipation),
            drive: Complex::new(0.0, -g / 2.0),
            epsilon,
            omega: 1.0 + epsilon * sigma,
            phase: -psi,
            z: Complex::from_polar(c, gamma),
            b,
            psi,
            impacts: 0,
        };
        std::iter::successors(Some(start), Walk::next)
            .skip(1)
            .map(|walk| Modulation {
                tau: walk.phase / walk.omega,
                c: walk.z.norm(),
                gamma: walk.z.arg(),
                b: walk.b,
                psi: walk.psi,
            })
    }
}

/// The motion just after an impact, with what is constant.
#[derive(Clone, Copy)]
struct Walk {
    /// `lambda/2 + i sigma`.
    rate: Complex<f64>,
    restitution: f64,
    drive: Complex<f64>,
    epsilon: f64,
    omega: f64,
    /// `Omega tau`.
    phase: f64,
    z: Complex<f64>,
    b: f64,
    psi: f64,
    impacts: u32,
}

/// Steps per period in the search for the next contact.
const STEPS: u32 = 256;

impl Walk {
    /// Sign of the triangle wave's slope now; the wall ahead.
    fn slope(&self) -> f64 {
        if self.impacts.is_multiple_of(2) { 1.0 } else { -1.0 }
    }

    /// `C exp(i gamma)` when the phase `Omega tau` has advanced by `ahead`, before the next impact (eq. 7).
    fn z_after(&self, ahead: f64) -> Complex<f64> {
        let tau1 = self.epsilon * ahead / self.omega;
        let exponent = self.rate * tau1;
        let source = Complex::from_polar(2.0 * FRAC_2_PI * self.b, self.psi) * Complex::i() / 2.0 + self.drive;
        // (1 - exp(-x))/x, by its series where the difference would cancel.
        let grown = if exponent.norm() < 1e-2 {
            let mut term = Complex::new(1.0, 0.0);
            (2..9).fold(term, |sum, n| {
                term *= -exponent / f64::from(n);
                sum + term
            })
        } else {
            (Complex::new(1.0, 0.0) - (-exponent).exp()) / exponent
        };
        self.z * (-exponent).exp() + source * tau1 * grown
    }

    fn triangle(&self, ahead: f64) -> f64 {
        let from_zero = self.phase + ahead + self.psi - f64::from(self.impacts) * PI;
        self.slope() * from_zero
    }

    fn w(&self, ahead: f64) -> f64 {
        let turned = Complex::from_polar(1.0, self.phase + ahead);
        (self.z_after(ahead) * turned).im + self.b * self.triangle(ahead)
    }

    /// How far ahead, in `Omega tau`, the next contact is; None if it is not on the wall expected.
    fn next_contact(&self) -> Option<f64> {
        let outside = |ahead: f64| self.slope() * self.w(ahead) >= 1.0;
        let step = TAU / f64::from(STEPS);
        for n in 1..=2 * STEPS {
            let end = f64::from(n) * step;
            if self.slope() * self.w(end) < -1.0 - 1e-9 {
                return None;
            }
            if outside(end) {
                return Some(bisection(end - step, end, outside).1);
            }
        }
        None
    }

    /// After the next impact; None if it does not continue the pattern.
    fn next(&self) -> Option<Self> {
        let ahead = self.next_contact()?;
        let z = self.z_after(ahead);
        let phase = self.phase + ahead;
        let slope = self.slope();
        // Restitution, and continuity of w (eq. 8).
        let v_rate = (z * Complex::from_polar(1.0, phase)).re;
        let b = self.restitution * self.b + (1.0 + self.restitution) * v_rate * slope;
        if b <= 0.0 {
            return None;
        }
        let before = phase + self.psi - f64::from(self.impacts) * PI;
        let psi = f64::from(self.impacts + 1) * PI - phase - self.b / b * before;
        // The particle leaves the wall, or this was no bounce.
        if slope * (v_rate - slope * b) >= 0.0 {
            return None;
        }
        Some(Self { phase, z, b, psi, impacts: self.impacts + 1, ..*self })
    }
}

impl SlowFlow {
    /// Change of the detuning of phase resonance by a slow drift at the amplitude `c` on the right branch, per unit of `dC/dtau`. `None` at the
    /// fold and below.
    pub fn drift(&self, c: f64) -> Option<f64> {
        let b = self.manifold.b(c, BranchSide::Right)?;
        let rate = 1e-6 * c;
        let [up, down] = [rate, -rate].map(|rate| self.flight(c, b, rate));
        let step = 1e-3 * c;
        let beside = self.backbone_at(self.manifold.b(c + step, BranchSide::Right)?);
        let by_drive = (beside.g - self.backbone_at(b).g) / step;
        // The mean over a flight, in which the particle's force grows, is not that over many flights: the difference has the mean of
        // s² cos s over half a period.
        let grown = FRAC_PI_2 - 4.0 / PI;
        // The damper acts on the velocity, which a change of C shifts in phase; at phase resonance the damper's force
        // on the base leads it by 2 zeta; and the losses change with C.
        let sigma = (up - down) / (2.0 * rate)
            + (0.25 * PI * grown * (by_drive - self.lambda) + 1.5 * self.lambda - 0.25 * by_drive) / c;
        sigma.is_finite().then_some(sigma)
    }

    /// Detuning of phase resonance by the flight in the middle of which the amplitude is `c` and changes at `rate`.
    fn flight(&self, c: f64, b: f64, rate: f64) -> f64 {
        let (change, r) = (PI * rate, self.manifold.dissipation);
        let c = c - 0.5 * change;
        let slope = 2.0 * c * self.manifold.slope(b);
        let b = b - 0.5 * change * slope;
        let (cos, sin) = (r * b, 1.0 - FRAC_PI_2 * b);
        // x = atan2(C sin x, C cos x) on the manifold.
        let b_step = change * slope;
        let x_step = -(FRAC_PI_2 * cos + r * sin) * b_step / (c * c);
        let x = sin.atan2(cos);
        let restitution = (1.0 - r) / (1.0 + r);
        // (1 - r) beta + (1 + r) C sin x xi = first,  pi beta + 2 C cos x xi = second.
        let first = (1.0 + restitution) * rate * x.sin() - b_step;
        let second = -PI * b_step - (b + cos) * x_step - change * x.sin();
        let (a11, a12, a21, a22) = (1.0 - restitution, (1.0 + restitution) * sin, PI, 2.0 * cos);
        let determinant = a11 * a22 - a12 * a21;
        let beta = (first * a22 - a12 * second) / determinant;
        let xi = (a11 * second - a21 * first) / determinant;
        let (x, speed) = (x + xi, b + beta + b_step);
        let (begin, length) = (1.0 - c * x.sin(), PI + x_step);
        let (end, after) = (begin - speed * length, x + length);
        let by_sin = begin * x.cos() - end * after.cos() - speed * (after.sin() - x.sin());
        by_sin / (length * (c + 0.5 * change))
    }
}

#[cfg(test)]
#[path = "../../tests/unit/modulation.rs"]
mod tests;
