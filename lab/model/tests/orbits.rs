//! Guards exact orbits: the closed form against independent 40-digit references, and periodic motions by shooting against the closed form,
//! against the plant, and along their curves.

use std::f64::consts::TAU;

use vines_model::{
    Dimensionless,
    orbit::{
        Bifurcation, Branch, Condition, ContinuationLimits, ImpactPattern, Orbit, Periodic, backbone_at_speed,
        branch_off, continue_both_ways, exact_backbone, phase_resonant, settle,
    },
    theory::{B_SYMMETRY_BREAKING, Manifold, SlowFlow},
};

mod reference;
use reference::rows;

/// The orbit closest to the row's sigma.
fn nearest(row: &reference::Row) -> Orbit {
    let scene = Dimensionless::new(row.epsilon, row.lambda, row.r, row.g);
    let distance = |orbit: &Orbit| (orbit.sigma - row.sigma).abs();
    phase_resonant(&scene)
        .into_iter()
        .min_by(|one, other| distance(one).total_cmp(&distance(other)))
        .expect("an orbit for every row")
}

#[test]
fn orbits_match_the_references_to_all_their_digits() {
    let (mut state, mut multipliers) = (0f64, 0f64);
    for row in rows() {
        let orbit = nearest(&row);
        for (found, expected) in [(orbit.sigma, row.sigma), (orbit.c, row.c), (orbit.b, row.b)] {
            state = state.max((found - expected).abs());
        }
        for (found, expected) in orbit.multipliers.iter().zip(row.multipliers) {
            multipliers = multipliers.max((found - expected).abs());
        }
        assert_eq!(orbit.stable, row.multipliers[3] < 1.0, "{row:?}");
    }
    assert!(state < 1e-10, "the references have ten digits: {state:e}");
    assert!(multipliers < 6e-7, "the references have six digits: {multipliers:e}");
}

#[test]
fn what_is_found_beside_the_references_lies_on_the_unstable_left_branch() {
    let rows = rows();
    for row in &rows {
        let listed = |orbit: &Orbit| {
            rows.iter()
                .filter(|other| (other.epsilon, other.r, other.g) == (row.epsilon, row.r, row.g))
                .any(|other| (other.sigma - orbit.sigma).abs() < 1e-8)
        };
        let scene = Dimensionless::new(row.epsilon, row.lambda, row.r, row.g);
        let b_min = Manifold::new(row.r).b_min();
        for orbit in phase_resonant(&scene).iter().filter(|orbit| !listed(orbit)) {
            assert!(orbit.b < b_min && !orbit.stable, "{orbit:?}");
        }
    }
}

#[test]
fn no_orbit_is_invented_where_the_excitation_is_too_weak() {
    assert_eq!(phase_resonant(&Dimensionless::new(0.0084, 1.43, 0.65, 0.2)), []);
    assert_eq!(phase_resonant(&Dimensionless::new(0.0084, 1.43, 0.65, 0.0)), []);
}

#[test]
fn the_curve_of_the_backbone_has_an_orbit_of_every_frequency_that_it_passes() {
    for (epsilon, lambda, r) in [
        (0.0084, 1.43, 0.65),
        (0.03, 0.4, 0.9),
        (0.002, 2.5, 0.4),
        (0.0137, 2.36, 0.86),
    ] {
        let scene = Dimensionless::new(epsilon, lambda, r, 1.0);
        let fold = SlowFlow::new(lambda, r).manifold.b_min();
        let mut before = None;
        for n in 0..2000 {
            let speed = 1.3 + 0.0005 * f64::from(n) * (fold - 1.3);
            let [omega, c, g] = backbone_at_speed(&scene, speed).unwrap_or_else(|| panic!("{scene:?} {speed}"));
            let orbits = exact_backbone(&scene, omega);
            let apart = orbits.iter().map(|orbit| (orbit.c - c).hypot(orbit.g - g));
            assert!(
                apart.fold(1.0, f64::min) < 1e-8,
                "{scene:?} {speed}: {c} {g} {orbits:?}"
            );
            let is_smooth = before.is_none_or(|before: [f64; 2]| (c - before[0]).hypot(omega - before[1]) < 0.01);
            assert!(is_smooth, "{scene:?} {speed}: {before:?} {omega}, {c}");
            before = Some([c, omega]);
        }
    }
}

// Shooting

fn scene(g: f64) -> Dimensionless {
    Dimensionless::new(0.0084, 1.43, 0.65, g)
}

fn response(g: f64) -> (Dimensionless, Branch) {
    let scene = scene(g);
    let fastest = |one: &vines_model::orbit::Orbit, other: &vines_model::orbit::Orbit| one.b.total_cmp(&other.b);
    let orbit = phase_resonant(&scene).into_iter().max_by(fastest).unwrap();
    let conditions = [Condition::Excitation(g), Condition::PhaseResonance];
    let start = Periodic::find(&scene, &ImpactPattern::symmetric(), &orbit.unknowns(), conditions).unwrap();
    let branch = continue_both_ways(&scene, &start, Condition::Excitation(g), &ContinuationLimits::default());
    (scene, branch)
}

/// The largest distance of the plant from its own start after each of this number of periods, started on the motion.
fn distance_of_plant(scene: &Dimensionless, motion: &Periodic, periods: u32) -> f64 {
    let [q1, dq1, q2, dq2] = motion.start(scene).expect("a state at phase zero");
    let mut plant = scene.plant([q1, dq1, q2, dq2]).unwrap();
    let omega = 1.0 + scene.epsilon * motion.sigma;
    let drive = lovines::Drive::harmonic(scene.epsilon * motion.g, omega);
    let whole = motion.pattern.periods();
    (0..periods).fold(0.0, |most, _| {
        for _ in 0..whole {
            plant.advance(drive, TAU / omega).unwrap();
        }
        let now = plant.state();
        let apart = [now.q1 - q1, now.dq1 - dq1, now.q2 - q2, now.dq2 - dq2];
        apart.iter().fold(most, |most: f64, one| most.max(one.abs()))
    })
}

#[test]
fn an_exact_response_passes_folds_and_phase_resonance() {
    let (scene, branch) = response(1.1);
    let sigmas: Vec<f64> = branch.points.iter().map(|one| one.sigma).collect();
    let turns = sigmas
        .windows(3)
        .filter(|s| (s[1] - s[0]) * (s[2] - s[1]) < 0.0)
        .count();
    assert!(turns >= 1 && branch.points.iter().any(|one| !one.stable));
    // Every motion is one that the plant repeats; unstable ones leave slowly.
    for motion in branch.points.iter().step_by(20) {
        let apart = distance_of_plant(&scene, motion, 2);
        assert!(apart < 1e-9, "{apart:e} at sigma = {}", motion.sigma);
    }
    for fold in branch.special.iter().filter(|one| one.kind == Bifurcation::Fold) {
        let nearest = fold.motion.multipliers.iter().map(|[re, im]| (re - 1.0).hypot(*im));
        assert!(nearest.fold(f64::MAX, f64::min) < 1e-4);
    }
}

#[test]
fn symmetry_breaks_near_the_theorys_speed_and_asymmetric_motions_leave_it() {
    let (scene, branch) = response(1.6);
    let breaking = branch
        .special
        .iter()
        .find(|one| one.kind == Bifurcation::SymmetryBreaking)
        .expect("a symmetry breaking");
    assert!((breaking.motion.b - B_SYMMETRY_BREAKING).abs() < 0.03);
    let limits = ContinuationLimits { points: 60, ..ContinuationLimits::default() };
    let aside = branch_off(&scene, breaking, Condition::Excitation(1.6), &limits).unwrap();
    let uneven = |one: &Periodic| (one.bounces[1].phase - one.bounces[0].phase - std::f64::consts::PI).abs();
    let interval = aside.points.iter().map(uneven).fold(0.0, f64::max);
    assert!(interval > 0.05);
    assert!(aside.points.iter().any(|one| one.stable));
    for motion in aside.points.iter().step_by(10) {
        assert!(distance_of_plant(&scene, motion, 2) < 1e-9);
    }
}

#[test]
fn the_exact_backbone_continued_is_the_closed_form() {
    let scene = scene(1.1);
    let orbit = phase_resonant(&scene).into_iter().find(|one| one.stable).unwrap();
    let conditions = [Condition::Excitation(1.1), Condition::PhaseResonance];
    let start = Periodic::find(&scene, &ImpactPattern::symmetric(), &orbit.unknowns(), conditions).unwrap();
    let branch = continue_both_ways(
        &scene,
        &start,
        Condition::PhaseResonance,
        &ContinuationLimits::default(),
    );
    assert!(branch.points.len() > 40, "{}: {:?}", branch.points.len(), branch.ended);
    for motion in &branch.points {
        let closed = exact_backbone(&scene, 1.0 + scene.epsilon * motion.sigma);
        let nearest = closed
            .iter()
            .map(|one| (one.c - motion.c).abs().max((one.g - motion.g).abs()))
            .fold(f64::MAX, f64::min);
        assert!(
            nearest < 1e-8,
            "{nearest:e} at sigma = {}, C = {}",
            motion.sigma,
            motion.c
        );
    }
}

#[test]
fn without_damping_drive_and_loss_the_backbone_is_the_conservative_mode() {
    let scene = Dimensionless::new(0.0084, 0.0, 1.0, 0.0);
    let mode = exact_backbone(&scene, 1.0 - 1.0 * scene.epsilon)
        .into_iter()
        .find(|one| one.c > 0.2)
        .unwrap();
    let conditions = [Condition::Sigma(mode.sigma), Condition::PhaseResonance];
    let start = Periodic::find(&scene, &ImpactPattern::symmetric(), &mode.unknowns(), conditions).unwrap();
    let limits = ContinuationLimits {
        sigma: [-3.0, 0.5],
        points: 200,
        ..ContinuationLimits::default()
    };
    let branch = continue_both_ways(&scene, &start, Condition::PhaseResonance, &limits);
    assert!(branch.points.len() > 20);
    let (mut most_g, mut energies) = (0f64, 0f64);
    for motion in &branch.points {
        most_g = most_g.max(motion.g.abs());
        let [q1, dq1, _, dq2] = motion.start(&Dimensionless { g: 0.0, ..scene }).unwrap();
        let energy = 0.5 * (q1 * q1 + dq1 * dq1 + scene.epsilon * dq2 * dq2);
        for [_, q1, dq1, _, dq2] in motion.motion(&scene, 40) {
            let now = 0.5 * (q1 * q1 + dq1 * dq1 + scene.epsilon * dq2 * dq2);
            energies = energies.max((now / energy - 1.0).abs());
        }
    }
    assert!(most_g < 1e-9 && energies < 1e-9);
}

#[test]
fn a_motion_with_more_impacts_is_followed_like_any_other() {
    let scene = scene(2.2);
    let motion = settle(&scene, -0.6, [0.0, 0.0, 0.0, 0.9], 800)
        .unwrap()
        .expect("a pattern");
    assert!(motion.pattern.impacts() > 2);
    let limits = ContinuationLimits { points: 40, ..ContinuationLimits::default() };
    let branch = continue_both_ways(&scene, &motion, Condition::Excitation(2.2), &limits);
    assert!(branch.points.len() > 20);
    for motion in branch.points.iter().step_by(7) {
        assert!(distance_of_plant(&scene, motion, 1) < 1e-9);
    }
}
