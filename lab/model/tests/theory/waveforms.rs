//! Motions in physical time.

use std::f64::consts::{FRAC_PI_2, PI};

use vines_model::{Dimensionless, orbit::phase_resonant, theory::Waveform};

use crate::{LAMBDA, R, close, flow};

#[test]
fn a_waveform_meets_its_walls_and_bounces_as_restitution_says() {
    let scene = Dimensionless {
        omega0: 55.4,
        b: 0.01,
        ..Dimensionless::new(0.0084, LAMBDA, R, 1.1)
    };
    let flow = flow();
    for one in flow.equilibria(1.1, -1.0) {
        let wave = Waveform::new(&scene, -1.0, one.b, one.gamma);
        let t = (FRAC_PI_2 - wave.psi) / wave.omega;
        close(wave.w(t) / scene.b, 1.0, 1e-12);
        close(wave.w(t + PI / wave.omega) / scene.b, -1.0, 1e-12);
        let h = 1e-6 / wave.omega;
        let before = (wave.w(t) - wave.w(t - h)) / h;
        let after = (wave.w(t + h) - wave.w(t)) / h;
        close(after / before, -R, 1e-4);
    }
}

#[test]
fn the_waveform_approaches_the_exact_motion_as_epsilon() {
    let distance = |epsilon: f64| {
        let scene = Dimensionless::new(epsilon, LAMBDA, R, 1.1);
        let orbit = phase_resonant(&scene).into_iter().find(|one| one.stable).unwrap();
        let point = flow().phase_resonant(1.1).into_iter().find(|one| one.stable()).unwrap();
        let wave = Waveform::new(&scene, point.sigma, point.b, -FRAC_PI_2);
        // The exact particle's flight from the impact on w = +1, and the waveform's, both from their own impact on.
        let impact = (FRAC_PI_2 - wave.psi) / wave.omega;
        let q2 = |t: f64| (wave.v(t) - wave.w(t)) / (1.0 + epsilon);
        (1..8)
            .map(|n| {
                let part = f64::from(n) / 8.0;
                let exact = orbit.start.q2 + orbit.start.dq2 * part * PI / orbit.omega;
                (q2(impact + part * PI / wave.omega) - exact).abs()
            })
            .fold(0.0, f64::max)
    };
    let (coarse, fine) = (distance(1e-2), distance(1e-3));
    let slope = (coarse / fine).log10();
    close(slope, 1.0, 0.1);
}
