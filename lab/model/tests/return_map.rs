//! A second implementation of the return map: closed forms from impact to impact, with derivatives of their own (docs/regimes.md, eqs. 24 and 25).

use std::f64::consts::PI;

use nalgebra::{Complex, Matrix2, Matrix4, RowVector4, SMatrix, Vector2};
use vines_model::{
    Dimensionless,
    orbit::{Bounce, ContinuationLimits, Periodic, response},
};

/// The map at one frequency and excitation.
struct ImpactMap {
    epsilon: f64,
    /// Jump of the particle's velocity over the relative velocity before the impact.
    jump: f64,
    /// Twice the damping ratio.
    damping: f64,
    omega: f64,
    /// Harmonic response of q1 to the base.
    response: Complex<f64>,
}

impl ImpactMap {
    fn of(scene: &Dimensionless, motion: &Periodic) -> Self {
        let (omega, damping) = (1.0 + scene.epsilon * motion.sigma, scene.epsilon * scene.lambda);
        let force = Complex::new(1.0, damping * omega);
        Self {
            epsilon: scene.epsilon,
            jump: (1.0 + scene.r) / (1.0 + scene.epsilon),
            damping,
            omega,
            response: force / (force - omega * omega) * (scene.epsilon * motion.g),
        }
    }

    /// Harmonic response (q, q') at a phase of the base, and its derivative by the phase.
    fn harmonic(&self, phase: f64) -> [Vector2<f64>; 2] {
        let z = self.response * Complex::from_polar(1.0, phase);
        [
            Vector2::new(z.im, self.omega * z.re),
            Vector2::new(z.re, -self.omega * z.im),
        ]
    }

    /// The free motion over the time `t`.
    fn propagator(&self, t: f64) -> Matrix2<f64> {
        let delta = 0.5 * self.damping;
        let omega = (1.0 - delta * delta).sqrt();
        let (sin, cos) = (omega * t).sin_cos();
        let (sine, damped) = (sin / omega, delta * sin / omega);
        Matrix2::new(cos + damped, sine, -sine, cos - damped) * (-delta * t).exp()
    }

    /// (q1, q1') at the time `t` after an impact.
    fn primary(&self, from: &Bounce, t: f64) -> Vector2<f64> {
        let free = Vector2::new(from.q1, from.dq1) - self.harmonic(from.phase)[0];
        self.propagator(t) * free + self.harmonic(from.phase + self.omega * t)[0]
    }

    /// The state after the next impact, on `wall` after about the time `t`, and its derivative by (phase, q1, q1', q2').
    fn step(&self, from: &Bounce, wall: f64, mut t: f64) -> (Bounce, Matrix4<f64>) {
        for _ in 0..5 {
            let at = self.primary(from, t);
            t -= (at[0] - from.q2() - from.dq2 * t - wall) / (at[1] - from.dq2);
        }
        let ([q1, dq1], phase) = (self.primary(from, t).into(), from.phase + self.omega * t);
        let dw = dq1 - from.dq2;
        let next = Bounce {
            phase,
            q1,
            dq1: dq1 - self.epsilon * self.jump * dw,
            dq2: from.dq2 + self.jump * dw,
            wall,
        };

        // (q1, q1') before the impact, after a fixed time of flight.
        let ([_, before], [steady, after]) = (self.harmonic(from.phase), self.harmonic(phase));
        let mut fixed = SMatrix::<f64, 2, 4>::zeros();
        fixed.set_column(0, &(after - self.propagator(t) * before));
        fixed.fixed_view_mut::<2, 2>(0, 1).copy_from(&self.propagator(t));
        let by_dq2 = RowVector4::new(0.0, 0.0, 0.0, 1.0);
        let t_by = (fixed.row(0) - RowVector4::new(0.0, 1.0, 0.0, 0.0) - by_dq2 * t) / -dw;
        // Of the harmonic motion and of the free one.
        let acceleration = self.omega * after[1] - (q1 - steady[0]) - self.damping * (dq1 - steady[1]);
        let dq1_by = fixed.row(1) + t_by * acceleration;
        let dw_by = dq1_by - by_dq2;
        let by = Matrix4::from_rows(&[
            RowVector4::new(1.0, 0.0, 0.0, 0.0) + t_by * self.omega,
            fixed.row(0) + t_by * dq1,
            dq1_by - dw_by * (self.epsilon * self.jump),
            by_dq2 + dw_by * self.jump,
        ]);
        (next, by)
    }
}

/// How far the impact map leads from a motion, and how far its multipliers are from the motion's, over the largest.
fn apart(scene: &Dimensionless, motion: &Periodic) -> [f64; 2] {
    let (map, pattern, bounces) = (ImpactMap::of(scene, motion), &motion.pattern, &motion.bounces);
    let sign = if pattern.mirrored { -1.0 } else { 1.0 };
    let first = bounces[0];
    let end = Bounce {
        phase: first.phase + PI * f64::from(pattern.half_periods),
        q1: sign * first.q1,
        dq1: sign * first.dq1,
        dq2: sign * first.dq2,
        wall: sign * first.wall,
    };
    let (mut off, mut whole) = (0_f64, Matrix4::identity());
    for (from, to) in bounces.iter().zip(bounces[1..].iter().chain([&end])) {
        let (next, by) = map.step(from, to.wall, (to.phase - from.phase) / map.omega);
        let pairs = [
            (next.phase, to.phase),
            (next.q1, to.q1),
            (next.dq1, to.dq1),
            (next.dq2, to.dq2),
        ];
        off = pairs.iter().fold(off, |off, (one, other)| off.max((one - other).abs()));
        whole = by * whole;
    }
    for row in 1..4 {
        whole.row_mut(row).scale_mut(sign);
    }
    // Sums of powers are smooth where multipliers meet.
    let multipliers = motion
        .stability
        .multipliers
        .iter()
        .map(|[re, im]| Complex::new(*re, *im));
    let multipliers: Vec<_> = multipliers.collect();
    let powers = [whole, whole * whole].map(|power| power.trace());
    let sums = [1, 2].map(|n| multipliers.iter().map(|one| one.powi(n)).sum::<Complex<f64>>().re);
    let largest = motion.stability.growth().max(1.0);
    let growth = (0..2).map(|n| (powers[n] - sums[n]).abs() / largest.powi(n as i32 + 1));
    [off, growth.fold(0.0, f64::max)]
}

#[test]
fn periodic_motions_of_all_patterns_close_by_the_impact_map_and_have_its_multipliers() {
    let (mut count, mut worst) = (0, [0_f64; 2]);
    for (scene, doublings) in [
        (Dimensionless::new(0.0084, 1.43, 0.65, 2.2), 2),
        (Dimensionless::new(0.05, 0.3, 0.8, 1.0), 1),
        (Dimensionless::new(0.0042, 3.0, 0.5, 4.0), 1),
    ] {
        let limits = ContinuationLimits { sigma: [-3.0, 1.0], ..Default::default() };
        for component in response(&scene, &limits, doublings).components {
            // Within 1e-3 of a graze, the multipliers lose their digits.
            for motion in component
                .branch
                .points
                .iter()
                .filter(|motion| motion.stability.growth() < 1e3)
            {
                let here = apart(&scene, motion);
                worst = [0, 1].map(|n| worst[n].max(here[n]));
                count += 1;
            }
        }
    }
    assert!(count > 500, "{count}");
    assert!(worst[0] < 1e-10 && worst[1] < 1e-8, "{worst:?}");
}
