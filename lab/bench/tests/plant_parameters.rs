//! What is measured does not depend on the plant that the client's scene states: restitution, mass of the particle and half-width of the cavity
//! are used for the comparison only.

use vines_testbench::backbone::track;
use vines_testbench::experiment::{Plan, run};
use vines_testbench::identification::identify;
use vines_testbench::loop_check::check;
use vines_testbench::rig::{BuiltIn, SensorsOnly, Simulated};
use vines_testbench::scene::{LinearResponse, Override, Scene};

/// Drive, limits and levels in metres: G = 1.1, and C from 0.6 to 0.3 of the default scene.
const IN_METRES: [&str; 6] = [
    "excitation.E=9.246125558142296e-5",
    "controller.E_max=6e-4",
    "backbone.E_max=4e-4",
    "backbone.A_from=0.006",
    "backbone.A_to=0.003",
    "backbone.points=4",
];

fn scene(settings: &[&str]) -> Scene {
    let settings = [&IN_METRES[..], settings].concat();
    let overrides: Vec<Override> = settings.iter().map(|one| one.parse().unwrap()).collect();
    Scene::load(None, &overrides).unwrap()
}

/// The rig of the true scene.
fn rig(settings: &[&str]) -> SensorsOnly {
    SensorsOnly::around(Simulated::of(&scene(settings)).unwrap())
}

/// Everything measured in SI units, bit by bit, and what was said of it.
fn tracked(settings: &[&str], falsified: &[&str]) -> Vec<([u64; 9], bool, String)> {
    let scene = scene(&[settings, falsified].concat());
    let mut controller = BuiltIn::new(&scene.backbone_config()).unwrap();
    let tracked = track(&mut rig(settings), &mut controller, &scene, |_, _| {}).unwrap();
    assert!(tracked.ended.is_none() && tracked.points.iter().any(|one| one.settled));
    let bits = |one: &vines_testbench::backbone::Point| {
        let si = [
            one.at.f_hz,
            one.at.a_m,
            one.at.e_m,
            one.at.u_f_hz,
            one.at.u_a_m,
            one.at.u_e_m,
        ];
        let [f, a, e, u_f, u_a, u_e] = si.map(f64::to_bits);
        let [phase, u_phase, periods] = [one.at.phase_error_deg, one.at.u_phase_deg, one.periods].map(f64::to_bits);
        (
            [f, a, e, u_f, u_a, u_e, phase, u_phase, periods],
            one.settled,
            one.regime.to_string(),
        )
    };
    tracked.points.iter().map(bits).collect()
}

/// An identification in SI units, bit by bit: the lock, and the points along the decay.
fn identified(settings: &[&str], falsified: &[&str]) -> Vec<[u64; 6]> {
    let mut scene = scene(&[settings, falsified].concat());
    // As a loop check finds it: without, noise hides the regime.
    scene.measured = Some(LinearResponse::of(&scene));
    let mut controller = BuiltIn::new(&scene.controller_config()).unwrap();
    let record = run(&mut rig(settings), &mut controller, &Plan::of(&scene), |_, _, _| {}).unwrap();
    let found = identify(&record, &scene).unwrap();
    let lock = found.lock;
    let lock = [
        lock.at.f_hz,
        lock.at.a_m,
        lock.at.e_m,
        lock.at.u_f_hz,
        lock.at.u_a_m,
        lock.at.u_e_m,
    ];
    let decay = found.decay.points.iter();
    assert!(decay.len() > 20);
    std::iter::once(lock)
        .chain(decay.map(|one| [one.t_s, one.f_hz, one.a_m, one.u_f_hz, one.u_a_m, 0.0]))
        .map(|values| values.map(f64::to_bits))
        .collect()
}

/// A mass that moves at the start: the first motion that is held is symmetric, so that no search is needed.
const MOVING: &str = "start.dq1=-0.2";

const FALSE: [&[&str]; 4] = [
    &["plant.r=0.5"],
    &["plant.m=0.0416"],
    &["plant.b=0.012"],
    &["plant.r=0.5", "plant.m=0.0416", "plant.b=0.012"],
];

#[test]
fn a_tracked_backbone_in_si_units_has_the_same_bits_whatever_the_scene_says_of_the_particle() {
    for settings in [
        &[MOVING][..],
        &[MOVING, "chain.snr=40"],
        &[MOVING, "resonance.sensor=q1"],
    ] {
        let expected = tracked(settings, &[]);
        for falsified in FALSE {
            assert_eq!(tracked(settings, falsified), expected, "{settings:?}, {falsified:?}");
        }
    }
}

#[test]
fn an_identification_in_si_units_has_the_same_bits_whatever_the_scene_says_of_the_particle() {
    for settings in [
        &[MOVING][..],
        &[MOVING, "chain.snr=40"],
        &[MOVING, "resonance.sensor=q1"],
    ] {
        let expected = identified(settings, &[]);
        for falsified in FALSE {
            assert_eq!(identified(settings, falsified), expected, "{settings:?}, {falsified:?}");
        }
    }
}

#[test]
fn a_loop_check_has_the_same_bits_whatever_the_scene_says_of_the_particle() {
    for settings in [&["start.dq2=0"][..], &["start.dq2=0", "chain.snr=40"]] {
        let checked = |falsified: &[&str]| {
            let scene = scene(&[settings, falsified].concat());
            format!("{:?}", check(&mut rig(settings), &scene).unwrap())
        };
        let expected = checked(&[]);
        for falsified in FALSE {
            assert_eq!(checked(falsified), expected, "{settings:?}, {falsified:?}");
        }
    }
}

/// Where impacts, or a symmetric motion, are searched for, b is the scale of the search.
#[test]
fn restitution_and_mass_of_the_particle_change_no_bit_of_a_search() {
    for settings in [&[][..], &["start.dq2=0"], &["resonance.sensor=acceleration"]] {
        let (by_track, by_lock) = (tracked(settings, &[]), identified(settings, &[]));
        for falsified in &FALSE[..2] {
            assert_eq!(tracked(settings, falsified), by_track, "{settings:?}, {falsified:?}");
            assert_eq!(identified(settings, falsified), by_lock, "{settings:?}, {falsified:?}");
        }
    }
}
