//! Guards the section `[shaker]`: presets that lock on the exact orbit with their shaker, the check, limits, and a sentence for every mistake.

use std::cell::Cell;
use std::f64::consts::{PI, TAU};
use std::rc::Rc;

use lovines::{Drive, Plant, StructureState};
use num_complex::Complex;
use vines_bench::backbone::track;
use vines_bench::comparison::{COMPARED_ABOVE, Comparison};
use vines_bench::experiment::{ExperimentError, run};
use vines_bench::identification::{DECAY_WINDOW, DecayEnd, DecayPoints, Regime, decay_points, identify};
use vines_bench::loop_check::{Verdict, check};
use vines_bench::plan::Plan;
use vines_bench::record::Record;
use vines_bench::rig::{
    BuiltIn, Command, Measured, Rig, RigError, RigFault, RigStage, SensorFault, Sensors, SensorsOnly, Simulated,
    SimulatedStructure, faulty,
};
use vines_bench::scene::{Scene, SceneError, Structure};
use vines_bench::survey::{BehindShaker, Survey, contradiction, phase_resonant};
use vines_model::orbit::StructureOrbit;

use super::common::{IntoParallelRefIterator, ParallelIterator, at, demodulated, mean_square};
use super::structures::Modal;
use super::{Altered, Asked, Foreign, changed, identified, paper, record, record_of, says, tracked_of};

const PRESETS: [&str; 3] = [
    include_str!("../../../../scenes/shaker-cantilever.toml"),
    include_str!("../../../../scenes/shaker-oscillator.toml"),
    include_str!("../../../../scenes/slip-table.toml"),
];

fn preset(n: usize, changes: &str) -> Result<Scene, SceneError> {
    Scene::parse("preset", &changed(PRESETS[n], changes), &[])
}

/// Behind a controlled current the coil does not dampen the table, which resonates at 6.2 Hz below the oscillator's 8.8 Hz.
const CURRENT: &str = "amplifier = \"voltage\" -> amplifier = \"current\"";

/// Of the cantilever.
const COMPENSATED: &str = "[shaker] -> [shaker]\ncompensated_mass = 0.02";

const ALIASING: &str = "[start] -> [chain]\nfilter = 4.0\n[controller]\nsamples_per_period = 120.33\n[start]";

/// Presets with changes, and the most periods to the lock.
const LOCKS: [(usize, &str, f64); 11] = [
    (0, "", f64::INFINITY),
    (1, "", f64::INFINITY),
    (2, "", f64::INFINITY),
    (0, COMPENSATED, f64::INFINITY),
    // A table whose own resonance is near.
    (2, CURRENT, f64::INFINITY),
    // Samples of 120.33 in a period see the edges of the force at another phase in each third one: they alias to no motion of several periods.
    (1, ALIASING, f64::INFINITY),
    // A coil that damps the decay is no dead sensor.
    (1, "resistance = 2.0 -> resistance = 0.5", f64::INFINITY),
    // The noise of the readings is in the command, and through it in the force, of which 1.8 % is left: the motion moves more than the readings' noise.
    (1, "[start] -> [chain]\nsnr = 60\n[start]", 400.0),
    (1, "[start] -> [chain]\nsnr = 40\n[start]", 400.0),
    (1, "[start] -> [chain]\nadc_bits = 16\n[start]", 400.0),
    (1, "[start] -> [chain]\ndelay = 2\nsnr = 60\n[start]", 400.0),
];

#[test]
fn rigs_lock_on_the_exact_orbit_with_their_shaker_also_through_noise_and_edges_that_alias() {
    LOCKS.par_iter().for_each(|(n, changes, most)| {
        let (nearest, periods) = distance_of_lock(&preset(*n, changes).unwrap());
        let found = format!("{nearest} u, {periods} periods");
        assert!(nearest < 3.0 && periods < *most, "preset {n}, {changes}: {found}");
    });
}

/// Modal shakers with published constants, whose Bl²/R is 7 and 27 times 2 m omega0: the coil holds the armature.
#[test]
#[ignore = "open: on one of these the secant does not reach the requested drive, though motions beside it were held"]
fn published_modal_shakers_lock_on_the_exact_orbit() {
    let limits = "voltage_max = 40.0 ->  ;; current_max = 15.0 ->  ;; force_max = 45.0 ->  ;; stroke_max = 0.0088 -> ";
    let shakers = [
        "\nmass = 0.057 -> \nmass = 0.44 ;; stiffness = 9932.0 -> stiffness = 1.1e5 ;; resistance = 2.0 -> resistance = 4.0\ninductance = 6e-4 ;; \
         Bl = 6.78 -> Bl = 36.0",
        "\nmass = 0.057 -> \nmass = 0.227 ;; stiffness = 9932.0 -> stiffness = 3500.0 ;; resistance = 2.0 -> resistance = 1.3 ;; Bl = 6.78 -> Bl = 30.0",
    ];
    for n in [0, 1] {
        for shaker in shakers {
            let (nearest, _) = distance_of_lock(&preset(n, &format!("{limits} ;; {shaker}")).unwrap());
            assert!(nearest < 3.0, "preset {n}, {shaker}: {nearest} u");
        }
    }
}

#[test]
fn a_lock_behind_a_shaker_states_its_force_in_newtons_and_its_command_in_volts() {
    let scene = preset(0, "").unwrap();
    let lock = identified(&scene).unwrap().lock;
    let unit = scene.units().reference;
    let (force, u_force) = (lock.at.f_n.unwrap(), lock.at.u_f_n.unwrap());
    let d = scene.dimensionless();
    assert!((unit.in_metres(force) / d.amplitude(lock.at.g) - 1.0).abs() < 1e-12);
    assert!((unit.in_metres(u_force) / d.amplitude(lock.at.u_g) - 1.0).abs() < 1e-12);
    assert!(lock.at.e_m.is_none() && lock.at.u_e_m.is_none());
    // The exact orbits of structure and shaker state both.
    let orbits = Survey::of(&scene, &|| ()).unwrap().orbits;
    let apart = |orbit: &&StructureOrbit| (orbit.omega / (TAU * lock.at.f_hz) - 1.0).abs();
    let nearest = orbits.iter().min_by(|one, other| apart(one).total_cmp(&apart(other)));
    let (exact, volts) = (nearest.unwrap(), lock.command_v.unwrap());
    assert!((force / exact.reference - 1.0).abs() < 2e-3, "{force} N, {exact:?}");
    assert!((volts / exact.drive - 1.0).abs() < 1e-2, "{volts} V, {exact:?}");
    // On a base there are no newtons, and without a shaker no volts.
    let table = identified(&preset(2, "").unwrap()).unwrap().lock;
    assert!(table.at.f_n.is_none() && table.command_v.unwrap() > 0.0);
    let lock = identified(&paper(&[])).unwrap().lock;
    assert!(lock.at.f_n.is_none() && lock.command_v.is_none());
}

/// The points are those of structure and shaker, and are compared as the driven mode alone would have them.
#[test]
fn tracked_points_behind_a_shaker_belong_to_their_scene_and_not_to_a_wrong_one() {
    for n in [1, 2] {
        let levels = "[start] -> [backbone]\npoints = 8\nC_from = 0.6\nC_to = 0.25\n\n[start]";
        let scene = preset(n, levels).unwrap();
        let points = tracked_of(&scene).points.into_iter();
        let points: Vec<_> = points.map(|point| point.at.measured(&scene.units())).collect();
        assert!(contradiction(&scene, points.clone()).is_none(), "preset {n}");
        let mut wrong = scene.clone();
        wrong.plant.restitution = 0.6;
        assert!(contradiction(&wrong, points).is_some(), "preset {n}");
    }
}

#[test]
fn all_levels_of_the_presets_with_a_shaker_settle() {
    for n in 0..PRESETS.len() {
        let found = tracked_of(&preset(n, "").unwrap());
        assert!(found.ended.is_none(), "preset {n}: {:?}", found.ended);
        for point in &found.points {
            let is_symmetric = point.regime_by_impacts == Some(Regime::Symmetric);
            assert!(is_symmetric && point.unsettled(true).is_none(), "preset {n}: {point:?}");
        }
    }
}

/// Distance of the lock from the nearest exact orbit, over the standard uncertainties, and the periods to it.
fn distance_of_lock(scene: &Scene) -> (f64, f64) {
    let lock = identified(scene).unwrap().lock;
    let at = lock.at;
    // The force is known to its uncertainty, which moves the orbit.
    let d = scene.dimensionless();
    let [orbits, moved] = [at.g, at.g + at.u_g].map(|g| {
        let amplitude = d.amplitude(g);
        let measured = Scene { amplitude, ..scene.clone() };
        phase_resonant(&measured, &measured.dimensionless())
    });
    let distance = orbits.iter().zip(moved).map(|(orbit, moved)| {
        let u_c = at.u_c.hypot(moved.c - orbit.c);
        ((at.sigma - orbit.sigma).abs() / at.u_sigma).max((at.c - orbit.c).abs() / u_c)
    });
    (distance.fold(f64::INFINITY, f64::min), lock.periods_to_lock)
}

/// An armature of half of the mass, whose stiff stinger passes the impacts on to the force cell; `rest`: more sections and keys.
fn edged(rest: &str) -> Scene {
    let text = "[plant]\nm = 0.01\nb = 1\nr = 0.65\n[structure]\ncavity = \"mass\"\nexcitation = \"force\"\ndrive = \"mass\"\nsensor = \"mass\"\n\
                modes = [{ frequency = 1, damping = 0.005, shape = { mass = 1.0 } }]\n[shaker]\nmass = 0.5\nstiffness = 4.0\ndamping = 0.1\n\
                stinger_stiffness = 1e4\nstinger_damping = 1.0\nresistance = 1\nBl = 0.3\n[excitation]\nG = 1\n";
    Scene::parse("edged", &format!("{text}{rest}"), &[]).unwrap()
}

/// The plant of a scene on an exact orbit, and the drive that holds it there.
fn on_orbit(scene: &Scene, orbit: &StructureOrbit) -> (Plant<lovines::Structure>, Drive) {
    let host = scene.structure.as_ref().unwrap().host.clone();
    let mut plant = Plant::with_host(host, scene.plant, &StructureState::default()).unwrap();
    let drive = Drive::harmonic(orbit.drive, orbit.omega);
    plant.begin(drive).unwrap();
    let start = &orbit.start;
    plant.set_sections(&start.sections, [start.q2, start.dq2]).unwrap();
    (plant, drive)
}

#[test]
fn edges_of_a_force_that_alias_are_smaller_than_the_precision_by_default() {
    let scene = edged("");
    let samples = scene.controller.samples_per_period;
    let structure = scene.structure.as_ref().unwrap();
    let rows = &structure.shaker.as_ref().unwrap().rows;
    let orbits = scene.orbits_of(scene.structure.as_ref().unwrap());
    let mut found = orbits.at_phase_resonance(0.99 * TAU).into_iter();
    let orbit = found.find(|orbit| orbit.stability.stable).unwrap();
    let (mut plant, drive) = on_orbit(&scene, &orbit);
    let count = 20_000;
    let mut force = Vec::new();
    for _ in 0..count {
        plant.advance(drive, TAU / orbit.omega / f64::from(count)).unwrap();
        force.push(plant.point(&rows.force)[0]);
    }
    let harmonic = |n: f64| {
        let turned = |(k, force): (usize, &f64)| force * Complex::cis(TAU * n * k as f64 / f64::from(count));
        force.iter().enumerate().map(turned).sum::<Complex<f64>>().norm()
    };
    let beside = |samples: f64| harmonic(samples - 1.0) / harmonic(1.0) / scene.backbone.precision;
    let [all, half] = [samples, 0.5 * samples].map(beside);
    assert!(samples > 200.0 && all < 1.2 && half > 0.8, "{samples}: {all} {half}");
}

#[test]
fn what_rings_beside_the_driven_mode_is_that_of_structure_and_shaker_and_edges_that_alias_are_stated() {
    let scene = edged("");
    let share = scene.knowledge().shaker.unwrap().aliased / scene.amplitude / scene.backbone.precision;
    assert!(share > 0.1 && share <= 1.0, "{share}");
    // The second mode of the cantilever, which the shaker damps a little more.
    let scene = preset(0, "").unwrap();
    let structure = scene.structure.as_ref().unwrap();
    let driven = structure.mode();
    let second = &structure.modes[1];
    let alone = driven.omega / (TAU * second.zeta * second.omega);
    let ringing = driven.omega / (TAU * -scene.knowledge().rings[0].unwrap().re);
    assert!((0.7..1.0).contains(&(ringing / alone)), "{ringing} {alone}");
}

#[test]
fn a_scene_takes_more_samples_for_a_shaker_only_if_it_does_not_say_how_many() {
    let samples = |rest: &str| edged(rest).controller.samples_per_period;
    assert_eq!(samples("[controller]\nsamples_per_period = 100\n"), 100.0);
    assert_eq!(samples("[controller]\nsamples_per_period = 130\n"), 130.0);
    assert!(samples("[chain]\nfilter = 10\n") < samples(""));
    assert!(samples("[backbone]\nprecision = 0.1\n") < samples(""));
    let of_presets = [0, 1, 2].map(|n| preset(n, "").unwrap().controller.samples_per_period);
    assert_eq!(of_presets, [100.0, 200.0, 100.0]);
}

/// The receptance of the cantilever of the preset at its tip, by forces at its root and at its tip, m/N.
fn receptance(scene: &Scene, omega: f64) -> [Complex<f64>; 2] {
    let bare = preset(0, "cell_mass = 0.02 -> ").unwrap();
    let structure = bare.structure.as_ref().unwrap();
    assert_eq!(structure.points, scene.structure.as_ref().unwrap().points);
    [structure.drive.unwrap(), structure.cavity].map(|from| Modal(structure, omega).receptance(structure.sensor, from))
}

#[test]
fn a_compensated_force_drives_the_structure_alone() {
    let scene = preset(0, COMPENSATED).unwrap();
    let structure = scene.structure.as_ref().unwrap();
    let (host, response) = (&structure.host, structure.response());
    for hertz in [2.0, 8.8156, 9.5, 55.0, 160.0] {
        let omega = TAU * hertz;
        let [by_force, by_impacts] = receptance(&scene, omega);
        let shaker = structure.shaker.as_ref().unwrap();
        let row = shaker.reference(structure.excitation, omega);
        let driven = host.frequency_response(&response, omega) / host.frequency_response(&row, omega);
        let hit = host.frequency_response_to_cavity(&response, omega)
            - by_force * host.frequency_response_to_cavity(&row, omega);
        let errors = [driven / by_force - 1.0, hit / by_impacts - 1.0].map(|error| error.norm());
        assert!(errors.iter().all(|error| *error < 1e-12), "{hertz} Hz: {errors:?}");
    }
}

/// A plant that starts on an exact orbit under its voltage stays there.
#[test]
fn exact_orbits_with_a_shaker_are_motions_of_the_plant() {
    for n in 0..PRESETS.len() {
        let scene = preset(n, "").unwrap();
        let orbits = scene.orbits_of(scene.structure.as_ref().unwrap());
        let range = [0.97, 1.0].map(|share| share * scene.dimensionless().omega0);
        let found = orbits.resonant(scene.drive(), range);
        assert!(!found.is_empty(), "preset {n}");
        for orbit in found {
            let (mut plant, drive) = on_orbit(&scene, &orbit);
            let before = plant.state();
            plant.advance(drive, 2.0 * PI / orbit.omega).unwrap();
            let (after, b) = (plant.state(), scene.plant.half_width);
            let error = (after.q1 - before.q1).abs().max((after.q2 - before.q2).abs()) / b;
            assert!(error < 1e-9 && plant.totals().impacts == 2, "preset {n}: {error:e}");
        }
    }
}

#[test]
fn measured_harmonics_of_the_force_are_those_of_the_exact_orbits_under_a_voltage() {
    // From other levels the loop may fall into the asymmetric motion that exists beside the symmetric one.
    let scene = preset(0, "C_to = 0.16 -> C_to = 0.44 ;; points = 18 -> points = 3").unwrap();
    let exact = Survey::of(&scene, &|| ()).unwrap().behind_shaker;
    let b = scene.units().response.of_metres(scene.plant.half_width);
    let points = tracked_of(&scene).points;
    assert_eq!(points.len(), 3);
    for point in points {
        let [second, third, fourth, fifth, sixth, seventh] = point.drive_harmonics.unwrap();
        let distance = |one: &&BehindShaker| (one.response / b - point.at.c).abs();
        let nearest = exact
            .iter()
            .min_by(|one, other| distance(one).total_cmp(&distance(other)));
        // They change by a hundredth between the levels that are compared; the samples see the edges of the force late.
        for (measured, exact) in [third, fifth, seventh].into_iter().zip(nearest.unwrap().harmonics) {
            assert!((measured / exact - 1.0).abs() < 0.05, "{measured} {exact}");
        }
        assert!([second, fourth, sixth].iter().all(|even| *even < 0.1 * third));
    }
}

#[test]
fn a_check_behind_a_shaker_measures_the_structure_and_names_a_fault() {
    for n in 0..PRESETS.len() {
        let scene = preset(n, "").unwrap().at_rest();
        let plan = scene.plan();
        let checked = check(&mut *Simulated::of(&scene).unwrap(), &plan).unwrap();
        assert_eq!(checked.verdict, Verdict::Healthy, "preset {n}");
        for (quantity, share) in checked.quantities.iter().zip([2e-5, 1e-3]) {
            let error = quantity.measured / quantity.expected - 1.0;
            assert!(error.abs() < share, "preset {n}: {quantity:?}");
        }
        for (factor, expected) in [(-1.0, Verdict::ResponseReversed), (0.0, Verdict::BaseDead)] {
            let mut rig = Altered::reading(&scene, |sensors| Sensors {
                reference: sensors.reference.map(|value| factor * value),
                ..sensors
            });
            assert_eq!(check(&mut rig, &plan).unwrap().verdict, expected, "preset {n}");
        }
    }
}

#[test]
fn a_heavy_table_that_floats_on_a_soft_suspension_is_not_taken_for_a_late_response() {
    let text = "[plant]\nM = 1\nk = 39.478\nc = 0.014\nm = 0.004\nb = 1\nr = 0.7\n[shaker]\nmass = 0.0105\nstiffness = 0.0112\n\
                damping = 4e-4\nstinger_stiffness = 397\nstinger_damping = 0.04\nresistance = 1\nBl = 0.216\ninductance = 0.047\n\
                table_mass = 2.96\n[excitation]\nG = 1.4\n";
    let scene = Scene::parse("floating", text, &[]).unwrap();
    let mut rig = Simulated::of(&scene.clone().at_rest()).unwrap();
    let checked = check(&mut *rig, &scene.plan()).unwrap();
    assert_eq!(checked.verdict, Verdict::Healthy);
    let measured = checked.linear.unwrap();
    let error = measured.damping_rate / 0.007 - 1.0;
    assert!(error.abs() < 1e-2, "{error:e}");
}

/// The difference in sigma and G of the lock on a checked rig, which reports no impacts, from the exact orbit with its C, with these settings of the
/// chain.
fn distance_of_checked_lock(chain: &str) -> [f64; 2] {
    let scene = preset(0, &format!("[start] -> {chain}[start]")).unwrap();
    let mut rig = SensorsOnly(Simulated::of(&scene).unwrap());
    // The check measures what a filter takes of the readings, and the results are corrected by it.
    let linear = check(&mut rig, &scene.plan()).unwrap().linear.unwrap();
    let plan = scene.plan_on(scene.knowledge().measured(linear.response));
    let mut controller = BuiltIn::new(&plan.lock).unwrap();
    let record = run(&mut Vec::new(), &mut rig, &mut controller, &plan, |_, _| {}).unwrap();
    let compared = Comparison::of(&identify(&record, &plan).unwrap(), &scene);
    let (at, exact) = (compared.lock.at, compared.exact.unwrap());
    assert!(compared.lock.at_requested_drive, "{at:?}");
    [at.sigma - exact.sigma, at.g - exact.g].map(f64::abs)
}

#[test]
fn a_rig_that_was_checked_locks_on_the_exact_orbit() {
    let distance = distance_of_checked_lock("");
    assert!(distance.iter().all(|one| *one < 1e-3), "{distance:?}");
}

/// The anti-alias filter makes the readings late, which the control knows.
#[test]
#[ignore = "open: an asymmetric motion exists beside the symmetric one, and behind a filter the loop holds it"]
fn a_rig_that_was_checked_locks_on_the_exact_orbit_behind_a_filter() {
    let distance = distance_of_checked_lock("[chain]\nfilter = 4.0\n");
    assert!(distance.iter().all(|one| *one < 1e-3), "{distance:?}");
}

#[test]
fn a_limit_that_is_reached_ends_the_experiment_with_its_name() {
    let scene = preset(0, "force_max = 45.0 -> force_max = 12.2").unwrap();
    let plan = scene.plan();
    let mut controller = BuiltIn::new(&plan.tracking).unwrap();
    let rig = Simulated::of(&scene).unwrap();
    let error = track(&mut Vec::new(), &mut SensorsOnly(rig), &mut controller, &plan, |_| {});
    let is_limit = |error: &ExperimentError| {
        matches!(error, ExperimentError::Rig(RigError::ShakerLimit { name: "force", .. }))
            && error.to_string().contains("shaker.force_max")
    };
    match error {
        Ok(tracked) => assert!(tracked.ended.as_ref().is_some_and(is_limit), "{:?}", tracked.ended),
        Err(error) => assert!(is_limit(&error), "{error}"),
    }
}

/// The limits, and the drive of 11.85 N, behind a force.
#[test]
fn a_limit_of_the_drive_behind_a_force_is_in_newtons_wherever_it_is_named() {
    let limited = |newtons: &str| {
        let limit = format!("[start] -> [phase_lock]\namplitude_max = {newtons}\n\n[start]");
        preset(0, &limit)
    };
    let refused = limited("6.0").unwrap_err().to_string();
    let expected = "phase_lock.amplitude_max = 6 N: at least the drive of [excitation], 11.";
    assert!(refused.starts_with(expected) && refused.ends_with(" N"), "{refused}");
    let scene = limited("20.0").unwrap();
    let (plan, unit) = (scene.plan(), scene.units().reference);
    assert!((unit.of_metres(plan.lock.amplitude_max.unwrap()) - 20.0).abs() < 1e-9);
    let error = excessive(&scene, unit.in_metres(20.0)).unwrap_err();
    let expected = "the controller asked for 30 N, and phase_lock.amplitude_max allows 20 N";
    assert!(error.to_string().starts_with(expected), "{error}");
}

/// A simulated structure, and the largest magnitudes of what is measured at its shaker in the last samples.
struct Extremes {
    rig: SimulatedStructure,
    structure: Structure,
    largest: Rc<Cell<[f64; 3]>>,
}

/// Channels with a limit, and the limit.
const LIMITED: [(&str, &str); 3] = [
    ("force", "force_max"),
    ("armature", "stroke_max"),
    ("current", "current_max"),
];

impl RigStage for Extremes {
    fn inner(&mut self) -> &mut dyn Rig {
        &mut self.rig
    }

    fn sense(&mut self) -> Result<Sensors, RigError> {
        let plant = self.rig.plant();
        let channels = self.structure.channels();
        let now = LIMITED.map(|(name, _)| channels.iter().find(|one| one.name == name).unwrap().read(plant).abs());
        let before = self.largest.get();
        // Falls to 1 % in 900 samples, so that the search is forgotten.
        self.largest.set([0, 1, 2].map(|n| now[n].max(0.995 * before[n])));
        self.rig.sense()
    }
}

/// Of 27 runs with one limit at 1.6 to 2.2 times what the held motion needs, every one locks, or names the limit and the need.
#[test]
#[ignore = "open: the bench plans within the amplifier's limit only; 9 of 27 runs end at another limit of the shaker"]
fn the_bench_plans_within_the_limits_of_a_shaker() {
    let mut failed = Vec::new();
    for (n, preset) in PRESETS.iter().enumerate() {
        let keys = ["voltage_max", "current_max", "stroke_max", "force_max"];
        let is_limit = |line: &&str| keys.iter().any(|key| line.starts_with(key));
        let text: Vec<_> = preset.lines().filter(|line| !is_limit(line)).collect();
        let text = text.join("\n");
        let scene = Scene::parse("without limits", &text, &[]).unwrap();
        let structure = scene.structure.clone().unwrap();
        let rig = SimulatedStructure::new(&structure, scene.plant, scene.start).unwrap();
        let largest = Rc::default();
        let rig = Extremes { rig, structure, largest: Rc::clone(&largest) };
        let plan = Plan { decay: 0, ..scene.plan() };
        let mut controller = BuiltIn::new(&plan.lock).unwrap();
        let mut rig = Measured::new(rig, scene.resonance, &scene.plant, 0.0);
        run(&mut Vec::new(), &mut rig, &mut controller, &plan, |_, _| {}).unwrap();
        for ((name, key), needed) in LIMITED.into_iter().zip(largest.get()) {
            for times in [1.6, 1.9, 2.2] {
                let limited = text.replace("[shaker]", &format!("[shaker]\n{key} = {:?}", times * needed));
                let ended = Scene::parse("limited", &limited, &[]).unwrap();
                let record = record(&mut *Simulated::of(&ended).unwrap(), &ended);
                let Err(error) = record.map_err(|error| error.to_string()) else {
                    continue;
                };
                if !(error.contains(key) && error.contains(&format!("{needed:.2e}"))) {
                    failed.push(format!("{n}, {name} at {times}: {error}"));
                }
            }
        }
    }
    assert!(failed.is_empty(), "{} of 27: {failed:#?}", failed.len());
}

/// Fewer samples than a period has, for which a command may stay at its limit.
const AT_LIMIT: usize = 60;

/// The record with a controller that asks for more than this amplitude, m, in the first samples, and for less afterwards.
fn excessive(scene: &Scene, amplitude: f64) -> Result<Record, ExperimentError> {
    let (omega, plan) = (scene.dimensionless().omega0, scene.plan());
    let answer = |command: &mut Command, (active, samples): Asked| {
        let share = match active {
            true if samples <= AT_LIMIT => 1.5,
            true => 0.8,
            false => 0.0,
        };
        let drive = vines_bench::rig::Drive { omega, amplitude: share * amplitude, ..Default::default() };
        let settled = Some(samples > 2 * AT_LIMIT);
        *command = Command { drive, settled, ..Command::default() };
        Ok(())
    };
    let mut controller = Foreign::new(&plan.lock, answer);
    let mut rig = Simulated::of(scene).unwrap();
    run(&mut Vec::new(), &mut *rig, &mut controller, &plan, |_, _| {})
}

#[test]
fn the_share_of_clipped_samples_is_that_of_the_commands_at_the_limit() {
    let scene = preset(0, "voltage_max = 40.0 -> voltage_max = 4.5").unwrap();
    let record = excessive(&scene, scene.amplitude).unwrap();
    let expected = 100.0 * AT_LIMIT as f64 / record.released as f64;
    let stated = record.clipped_percent.unwrap();
    assert!((stated - expected).abs() < 1e-9, "{stated} {expected}");
}

#[test]
fn the_decay_after_the_stinger_is_cut_is_that_of_the_simulation() {
    let scene = preset(1, "[shaker] -> [shaker]\nrelease = \"cut\"").unwrap();
    let record = record_of(&scene);
    let truth = demodulated(&record, &scene);
    let points = decay_points(&record, &scene.knowledge(), DECAY_WINDOW).points;
    let above = points.iter().filter(|point| point.c > COMPARED_ABOVE);
    let errors = above.filter_map(|point| Some(point.sigma - at(&truth, point.tau)?));
    let errors: Vec<f64> = errors.collect();
    let (count, error) = (errors.len(), mean_square(errors).sqrt());
    println!("{count} points, RMS error {error:.1e} of sigma");
    // The same fit of the default scene, without a shaker, has an error of 3e-3, because the window blurs the end.
    assert!(count > 20 && error < 2e-3, "{count} {error}");
}

#[test]
fn a_decay_beside_a_mode_that_a_window_cannot_tell_apart_has_no_points() {
    // The oscillator on a free table: poles of the 6 x 6 matrix of both, -0.97 + 59.17i and -2.26 + 38.84i.
    let open = preset(2, CURRENT).unwrap();
    let apart = open.knowledge().nearest_pole;
    assert!((apart - 20.372).abs() < 1e-3, "{apart}");
    let decay = |scene: &Scene| {
        let DecayPoints { points, end } = decay_points(&record_of(scene), &scene.knowledge(), DECAY_WINDOW);
        (points.len(), end)
    };
    assert_eq!(decay(&open), (0, DecayEnd::OtherMode));
    // Behind a voltage the coil holds the table, whose poles are real.
    let (count, end) = decay(&preset(2, "").unwrap());
    assert!(count > 40 && end == DecayEnd::Synchrony, "{count} {end:?}");
}

#[test]
fn a_backbone_of_a_few_levels_is_tracked_to_the_last_one_near_the_fold() {
    let few = preset(1, "[start] -> [backbone]\npoints = 4\n\n[start]").unwrap();
    for scene in [few, paper(&["backbone.points=4"])] {
        let found = tracked_of(&scene);
        let settled = found.points.iter().filter(|point| point.settled);
        assert_eq!((found.points.len(), settled.count()), (4, 4), "{:?}", found.ended);
    }
}

/// Instant at which the lock has been held for thirty samples.
const HELD: f64 = f64::INFINITY;

/// After each fault the drive is zero within the seconds of its row, and the error names the channel that contradicts the path that the check has
/// measured: so an amplifier that clips is found also where the scene has no limit. Where 22 % of the force is left at the resonance, a cell that reads a third is slower to show than the
/// 0.3 s asked for: it loses two thirds of what is asked for, and the control has to add to it.
#[test]
fn faults_of_a_shaker_end_the_drive_in_time_with_the_channel_that_contradicts() {
    use {RigFault::*, SensorFault::*};
    let [stinger, amplifier, stop] = RigFault::OF_SHAKER.map(|(_, fault)| fault);
    let third = Base(Gain(1.0 / 3.0));
    let no_limit = "voltage_max = 40.0 -> ";
    // More of the armature moves with the structure: 22 % of the force is left at the resonance.
    let strong = "voltage_max = 40.0 ->  ;; tip = 0.51252, root = 0.04672 -> tip = 0.51252, root = 0.1786 ;; force_max = 45.0 ->  ;; stroke_max = 0.0088 -> ";
    let all = [Base(Reversed), Base(Dead), Base(Saturated), amplifier, stinger, stop];
    // Periods after which the fault begins, and seconds to a drive of zero.
    let cases = [
        (0, "", &all[..], &[HELD][..], 0.3),
        // Little of the force is left.
        (1, "", &[Base(Reversed), amplifier], &[60.0], 0.3),
        (1, "", &[stinger], &[30.0, 60.0, 90.0], 0.32),
        (1, "", &[Base(Saturated)], &[120.0, HELD], 0.3),
        (0, no_limit, &[amplifier, third], &[20.0, 90.0, 200.0], 0.3),
        (0, strong, &[amplifier, third], &[20.0, 90.0, 200.0], 0.5),
    ];
    for (n, changes, faults, instants, within) in cases {
        let scene = preset(n, changes).unwrap();
        let period = scene.dimensionless().natural_period();
        let pairs = faults
            .iter()
            .flat_map(|fault| instants.iter().map(move |one| (*fault, *one)));
        for (fault, periods) in pairs {
            let held = || {
                let healthy = record_of(&scene);
                (healthy.settled + 30) as f64 * healthy.sample_time
            };
            let begins = if periods == HELD { held() } else { periods * period };
            let name = match fault {
                _ if fault == stop => "shaker.stroke_max",
                _ if fault == amplifier || fault == third => "the force contradicts command and response",
                _ => "the force contradicts",
            };
            for phase in [0.0, 0.3] {
                let zero = Rc::new(Cell::new(None));
                let told = Rc::clone(&zero);
                let mut rig = faulty(&scene, fault, begins + phase * period, move |time| told.set(time)).unwrap();
                let ended = record(&mut rig, &scene).map(|record| record.samples.len());
                drop(rig);
                let is_named = ended.as_ref().is_err_and(|error| error.to_string().contains(name));
                let is_off = zero.get().is_some_and(|time| time < within);
                let case = format!("{n}, {changes}, {fault:?} after {periods} periods");
                assert!(is_named && is_off, "{case}: {zero:?}, {ended:?}");
            }
        }
    }
}

#[test]
fn an_amplifier_that_controls_the_current_needs_the_voltage_for_it() {
    // The slip table commands 90 A at most; at the resonance its coil moves at 0.005 m/s, and needs 0.6 V for it.
    let of = |voltage: &str| {
        preset(
            2,
            &format!("{CURRENT} ;; voltage_max = 100.0 -> voltage_max = {voltage}"),
        )
    };
    says(of("0.1"), "shaker.voltage_max");
    let scene = of("4.0").unwrap();
    let mut rig = Simulated::of(&scene).unwrap();
    let (omega, step) = (scene.dimensionless().omega0, scene.sample_time());
    let amplitude = scene.units().command.of_metres(10.0 * scene.amplitude);
    let drive = vines_bench::rig::Drive { omega, amplitude, ..Default::default() };
    let error = (0..20_000).find_map(|_| rig.advance(drive, step).err());
    let is_limit = matches!(error, Some(RigError::ShakerLimit { name: "voltage", value, .. }) if value.abs() > 4.0);
    assert!(is_limit, "{error:?}");
}

#[test]
fn a_table_whose_own_resonance_is_near_is_controlled_as_slowly_as_this_allows() {
    let speeds = [(0, ""), (1, ""), (2, ""), (2, CURRENT)]
        .map(|(n, changes)| preset(n, changes).unwrap().knowledge().shaker.unwrap().speed);
    assert_eq!(speeds, [1.0, 1.0, 1.0, 0.25]);
}

#[test]
fn a_heavy_shaker_or_one_in_other_units_is_doubted() {
    for (n, changes, named) in [
        (0, "", ""),
        (1, "", ""),
        (2, "", ""),
        (0, "mass = 0.057 -> mass = 57.0", "armature over structure"),
        (0, "mass = 0.057 -> mass = 57.0", "over the weight of the armature"),
        (2, "mass = 12.0  -> mass = 12e3 ", "over the weight of the armature"),
        (0, "stiffness = 9932.0 -> stiffness = 9.932", "sag"),
        (0, "stroke_max = 0.0088 -> stroke_max = 8.8", "shaker.stroke_max"),
    ] {
        let scene = preset(n, changes).unwrap();
        let names: Vec<_> = scene.implausible().map(|one| one.name).collect();
        let is_named = names.iter().any(|name| name.contains(named));
        assert_eq!(is_named, !named.is_empty(), "{n}, {changes}: {names:?}");
    }
    // Without a shaker.
    assert_eq!(paper(&[]).implausible().count(), 0);
}

/// Presets with changes, and parts of the sentence that refuses them.
const MISTAKES: &str = r#"
0: \nmass = 0.057 -> \nmass = 0 => mass of the armature | kg
0: resistance = 2.0 -> resistance = -2.0 => resistance of the coil | ohm
0: Bl = 6.78 -> Bl = 0 => V s/m | positive
0: voltage_max = 40.0 -> voltage_max = -1 => voltage_max | positive
0: amplifier = "voltage" -> amplifier = "current"\ninductance = 1e-3 => voltage_max | cut_off
0: cell_mass = 0.02 -> table_mass = 2 => table_mass | base
0: cell_mass = 0.02 -> cell_mass = nan => end of the stinger NaN kg | positive
0: [shaker] -> [shaker]\ncut_off = -1 => cut_off = -1 Hz | positive
0: [shaker] -> [shaker]\ncut_off = 1e15 => cut_off = 1000000000000000 Hz | 1e11
0: 55.247 -> 1e15 => mode 2 has frequency = 1000000000000000 Hz | 1e11 Hz
0: [shaker] -> [shaker]\ncompensated_mass = -0.01 => compensated_mass = -0.01 kg | 0 or positive
0: [shaker] -> [shaker]\ncompensated_mass = 30 => -29.98 kg in front of the force cell | positive definite
2: [shaker] -> [shaker]\ncompensated_mass = 1 => compensated_mass = 1 kg | table
0: force_max = 45.0 -> force_max = 0.1 => force_max | N
0: voltage_max = 40.0 -> voltage_max = 0.4 => voltage_max | times what
0: current_max = 15.0 -> current_max = 0.1 => current_max | A
0: stroke_max = 0.0088 -> stroke_max = 1e-5 => stroke_max | m
1: M = 3.807 ->  => M | SI
0: [start] -> [resonance]\nreference_quantity = "acceleration"\n[start] => reference_quantity | the reference is this force
2: table_mass = 40.0 -> table_mass = 0 => end of the stinger | kg
2: [start] -> [chain]\nreference = false\n[start] => phase turns by 26.4 degrees | force cell
"#;

#[test]
fn what_is_wrong_with_a_shaker_is_said_in_one_sentence() {
    for line in MISTAKES.trim().lines() {
        let (n, mistake) = line.split_once(": ").unwrap();
        let (changes, parts) = mistake.split_once(" => ").unwrap();
        let message = says(preset(n.parse().unwrap(), changes), parts);
        assert!(!message.contains('\n'), "{message}");
    }
}

#[test]
fn where_harmonics_of_the_force_exceed_the_range_of_its_converter_there_is_neither_a_lock_nor_a_settled_level() {
    let clipped = ["chain.adc_bits=16", "chain.base_range=1.11"];
    let scene = super::preset("shaker-cantilever", &clipped).unwrap();
    let record = record_of(&scene);
    let error = identify(&record, &scene.plan()).unwrap_err();
    assert!(error.to_string().contains("chain.base_range"), "{error}");
    let levels = ["chain.adc_bits=16", "chain.base_range=1.15", "backbone.points=6"];
    let scene = super::preset("shaker-cantilever", &levels).unwrap();
    let tracked = tracked_of(&scene);
    let mut points = tracked.points.iter();
    assert!(
        points.any(|point| !point.settled && point.saturated.is_some()),
        "{:?}",
        tracked.points
    );
}
