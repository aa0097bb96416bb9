//! Amplitudes that drift along the manifold: how far a slowly changing motion differs from the steady one of the same amplitude.
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
//! The map of the impacts, iterated at a constant rate, confirms all of this (the tests below).

use std::f64::consts::{FRAC_PI_2, PI};

use super::slow_flow::{BranchSide, SlowFlow};

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
mod tests {
    use super::*;

    #[test]
    fn without_drift_a_flight_has_the_detuning_of_the_backbone() {
        let flow = SlowFlow::new(1.43, 0.65);
        for c in [0.2, 0.45, 0.7] {
            let b = flow.manifold.b(c, BranchSide::Right).unwrap();
            let (sigma, expected) = (flow.flight(c, b, 0.0), flow.free_detuning(b));
            assert!((sigma - expected).abs() < 1e-12, "{sigma} {expected}");
        }
    }

    /// Detuning from the map of the impacts, iterated while C changes at a constant rate, in excess of the backbone at the C of the middle: the first harmonic of the particle's position over many flights.
    fn by_map(flow: &SlowFlow, r: f64, c: f64, rate: f64) -> f64 {
        const FLIGHTS: u32 = 100;
        let begin = c - rate * PI * f64::from(FLIGHTS) / 2.0;
        let amplitude = |t: f64| begin + rate * t;
        let b = flow.manifold.b(begin, BranchSide::Right).unwrap();
        let position = |t: f64| amplitude(t) * t.sin();
        let velocity = |t: f64| amplitude(t) * t.cos() + rate * t.sin();
        let middle = PI * f64::from(FLIGHTS) / 2.0;
        let weight = |t: f64| {
            if (t - middle).abs() < 30.0 * PI {
                ((t - middle) / 60.0).cos().powi(4)
            } else {
                0.0
            }
        };
        let (mut t, mut wall, mut before) = ((1.0 - FRAC_PI_2 * b).atan2(flow.manifold.dissipation * b), 1.0, -b);
        let (mut sine, mut total) = (0.0, 0.0);
        for _ in 0..FLIGHTS {
            let after = (1.0 + r) * velocity(t) - r * before;
            let from = position(t) - wall;
            let mut next = t + PI;
            for _ in 0..30 {
                next -= (position(next) - from - after * (next - t) + wall) / (velocity(next) - after);
            }
            // Simpson's rule.
            let step = (next - t) / 40.0;
            for n in 0..=40 {
                let at = t + f64::from(n) * step;
                let share = step / 3.0 * [2.0, 4.0][n as usize % 2] * if n % 40 == 0 { 0.5 } else { 1.0 } * weight(at);
                let particle = from + after * f64::from(n) * step;
                sine += share * particle * at.sin() / amplitude(at);
                total += share;
            }
            (t, wall, before) = (next, -wall, after);
        }
        let backbone = flow.backbone_at(flow.manifold.b(amplitude(middle), BranchSide::Right).unwrap());
        -sine / total - backbone.sigma
    }

    #[test]
    fn the_effect_of_a_drift_is_that_of_the_map_of_the_impacts() {
        for (r, c) in [(0.65, 0.25), (0.65, 0.45), (0.8, 0.2), (0.5, 0.4), (0.9, 0.6)] {
            let flow = SlowFlow::new(0.0, r);
            let (rate, step) = (1e-6, 1e-4);
            let [up, down] = [rate, -rate].map(|rate| by_map(&flow, r, c, rate));
            let mapped = (up - down) / (2.0 * rate);
            let [low, high] =
                [c - step, c + step].map(|c| flow.backbone_at(flow.manifold.b(c, BranchSide::Right).unwrap()));
            // The term that is not an effect of the impacts.
            let found = flow.drift(c).unwrap() + 0.25 * (high.g - low.g) / (2.0 * step) / c;
            assert!((found / mapped - 1.0).abs() < 0.01, "{r} {c}: {found:?} {mapped:?}");
        }
    }
}
