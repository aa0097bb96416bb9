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
        Bifurcation, Branch, BranchBifurcation, BranchEnd, Condition, ContinuationLimits, DOUBLINGS, FrequencyResponse,
        Periodic, bifurcation_curves, response, settle, symmetric_orbits,
    },
};

mod common;
use common::{setting, symmetric, within};

fn scene(g: f64) -> Dimensionless {
    Dimensionless::new(0.0084, 1.43, 0.65, g)
}

/// The response of a scene over the usual range.
fn searched(scene: &Dimensionless) -> FrequencyResponse {
    response(scene, &ContinuationLimits::default(), DOUBLINGS)
}

/// The detunings of the folds on some branches.
fn folds<'a>(branches: impl Iterator<Item = &'a Branch>) -> Vec<f64> {
    let special = branches.flat_map(|branch| &branch.special);
    let folds = special.filter(|one| one.kind == Bifurcation::Fold);
    folds.map(|one| one.motion.sigma).collect()
}

/// Distance of a point from the line between two others, in the first N coordinates of all.
fn beside<const N: usize>(at: [f64; N], from: [f64; N], to: [f64; N]) -> f64 {
    let difference = |a: [f64; N], b: [f64; N]| std::array::from_fn::<f64, N, _>(|n| a[n] - b[n]);
    let dot = |a: [f64; N], b: [f64; N]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let (chord, off) = (difference(to, from), difference(at, from));
    let part = (dot(off, chord) / dot(chord, chord)).clamp(0.0, 1.0);
    let rest = std::array::from_fn(|n| off[n] - part * chord[n]);
    dot(rest, rest).sqrt()
}

/// What holds for every response: all symmetric motions lie on its components, no component is listed twice, mirror images are one branch,
/// a branch reaches the motion that it joins, a torus is a modulation only where the motion was stable, and a drawing is within 1e-4.
fn checked(scene: &Dimensionless) -> FrequencyResponse {
    let found = searched(scene);
    for sigma in [-2.0, -0.4, -0.2, 0.0, 0.2] {
        for orbit in symmetric_orbits(scene, sigma) {
            let motion = orbit.periodic(scene, [Condition::Sigma(sigma), Condition::Excitation(scene.g)]);
            assert!(found.contains(scene, &motion.unwrap()), "G = {}: {orbit:?}", scene.g);
        }
    }
    for (n, component) in found.components.iter().enumerate() {
        let (name, branch) = (&component.name, &component.branch);
        let points = &branch.points;
        let middle = &points[points.len() / 2];
        let others = &found.components[n + 1..];
        assert!(!others.iter().any(|other| other.branch.passes(scene, middle)), "{name}");

        // How much the first flight of a 1:1 motion is longer than half a period, rad.
        let asymmetry = |motion: &Periodic| motion.bounces[1].phase - motion.bounces[0].phase - std::f64::consts::PI;
        if name.starts_with("asymmetric 1:1") {
            // Between its ends no motion is symmetric again.
            let intervals = points.iter().map(asymmetry).filter(|one| one.abs() > 1e-6);
            let signs: Vec<f64> = intervals.map(f64::signum).collect();
            assert!(signs.windows(2).all(|pair| pair[0] == pair[1]), "{name}");
            let ends = [&points[0], &points[points.len() - 1]].into_iter().zip(branch.ended);
            let mut joined = ends.filter(|(_, ended)| *ended == BranchEnd::Joins);
            assert!(joined.all(|(end, _)| asymmetry(end).abs() < 0.01), "{name}");
        }
        for torus in branch
            .special
            .iter()
            .filter(|one| one.kind == Bifurcation::NeimarkSacker && one.motion.bounds_stability())
        {
            let near = |motion: &Periodic| (motion.sigma - torus.motion.sigma).abs() < 0.1;
            assert!(points.iter().any(|one| near(one) && one.stability.stable), "{name}");
        }

        let place = |one: &Periodic| {
            let (sin, cos) = one.gamma.sin_cos();
            [one.sigma, one.c * cos, one.c * sin, one.b, one.g]
        };
        let drawn: Vec<_> = branch.drawn().into_iter().map(place).collect();
        let near = |at, line: &[[f64; 5]]| beside(at, line[0], line[1]) < 1.0001e-4;
        let is_drawn = |one: &Periodic| drawn.windows(2).any(|line| near(place(one), line));
        assert!(points.iter().all(is_drawn) && drawn.len() <= points.len(), "{name}");
    }
    found
}

#[test]
fn components_of_responses_are_complete_distinct_and_reach_what_they_join() {
    for g in [0.98, 1.0, 1.005, 1.1, 1.6, 2.2, 2.7] {
        let found = checked(&scene(g));
        let count = |name: &str| found.components.iter().filter(|one| one.name.starts_with(name)).count();
        assert!(g != 1.6 || count("asymmetric 1:1") > 0);
        let longest = &found.components[0].branch;
        assert!(g != 2.7 || longest.drawn().len() < longest.points.len());
        if g < 1.01 {
            // A closed isola, which turns twice, and beside it the component of slow particles.
            assert!(count("symmetric 1:1") >= 2, "G = {g}");
            let closed = || symmetric(&found).filter(|branch| branch.ended == [BranchEnd::Closed; 2]);
            assert!(closed().count() > 0 && closed().all(|one| folds([one].into_iter()).len() == 2));
        }
    }
    let found = checked(&Dimensionless::new(0.004, 1.0, 0.5, 1.4982));
    let joins = |name: &str, branch: &Branch| name.starts_with("asym") && branch.ended.contains(&BranchEnd::Joins);
    assert!(found.components.iter().any(|one| joins(&one.name, &one.branch)));
}

#[test]
fn bifurcations_and_branches_close_together_are_told_apart() {
    // At sigma = 4.0125 a complex pair leaves the unit circle and, at 4.0138, one of the two returns: in one step.
    let close = folds(symmetric(&searched(&scene(1.1514))));
    assert!(close.iter().any(|sigma| (sigma - 4.0138).abs() < 1e-3));
    // At G = 0.84278 two branches meet at sigma = -0.435; below, each of them has a fold there, and above none.
    for (g, count) in [(0.84275, 2), (0.8428, 0), (0.84285, 0)] {
        let scene = Dimensionless::new(0.008650812324298334, 1.3523112557067605, 0.9126958726492855, g);
        let limits = ContinuationLimits { sigma: [-5.0, 5.0], ..ContinuationLimits::default() };
        let found = response(&scene, &limits, DOUBLINGS);
        assert_eq!(folds(symmetric(&found)).len(), count, "G = {g}");
        assert_eq!(symmetric(&found).count(), 2, "G = {g}");
    }
}

#[test]
fn an_isola_between_two_detunings_of_the_search_is_found_with_its_folds() {
    // It begins at G = 0.62167597. Up to 0.6216766, it is narrower than the detunings are apart; its equations are nearly singular.
    for n in 0..20 {
        let found = searched(&scene(0.6216761 + 5e-7 * f64::from(n)));
        assert_eq!(found.components.len(), 1);
        let Branch { ended, special, .. } = &found.components[0].branch;
        assert_eq!((*ended, special.len()), ([BranchEnd::Closed; 2], 2));
    }
}

/// A scene of random parameters, with G = 1.
fn any_scene(random: &mut ChaCha8Rng) -> Dimensionless {
    let epsilon = within(random, [0.003_f64.ln(), 0.05_f64.ln()]).exp();
    let [lambda, r] = [[0.2, 2.0], [0.3, 0.95]].map(|range| within(random, range));
    Dimensionless::new(epsilon, lambda, r, 1.0)
}

/// Settles from random starts at random detunings; counts the 1:1 motions, the others, and those of each that no component contains.
fn missing(scene: &Dimensionless, count: usize, seed: u64) -> [usize; 4] {
    let found = searched(scene);
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut counts = [0; 4];
    for _ in 0..count {
        let ranges = [[-6.0, 6.0], [-1.5, 1.5], [-1.5, 1.5], [-0.99, 0.99], [-2.0, 2.0]];
        // The particle is inside its cavity.
        let [sigma, q1, dq1, w, dq2] = ranges.map(|range| within(&mut random, range));
        let Ok(Some(motion)) = settle(scene, sigma, [q1, dq1, q1 + w, dq2], 800) else {
            continue;
        };
        let other = usize::from(!motion.pattern.is_one_to_one());
        counts[other] += 1;
        counts[2 + other] += usize::from(motion.stability.stable && !found.contains(scene, &motion));
    }
    counts
}

#[test]
fn no_stable_1_to_1_orbit_from_random_starts_is_missing_from_the_components() {
    let mut random = ChaCha8Rng::seed_from_u64(setting("SEED", 20_261_121));
    let mut sums = [0; 4];
    for n in 0..setting("SCENES", 4) {
        let scene = any_scene(&mut random);
        let g = within(&mut random, [0.4, 3.0]);
        let counts = missing(&Dimensionless { g, ..scene }, 60, 100 + n);
        (0..4).for_each(|n| sums[n] += counts[n]);
    }
    let [motions, others, missing, missing_others] = sums;
    println!("all: 1:1 {motions}, others {others}, missing {missing} and {missing_others}");
    assert!(motions > 40 && missing == 0);
}

// Bifurcation curves

const LIMITS: ContinuationLimits = ContinuationLimits { sigma: [-5.0, 5.0], g: [0.1, 3.0], points: 2000, step: 0.05 };
/// Largest distance of a bifurcation from a curve, or from the nearest one of a frequency response.
const NEAR: f64 = 2e-3;
/// Random points of the curves of a scene that are compared with the frequency response through them.
const POINTS: usize = 22;

/// Smallest distance of a multiplier from its value at a bifurcation.
fn off_circle(kind: Bifurcation, motion: &Periodic) -> f64 {
    let distance = |[re, im]: &[f64; 2]| match kind {
        Bifurcation::Fold => (re - 1.0).hypot(*im),
        Bifurcation::SymmetryBreaking | Bifurcation::PeriodDoubling => (re + 1.0).hypot(*im),
        Bifurcation::NeimarkSacker => (re.hypot(*im) - 1.0).abs(),
    };
    motion
        .stability
        .multipliers
        .iter()
        .map(distance)
        .fold(f64::MAX, f64::min)
}

/// The bifurcations of the 1:1 motions at one excitation.
fn bifurcations(scene: &Dimensionless, g: f64) -> Vec<BranchBifurcation> {
    let found = response(&Dimensionless { g, ..*scene }, &LIMITS, 1);
    let specials = found.components.into_iter().flat_map(|one| one.branch.special);
    specials.filter(|one| one.motion.pattern.is_one_to_one()).collect()
}

/// Both directions for one scene: number of bifurcations compared and the largest distance of each, and of a multiplier from its value.
fn compare(scene: &Dimensionless, levels: &[f64], random: &mut ChaCha8Rng) -> ([usize; 2], [f64; 3]) {
    let curves = bifurcation_curves(scene, &LIMITS);
    let (mut counts, mut largest) = ([0; 2], [0.0_f64; 3]);
    let place = |one: &Periodic| [one.sigma, one.g];
    let curve_motions = curves
        .iter()
        .flat_map(|curve| curve.branch.points.iter().map(|one| (curve.kind, one)));
    let motions: Vec<(Bifurcation, &Periodic)> = curve_motions.collect();
    let seventh = motions.iter().step_by(7);
    largest[2] = seventh
        .map(|(kind, motion)| off_circle(*kind, motion))
        .fold(0.0, f64::max);
    for special in levels.iter().flat_map(|g| bifurcations(scene, *g)) {
        let same = curves.iter().filter(|curve| curve.kind == special.kind);
        let lines = same.flat_map(|curve| curve.branch.points.windows(2));
        let apart = lines.map(|pair| beside(place(&special.motion), place(&pair[0]), place(&pair[1])));
        counts[0] += 1;
        largest[0] = largest[0].max(apart.fold(f64::MAX, f64::min));
    }
    for _ in 0..POINTS.min(motions.len()) {
        let (kind, motion) = motions[random.next_u64() as usize % motions.len()];
        // At its ends a curve may be outside of the range; where it turns in G, two bifurcations of a response become one.
        if !(-4.9..4.9).contains(&motion.sigma) || !(0.15..2.95).contains(&motion.g) {
            continue;
        }
        let found = bifurcations(scene, motion.g).into_iter().filter(|one| one.kind == kind);
        let apart = found.map(|one| (one.motion.sigma - motion.sigma).abs());
        counts[1] += 1;
        largest[1] = largest[1].max(apart.fold(f64::MAX, f64::min));
    }
    (counts, largest)
}

#[test]
fn every_bifurcation_of_a_response_lies_on_a_curve_and_every_point_of_a_curve_is_one() {
    let mut random = ChaCha8Rng::seed_from_u64(setting("SEED", 1));
    for n in 0..=setting("SCENES", 0) {
        // Levels that the search for the curves does not use.
        let (scene, levels) = match n {
            0 => (scene(1.1), [0.97, 1.003, 1.37, 1.63, 2.21]),
            _ => (any_scene(&mut random), [0; 5].map(|_| within(&mut random, [0.4, 3.0]))),
        };
        let (counts, largest) = compare(&scene, &levels, &mut random);
        let rounded = largest.map(|one| format!("{one:.1e}"));
        println!("{scene:?}: {counts:?} compared, largest distances {rounded:?}");
        let [from_curves, from_responses, off_circle] = largest;
        assert!(off_circle < 1e-6 && from_curves.max(from_responses) < NEAR);
        assert!(n > 0 || counts[0] > 15 && counts[1] > 15, "{counts:?}");
    }
}
