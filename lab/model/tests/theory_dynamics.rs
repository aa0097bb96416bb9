//! Identities of the first-order theory off the manifold, at any detuning, and in physical time.

use std::f64::consts::{FRAC_PI_2, PI};

use vines_model::{
    Dimensionless,
    orbit::phase_resonant,
    theory::{B_SYMMETRY_BREAKING, Manifold, SlowFlow, Waveform, half_period_map, triangle_wave},
};

const LAMBDA: f64 = 1.43;
const R: f64 = 0.65;

fn flow() -> SlowFlow {
    SlowFlow::new(LAMBDA, R)
}

fn close(one: f64, other: f64, tolerance: f64) {
    let size = 1f64.max(one.abs());
    assert!((one - other).abs() <= tolerance * size, "{one} and {other}");
}

/// (B, psi) one impact later at frozen C and gamma: the fast map.
fn fast_map(r: f64, (c, gamma): (f64, f64), (b, psi): (f64, f64)) -> [f64; 2] {
    let next = SlowFlow::new(LAMBDA, r)
        .modulation(0.0, (0.0, 0.0), (c, gamma), (b, psi))
        .next()
        .expect("an impact");
    [next.b, next.psi]
}

#[test]
fn a_motion_on_the_manifold_stays_at_an_impact() {
    for r in [0.3, 0.65, 0.9, 1.0] {
        let flow = SlowFlow::new(LAMBDA, r);
        for b in [0.5, 0.7, 0.9, 1.2] {
            let gamma = -1.2;
            let psi = flow.psi(b, gamma);
            let [b_after, psi_after] = fast_map(r, (flow.manifold.c(b), gamma), (b, psi));
            close(b_after, b, 1e-12);
            close(psi_after, psi, 1e-12);
        }
    }
}

#[test]
fn the_jumps_linearised_are_the_half_period_map() {
    for (r, b) in [(0.65, 0.7), (0.65, 0.9), (0.65, 1.2), (0.9, 0.8), (0.3, 0.5)] {
        let flow = SlowFlow::new(LAMBDA, r);
        let (gamma, h) = (0.3, 1e-6);
        let (c, psi) = (flow.manifold.c(b), flow.psi(b, gamma));
        let map = |b: f64, psi: f64| fast_map(r, (c, gamma), (b, psi));
        let by = |plus: [f64; 2], minus: [f64; 2]| [0, 1].map(|i| (plus[i] - minus[i]) / (2.0 * h));
        let by_b = by(map(b + h, psi), map(b - h, psi));
        let by_psi = by(map(b, psi + h), map(b, psi - h));
        let [trace, determinant] = half_period_map(r, b);
        close(by_b[0] + by_psi[1], trace, 1e-7);
        close(by_b[0] * by_psi[1] - by_b[1] * by_psi[0], determinant, 1e-7);
    }
}

#[test]
fn the_manifold_is_approached_by_the_square_root_of_the_determinant_an_impact() {
    // B = 0.8 has complex multipliers of modulus r; over many impacts the distance shrinks as r^n.
    let flow = flow();
    let b = 0.8;
    let (c, gamma) = (flow.manifold.c(b), -1.0);
    let start = (b * (1.0 + 1e-4), flow.psi(b, gamma));
    let distances: Vec<f64> = flow
        .modulation(0.0, (0.0, 0.0), (c, gamma), start)
        .take(31)
        .map(|one| (one.b - b).hypot(one.psi - flow.psi(b, gamma)))
        .collect();
    let rate = (distances[30] / distances[0]).powf(1.0 / 30.0);
    println!("distance to the manifold: times {rate:.3} an impact (r = {R})");
    close(rate, R, 0.05);
}

/// Largest distance of the walk's C from the slow flow's, from B 5 % off the manifold, over tau1 from 0.05 to 0.5.
fn distance_from_slow_flow(epsilon: f64) -> f64 {
    let flow = flow();
    let (g, sigma) = (1.1, -1.0);
    let (b, gamma) = (0.85, -1.3);
    let start = (flow.manifold.c(b), gamma);
    let walk = flow.modulation(epsilon, (g, sigma), start, (1.05 * b, flow.psi(b, gamma)));
    // The slow flow by small classical steps in (C^2, gamma).
    let speed = |square: f64| {
        flow.manifold
            .b(square.sqrt(), vines_model::theory::BranchSide::Right)
            .expect("above the fold")
    };
    let rates = |[square, gamma]: [f64; 2]| flow.rates(g, sigma, speed(square), gamma);
    let mut state = [start.0 * start.0, gamma];
    let mut reached = 0.0;
    let mut largest = 0f64;
    for one in walk {
        let tau1 = epsilon * one.tau;
        if tau1 > 0.5 {
            break;
        }
        let h = tau1 - reached;
        let add = |x: [f64; 2], k: [f64; 2], h: f64| [x[0] + h * k[0], x[1] + h * k[1]];
        let k1 = rates(state);
        let k2 = rates(add(state, k1, h / 2.0));
        let k3 = rates(add(state, k2, h / 2.0));
        let k4 = rates(add(state, k3, h));
        state = [0, 1].map(|i| state[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]));
        reached = tau1;
        if tau1 > 0.05 {
            largest = largest.max((one.c - state[0].sqrt()).abs());
        }
    }
    assert!(reached > 0.45, "the walk ended at tau1 = {reached}");
    largest
}

#[test]
fn past_the_fast_approach_the_impacts_follow_the_slow_flow_to_first_order() {
    let (coarse, fine) = (distance_from_slow_flow(4e-3), distance_from_slow_flow(5e-4));
    let slope = (coarse / fine).ln() / 8f64.ln();
    println!("C of the walk less that of the slow flow: {coarse:.1e}, {fine:.1e}, as epsilon^{slope:.2}");
    assert!((0.85..1.2).contains(&slope));
}

#[test]
fn a_walk_from_an_equilibrium_rests_there() {
    let flow = flow();
    let (g, sigma) = (1.1, -1.2);
    let one = flow
        .equilibria(g, sigma)
        .into_iter()
        .find(|one| one.impacts_stable && one.slow_flow_stable)
        .unwrap();
    let epsilon = 1e-3;
    let phases = (one.b, flow.psi(one.b, one.gamma));
    let last = flow
        .modulation(epsilon, (g, sigma), (one.c, one.gamma), phases)
        .take(4_000)
        .last()
        .unwrap();
    close(last.c, one.c, 5.0 * epsilon);
    close(last.b, one.b, 5.0 * epsilon);
    close(last.gamma, one.gamma, 5.0 * epsilon);
}

#[test]
fn below_the_fold_the_walk_ends() {
    let flow = flow();
    let b = flow.manifold.b_min() + 0.02;
    let c = flow.manifold.c(b);
    let walk = flow.modulation(1e-3, (0.0, 0.0), (c, 0.0), (b, flow.psi(b, 0.0)));
    let last = walk.take(100_000).last().unwrap();
    assert!(last.tau < 50_000.0 * PI, "it never ends");
    assert!(last.c < flow.manifold.c_min(), "{last:?}");
}

#[test]
fn every_point_of_a_frequency_response_is_an_equilibrium() {
    let flow = flow();
    for g in [0.9, 1.1, 1.6] {
        let curves = flow.frequency_responses(g, 81);
        assert!(!curves.is_empty());
        for point in curves.iter().flatten() {
            let [amplitude, phase] = flow.rates(g, point.sigma, point.motion.b, point.motion.gamma);
            close(amplitude, 0.0, 1e-7);
            close(phase, 0.0, 1e-7);
        }
    }
}

#[test]
fn at_one_detuning_the_responses_cross_as_often_as_there_are_equilibria() {
    let flow = flow();
    for (g, sigma) in [(1.1, -1.0), (1.3, 0.2), (1.6, -0.8), (1.1, 3.0), (0.9, -1.2)] {
        let crossings: usize = flow
            .frequency_responses(g, 4_001)
            .iter()
            .map(|curve| {
                let sides = curve.windows(2);
                sides
                    .filter(|pair| (pair[0].sigma > sigma) != (pair[1].sigma > sigma))
                    .count()
            })
            .sum();
        assert_eq!(crossings, flow.equilibria(g, sigma).len(), "G = {g}, sigma = {sigma}");
    }
}

#[test]
fn the_backbone_passes_through_the_maxima_of_the_frequency_responses() {
    for r in [0.4, 0.65, 0.9] {
        let flow = SlowFlow::new(LAMBDA, r);
        for above in [0.05, 0.2, 0.6] {
            let fold = flow.backbone_at(flow.manifold.b_min());
            let g = fold.g + above;
            // The maximum over sigma by a search among all equilibria, which knows nothing of phase resonance.
            let highest = |sigma: f64| {
                flow.equilibria(g, sigma).iter().fold(0.0, |most: f64, one| {
                    if one.b > flow.manifold.b_min() {
                        most.max(one.c)
                    } else {
                        most
                    }
                })
            };
            let mut best = (-400..400)
                .map(|n| f64::from(n) * 0.01)
                .max_by(|a, b| highest(*a).total_cmp(&highest(*b)))
                .unwrap();
            let mut step = 0.01;
            while step > 1e-10 {
                match [best - step, best + step]
                    .into_iter()
                    .find(|one| highest(*one) > highest(best))
                {
                    Some(one) => best = one,
                    None => step /= 2.0,
                }
            }
            let point = flow.phase_resonant(g).into_iter().next_back().unwrap();
            close(best, point.sigma, 1e-4);
            close(highest(best), point.c, 1e-8);
        }
    }
}

#[test]
fn the_activation_thresholds_are_where_equilibria_begin() {
    let flow = flow();
    for sigma in [-2.0, -1.2, -0.5, 0.4] {
        let activation = flow.activation(sigma);
        let h = 1e-6;
        assert!(flow.equilibria(activation.existence - h, sigma).is_empty());
        assert!(!flow.equilibria(activation.existence + h, sigma).is_empty());
        let stable = activation.stable.expect("a stable motion at some G");
        assert!(!flow.has_stable_motion(stable - 1e-4, sigma), "sigma = {sigma}");
        assert!(flow.has_stable_motion(stable + 1e-4, sigma), "sigma = {sigma}");
        assert!(activation.existence <= stable);
    }
    // From rest the linear resonance must reach the wall: C = G/lambda = 1.
    close(flow.activation(0.0).steady_linear, LAMBDA, 1e-15);
    close(flow.activation(0.0).from_rest, LAMBDA, 1e-15);
}

#[test]
fn elastic_undamped_motion_needs_no_excitation_on_its_backbone() {
    let flow = SlowFlow::new(0.0, 1.0);
    for b in [0.7, 0.9, 1.2] {
        close(flow.backbone_at(b).g, 0.0, 1e-15);
        close(flow.excitation_at(flow.free_detuning(b), b), 0.0, 1e-15);
    }
}

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
        let t = wave.impact_time();
        close(wave.w(t) / scene.b, 1.0, 1e-12);
        close(wave.w(t + PI / wave.omega) / scene.b, -1.0, 1e-12);
        let h = 1e-6 / wave.omega;
        let before = (wave.w(t) - wave.w(t - h)) / h;
        let after = (wave.w(t + h) - wave.w(t)) / h;
        close(after / before, -R, 1e-4);
        close(wave.q1(0.3) - wave.q2(0.3), wave.w(0.3), 1e-15);
        close(wave.q1(0.3) + scene.epsilon * wave.q2(0.3), wave.v(0.3), 1e-15);
    }
    close(triangle_wave(FRAC_PI_2), FRAC_PI_2, 1e-15);
    close(triangle_wave(PI + 0.2), -0.2, 1e-12);
}

#[test]
fn the_waveform_approaches_the_exact_motion_as_epsilon() {
    let distance = |epsilon: f64| {
        let scene = Dimensionless::new(epsilon, LAMBDA, R, 1.1);
        let orbit = phase_resonant(&scene).into_iter().find(|one| one.stable).unwrap();
        let point = flow().phase_resonant(1.1).into_iter().find(|one| one.stable()).unwrap();
        let wave = Waveform::new(&scene, point.sigma, point.b, -FRAC_PI_2);
        // The exact particle's flight from the impact on w = +1, and the waveform's, both from their own impact on.
        let t = wave.impact_time();
        (1..8)
            .map(|n| {
                let part = f64::from(n) / 8.0;
                let exact = orbit.start.q2 + orbit.start.dq2 * part * PI / orbit.omega;
                (wave.q2(t + part * PI / wave.omega) - exact).abs()
            })
            .fold(0.0, f64::max)
    };
    let (coarse, fine) = (distance(1e-2), distance(1e-3));
    let slope = (coarse / fine).log10();
    println!("q2 of the waveform less the exact one: {coarse:.1e}, {fine:.1e}, as epsilon^{slope:.2}");
    close(slope, 1.0, 0.1);
}

#[test]
fn the_phase_of_a_decay_is_the_integral_of_its_detuning() {
    let decay = flow().decay(0.9).unwrap();
    let (tau1, h) = (0.3, 1e-5);
    let turned = |tau1: f64| decay.turned(decay.at(tau1).unwrap().b);
    let rate = (turned(tau1 + h) - turned(tau1 - h)) / (2.0 * h);
    close(rate, decay.at(tau1).unwrap().sigma, 1e-6);
}

#[test]
fn a_decaying_motion_stays_between_its_walls() {
    let decay = flow().decay(0.9).unwrap();
    let epsilon = 0.001;
    let end = decay.duration() / epsilon;
    let mut touched = 0f64;
    for n in 0..4000 {
        let tau = end * f64::from(n) / 4000.0;
        let [v, w] = decay.motion(epsilon, 0.4, tau).unwrap();
        assert!(w.abs() <= 1.0 + 1e-9 && v.abs() < 1.0, "tau = {tau}: v = {v}, w = {w}");
        touched = touched.max(w.abs());
    }
    assert!(touched > 0.999);
    assert_eq!(decay.motion(epsilon, 0.4, 1.001 * end), None);
}

#[test]
fn the_stable_island_lies_between_fold_and_symmetry_breaking() {
    let flow = flow();
    let (b_min, sigma) = (Manifold::new(R).b_min(), -1.0);
    let within = flow.stable_at(sigma, 0.5 * (b_min + B_SYMMETRY_BREAKING));
    assert!(within && !flow.stable_at(sigma, b_min - 0.01) && !flow.stable_at(sigma, B_SYMMETRY_BREAKING + 0.01));
}

/// The smallest G at which the plant, at rest until the drive is switched on, has an impact.
fn first_impact(epsilon: f64, lambda: f64, sigma: f64) -> f64 {
    let hits = |g: f64| {
        let scene = Dimensionless::new(epsilon, lambda, 0.65, g);
        let mut plant = scene.plant([0.0; 4]).unwrap();
        let drive = scene.drive(sigma);
        let periods = 6.0 / (epsilon * lambda);
        plant.advance(drive, periods).unwrap().impacts > 0
    };
    vines_model::numerics::try_bisection(0.0, 40.0, 1e-6, |g| Ok::<_, ()>(!hits(g)))
        .unwrap()
        .1
}

#[test]
fn impacts_begin_from_rest_where_the_beat_reaches_the_wall() {
    for (sigma, known) in [(-1.18, 2.322), (-2.0, 3.122), (-5.0, 6.10)] {
        let flow = SlowFlow::new(1.43, 0.65);
        let found = flow.activation(sigma);
        let [plant, half] = [0.0084, 0.0042].map(|epsilon| first_impact(epsilon, 1.43, sigma));
        println!(
            "sigma = {sigma}: from rest {:.4}, plant {plant:.4} and {half:.4} at half epsilon, steady {:.4}",
            found.from_rest, found.steady_linear
        );
        assert!((plant - known).abs() < 0.006 * known, "{plant}");
        assert!((found.from_rest - plant).abs() < 0.03 * plant, "{found:?}");
        assert!(
            (found.from_rest - half).abs() < 0.7 * (found.from_rest - plant).abs() + 1e-3,
            "{found:?}"
        );
        assert!(found.steady_linear > 1.1 * found.from_rest);
    }
}
