//! The linear response of a rig from its growth in the loop check, and the gains that follow from it.
//!
//! In the n-th period the phasor of the response is `z = s + a q^n` with `q = exp(-r T)`, `r = delta + i (omega - omega_d)` and
//! `s = -i g E/r`, less what the growth within a period adds at twice the frequency, `conj(a q^n) (1 - p)/(1 - p exp(-4 pi i/N))` with
//! `p = exp(-conj(r) T/N)` and N samples per period.
//! Least squares over all periods (Gauss and Newton) give `s`, `a` and `q`; `a` is free because of delays and of what was left of an
//! earlier motion. The covariance of the fit gives the uncertainties. The natural frequency is `omega_0 = |omega_d + i delta|`.

use std::f64::consts::PI;

use nalgebra::{Matrix3, RowVector3, Vector3};
use num_complex::Complex64;
use phase_lock::Gains;
use serde::Serialize;

use crate::scene::{LinearResponse, Reference, Scene};

/// The linear response, and the tuning of the loop for it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Linear {
    /// Natural frequency, rad/s.
    pub omega_0: f64,
    /// Damping rate, rad/s.
    pub damping_rate: f64,
    /// Standard uncertainty of each of the two, rad/s.
    pub u_damping_rate: f64,
    /// Growth rate of the response at resonance per amplitude of the base, 1/s.
    pub response_gain: f64,
    /// Standard uncertainty of the gain, relative, and of its phase, rad.
    pub u_gain: f64,
    /// Phase of the response at resonance relative to the base, degrees: -90, less what is late.
    pub phase: f64,
    /// Bandwidth of the detector, rad/s, from which the gains follow.
    pub bandwidth: f64,
    /// Proportional gain, rad/s per rad, and integral gain, rad/s² per rad.
    pub gains: [f64; 2],
    /// Phase margin of the loop with a delay of one sample, degrees.
    pub phase_margin: f64,
}

impl Linear {
    /// The response whose phasors, m, are given period by period, each of `samples` samples; `base` is the phasor of the base, m, and `u_base`
    /// its relative standard uncertainty. `None` without a growth from rest that is more than noise.
    pub(super) fn of(
        phasors: &[Complex64],
        (base, u_base): (Complex64, f64),
        omega: f64,
        samples: usize,
        scene: &Scene,
    ) -> Option<Self> {
        let period = samples as f64 * scene.sample_time();
        let (mut q, [mut steady, mut initial]) = start(phasors)?;
        let [mut u_q, mut u_gain] = [f64::NAN; 2];
        for _ in 0..ROUNDS {
            let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
            let (mut power, mut rest) = (Complex64::ONE, 0.0);
            let p = q.conj().powf(1.0 / samples as f64);
            let within = (1.0 - p) / (1.0 - p * Complex64::cis(-4.0 * PI / samples as f64));
            for (n, z) in phasors.iter().enumerate() {
                let row = RowVector3::new(Complex64::ONE, power, initial * power / q * n as f64);
                let residual = z - steady - initial * power + (initial * power).conj() * within;
                normal += row.adjoint() * row;
                right += row.adjoint() * residual;
                rest += residual.norm_sqr();
                power *= q;
            }
            let inverse = normal.try_inverse()?;
            let change = inverse * right;
            // Two components of each phasor, and of each of three unknowns.
            let variance = rest / (2.0 * phasors.len() as f64 - 6.0);
            u_q = (variance * inverse[(2, 2)].re).sqrt();
            // Relative change of the gain, which is proportional to `s r`.
            let slope = RowVector3::new(1.0 / steady, Complex64::ZERO, 1.0 / (q * q.ln()));
            u_gain = (variance * (slope * inverse * slope.adjoint())[0].re).sqrt();
            (steady, initial, q) = (steady + change[0], initial + change[1], q + change[2]);
        }
        let rate = -q.ln() / period;
        let gain = steady * rate / base;
        let is_growth = (steady + initial).norm() < AT_REST * steady.norm();
        if !(gain.norm().is_finite() && u_gain < DETERMINED && q.norm() > 0.0 && is_growth) {
            return None;
        }
        let bandwidth = scene.controller.bandwidth * scene.dimensionless().omega0;
        let gains = Gains::from_bandwidth(bandwidth, rate.re.max(0.0));
        Some(Self {
            omega_0: (omega - rate.im).hypot(rate.re),
            damping_rate: rate.re,
            u_damping_rate: u_q / (q.norm() * period),
            response_gain: gain.norm(),
            u_gain: u_gain.hypot(u_base),
            phase: gain.arg().to_degrees(),
            bandwidth,
            gains: [gains.proportional, gains.integral],
            phase_margin: gains
                .phase_margin(bandwidth, rate.re.max(0.0), scene.sample_time())
                .to_degrees(),
        })
    }

    /// The gain of an oscillator of this natural frequency and damping that is moved through its spring and damper, or by the force in them,
    /// at the frequency `omega`, rad/s.
    pub(super) fn expected_gain(&self, omega: f64, reference: Reference) -> Complex64 {
        let damper = match reference {
            Reference::Base => 2.0 * self.damping_rate * omega,
            Reference::Force => 0.0,
        };
        let free = (self.omega_0.powi(2) - self.damping_rate.powi(2)).max(0.0).sqrt();
        Complex64::new(self.omega_0.powi(2), damper) / Complex64::new(self.damping_rate, omega + free)
    }

    /// The frequency response.
    pub fn response(&self) -> LinearResponse {
        LinearResponse {
            omega0: self.omega_0,
            damping_rate: self.damping_rate,
            uncertainty: self.u_damping_rate,
            gain: Complex64::from_polar(self.response_gain, self.phase.to_radians()),
        }
    }
}

/// Largest response at the start, as a share of the steady one, of a growth from rest.
const AT_REST: f64 = 0.5;
/// Largest relative standard uncertainty of the gain of a response that is more than noise.
const DETERMINED: f64 = 0.1;
/// Rounds of the fit; each squares the relative error.
const ROUNDS: usize = 8;

/// First values of `q`, and of `s` and `a`, by the recursion `z' = q z + (1 - q) s` from period to period. `None` without a growth.
fn start(phasors: &[Complex64]) -> Option<(Complex64, [Complex64; 2])> {
    let steps = phasors.len().checked_sub(4)? as f64 + 3.0;
    let (before, after) = (&phasors[..phasors.len() - 1], &phasors[1..]);
    let mean = |values: &[Complex64]| values.iter().sum::<Complex64>() / steps;
    let (mean_before, mean_after) = (mean(before), mean(after));
    let power: f64 = before.iter().map(|z| (z - mean_before).norm_sqr()).sum();
    let products = before.iter().zip(after);
    let q = products
        .map(|(z, next)| (z - mean_before).conj() * next)
        .sum::<Complex64>()
        / power;
    let steady = (mean_after - q * mean_before) / (1.0 - q);
    (steady.norm().is_finite() && q.norm() > 0.0).then(|| (q, [steady, phasors[0] - steady]))
}
