//! Guards the exact orbits of structures: against figures of an independent computation, against the study's oscillator, and along their curves.

mod common;

use std::f64::consts::FRAC_PI_2;

use common::within;
use lovines::oscillator::Oscillator;
use lovines::{Excitation, Host, Mode};
use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};
use vines_model::orbit::{Bifurcation, Particle, StructureBranch, StructureOrbit, StructureOrbits, StructureRange};
use vines_model::theory::SlowFlow;

/// The default scene: mass, stiffness and damping of its oscillator, and the particle.
const RIG: [f64; 3] = [3.807, 11.68e3, 2.53];
const PARTICLE: Particle = Particle { mass: 0.032, half_width: 0.01, restitution: 0.65 };

fn omega0() -> f64 {
    (RIG[1] / RIG[0]).sqrt()
}

/// The mass-normalised shape of one mode that is the oscillator.
fn shape() -> f64 {
    1.0 / RIG[0].sqrt()
}

/// A mode at `ratio` times the oscillator's frequency with `damping` times its damping ratio.
fn mode(ratio: f64, damping: f64, [cavity, drive]: [f64; 2]) -> Mode {
    let zeta = damping * RIG[2] / (2.0 * RIG[0] * omega0());
    Mode { omega: ratio * omega0(), zeta, cavity, drive }
}

/// The oscillator, and a second mode with the opposite sign at the cavity; the response is read where the force acts.
fn two_modes(ratio: f64, damping: f64) -> StructureOrbits {
    let phi = shape();
    let modes = [mode(1.0, 1.0, [phi; 2]), mode(ratio, damping, [-phi, phi])];
    let host = Host::from_modes(Excitation::Force, &modes).unwrap();
    StructureOrbits::new(&host, PARTICLE).with_response(&host.row(&[phi; 2]).unwrap())
}

fn one_mode() -> StructureOrbits {
    let host = Host::from_modes(Excitation::Force, &[mode(1.0, 1.0, [shape(); 2])]).unwrap();
    StructureOrbits::new(&host, PARTICLE)
}

/// The orbit at phase resonance with the faster particle: the right branch.
fn right(orbits: &StructureOrbits, omega: f64) -> StructureOrbit {
    let found = orbits.at_phase_resonance(omega * omega0()).into_iter();
    found
        .max_by(|one, other| one.speed.total_cmp(&other.speed))
        .expect("an orbit")
}

/// B, C, the force and the modulus of the largest multiplier.
fn figures(orbit: &StructureOrbit) -> [f64; 4] {
    let b = PARTICLE.half_width;
    [
        orbit.speed / (b * omega0()),
        orbit.response / b,
        orbit.drive,
        orbit.stability.growth(),
    ]
}

#[test]
fn orbits_of_one_and_two_modes_have_the_figures_of_an_independent_computation() {
    let expected = [
        (one_mode(), 0.990, [0.8564, 0.4058, 1.0463, 0.9876]),
        (two_modes(6.27, 1.0), 0.990, [0.8526, 0.4014, 1.0473, 1.1338]),
        (one_mode(), 0.994, [1.3345, 1.1489, 2.0149, 2.0619]),
        (two_modes(2.97, 1.0), 0.994, [0.9356, 0.6568, 1.6199, 0.9784]),
    ];
    for (orbits, omega, figures_there) in expected {
        let found = figures(&right(&orbits, omega));
        let off = (0..4).map(|n| (found[n] - figures_there[n]).abs()).fold(0.0, f64::max);
        assert!(off < 1e-4, "{found:?} {figures_there:?}");
    }
}

/// A bifurcation, and the section that contributes most to it.
type Change = (Bifurcation, Option<usize>);

/// The bifurcations of a backbone above the fold with what causes them, and the stable frequencies over omega0.
fn changes(branches: &[StructureBranch]) -> (Vec<Change>, Vec<[f64; 2]>) {
    let fast = |orbit: &StructureOrbit| orbit.speed > 0.7 * PARTICLE.half_width * omega0();
    let changes = branches
        .iter()
        .flat_map(|branch| &branch.changes)
        .filter(|change| fast(&change.orbit));
    let stretches = branches.iter().flat_map(|branch| {
        branch
            .orbits
            .chunk_by(|one, other| one.stability.stable == other.stability.stable)
    });
    let ends = |stretch: &[StructureOrbit]| [0, stretch.len() - 1].map(|n| stretch[n].omega / omega0());
    let stable = stretches.filter(|stretch| stretch[0].stability.stable && fast(&stretch[0]));
    (
        changes.map(|change| (change.kind, change.section())).collect(),
        stable.map(ends).collect(),
    )
}

#[test]
fn the_facts_say_where_the_backbone_loses_its_stability_and_to_which_mode() {
    let facts = two_modes(6.27, 3.0).facts(0, [omega0(); 2], 300, &|| ()).unwrap();
    let (alone, stable_alone) = changes(&facts.alone);
    assert_eq!(
        alone,
        [(Bifurcation::SymmetryBreaking, None), (Bifurcation::Fold, Some(0))]
    );
    let (all, stable) = changes(&facts.all);
    let taken = (Bifurcation::NeimarkSacker, Some(1));
    assert_eq!(
        all,
        [
            (Bifurcation::SymmetryBreaking, Some(1)),
            taken,
            taken,
            (Bifurcation::Fold, Some(0))
        ]
    );
    assert_eq!((stable_alone.len(), stable.len()), (1, 2));
    // Between 0.9906 and 0.9925 the second mode takes the stability.
    assert!(
        (stable[0][1] - 0.9926).abs() < 2e-4 && (stable[1][0] - 0.9905).abs() < 2e-4,
        "{stable:?}"
    );
    assert_eq!(facts.modes[1].harmonic.0, 7);
    let influences = [6.27, 2.97].map(|ratio| two_modes(ratio, 1.0).modes(0).unwrap()[1].influence);
    assert!(influences[0] < 0.002 && influences[1] > 0.04, "{influences:?}");
}

/// Amplitude of the base, m, that drives the oscillator with the numbers of the first mode as a unit drive does the mode.
fn base_per_drive(host: &Host) -> f64 {
    let section = &host.sections()[0];
    let Oscillator { delta, omega0, omega0_squared, .. } = section.oscillator;
    (section.driven(omega0)[0] * section.cavity[0]).norm() / omega0_squared.hypot(2.0 * delta * omega0)
}

#[test]
fn a_backbone_is_smooth_at_phase_resonance_and_changes_its_stability_where_a_multiplier_is_on_the_circle() {
    let range = StructureRange {
        omega: [0.98 * omega0(), 1.0 * omega0()],
        speed: 1.5 * PARTICLE.half_width * omega0(),
        points: 200,
    };
    let mut kinds = Vec::new();
    for orbits in [
        one_mode(),
        two_modes(6.27, 3.0),
        two_modes(6.27, 1.0),
        two_modes(2.97, 1.0),
    ] {
        let branches = orbits.backbone(&range);
        assert!(!branches.is_empty());
        for branch in &branches {
            for pair in branch.orbits.windows(2) {
                let [from, to] = [&pair[0], &pair[1]];
                assert!((from.phase + FRAC_PI_2).abs() < 1e-9, "{}", from.phase);
                let step = (from.speed - to.speed).abs() / (PARTICLE.half_width * omega0());
                assert!(step < 0.1, "{step}");
            }
            for change in &branch.changes {
                let distance = |[re, im]: &[f64; 2]| (re.hypot(*im) - 1.0).abs();
                let nearest = change
                    .orbit
                    .stability
                    .multipliers
                    .iter()
                    .map(distance)
                    .fold(f64::MAX, f64::min);
                assert!(nearest < 1e-6, "{:?} {nearest:e}", change.kind);
                kinds.push(change.kind);
            }
        }
    }
    for kind in [Bifurcation::SymmetryBreaking, Bifurcation::NeimarkSacker] {
        assert!(kinds.contains(&kind), "{kinds:?}");
    }
}

#[test]
fn a_frequency_response_has_the_orbits_of_each_frequency_and_its_folds_are_its_turning_points() {
    let orbits = two_modes(6.27, 3.0);
    let range = StructureRange {
        omega: [0.97 * omega0(), 1.0 * omega0()],
        speed: 3.0 * PARTICLE.half_width * omega0(),
        points: 100,
    };
    let drive = 1.2;
    let branches = orbits.frequency_response(drive, &range);
    let mut folds = 0;
    for branch in &branches {
        for orbit in &branch.orbits {
            let there = orbits.at(orbit.omega, drive);
            let same = there.iter().any(|other| (other.speed / orbit.speed - 1.0).abs() < 1e-6);
            assert!(
                same && (orbit.drive / drive - 1.0).abs() < 1e-9,
                "{}",
                orbit.omega / omega0()
            );
        }
        for change in branch.changes.iter().filter(|change| change.kind == Bifurcation::Fold) {
            let [one, other] = [-1.0, 1.0].map(|side| orbits.at(change.orbit.omega * (1.0 + side * 1e-7), drive).len());
            assert_eq!(one.abs_diff(other), 2, "one side has two orbits more");
            folds += 1;
        }
    }
    assert!(folds > 0);
}

#[test]
fn first_order_theory_of_the_driven_mode_approaches_the_exact_orbits_of_the_structure_as_the_particle_gets_lighter() {
    let phi = shape();
    let mut before = [f64::INFINITY; 3];
    for halvings in 0..5 {
        let mass = PARTICLE.mass / f64::from(1 << halvings);
        // With a constant lambda, the damping falls as the mass.
        let damping = mass / PARTICLE.mass;
        let modes = [
            mode(1.0, damping, [phi, 0.7 * phi]),
            mode(8.4, damping, [0.4 * phi, -0.9 * phi]),
        ];
        let host = Host::from_modes(Excitation::Force, &modes).unwrap();
        let point = host.row(&[0.7 * phi, -0.9 * phi]).unwrap();
        let orbits = StructureOrbits::new(&host, Particle { mass, ..PARTICLE }).with_response(&point);
        let (numbers, base_per_drive) = (orbits.numbers(0).unwrap(), base_per_drive(&host));
        let theory = SlowFlow::new(numbers.lambda, numbers.r).backbone_at(0.85);
        let found = orbits.at_phase_resonance(numbers.omega(theory.sigma));
        let exact = found
            .into_iter()
            .max_by(|one, other| one.speed.total_cmp(&other.speed))
            .unwrap();
        let pairs = [
            (exact.speed, theory.b * numbers.b * numbers.omega0),
            (exact.response, theory.c * numbers.b * 0.7),
            (exact.drive, numbers.amplitude(theory.g) / base_per_drive),
        ];
        let errors = pairs.map(|(exact, theory)| (exact / theory - 1.0).abs());
        for (error, before) in errors.iter().zip(before) {
            assert!(*error < 0.6 * before, "{halvings} {errors:?} {before:?}");
        }
        before = errors;
    }
    assert!(before.iter().all(|error| *error < 0.01), "{before:?}");
}

#[test]
fn no_orbit_near_the_driven_mode_is_missing_however_small_the_mass_ratios_are() {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let mut crossings = 0;
    for _ in 0..60 {
        let mut decades = |low: f64, high: f64| 10_f64.powf(within(&mut random, [low, high]));
        let mut mode = |omega: f64| Mode {
            omega,
            zeta: decades(-6.0, -2.0),
            cavity: decades(-1.5, 0.0),
            drive: decades(-1.0, 0.0),
        };
        let modes = [mode(1.0), mode(1.07), mode(2.6)];
        let particle = Particle { mass: decades(-4.0, -1.5), ..PARTICLE };
        let epsilon = particle.mass * modes[0].cavity.powi(2);
        let host = Host::from_modes(Excitation::Force, &modes).unwrap();
        let orbits = StructureOrbits::new(&host, particle);
        // Equal steps of 0.005 in the detuning on both sides.
        let at: Vec<_> = (-800..800)
            .map(|n| orbits.at_phase_resonance(1.0 + epsilon * 0.005 * f64::from(n)))
            .collect();
        let middle = at.iter().flatten().map(|orbit| orbit.reference).fold(0.0, f64::max) / 3.0;
        let found = orbits.resonant(middle, [0.2, 3.0]);
        for pair in at.windows(2).filter(|pair| pair[0].len() == pair[1].len()) {
            for (one, other) in pair[0].iter().zip(&pair[1]) {
                if (one.reference > middle) != (other.reference > middle) {
                    let between = |orbit: &&StructureOrbit| (one.omega..=other.omega).contains(&orbit.omega);
                    assert!(
                        found.iter().any(|orbit| between(&orbit)),
                        "{modes:?} {particle:?} {}",
                        one.omega
                    );
                    crossings += 1;
                }
            }
        }
    }
    assert!(crossings > 30, "{crossings}");
}
