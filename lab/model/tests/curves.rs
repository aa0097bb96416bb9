//! Guards exact curves: the components of frequency responses, of which none is missed, and the bifurcation curves in (sigma, G), which are
//! compared with the bifurcations on frequency responses in both directions. `SCENES` sets the number of random scenes, `SEED` their seed
//! (docs/regimes.md has a longer run).

use rand_chacha::{
    ChaCha8Rng,
    rand_core::{Rng, SeedableRng},
};
use vines_model::{
    Dimensionless,
    orbit::{
        Bifurcation, BifurcationCurve, Branch, BranchBifurcation, BranchEnd, ContinuationLimits, DOUBLINGS,
        FrequencyResponse, Periodic, bifurcation_curves, response, settle, symmetric_orbits,
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

/// How much the first flight of a 1:1 motion is longer than half a period, rad.
fn asymmetry(motion: &Periodic) -> f64 {
    motion.bounces[1].phase - motion.bounces[0].phase - std::f64::consts::PI
}

#[test]
fn beside_the_closed_isola_the_response_has_the_component_of_slow_particles() {
    for g in [0.98, 1.0, 1.005] {
        let found = followed(g);
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
        (0..4).for_each(|n| sums[n] += counts[n]);
    }
    println!(
        "all: 1:1 {}, others {}, missing {} and {}",
        sums[0], sums[1], sums[2], sums[3]
    );
    assert!(sums[0] > 40 && sums[2] == 0, "{sums:?}");
}

// Bifurcation curves

const LIMITS: ContinuationLimits = ContinuationLimits { sigma: [-5.0, 5.0], g: [0.1, 3.0], points: 2000, step: 0.05 };
/// Largest distance of a bifurcation from a curve, or from the nearest one of a frequency response.
const NEAR: f64 = 2e-3;
/// Random points of the curves of a scene that are compared with the frequency response through them.
const POINTS: usize = 22;

/// On the curve a multiplier has its value.
fn off_circle(curve: &BifurcationCurve, motion: &Periodic) -> f64 {
    let distance = |[re, im]: &[f64; 2]| match curve.kind {
        Bifurcation::Fold => (re - 1.0).hypot(*im),
        Bifurcation::SymmetryBreaking | Bifurcation::PeriodDoubling => (re + 1.0).hypot(*im),
        Bifurcation::Torus => (re.hypot(*im) - 1.0).abs(),
    };
    motion.multipliers.iter().map(distance).fold(f64::MAX, f64::min)
}

/// The bifurcations of the 1:1 motions at one excitation.
fn bifurcations(scene: &Dimensionless) -> Vec<BranchBifurcation> {
    let found = response(scene, &LIMITS, 1);
    let specials = found.components.into_iter().flat_map(|one| one.branch.special);
    specials.filter(|one| one.motion.pattern.is_one_to_one()).collect()
}

/// Distance in (sigma, G) of a bifurcation from the curves of its kind.
fn from_curves(curves: &[BifurcationCurve], special: &BranchBifurcation) -> f64 {
    let at = (special.motion.sigma, special.motion.g);
    let curves = curves.iter().filter(|one| one.kind == special.kind);
    let segments = curves.flat_map(|one| one.branch.points.windows(2));
    segments
        .map(|pair| to_segment(at, (pair[0].sigma, pair[0].g), (pair[1].sigma, pair[1].g)))
        .fold(f64::MAX, f64::min)
}

fn to_segment(at: (f64, f64), from: (f64, f64), to: (f64, f64)) -> f64 {
    let (dx, dy) = (to.0 - from.0, to.1 - from.1);
    let part = (((at.0 - from.0) * dx + (at.1 - from.1) * dy) / (dx * dx + dy * dy)).clamp(0.0, 1.0);
    (at.0 - from.0 - part * dx).hypot(at.1 - from.1 - part * dy)
}

/// Both directions for one scene: number of bifurcations compared and the largest distance of each, and of a multiplier from its value.
fn compare(scene: &Dimensionless, levels: &[f64], random: &mut ChaCha8Rng) -> ([usize; 2], [f64; 3]) {
    let curves = bifurcation_curves(scene, &LIMITS);
    let (mut counts, mut largest) = ([0; 2], [0.0_f64; 3]);
    let mut motions = Vec::new();
    for curve in &curves {
        let points = &curve.branch.points;
        motions.extend(points.iter().map(|one| (curve, one)));
        let off = points.iter().step_by(7).map(|one| off_circle(curve, one));
        largest[2] = off.fold(largest[2], f64::max);
    }
    for &g in levels {
        for special in bifurcations(&Dimensionless { g, ..*scene }) {
            let apart = from_curves(&curves, &special);
            counts[0] += 1;
            largest[0] = largest[0].max(apart);
        }
    }
    for _ in 0..POINTS.min(motions.len()) {
        let (curve, motion) = motions[random.next_u64() as usize % motions.len()];
        // At its ends a curve may be outside of the range; where it turns in G, two bifurcations of a response become one.
        let inside = (-4.9..4.9).contains(&motion.sigma) && (0.15..2.95).contains(&motion.g);
        if !inside {
            continue;
        }
        let found = bifurcations(&Dimensionless { g: motion.g, ..*scene });
        let same = found.iter().filter(|one| one.kind == curve.kind);
        let apart = same
            .map(|one| (one.motion.sigma - motion.sigma).abs())
            .fold(f64::MAX, f64::min);
        counts[1] += 1;
        largest[1] = largest[1].max(apart);
    }
    (counts, largest)
}

#[test]
fn every_bifurcation_of_a_response_lies_on_a_curve_and_every_point_of_a_curve_is_one() {
    let mut random = ChaCha8Rng::seed_from_u64(setting("SEED", 1));
    for n in 0..=setting("SCENES", 0) {
        let mut within = |low: f64, high: f64| low + (high - low) * (random.next_u64() as f64 / u64::MAX as f64);
        // Levels that the search for the curves does not use.
        let (scene, levels) = if n == 0 {
            (
                Dimensionless::new(0.0084, 1.43, 0.65, 1.1),
                vec![0.97, 1.003, 1.37, 1.63, 2.21],
            )
        } else {
            let epsilon = within(0.003_f64.ln(), 0.05_f64.ln()).exp();
            let scene = Dimensionless::new(epsilon, within(0.2, 2.0), within(0.3, 0.95), 1.0);
            (scene, (0..5).map(|_| within(0.4, 3.0)).collect())
        };
        let (counts, largest) = compare(&scene, &levels, &mut random);
        let rounded = largest.map(|one| format!("{one:.1e}"));
        println!("{scene:?}: {counts:?} compared, largest distances {rounded:?}");
        assert!(
            largest[2] < 1e-6 && largest[0] < NEAR && largest[1] < NEAR,
            "{largest:?}"
        );
        assert!(n > 0 || counts[0] > 15 && counts[1] > 15, "{counts:?}");
    }
}
