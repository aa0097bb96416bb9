//! Guards exact orbits: the closed form against independent 40-digit references, and periodic motions by shooting against the closed form,
//! against the plant, and along their curves.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use vines_model::{
    Definition, Dimensionless,
    orbit::{
        Bifurcation, Branch, BranchBifurcation, Condition, ContinuationLimits, Orbit, StructureBranch, StructureOrbits,
        StructureRange, backbone, backbone_at_speed, continue_both_ways, exact_backbone, phase_resonant, response,
        settle,
    },
    theory::{B_SYMMETRY_BREAKING, Manifold, SlowFlow},
};

mod common;
use common::{Row, at_phase_zero, rows, symmetric};

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
        let same_scene = |other: &&Row| other.scene() == row.scene();
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
fn the_curve_of_the_backbone_has_an_orbit_of_every_frequency_that_it_passes_at_any_phase() {
    const SCENES: [[f64; 3]; 4] = [
        [0.0084, 1.43, 0.65],
        [0.03, 0.4, 0.9],
        [0.002, 2.5, 0.4],
        [0.0137, 2.36, 0.86],
    ];
    let phases = [-90.0_f64, -75.0, -110.0];
    for (phase, [epsilon, lambda, r]) in phases.into_iter().flat_map(|phase| SCENES.map(|scene| (phase, scene))) {
        let definition = Definition::default().at_phase(phase.to_radians());
        let scene = Dimensionless { definition, ..Dimensionless::new(epsilon, lambda, r, 1.0) };
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

/// Detunings from -6 to 6.
const LIMITS: ContinuationLimits = ContinuationLimits {
    sigma: [-6.0, 6.0],
    g: [-1e-6, 10.0],
    points: 2000,
    step: 0.05,
};

fn scene(g: f64) -> Dimensionless {
    Dimensionless::new(0.0084, 1.43, 0.65, g)
}

/// Requires that the plant, started on every tenth motion of a branch that does not leave at once, is back at its start after each of two
/// repetitions.
fn repeats_on_the_plant(scene: &Dimensionless, branch: &Branch) {
    let slow = branch.points.iter().filter(|motion| motion.stability.growth() < 10.0);
    for motion in slow.step_by(10) {
        let start = at_phase_zero(scene, motion);
        let mut plant = scene.plant(start).unwrap();
        let drive = Dimensionless { g: motion.g, ..*scene }.drive(motion.sigma);
        for n in 1..=2 * motion.pattern.periods() {
            plant.advance(drive, TAU / drive.omega).unwrap();
            let now = scene.state(&plant.state());
            let is_back = (0..4).all(|n| (now[n] - start[n]).abs() < 1e-9);
            let repeats = n.is_multiple_of(motion.pattern.periods());
            assert!(is_back || !repeats, "{now:?} {start:?} at sigma = {}", motion.sigma);
        }
    }
}

#[test]
fn the_motions_of_exact_responses_repeat_on_the_plant_and_break_their_symmetry_at_the_speed_of_the_theory() {
    for g in [1.1, 1.6] {
        let found = response(&scene(g), &LIMITS, 1);
        found
            .components
            .iter()
            .for_each(|one| repeats_on_the_plant(&scene(g), &one.branch));
        let special = symmetric(&found).flat_map(|branch| &branch.special);
        let mut breaking = special.filter(|one| one.kind == Bifurcation::SymmetryBreaking);
        let is_near = |one: &BranchBifurcation| (one.motion.b - B_SYMMETRY_BREAKING).abs() < 0.03;
        assert_eq!(
            breaking.any(is_near),
            g == 1.6,
            "only the larger excitation reaches this speed"
        );
    }
}

#[test]
fn a_motion_with_more_impacts_is_followed_like_any_other() {
    let scene = scene(2.2);
    let settled = settle(&scene, -0.6, [0.0, 0.0, 0.0, 0.9], 800).unwrap();
    let motion = settled.expect("a pattern");
    assert!(motion.pattern.impacts() > 2);
    let limits = ContinuationLimits { points: 40, ..LIMITS };
    let branch = continue_both_ways(&scene, &motion, Condition::Excitation(2.2), &limits);
    assert!(branch.points.len() > 20);
    repeats_on_the_plant(&scene, &branch);
}

#[test]
fn without_damping_drive_and_loss_the_backbone_is_the_conservative_mode() {
    let scene = Dimensionless::new(0.0084, 0.0, 1.0, 0.0);
    let orbits: Vec<Orbit> = backbone(&scene, Some([-3.0, 0.5]), 200)
        .into_iter()
        .flat_map(|curve| curve.points)
        .collect();
    assert!(orbits.len() > 20);
    for orbit in orbits.iter().filter(|orbit| orbit.multipliers[3] < 10.0) {
        let start = [orbit.start.q1, orbit.start.dq1, orbit.start.q2, orbit.start.dq2];
        let mut plant = scene.plant(start).unwrap();
        plant
            .advance(
                Dimensionless { g: orbit.g, ..scene }.drive(orbit.sigma),
                PI / orbit.omega,
            )
            .unwrap();
        let half_a_period_later = scene.state(&plant.state());
        // The particle is on the wall, just before or after its impact.
        let mirrored = [0, 2].map(|n| half_a_period_later[n] + start[n]);
        assert!(
            mirrored.iter().all(|off| off.abs() < 1e-9),
            "{mirrored:?} at sigma = {}",
            orbit.sigma
        );
        let energy = |[q1, dq1, _, dq2]: [f64; 4]| 0.5 * (q1 * q1 + dq1 * dq1 + scene.epsilon * dq2 * dq2);
        let change = energy(half_a_period_later) / energy(start) - 1.0;
        assert!(orbit.g.abs() < 1e-9 && change.abs() < 1e-9, "{change:e}");
        // The phase of a base at rest is that of resonance.
        assert!((orbit.gamma + FRAC_PI_2).abs() < 1e-9);
    }
}

#[test]
fn a_conservative_mode_is_neutral_where_no_multiplier_is_off_the_unit_circle_and_nowhere_stable() {
    for epsilon in [1e-3, 0.0084, 0.03] {
        let scene = Dimensionless::new(epsilon, 0.0, 1.0, 0.0);
        let curves = backbone(&scene, Some([-6.0, 6.0]), 400);
        let orbits = || curves.iter().flat_map(|curve| &curve.points);
        let neutral = orbits().filter(|orbit| orbit.neutral).count();
        // The largest multiplier of such an orbit is 1 but for the root of rounding, which a double one has.
        let off = |orbit: &Orbit| (orbit.multipliers[3] - 1.0).abs();
        assert!(neutral > 100, "{neutral}");
        assert!(orbits().all(|orbit| !orbit.stable && orbit.neutral == (off(orbit) <= 1e-7)));
        let between = orbits().filter(|orbit| off(orbit) > 1e-7 && off(orbit) < 1e-5).count();
        assert!(
            20 * between < neutral,
            "{between} orbits are unstable by little, {neutral} neutral"
        );
    }
}

#[test]
fn the_drives_of_stable_orbits_end_where_the_backbone_loses_its_stability() {
    let scene = Dimensionless::new(0.032 / 3.807, 1.43, 0.65, 1.1);
    let branches = StructureOrbits::of(&scene).backbone(&StructureRange::at_any_speed(&scene, [-6.0, 6.0], 400));
    let stable = branches.iter().flat_map(StructureBranch::stable_to_their_ends);
    let drives = stable.flatten().map(|orbit| scene.excitation(orbit.reference));
    let largest = drives.fold(0.0, f64::max);
    let broken = backbone(&scene, Some([-6.0, 6.0]), 400)
        .into_iter()
        .flat_map(|curve| curve.special)
        .filter(|(kind, _)| *kind == Bifurcation::SymmetryBreaking)
        .map(|(_, orbit)| orbit.g)
        .fold(f64::INFINITY, f64::min);
    assert!(
        (largest - broken).abs() < 1e-9 && (largest - 1.423).abs() < 2e-3,
        "{largest} {broken}"
    );
}
