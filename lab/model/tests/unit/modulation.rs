//! Unit tests of modulation.

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
