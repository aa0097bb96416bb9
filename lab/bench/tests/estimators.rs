//! The estimators of the decay, against the decay as the plant itself knows it.

use vines_testbench::estimators::{Decay, Quality};
use vines_testbench::scene::{Override, Scene};

fn scene(settings: &[&str]) -> Scene {
    let overrides: Vec<Override> = settings.iter().map(|s| s.parse().unwrap()).collect();
    let text = include_str!("../../../scenes/dimensionless.toml");
    Scene::parse("dimensionless.toml", text, &overrides).unwrap()
}

fn quality(settings: &[&str], snr: Option<f64>) -> Quality {
    let scene = scene(settings);
    let quality = Decay::of(&scene).unwrap().quality(&scene, snr, 2);
    println!("{quality:?}");
    assert!(quality.points > 10);
    quality
}

#[test]
fn clean_the_fit_is_within_0_02_in_sigma_and_through_40_db_within_0_04() {
    assert!(quality(&[], None).rms <= 0.02);
    assert!(quality(&[], Some(40.0)).rms <= 0.04);
}

#[test]
fn zero_crossings_are_exact_on_clean_data_and_no_good_in_noise() {
    let crossings = ["record.estimator=\"crossings\""];
    assert!(quality(&crossings, None).rms <= 1e-4);
    assert!(quality(&crossings, Some(40.0)).rms > 0.1);
}
