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
use vines_testbench::rig::{BuiltIn, Chain, Drive, Rig, RigError, RigStage, Sensors, Simulated};
use vines_testbench::scene::{Definition, Dimensionless, Parameters, Scene};

/// The rig that the points belong to.
const RIG: Parameters = Parameters {
    primary_mass: 3.9,
    stiffness: 11.5e3,
    damping: 3.0,
    particle_mass: 0.036,
    half_width: 0.0095,
    restitution: 0.55,
    cavity: lovines::Cavity::IDEAL,
};

/// Twelve points of the rig from the fold on, with this relative standard uncertainty of both amplitudes, and a hundredth of it of the frequency.
/// `seed` 0: without noise.
fn points(uncertainty: f64, seed: u64) -> Vec<MeasuredPoint> {
    let d = Dimensionless::of(&RIG, 0.0);
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut measured = |value: f64, relative: f64| {
        let normal: f64 = StandardNormal.sample(&mut random);
        let noise = if seed == 0 { 0.0 } else { relative * normal };
        Estimate { value: value * (1.0 + noise), uncertainty: value * relative }
    };
    let speeds = (0..12).map(|n| 0.7 + 0.03 * f64::from(n));
    speeds
        .map(|speed| {
            let [omega, c, g] = backbone_at_speed(&d, speed).unwrap();
            MeasuredPoint {
                response: measured(c * d.b, uncertainty),
                omega: measured(d.omega0 * omega, 0.01 * uncertainty),
                drive: measured(d.amplitude(g), uncertainty),
            }
        })
        .collect()
}

/// The fit of a client that believes in the default scene.
fn fitted(points: &[MeasuredPoint], known: &[&str]) -> Result<Fit, FitError> {
    let known: Vec<Known> = known.iter().map(|one| one.parse().unwrap()).collect();
    let scene = Scene::load(None, &[]).unwrap();
    fit(points, Definition::default(), &scene.plant, &known)
}

/// Error over the standard uncertainty.
fn pull(fit: &Fit, quantity: Quantity) -> f64 {
    let estimate = fit.estimate(quantity).unwrap();
    (estimate.value - quantity.of_plant(&RIG)) / estimate.uncertainty
}

#[test]
fn exact_points_give_the_parameters_of_another_rig_than_the_expected_one() {
    let fit = fitted(&points(1e-4, 0), &[]).unwrap();
    for quantity in &Quantity::ALL[..5] {
        assert!(
            pull(&fit, *quantity).abs() < 1e-3,
            "{quantity}: {:?}",
            fit.estimate(*quantity)
        );
    }
    assert!(fit.chi_square < 1e-6 && fit.left_out.is_empty() && !fit.is_rejected());
}

#[test]
fn through_noise_the_stated_intervals_hold_the_parameters_and_chi_square_its_degrees_of_freedom() {
    let (mut within, mut chi_square) = (0, 0.0);
    for seed in 1..=60 {
        let fit = fitted(&points(2e-3, seed), &[]).unwrap();
        within += Quantity::ALL[..5]
            .iter()
            .filter(|quantity| pull(&fit, **quantity).abs() <= 1.96)
            .count();
        chi_square += fit.chi_square / fit.degrees as f64 / 60.0;
    }
    println!("{within} of 300 within 1.96 u, chi-square {chi_square:.2} per degree of freedom");
    assert!((270..=297).contains(&within) && (0.85..1.15).contains(&chi_square));
}

#[test]
fn points_of_another_motion_are_left_out_and_named() {
    let mut points = points(2e-3, 5);
    points[3].omega.value *= 1.003;
    points[11].drive.value *= 1.2;
    let fit = fitted(&points, &[]).unwrap();
    assert_eq!(fit.left_out, [3, 11]);
    assert!(
        Quantity::ALL[..5]
            .iter()
            .all(|quantity| pull(&fit, *quantity).abs() < 4.0)
    );
}

#[test]
fn points_that_no_parameters_describe_are_rejected() {
    let mut points = points(1e-3, 6);
    let (first, last) = (points[0].response.value, points[11].response.value);
    for point in &mut points {
        // A structure whose frequency depends on the amplitude by itself, and a loss that grows with it.
        let share = (point.response.value - first) / (last - first);
        point.drive.value *= 1.0 + 0.1 * (6.0 * share).sin();
    }
    let fit = fitted(&points, &[]).unwrap();
    assert!(fit.is_rejected() && fit.left_out.is_empty(), "{:?}", fit.p_value());
}

#[test]
fn a_known_mass_gives_masses_stiffness_and_damping_in_si_units() {
    assert!(
        fitted(&points(1e-4, 0), &[])
            .unwrap()
            .estimate(Quantity::Stiffness)
            .is_none()
    );
    let fit = fitted(&points(1e-4, 0), &["m=0.036±0.0004"]).unwrap();
    let [mass, stiffness] =
        [Quantity::PrimaryMass, Quantity::Stiffness].map(|quantity| fit.estimate(quantity).unwrap());
    assert!((mass.value / RIG.primary_mass - 1.0).abs() < 1e-3 && (stiffness.value / RIG.stiffness - 1.0).abs() < 1e-3);
    // The relative uncertainty of the mass is at least that of the one that is known.
    assert!((1.0 / 90.0..0.03).contains(&(mass.uncertainty / mass.value)));
    let plant = fit.plant(&RIG);
    assert!((plant.damping / RIG.damping - 1.0).abs() < 1e-2);
}

#[test]
fn a_value_that_is_known_exactly_is_kept_and_reduces_the_uncertainty_of_the_others() {
    let free = fitted(&points(2e-3, 7), &[]).unwrap();
    let fixed = fitted(&points(2e-3, 7), &["b=0.0095"]).unwrap();
    let r = |fit: &Fit| fit.estimate(Quantity::R).unwrap().uncertainty;
    assert!((fixed.estimate(Quantity::B).unwrap().value - 0.0095).abs() < 1e-10);
    assert!(r(&fixed) < 0.8 * r(&free), "{} {}", r(&fixed), r(&free));
}

#[test]
fn what_the_points_do_not_separate_is_said() {
    let near = &points(2e-2, 0)[..3];
    let fit = fitted(near, &[]).unwrap();
    assert!(!fit.not_separated().is_empty());
    assert!(fitted(&points(1e-4, 0), &[]).unwrap().not_separated().is_empty());
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
    let settings = [
        "chain.snr=60",
        "backbone.C_from=0.65",
        "backbone.C_to=0.25",
        "backbone.points=10",
    ];
    let overrides: Vec<_> = settings.iter().map(|one| one.parse().unwrap()).collect();
    let scene = Scene::load(None, &overrides).unwrap();
    let rig = Simulated::new(RIG, scene.start).unwrap();
    let mut rig = Recorder {
        rig: Chain::around(Box::new(rig), &scene),
        read: Sensors::default(),
        channels: [Vec::new(), Vec::new()],
    };
    let mut controller = BuiltIn::new(&scene.backbone_config()).unwrap();
    track(&mut rig, &mut controller, &scene, |_, _| {}).unwrap();
    let [response, drive] = rig.channels;
    // In the middle of the first level's and of the last level's hold.
    let kept = 3000..response.len() - 500;
    Recording {
        origin: "record.csv".into(),
        channels: ["y".into(), "x".into()],
        sample_time: scene.sample_time(),
        response: response[kept.clone()].to_vec(),
        drive: drive[kept].to_vec(),
    }
}

/// Keeps what is read.
struct Recorder {
    rig: Box<dyn Rig>,
    read: Sensors,
    channels: [Vec<f64>; 2],
}

impl RigStage for Recorder {
    fn inner(&mut self) -> &mut dyn Rig {
        &mut *self.rig
    }

    fn sense(&mut self) -> Result<Sensors, RigError> {
        self.read = self.rig.sense()?;
        Ok(self.read)
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        self.channels[0].push(self.read.response);
        self.channels[1].push(self.read.reference.unwrap());
        self.rig.advance(drive, step)
    }
}

/// A scene with the wrong restitution, half-width, damping and stiffness.
fn wrong_scene() -> Scene {
    let settings = [
        "plant.r=0.75",
        "plant.b=0.0105",
        "plant.c=3.5",
        "plant.k=11600",
        "plant.M=3.9",
    ];
    let overrides: Vec<_> = settings.iter().map(|one| one.parse().unwrap()).collect();
    Scene::load(None, &overrides).unwrap()
}

#[test]
fn a_recording_that_begins_and_ends_in_the_middle_of_a_level_gives_the_parameters() {
    let scene = wrong_scene();
    let parts = parts(&[recording()], &scene, &[]).unwrap().concat();
    let points: Vec<MeasuredPoint> = parts.iter().filter_map(|part| part.point).collect();
    assert!(
        parts.iter().filter(|part| part.kind == Kind::Held).count() >= 4,
        "{parts:?}"
    );
    let fit = fit(&points, Definition::default(), &scene.plant, &[]).unwrap();
    for quantity in &Quantity::ALL[..5] {
        let estimate = fit.estimate(*quantity).unwrap();
        assert!(
            pull(&fit, *quantity).abs() < 3.0 && estimate.uncertainty < 0.2 * estimate.value,
            "{quantity}: {estimate:?}"
        );
    }
    assert!(!fit.is_rejected());
}

#[test]
fn channels_that_are_no_recording_of_a_rig_near_resonance_are_refused_with_what_to_do() {
    let scene = wrong_scene();
    let good = recording();
    let count = 6000;
    let good = Recording {
        response: good.response[..count].to_vec(),
        drive: good.drive[..count].to_vec(),
        ..good
    };
    let refused = |damage: &dyn Fn(&mut Recording)| {
        let mut damaged = good.clone();
        damage(&mut damaged);
        damaged.parts(&scene).unwrap_err().to_string()
    };
    let clipped = |values: &mut Vec<f64>| values.iter_mut().for_each(|value| *value = value.clamp(-5e-3, 5e-3));
    let cases: [(String, &[&str]); 9] = [
        (
            refused(&|one| one.response[17] = f64::NAN),
            &["channel y", "sample 18", "repair"],
        ),
        (
            refused(&|one| one.drive.truncate(5999)),
            &["y has 6000 samples", "x has 5999"],
        ),
        (
            refused(&|one| clipped(&mut one.response)),
            &["channel y is clipped", "reduce the gain"],
        ),
        (
            refused(&|one| one.drive.fill(0.0)),
            &["channel x is constant", "connected"],
        ),
        (
            refused(&|one| std::mem::swap(&mut one.response, &mut one.drive)),
            &["swapped"],
        ),
        (
            refused(&|one| one.drive.iter_mut().for_each(|value| *value *= -1.0)),
            &["wrong sign", "--drive x:-1"],
        ),
        (
            refused(&|one| one.sample_time *= 3.0),
            &["strongest oscillation", "--rate"],
        ),
        (
            refused(&|one| one.sample_time *= 30.0),
            &["are needed: give the rate with --rate"],
        ),
        (
            refused(&|one| {
                one.response.truncate(500);
                one.drive.truncate(500);
            }),
            &["at least 16 are needed"],
        ),
    ];
    for (message, words) in cases {
        assert!(
            message.starts_with("record.csv") && words.iter().all(|word| message.contains(word)),
            "{message}"
        );
    }
}

/// The periodic motions of a rig with this cavity as points with the uncertainties of 60 dB, with noise.
fn real_points(cavity: Cavity) -> Vec<MeasuredPoint> {
    let rig = Parameters { cavity, ..RIG };
    let mut random = ChaCha8Rng::seed_from_u64(11);
    let mut measured = |value: f64, relative: f64| {
        let normal: f64 = StandardNormal.sample(&mut random);
        Estimate {
            value: value * (1.0 + relative * normal),
            uncertainty: value * relative,
        }
    };
    let amplitudes = (0..10).map(|n| (0.36 + 0.03 * f64::from(n)) * RIG.half_width);
    amplitudes
        .map(|amplitude| {
            let motion = resonant_motion(&rig, Definition::default(), amplitude, None).unwrap();
            MeasuredPoint {
                response: measured(amplitude, 1e-4),
                omega: measured(motion.omega, 1e-6),
                drive: measured(motion.amplitude, 1e-4),
            }
        })
        .collect()
}

#[test]
fn the_effect_that_explains_a_misfit_is_named_with_its_strength() {
    let known: Vec<Known> = ["b=0.0095±0.00003", "epsilon=0.00923±0.00003"]
        .map(|one| one.parse().unwrap())
        .into();
    let scene = wrong_scene();
    for (cavity, effect, strength) in [
        (
            Cavity { kinetic_friction: 0.03, ..Cavity::IDEAL },
            Effect::Friction,
            0.03,
        ),
        (
            Cavity { tilt: 0.1, ..Cavity::IDEAL },
            Effect::Tilt,
            0.1_f64.to_degrees(),
        ),
    ] {
        let found = explain(
            &real_points(cavity),
            Definition::default(),
            &scene.plant,
            &known,
            |_| {},
        )
        .unwrap();
        let best = found.explains().unwrap_or_else(|| panic!("{}", found.verdict()));
        let Estimate { value, uncertainty } = best.strength;
        assert!(
            best.effect == effect && found.ideal.is_rejected(),
            "{}",
            found.verdict()
        );
        assert!(
            (value - strength).abs() < 3.0 * uncertainty && uncertainty < 0.2 * strength,
            "{:?}",
            best.strength
        );
        assert!(
            found.verdict().contains("without it, chi-square is"),
            "{}",
            found.verdict()
        );
    }
}

#[test]
fn unequal_gaps_leave_the_points_as_they_are() {
    let half = RIG.half_width;
    let skewed = Cavity {
        b_plus: Some(1.1 * half),
        b_minus: Some(0.9 * half),
        ..Cavity::IDEAL
    };
    let [ideal, skewed] = [Cavity::IDEAL, skewed].map(|cavity| {
        let rig = Parameters { cavity, ..RIG };
        resonant_motion(&rig, Definition::default(), 0.5 * half, None).unwrap()
    });
    assert!(
        (ideal.omega / skewed.omega - 1.0).abs() < 1e-11 && (ideal.amplitude / skewed.amplitude - 1.0).abs() < 1e-9
    );
}
