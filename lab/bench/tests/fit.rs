//! Guards the fit of a rig's parameters to points of its backbone: exact points, noise, points that do not belong, and what is refused.

use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use vines_model::numerics::Estimate;
use vines_model::orbit::backbone_at_speed;
use vines_testbench::experiment::{Plan, run};
use vines_testbench::fit::{Fit, FitError, Known, MeasuredPoint, Quantity, Recording, at, contradiction, fit};
use vines_testbench::record::Sample;
use vines_testbench::rig::{BuiltIn, Chain, SensorsOnly, Simulated};
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

/// A recording of a whole experiment on [`RIG`]: search, lock, hold and decay.
fn recording(settings: &[&str]) -> Recording {
    let overrides: Vec<_> = settings.iter().map(|one| one.parse().unwrap()).collect();
    let scene = Scene::load(None, &overrides).unwrap();
    let rig = Simulated::new(RIG, Default::default()).unwrap();
    let mut rig = SensorsOnly::around(Chain::around(Box::new(rig), &scene));
    let mut controller = BuiltIn::new(&scene.controller_config()).unwrap();
    let plan = Plan::of(&scene);
    let record = run(&mut rig, &mut controller, &plan, |_, _, _| {}).unwrap();
    let channel = |value: fn(&Sample) -> f64| record.samples.iter().map(value).collect();
    Recording {
        origin: "record.csv".into(),
        channels: ["y".into(), "x".into()],
        sample_time: record.sample_time,
        response: channel(|one| one.sensors.response),
        drive: channel(|one| one.sensors.reference.unwrap()),
    }
}

#[test]
fn a_recording_of_a_search_a_hold_and_a_decay_gives_points_on_the_backbone_of_the_rig() {
    for snr in ["none", "60", "40"] {
        let recording = recording(&[&format!("chain.snr={snr}")]);
        let scene = Scene::load(None, &[]).unwrap();
        let parts = recording.parts(&scene).unwrap();
        let points: Vec<MeasuredPoint> = parts.iter().filter_map(|part| part.point).collect();
        for part in &parts {
            println!(
                "{:.2?} {:?} {:?} {:?}",
                part.seconds, part.kind, part.regime, part.point
            );
        }
        let at = at(&points, Definition::default(), &RIG, &[]).unwrap();
        println!(
            "{snr}: {} points, chi-square {} residuals {:.1?}",
            points.len(),
            at.chi_square,
            at.residuals
        );
        let fit = fit(&points, Definition::default(), &scene.plant, &[]);
        match fit {
            Ok(fit) => {
                for quantity in &Quantity::ALL[..5] {
                    println!(
                        "{quantity} {:?} {:.2} u",
                        fit.estimate(*quantity),
                        pull(&fit, *quantity)
                    );
                }
                println!("{:?} {} {:?}", fit.p_value(), fit.chi_square, fit.left_out);
            }
            Err(e) => println!("{e}"),
        }
    }
}
