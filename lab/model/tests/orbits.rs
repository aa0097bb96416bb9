//! Guards exact orbits: the closed form against independent 40-digit references, and periodic motions by shooting against the closed form,
//! against the plant, and along their curves.

use std::f64::consts::TAU;

use vines_model::{
    Dimensionless,
    orbit::{
        Bifurcation, Branch, Condition, ContinuationLimits, Orbit, Periodic, backbone_at_speed, branch_off,
        continue_both_ways, exact_backbone, phase_resonant, settle,
    },
    theory::{B_SYMMETRY_BREAKING, Manifold, SlowFlow},
};

mod reference;
use reference::rows;

#[test]
fn orbits_match_the_references_to_all_their_digits_and_others_are_on_the_unstable_left_branch() {
    let (mut state, mut multipliers) = (0f64, 0f64);
    let rows = rows();
    for row in &rows {
        let orbits = phase_resonant(&row.scene());
        let distance = |orbit: &Orbit| (orbit.sigma - row.sigma).abs();
        let nearest = orbits
            .iter()
            .min_by(|one, other| distance(one).total_cmp(&distance(other)));
        let orbit = nearest.expect("an orbit for every row");
        for (found, expected) in [(orbit.sigma, row.sigma), (orbit.c, row.c), (orbit.b, row.b)] {
            state = state.max((found - expected).abs());
        }
        for (found, expected) in orbit.multipliers.iter().zip(row.multipliers) {
            multipliers = multipliers.max((found - expected).abs());
        }
        assert_eq!(orbit.stable, row.multipliers[3] < 1.0, "{row:?}");
        let same_scene = |other: &&reference::Row| other.scene() == row.scene();
        let listed = |orbit: &Orbit| {
            rows.iter()
                .filter(same_scene)
                .any(|one| (one.sigma - orbit.sigma).abs() < 1e-8)
        };
        for orbit in orbits.iter().filter(|orbit| !listed(orbit)) {
            assert!(orbit.b < Manifold::new(row.r).b_min() && !orbit.stable, "{orbit:?}");
        }
    }
    assert!(state < 1e-10, "the references have ten digits: {state:e}");
    assert!(multipliers < 6e-7, "the references have six digits: {multipliers:e}");
}

#[test]
fn no_orbit_is_invented_where_the_excitation_is_too_weak() {
    assert_eq!(phase_resonant(&scene(0.2)), []);
    assert_eq!(phase_resonant(&scene(0.0)), []);
}

/// Smallest difference in C and G from the orbits of the exact backbone at a frequency.
fn from_backbone(scene: &Dimensionless, [omega, c, g]: [f64; 3]) -> f64 {
    let orbits = exact_backbone(scene, omega).into_iter();
    orbits.map(|orbit| (orbit.c - c).hypot(orbit.g - g)).fold(1.0, f64::min)
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
            let motion = backbone_at_speed(&scene, speed).unwrap_or_else(|| panic!("{scene:?} {speed}"));
            assert!(from_backbone(&scene, motion) < 1e-8, "{scene:?} {speed}: {motion:?}");
            let [omega, c, _] = motion;
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

/// The curve of a condition through an orbit at phase resonance, which another condition selects.
fn through(
    orbit: &Orbit,
    scene: &Dimensionless,
    by: Condition,
    along: Condition,
    limits: ContinuationLimits,
) -> Branch {
    let start = orbit.periodic(scene, [by, Condition::PhaseResonance]).unwrap();
    continue_both_ways(scene, &start, along, &limits)
}

/// The exact response through the orbit with the fastest particle.
fn response(scene: &Dimensionless) -> Branch {
    let fastest = |one: &Orbit, other: &Orbit| one.b.total_cmp(&other.b);
    let orbit = phase_resonant(scene).into_iter().max_by(fastest).unwrap();
    let excitation = Condition::Excitation(scene.g);
    through(&orbit, scene, excitation, excitation, ContinuationLimits::default())
}

/// Requires that the plant, started on every motion at this distance in the branch, is back at its start after each repetition.
fn repeats_on_the_plant(scene: &Dimensionless, branch: &Branch, distance: usize, repetitions: u32) {
    for motion in branch.points.iter().step_by(distance) {
        let [_, start @ ..] = motion.motion(scene, 1)[0];
        let mut plant = scene.plant(start).unwrap();
        let drive = Dimensionless { g: motion.g, ..*scene }.drive(motion.sigma);
        for _ in 0..repetitions {
            for _ in 0..motion.pattern.periods() {
                plant.advance(drive, TAU / drive.omega).unwrap();
            }
            let now = scene.state(&plant.state());
            let apart = (0..4).map(|n| (now[n] - start[n]).abs()).fold(0.0, f64::max);
            assert!(apart < 1e-9, "{apart:e} at sigma = {}", motion.sigma);
        }
    }
}

#[test]
fn an_exact_response_passes_folds_and_phase_resonance() {
    let scene = scene(1.1);
    let branch = response(&scene);
    let sigmas: Vec<f64> = branch.points.iter().map(|one| one.sigma).collect();
    let mut turns = sigmas.windows(3).filter(|s| (s[1] - s[0]) * (s[2] - s[1]) < 0.0);
    assert!(turns.next().is_some() && branch.points.iter().any(|one| !one.stable));
    // Unstable motions leave slowly.
    repeats_on_the_plant(&scene, &branch, 20, 2);
    for fold in branch.special.iter().filter(|one| one.kind == Bifurcation::Fold) {
        let nearest = fold.motion.multipliers.iter().map(|[re, im]| (re - 1.0).hypot(*im));
        assert!(nearest.fold(f64::MAX, f64::min) < 1e-4);
    }
}

#[test]
fn symmetry_breaks_near_the_theorys_speed_and_asymmetric_motions_leave_it() {
    let scene = scene(1.6);
    let branch = response(&scene);
    let mut special = branch.special.iter();
    let breaking = special
        .find(|one| one.kind == Bifurcation::SymmetryBreaking)
        .expect("a symmetry breaking");
    assert!((breaking.motion.b - B_SYMMETRY_BREAKING).abs() < 0.03);
    let limits = ContinuationLimits { points: 60, ..ContinuationLimits::default() };
    let aside = branch_off(&scene, breaking, Condition::Excitation(1.6), &limits).unwrap();
    let uneven = |one: &Periodic| (one.bounces[1].phase - one.bounces[0].phase - TAU / 2.0).abs();
    assert!(aside.points.iter().map(uneven).fold(0.0, f64::max) > 0.05);
    assert!(aside.points.iter().any(|one| one.stable));
    repeats_on_the_plant(&scene, &aside, 10, 2);
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
    repeats_on_the_plant(&scene, &branch, 7, 1);
}

#[test]
fn the_exact_backbone_continued_is_the_closed_form() {
    let scene = scene(1.1);
    let orbit = phase_resonant(&scene).into_iter().find(|one| one.stable).unwrap();
    let limits = ContinuationLimits::default();
    let branch = through(
        &orbit,
        &scene,
        Condition::Excitation(1.1),
        Condition::PhaseResonance,
        limits,
    );
    assert!(branch.points.len() > 40, "{}: {:?}", branch.points.len(), branch.ended);
    for motion in &branch.points {
        let off = from_backbone(&scene, [1.0 + scene.epsilon * motion.sigma, motion.c, motion.g]);
        assert!(off < 1e-8, "{off:e} at sigma = {}, C = {}", motion.sigma, motion.c);
    }
}

#[test]
fn without_damping_drive_and_loss_the_backbone_is_the_conservative_mode() {
    let scene = Dimensionless::new(0.0084, 0.0, 1.0, 0.0);
    let mode = exact_backbone(&scene, 1.0 - scene.epsilon)
        .into_iter()
        .find(|one| one.c > 0.2)
        .unwrap();
    let limits = ContinuationLimits {
        sigma: [-3.0, 0.5],
        points: 200,
        ..ContinuationLimits::default()
    };
    let branch = through(
        &mode,
        &scene,
        Condition::Sigma(mode.sigma),
        Condition::PhaseResonance,
        limits,
    );
    assert!(branch.points.len() > 20);
    for motion in &branch.points {
        let energy = |[_, q1, dq1, _, dq2]: [f64; 5]| 0.5 * (q1 * q1 + dq1 * dq1 + scene.epsilon * dq2 * dq2);
        let states = motion.motion(&scene, 40);
        let spread = states.iter().map(|one| (energy(*one) / energy(states[0]) - 1.0).abs());
        assert!(motion.g.abs() < 1e-9 && spread.fold(0.0, f64::max) < 1e-9);
    }
}
