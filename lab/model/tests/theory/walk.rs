//! Modulation off the manifold, from impact to impact: an independent computation of how motions approach the manifold and move along it.
//!
//! Between impacts B and psi are constant, and `Z = C exp(i gamma)` obeys a linear equation, so the sequence has a closed form except for
//! the times of the impacts.

use std::f64::consts::{FRAC_2_PI, PI, TAU};

use nalgebra::Complex;
use vines_model::numerics::bisection;
use vines_model::theory::SlowFlow;

/// Amplitudes and phases just after an impact; on or off the manifold.
#[derive(Debug, Clone, Copy)]
pub struct Modulation {
    /// Fast time `omega0 t` of the impact.
    pub tau: f64,
    /// Amplitude of v over b.
    pub c: f64,
    /// Phase of v relative to the base, rad.
    pub gamma: f64,
    /// Particle speed over `b omega0`, once it has left the wall.
    pub b: f64,
    /// Phase of the triangle wave, rad.
    pub psi: f64,
}

/// The impacts that follow from the amplitude `c` and phase `gamma` (rad) of v and the speed `b` and phase `psi` (rad)
/// of the particle's triangle wave, begun where that rises through zero (`Omega tau = -psi`), at the mass ratio `epsilon`
/// (0 keeps C and gamma: the fast map alone), the excitation `g` and the detuning `sigma` (docs/theory.md, eqs. 7 and 8).
///
/// Ends when the impacts stop alternating between the walls or B is no longer positive: without two impacts per period these
/// variables have no meaning.
pub fn modulation(
    flow: &SlowFlow,
    epsilon: f64,
    (g, sigma): (f64, f64),
    (c, gamma): (f64, f64),
    (b, psi): (f64, f64),
) -> impl Iterator<Item = Modulation> {
    let start = Walk {
        rate: Complex::new(flow.lambda / 2.0, sigma),
        restitution: (1.0 - flow.manifold.dissipation) / (1.0 + flow.manifold.dissipation),
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
