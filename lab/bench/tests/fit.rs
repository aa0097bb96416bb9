//! Guards the fit of a rig's parameters to points of its backbone: exact points, noise, points that do not belong, and what is refused.

use lovines::Cavity;
use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use vines_model::numerics::Estimate;
use vines_model::orbit::{backbone_at_speed, resonant_motion};
use vines_testbench::backbone::track;
use vines_testbench::fit::{
    Effect, Fit, FitError, Kind, Known, MeasuredPoint, Quantity, Recording, contradiction, explain, fit, parts,
};
use vines_testbench::rig::{BuiltIn, Chain, Rig, RigError, RigStage, Sensors, Simulated};
use vines_testbench::scene::{Definition, Dimensionless, Parameters, Scene};

/// The rig that the points belong to.
const RIG: Parameters = Parameters {
    primary_mass: 3.9,
    stiffness: 11.5e3,
    damping: 3.0,
    particle_mass: 0.036,
    half_width: 0.0095,
    restitution: 0.55,
    cavity: Cavity::IDEAL,
};
/// What a fit finds without a scale.
const FITTED: &[Quantity] = Quantity::ALL.split_at(5).0;

/// The default scene with these settings.
fn scene(settings: &str) -> Scene {
    let overrides: Vec<_> = settings.split(' ').map(|one| one.parse().unwrap()).collect();
    Scene::load(None, &overrides).unwrap()
}

/// A scene with the wrong restitution, half-width, damping and stiffness.
fn wrong_scene() -> Scene {
    scene("plant.r=0.75 plant.b=0.0105 plant.c=3.5 plant.k=11600 plant.M=3.9")
}

/// Response, m, frequency, rad/s, and drive, m, measured with this relative standard uncertainty of both amplitudes, and a hundredth of it of the
/// frequency. `seed` 0: without noise.
fn measured(motions: impl Iterator<Item = [f64; 3]>, uncertainty: f64, seed: u64) -> Vec<MeasuredPoint> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut estimate = |value: f64, relative: f64| {
        let normal: f64 = StandardNormal.sample(&mut random);
        let noise = if seed == 0 { 0.0 } else { relative * normal };
        Estimate { value: value * (1.0 + noise), uncertainty: value * relative }
    };
    let point = |[response, omega, drive]: [f64; 3]| MeasuredPoint {
        response: estimate(response, uncertainty),
        omega: estimate(omega, 0.01 * uncertainty),
        drive: estimate(drive, uncertainty),
    };
    motions.map(point).collect()
}

/// Twelve points of the rig from the fold on.
fn points(uncertainty: f64, seed: u64) -> Vec<MeasuredPoint> {
    let d = Dimensionless::of(&RIG, 0.0);
    let motions = (0..12).map(|n| {
        let [omega, c, g] = backbone_at_speed(&d, 0.7 + 0.03 * f64::from(n)).unwrap();
        [c * d.b, d.omega0 * omega, d.amplitude(g)]
    });
    measured(motions, uncertainty, seed)
}

/// The fit of a client that believes in the default scene.
fn fitted(points: &[MeasuredPoint], known: &[&str]) -> Result<Fit, FitError> {
    let known: Vec<Known> = known.iter().map(|one| one.parse().unwrap()).collect();
    fit(
        points,
        Definition::default(),
        &Scene::load(None, &[]).unwrap().plant,
        &known,
    )
}

/// Largest error of the five parameters over their standard uncertainties.
fn worst(fit: &Fit) -> f64 {
    let pulls = FITTED.iter().map(|quantity| pull(fit, *quantity).abs());
    pulls.fold(0.0, f64::max)
}

/// Error over the standard uncertainty.
fn pull(fit: &Fit, quantity: Quantity) -> f64 {
    let estimate = fit.estimate(quantity).unwrap();
    (estimate.value - quantity.of_plant(&RIG)) / estimate.uncertainty
}

#[test]
fn exact_points_give_the_parameters_of_another_rig_than_the_expected_one() {
    let fit = fitted(&points(1e-4, 0), &[]).unwrap();
    assert!(worst(&fit) < 1e-3, "{fit:?}");
    assert!(fit.chi_square < 1e-6 && fit.left_out.is_empty() && !fit.is_rejected());
    // What points do not separate is said; these do.
    assert!(fit.not_separated().is_empty());
    let near = fitted(&points(2e-2, 0)[..3], &[]).unwrap();
    assert!(!near.not_separated().is_empty());
}

#[test]
fn through_noise_the_stated_intervals_hold_the_parameters_and_chi_square_its_degrees_of_freedom() {
    let (mut within, mut chi_square) = (0, 0.0);
    for seed in 1..=60 {
        let fit = fitted(&points(2e-3, seed), &[]).unwrap();
        within += FITTED.iter().filter(|one| pull(&fit, **one).abs() <= 1.96).count();
        chi_square += fit.chi_square / fit.degrees as f64 / 60.0;
    }
    println!("{within} of 300 within 1.96 u, chi-square {chi_square:.2} per degree of freedom");
    assert!((270..=297).contains(&within) && (0.85..1.15).contains(&chi_square));
}

#[test]
fn points_of_another_motion_are_left_out_and_named_and_points_that_no_parameters_describe_rejected() {
    let mut strange = points(2e-3, 5);
    strange[3].omega.value *= 1.003;
    strange[11].drive.value *= 1.2;
    let fit = fitted(&strange, &[]).unwrap();
    assert!(fit.left_out == [3, 11] && worst(&fit) < 4.0, "{fit:?}");
    let mut bent = points(1e-3, 6);
    let (first, last) = (bent[0].response.value, bent[11].response.value);
    for point in &mut bent {
        // A structure whose frequency depends on the amplitude by itself, and a loss that grows with it.
        let share = (point.response.value - first) / (last - first);
        point.drive.value *= 1.0 + 0.1 * (6.0 * share).sin();
    }
    let fit = fitted(&bent, &[]).unwrap();
    assert!(fit.is_rejected() && fit.left_out.is_empty(), "{:?}", fit.p_value());
}

#[test]
fn a_known_mass_gives_si_units_and_a_value_that_is_known_exactly_is_kept_and_helps_the_others() {
    let exact = points(1e-4, 0);
    assert!(fitted(&exact, &[]).unwrap().estimate(Quantity::Stiffness).is_none());
    let fit = fitted(&exact, &["m=0.036±0.0004"]).unwrap();
    let relative = |quantity: Quantity| fit.estimate(quantity).unwrap().scaled(1.0 / quantity.of_plant(&RIG));
    let [mass, stiffness] = [Quantity::PrimaryMass, Quantity::Stiffness].map(relative);
    assert!((mass.value - 1.0).abs() < 1e-3 && (stiffness.value - 1.0).abs() < 1e-3);
    // The relative uncertainty of the mass is at least that of the one that is known.
    assert!((1.0 / 90.0..0.03).contains(&(mass.uncertainty / mass.value)));
    assert!((fit.plant(&RIG).damping / RIG.damping - 1.0).abs() < 1e-2);
    let [free, fixed] = [&[][..], &["b=0.0095"]].map(|known| fitted(&points(2e-3, 7), known).unwrap());
    let r = |fit: &Fit| fit.estimate(Quantity::R).unwrap().uncertainty;
    assert!((fixed.estimate(Quantity::B).unwrap().value - 0.0095).abs() < 1e-10);
    assert!(r(&fixed) < 0.8 * r(&free), "{} {}", r(&fixed), r(&free));
}

#[test]
fn too_few_points_and_numbers_that_are_not_positive_are_refused() {
    let all = points(1e-3, 0);
    assert!(matches!(fitted(&all[..2], &[]), Err(FitError::TooFew(2))));
    let broken: [fn(&mut MeasuredPoint); 3] = [
        |point| point.response.value = f64::NAN,
        |point| point.drive.value = -1e-4,
        |point| point.omega.uncertainty = 0.0,
    ];
    for damage in broken {
        let mut points = all.clone();
        damage(&mut points[4]);
        let message = fitted(&points, &[]).unwrap_err().to_string();
        assert!(message.starts_with("point 5: "), "{message}");
    }
    for text in ["q=1", "r", "r=x", "m=-1", "m=0.03±-1"] {
        assert!(text.parse::<Known>().is_err(), "{text}");
    }
}

#[test]
fn points_of_another_rig_contradict_the_scene_and_those_of_its_own_do_not() {
    let points = points(2e-3, 8);
    assert_eq!(contradiction(&points, Definition::default(), &RIG), None);
    let wrong = Parameters { restitution: 0.65, ..RIG };
    let text = contradiction(&points, Definition::default(), &wrong).unwrap();
    assert!(
        text.contains("r = 5.5") && text.contains("the scene says 6.5000e-1"),
        "{text}"
    );
}

/// A recording of a backbone at 60 dB that is tracked on [`RIG`], and cut in the middle of its first and its last level.
fn recording() -> Recording {
    let scene = scene("backbone.C_from=0.65 backbone.C_to=0.25 backbone.points=10 chain.snr=60");
    let rig = Simulated::new(RIG, scene.start).unwrap();
    let mut rig = Recorder { rig: Chain::around(Box::new(rig), &scene), read: Vec::new() };
    let mut controller = BuiltIn::new(&scene.backbone_config()).unwrap();
    track(&mut rig, &mut controller, &scene.plan(), |_, _| {}).unwrap();
    let kept = &rig.read[3000..rig.read.len() - 500];
    Recording {
        origin: "record.csv".into(),
        channels: ["y".into(), "x".into()],
        start: 0.0,
        is_acceleration: false,
        notes: Vec::new(),
        sample_time: scene.sample_time(),
        response: kept.iter().map(|one| one.response).collect(),
        drive: kept.iter().map(|one| one.reference.unwrap()).collect(),
    }
}

/// Keeps what is read before each step.
struct Recorder {
    rig: Box<dyn Rig>,
    read: Vec<Sensors>,
}

impl RigStage for Recorder {
    fn inner(&mut self) -> &mut dyn Rig {
        &mut *self.rig
    }

    fn sense(&mut self) -> Result<Sensors, RigError> {
        self.read.push(self.rig.sense()?);
        Ok(self.read[self.read.len() - 1])
    }
}

#[test]
fn a_recording_that_begins_and_ends_in_the_middle_of_a_level_gives_the_parameters() {
    let scene = wrong_scene();
    let parts = parts(&[recording()], &scene, &[]).unwrap().concat();
    let points: Vec<MeasuredPoint> = parts.iter().filter_map(|part| part.point).collect();
    let held = parts.iter().filter(|part| part.kind == Kind::Held).count();
    assert!(held >= 4, "{parts:?}");
    let fit = fit(&points, Definition::default(), &scene.plant, &[]).unwrap();
    let mut estimates = FITTED.iter().map(|quantity| fit.estimate(*quantity).unwrap());
    let are_narrow = estimates.all(|one| one.uncertainty < 0.2 * one.value);
    assert!(worst(&fit) < 3.0 && are_narrow && !fit.is_rejected(), "{fit:?}");
}

#[test]
fn channels_that_are_no_recording_of_a_rig_near_resonance_are_refused_with_what_to_do() {
    let scene = wrong_scene();
    let mut good = recording();
    good.response.truncate(6000);
    good.drive.truncate(6000);
    let each = |values: &mut Vec<f64>, of: fn(f64) -> f64| values.iter_mut().for_each(|value| *value = of(*value));
    /// What breaks a recording, and what its message contains.
    type Case<'a> = (&'a dyn Fn(&mut Recording), &'a [&'a str]);
    let clip = |one: &mut Recording| each(&mut one.response, |value| value.clamp(-5e-3, 5e-3));
    let reverse = |one: &mut Recording| each(&mut one.drive, |value| -value);
    let cut = |one: &mut Recording| {
        one.response.truncate(500);
        one.drive.truncate(500);
    };
    let cases: [Case; 9] = [
        (
            &|one| one.response[17] = f64::NAN,
            &["channel y", "sample 18", "repair"],
        ),
        (&|one| one.drive.truncate(5999), &["y has 6000 samples", "x has 5999"]),
        (&clip, &["channel y is clipped", "reduce the gain"]),
        (&|one| one.drive.fill(0.0), &["channel x is constant", "connected"]),
        (&|one| std::mem::swap(&mut one.response, &mut one.drive), &["swapped"]),
        (&reverse, &["wrong sign", "--drive x:-1"]),
        (&|one| one.sample_time *= 3.0, &["strongest oscillation", "--rate"]),
        (&|one| one.sample_time *= 30.0, &["needed: give the rate with --rate"]),
        (&cut, &["at least 16 are needed"]),
    ];
    for (damage, words) in cases {
        let mut damaged = good.clone();
        damage(&mut damaged);
        let message = damaged.parts(&scene.knowledge()).unwrap_err().to_string();
        let is_complete = words.iter().all(|word| message.contains(word));
        assert!(message.starts_with("record.csv") && is_complete, "{message}");
    }
}

#[test]
fn the_effect_that_explains_a_misfit_is_named_with_its_strength() {
    let known = ["b=0.0095±0.00003", "epsilon=0.00923±0.00003"].map(|one| one.parse().unwrap());
    let friction = Cavity { kinetic_friction: 0.03, ..Cavity::IDEAL };
    let tilt = Cavity { tilt: 0.1, ..Cavity::IDEAL };
    for (cavity, effect) in [(friction, Effect::Friction), (tilt, Effect::Tilt)] {
        // The periodic motions of the rig, with the uncertainties of 60 dB.
        let motions = (0..10).map(|n| motion_at(cavity, (0.36 + 0.03 * f64::from(n)) * RIG.half_width));
        let points = measured(motions, 1e-4, 11);
        let found = explain(&points, Definition::default(), &wrong_scene().plant, &known, |_| {}).unwrap();
        let verdict = found.verdict();
        let best = found.explains().unwrap_or_else(|| panic!("{verdict}"));
        let (Estimate { value, uncertainty }, strength) = (best.strength, effect.strength_of(&cavity));
        assert!(best.effect == effect && found.ideal.is_rejected(), "{verdict}");
        assert!(
            (value - strength).abs() < 3.0 * uncertainty && uncertainty < 0.2 * strength,
            "{verdict}"
        );
        assert!(verdict.contains("without it, chi-square is"), "{verdict}");
    }
}

/// Response, m, frequency, rad/s, and drive, m, of the rig with a cavity at this amplitude of the response.
fn motion_at(cavity: Cavity, amplitude: f64) -> [f64; 3] {
    let rig = Parameters { cavity, ..RIG };
    let motion = resonant_motion(&rig, Definition::default(), amplitude, None).unwrap();
    [amplitude, motion.omega, motion.amplitude]
}

#[test]
fn unequal_gaps_leave_the_points_as_they_are() {
    let half = RIG.half_width;
    let (b_plus, b_minus) = (Some(1.1 * half), Some(0.9 * half));
    let skewed = Cavity { b_plus, b_minus, ..Cavity::IDEAL };
    let [ideal, skewed] = [Cavity::IDEAL, skewed].map(|cavity| motion_at(cavity, 0.5 * half));
    assert!((ideal[1] / skewed[1] - 1.0).abs() < 1e-11 && (ideal[2] / skewed[2] - 1.0).abs() < 1e-9);
}
