//! The components of exact frequency responses: none is missed.

use rand_chacha::{
    ChaCha8Rng,
    rand_core::{Rng, SeedableRng},
};
use vines_model::{
    Dimensionless,
    numerics::range,
    orbit::{
        Bifurcation, Branch, BranchEnd, ContinuationLimits, DOUBLINGS, FrequencyResponse, Periodic, response, settle,
        symmetric_orbits,
    },
};

mod common;
use common::setting;

fn scene(g: f64) -> Dimensionless {
    Dimensionless::new(0.0084, 1.43, 0.65, g)
}

/// The response of a scene over the usual range.
fn searched(scene: &Dimensionless) -> FrequencyResponse {
    response(scene, &ContinuationLimits::default(), DOUBLINGS)
}

fn followed(g: f64) -> FrequencyResponse {
    searched(&scene(g))
}

fn list(response: &FrequencyResponse) {
    for one in &response.components {
        let Branch { points, special, ended } = &one.branch;
        let sigmas = range((f64::MAX, f64::MIN), points.iter().map(|one| one.sigma));
        let special: Vec<_> = special.iter().map(|one| (one.name(), one.motion.sigma)).collect();
        println!(
            "G = {}: {}, sigma {sigmas:.3?}, ended {ended:?}, {special:.4?}",
            response.g, one.name
        );
    }
}

/// How much the first flight of a 1:1 motion is longer than half a period, rad.
fn asymmetry(motion: &Periodic) -> f64 {
    motion.bounces[1].phase - motion.bounces[0].phase - std::f64::consts::PI
}

#[test]
fn beside_the_closed_isola_the_response_has_the_component_of_slow_particles() {
    for g in [0.98, 1.0, 1.005] {
        let found = followed(g);
        list(&found);
        let symmetric: Vec<_> = found.symmetric().collect();
        assert!(symmetric.len() >= 2, "G = {g}");
        assert!(symmetric.iter().any(|one| one.ended == [BranchEnd::Closed; 2]));
        for one in &symmetric {
            let folds = one.special.iter().filter(|one| one.kind == Bifurcation::Fold).count();
            assert!(
                one.ended != [BranchEnd::Closed; 2] || folds == 2,
                "a closed curve turns twice, G = {g}: {folds}"
            );
        }
        // Random starts settle on these.
        for sigma in [-0.4, -0.2, 0.0, 0.2] {
            let Some(stable) = symmetric_orbits(&scene(g), sigma).into_iter().find(|one| one.stable) else {
                assert!(g < 1.0, "a stable orbit at sigma = {sigma}");
                continue;
            };
            let near = |one: &Periodic| (one.sigma - sigma).abs() < 0.06 && (one.c - stable.c).abs() < 0.02;
            assert!(
                symmetric.iter().any(|one| one.points.iter().any(near)),
                "G = {g}, sigma = {sigma}"
            );
        }
    }
}

#[test]
fn a_response_that_leaves_the_range_has_its_left_branch_too() {
    for g in [2.2, 2.7] {
        let found = followed(g);
        list(&found);
        let orbits = symmetric_orbits(&scene(g), -2.0);
        assert!(!orbits.is_empty());
        for orbit in orbits {
            let near = |one: &Periodic| (one.sigma + 2.0).abs() < 0.06 && (one.c - orbit.c).abs() < 0.05;
            assert!(
                found.symmetric().any(|one| one.points.iter().any(near)),
                "G = {g}: {orbit:?}"
            );
        }
    }
}

#[test]
fn mirror_images_of_an_asymmetric_branch_are_one_branch() {
    let found = followed(1.6);
    list(&found);
    let asymmetric: Vec<_> = found
        .components
        .iter()
        .filter(|one| one.name.starts_with("asymmetric 1:1"))
        .collect();
    assert!(!asymmetric.is_empty());
    for one in &asymmetric {
        // Between its ends no motion is symmetric again.
        let intervals = one.branch.points.iter().map(asymmetry);
        let signs: Vec<_> = intervals.filter(|one| one.abs() > 1e-6).map(f64::signum).collect();
        assert!(signs.windows(2).all(|pair| pair[0] == pair[1]), "{}", one.name);
    }
}

#[test]
fn a_component_that_joins_another_at_both_ends_is_listed_once() {
    let found = followed(2.7);
    list(&found);
    for (n, one) in found.components.iter().enumerate() {
        let middle = &one.branch.points[one.branch.points.len() / 2];
        for other in &found.components[n + 1..] {
            assert!(
                !other.branch.passes(&scene(2.7), middle),
                "{} and {}",
                one.name,
                other.name
            );
        }
    }
}

#[test]
fn a_torus_is_reported_as_modulation_only_where_the_motion_was_stable() {
    for g in [1.0, 1.1, 1.6, 2.2] {
        for one in followed(g).components {
            for special in one.branch.special.iter().filter(|one| one.name().starts_with("torus")) {
                let near = |motion: &&Periodic| (motion.sigma - special.motion.sigma).abs() < 0.1;
                assert!(
                    one.branch.points.iter().filter(near).any(|one| one.stable),
                    "{}",
                    one.name
                );
            }
        }
    }
}

#[test]
fn two_bifurcations_close_together_are_both_found() {
    // At sigma = 4.0125 a complex pair leaves the unit circle and, at 4.0138, one of the two returns: in one step.
    let found = followed(1.1514);
    list(&found);
    let folds = found
        .symmetric()
        .flat_map(|one| &one.special)
        .filter(|one| one.kind == Bifurcation::Fold);
    assert!(folds.into_iter().any(|one| (one.motion.sigma - 4.0138).abs() < 1e-3));
}

#[test]
fn a_drawing_needs_fewer_motions_and_stays_within_1e_4() {
    let found = followed(2.7);
    for one in &found.components {
        let place = |one: &Periodic| [one.sigma, one.c, one.b];
        let drawn: Vec<_> = one.branch.drawn().into_iter().map(place).collect();
        let beside = |motion: &Periodic, [from, to]: [[f64; 3]; 2]| {
            let at = place(motion);
            let dot = |a: &dyn Fn(usize) -> f64, b: &dyn Fn(usize) -> f64| (0..3).map(|n| a(n) * b(n)).sum::<f64>();
            let (chord, off) = (|n: usize| to[n] - from[n], |n: usize| at[n] - from[n]);
            let part = (dot(&off, &chord) / dot(&chord, &chord)).clamp(0.0, 1.0);
            let rest = |n: usize| off(n) - part * chord(n);
            dot(&rest, &rest).sqrt()
        };
        let lines = || drawn.windows(2).map(|pair| [pair[0], pair[1]]);
        let largest = |motion| lines().map(|line| beside(motion, line)).fold(f64::MAX, f64::min);
        let largest = one.branch.points.iter().map(largest).fold(0.0, f64::max);
        println!(
            "{}: {} of {} motions, {largest:.1e}",
            one.name,
            drawn.len(),
            one.branch.points.len()
        );
        assert!(largest < 1.01e-4 && drawn.len() <= one.branch.points.len());
    }
    let longest = found.components[0].branch.drawn().len();
    assert!(longest < found.components[0].branch.points.len());
}

#[test]
fn an_isola_between_two_detunings_of_the_search_is_found_with_its_folds() {
    // It begins at G = 0.62167597. Up to 0.6216766, it is narrower than the detunings are apart; its equations are nearly singular.
    for n in 0..20 {
        let g = 0.6216761 + 5e-7 * f64::from(n);
        let found = followed(g);
        list(&found);
        assert_eq!(found.components.len(), 1);
        let Branch { ended, special, .. } = &found.components[0].branch;
        assert_eq!((*ended, special.len()), ([BranchEnd::Closed; 2], 2));
    }
}

#[test]
fn continuation_does_not_step_from_one_branch_to_another_one_close_by() {
    // At G = 0.84278 two branches meet at sigma = -0.435; below, each of them has a fold there, and above none.
    for (g, folds) in [(0.84275, 2), (0.8428, 0), (0.84285, 0)] {
        let scene = Dimensionless::new(0.008650812324298334, 1.3523112557067605, 0.9126958726492855, g);
        let limits = ContinuationLimits { sigma: [-5.0, 5.0], ..ContinuationLimits::default() };
        let found = response(&scene, &limits, DOUBLINGS);
        list(&found);
        let special = found.symmetric().flat_map(|one| &one.special);
        assert_eq!(
            special.filter(|one| one.kind == Bifurcation::Fold).count(),
            folds,
            "G = {g}"
        );
        assert_eq!(found.symmetric().count(), 2, "G = {g}");
    }
}

#[test]
fn a_branch_reaches_the_motion_that_it_joins() {
    let scene = Dimensionless::new(0.004, 1.0, 0.5, 1.4982);
    let found = searched(&scene);
    for one in &found.components {
        let points = &one.branch.points;
        let ends = [&points[0], &points[points.len() - 1]]
            .into_iter()
            .zip(one.branch.ended);
        for (end, _) in ends.filter(|(_, ended)| *ended == BranchEnd::Joins) {
            assert!(asymmetry(end).abs() < 0.01, "{}: sigma = {}", one.name, end.sigma);
        }
    }
}

/// A random state with the particle inside its cavity: (q1, q1', q2, q2'), dimensionless.
fn start(random: &mut impl Rng) -> [f64; 4] {
    let mut uniform = |low: f64, high: f64| low + (high - low) * (random.next_u64() as f64 / u64::MAX as f64);
    let [q1, dq1, w, dq2] = [
        uniform(-1.5, 1.5),
        uniform(-1.5, 1.5),
        uniform(-0.99, 0.99),
        uniform(-2.0, 2.0),
    ];
    [q1, dq1, q1 + w, dq2]
}

/// Settles from random starts at random detunings; counts the 1:1 motions, the others, and those of each that no component contains.
fn missing(scene: &Dimensionless, count: usize, seed: u64) -> [usize; 4] {
    let found = searched(scene);
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut counts = [0; 4];
    for _ in 0..count {
        let sigma = 12.0 * (random.next_u64() as f64 / u64::MAX as f64) - 6.0;
        let Ok(Some(motion)) = settle(scene, sigma, start(&mut random), 800) else {
            continue;
        };
        let other = usize::from(!motion.pattern.is_one_to_one());
        counts[other] += 1;
        if motion.stable && !found.contains(scene, &motion) {
            println!(
                "{scene:?}: {} at sigma = {sigma}, C = {} is missing",
                motion.pattern.name(),
                motion.c
            );
            counts[2 + other] += 1;
        }
    }
    counts
}

#[test]
fn no_stable_1_to_1_orbit_from_random_starts_is_missing_from_the_components() {
    // SCENES sets their number, SEED their seed.
    let mut random = ChaCha8Rng::seed_from_u64(setting("SEED", 20_261_121));
    let mut sums = [0; 4];
    let scenes = setting("SCENES", 4);
    for n in 0..scenes {
        let mut within = |low: f64, high: f64| low + (high - low) * (random.next_u64() as f64 / u64::MAX as f64);
        let epsilon = within(0.003_f64.ln(), 0.05_f64.ln()).exp();
        let scene = Dimensionless::new(epsilon, within(0.2, 2.0), within(0.3, 0.95), within(0.4, 3.0));
        let counts = missing(&scene, 60, 100 + n);
        println!(
            "scene {n}: 1:1 {}, others {}, missing {} and {}",
            counts[0], counts[1], counts[2], counts[3]
        );
        (0..4).for_each(|n| sums[n] += counts[n]);
    }
    println!(
        "all: 1:1 {}, others {}, missing {} and {}",
        sums[0], sums[1], sums[2], sums[3]
    );
    assert!(sums[0] > 40 && sums[2] == 0, "{sums:?}");
}
