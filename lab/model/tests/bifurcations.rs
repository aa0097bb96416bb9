//! Bifurcation curves in (sigma, G) against the bifurcations on frequency responses, in both directions. `SCENES` sets the number of
//! random scenes beside the default one, `SEED` their seed (docs/regimes.md has a longer run).

use rand_chacha::{
    ChaCha8Rng,
    rand_core::{Rng, SeedableRng},
};
use vines_model::{
    Dimensionless,
    orbit::{
        Bifurcation, BifurcationCurve, BranchBifurcation, BranchEnd, ContinuationLimits, Periodic, bifurcation_curves,
        response,
    },
};

mod common;
use common::setting;

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
        println!(
            "{}: {} points, ends {:?}",
            curve.name(),
            points.len(),
            curve.branch.ended
        );
        motions.extend(points.iter().map(|one| (curve, one)));
        let off = points.iter().step_by(7).map(|one| off_circle(curve, one));
        largest[2] = off.fold(largest[2], f64::max);
    }
    for &g in levels {
        for special in bifurcations(&Dimensionless { g, ..*scene }) {
            let apart = from_curves(&curves, &special);
            println!(
                "G = {g:.4}: {} at sigma = {:.4}: {apart:.1e} from a curve",
                special.kind.name(),
                special.motion.sigma
            );
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
        println!(
            "{} at sigma = {:.4}, G = {:.4}: {apart:.1e} from a bifurcation of the response",
            curve.name(),
            motion.sigma,
            motion.g
        );
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

#[test]
fn two_bifurcations_of_a_kind_within_a_step_are_both_found() {
    // A pair of multipliers leaves the circle at sigma = -0.6139 and returns at -0.5910: the count of those outside does not change.
    let scene = Dimensionless::new(0.021564311166206957, 1.5038521612880744, 0.7548147212665681, 0.9354);
    let mut found: Vec<f64> = bifurcations(&scene)
        .into_iter()
        .filter(|one| one.kind == Bifurcation::Torus)
        .map(|one| one.motion.sigma)
        .filter(|sigma| (-0.65..-0.55).contains(sigma))
        .collect();
    found.sort_by(f64::total_cmp);
    println!("{found:?}");
    assert!(matches!(found[..], [first, second] if (first + 0.6139).abs() < 1e-3 && (second + 0.5910).abs() < 1e-3));
}

#[test]
fn a_curve_of_asymmetric_folds_reaches_the_symmetry_breaking_where_it_ends() {
    // It ends at sigma = -0.854134, G = 0.535646, where the equations are singular, and at sigma = -0.050283, G = 1.347293.
    let scene = Dimensionless::new(0.01868089571475754, 0.45669401694636375, 0.8115318618163199, 0.535649);
    let curves = bifurcation_curves(&scene, &LIMITS);
    let folds = curves
        .iter()
        .find(|one| one.name() == "fold of asymmetric 1:1")
        .unwrap();
    assert_eq!(folds.branch.ended, [BranchEnd::Joins; 2]);
    // 3e-6 above the end, both halves of the motion differ by 3e-3.
    let found = bifurcations(&scene);
    let fold = |one: &&BranchBifurcation| one.kind == Bifurcation::Fold && (one.motion.sigma + 0.854126).abs() < 1e-5;
    assert!(found.iter().any(|one| fold(&one)), "{found:?}");
}
