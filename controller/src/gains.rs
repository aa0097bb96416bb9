//! The gains of the loop from the detector's bandwidth.

use crate::real::{self, Real};

/// Gains of the PI loop filter.
///
/// Near phase resonance the phase of a lightly damped structure follows `phi' = -delta phi + omega_0 - omega` (`delta`: its
/// damping rate), the detector is a low pass of bandwidth `wLP`, and the loop filter is `omega = omega_c + kp e + ki ∫e`.
/// With `x = s/wLP` and `d = delta/wLP` the closed loop has the characteristic polynomial
/// `x^3 + (1 + d) x^2 + (d + kp/wLP) x + ki/wLP^2`. The sum of its roots is fixed, so the slowest root is fastest if
/// all three have the real part `p = -(d + 1)/3`. With imaginary parts `0, ±l` the gains are
///
/// ```text
/// kp = wLP (3 p^2 + l^2 - d),     ki = -wLP^2 p (p^2 + l^2)
/// ```
///
/// The choice here is `l = 0`, three equal real roots, which is conservative. Use `delta = 0` if the damping is unknown.
///
/// Source: P. Hippold, M. Scheel, L. Renson, M. Krack, "Robust and fast backbone tracking via phase-locked loops"
/// (2024), arXiv:2403.06639, for an ideal exciter.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Gains {
    /// Proportional gain, rad/s per rad.
    pub proportional: Real,
    /// Integral gain, rad/s² per rad.
    pub integral: Real,
}

impl Gains {
    /// Gains for a detector of the given bandwidth (rad/s, above 0) and a structure of the given damping rate (rad/s,
    /// damping ratio times natural frequency; 0 or above).
    #[must_use]
    pub fn from_bandwidth(bandwidth: Real, damping_rate: Real) -> Self {
        let d = damping_rate / bandwidth;
        let p = -(d + 1.0) / 3.0;
        Self {
            proportional: bandwidth * (3.0 * p * p - d),
            integral: -bandwidth * bandwidth * p * p * p,
        }
    }

    /// Phase margin, rad, of the loop with this detector and structure and a delay, s.
    ///
    /// The open loop is `wLP (kp s + ki) exp(-s delay)/(s (s + delta) (s + wLP))`. Its gain falls with the frequency, so that it is 1
    /// at one frequency only.
    #[must_use]
    pub fn phase_margin(&self, bandwidth: Real, damping_rate: Real, delay: Real) -> Real {
        let gain = |w: Real| {
            let open = bandwidth * real::hypot(self.proportional * w, self.integral);
            open / (w * real::hypot(w, damping_rate) * real::hypot(w, bandwidth))
        };
        let (mut low, mut high) = (0.0, bandwidth);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            *(if gain(middle) > 1.0 { &mut low } else { &mut high }) = middle;
        }
        real::atan2(self.proportional * low, self.integral) + crate::real::consts::FRAC_PI_2
            - real::atan2(low, damping_rate)
            - real::atan2(low, bandwidth)
            - delay * low
    }
}

#[cfg(test)]
#[cfg(not(feature = "f32"))]
mod tests {
    use super::*;

    #[test]
    fn the_closed_loop_has_a_triple_root_and_positive_gains_for_every_damping() {
        for (bandwidth, delta) in [(5.5, 0.33), (1.0, 0.0), (1.0, 0.1), (1.0, 1.0), (1.0, 10.0), (1.0, 1e3)] {
            let gains = Gains::from_bandwidth(bandwidth, delta);
            assert!(gains.proportional > 0.0 && gains.integral > 0.0, "{delta}");
            let s = -(bandwidth + delta) / 3.0;
            let [c2, c1, c0] = [
                bandwidth + delta,
                bandwidth * (delta + gains.proportional),
                bandwidth * gains.integral,
            ];
            for (residual, size) in [
                (s * s * s + c2 * s * s + c1 * s + c0, s * s * s),
                (3.0 * s * s + 2.0 * c2 * s + c1, s * s),
                (6.0 * s + 2.0 * c2, s),
            ] {
                assert!(residual.abs() < 1e-12 * size.abs().max(1.0), "{delta}: {residual}");
            }
        }
    }

    #[test]
    fn the_phase_margin_is_above_50_degrees_and_zero_with_the_delay_that_uses_it_up() {
        for damping in [0.0, 0.01, 0.06, 0.3] {
            let gains = Gains::from_bandwidth(1.0, damping);
            let margin = gains.phase_margin(1.0, damping, 0.0);
            assert!((50.0..75.0).contains(&margin.to_degrees()), "{damping}: {margin}");
            // The open loop at the frequency of gain 1, whose phase a delay of 1 s shifts by that frequency.
            let w = margin - gains.phase_margin(1.0, damping, 1.0);
            let open = (gains.proportional * w).hypot(gains.integral) / (w * w.hypot(damping) * w.hypot(1.0));
            assert!((open - 1.0).abs() < 1e-9, "{open}");
            assert!(gains.phase_margin(1.0, damping, margin / w).abs() < 1e-9);
        }
    }
}
