//! Tests of `Evidence`.

use super::*;
use crate::rig::Command;

/// A period of readings of both sensors, m, and of phase errors, rad, in the dimensionless default scene.
fn evidence(settings: &[&str], reading: impl Fn(usize) -> (f64, Option<f64>, Option<f64>)) -> Evidence {
    let settings: Vec<_> = settings.iter().map(|setting| setting.parse().unwrap()).collect();
    let text = include_str!("../../../../scenes/dimensionless.toml");
    let scene = Scene::parse("dimensionless.toml", text, &settings).unwrap();
    let sample = |n: usize| {
        let (response, reference, phase_error) = reading(n);
        Sample {
            time: n as f64 * scene.sample_time(),
            sensors: Sensors { response, reference },
            command: Command { phase_error, ..Command::default() },
            ground_truth: None,
        }
    };
    let phase_error =
        |error: Option<f64>| error.map_or(PhaseError::NotMeasured, |error| PhaseError::Degrees(error.to_degrees()));
    Evidence::of(&(0..150).map(sample).collect::<Vec<_>>(), &scene, phase_error)
}

#[test]
fn a_response_above_its_limit_is_stated_beside_the_limit() {
    // The largest reading of the last period, also if the controller switched the drive off a few samples later.
    let found = evidence(&["controller.C_max=0.3"], |n| {
        (if n == 140 { -0.301_234_9 } else { 0.2 }, Some(0.01), None)
    });
    let text = found.text(Fault::ResponseTooLarge);
    assert!(
        text.starts_with("it read 0.30123 m, and controller.C_max allows 0.3 m. Lower"),
        "{text}"
    );
    let without = evidence(&["controller.C_max='none'"], |_| (0.2, None, None));
    let text = without.text(Fault::ResponseTooLarge);
    assert!(text.contains("controller.C_max sets no limit"), "{text}");
}

#[test]
fn a_lost_lock_is_stated_with_its_mean_phase_error_in_degrees() {
    let found = evidence(&[], |n| (0.4, Some(0.01), Some(if n < 50 { 9.0 } else { 0.25 })));
    let text = found.text(Fault::LockLost);
    let expected = "phase error was 14.324 degrees, and phase_lock.lock.unlock_tolerance allows 11.459 degrees; the response read at most 0.4 m, \
                    the base 0.01 m";
    assert!(text.contains(expected), "{text}");
    let text = evidence(&[], |_| (0.4, None, None)).text(Fault::LockLost);
    assert!(text.contains("phase error could not be measured"), "{text}");
}

#[test]
fn a_signal_that_is_missing_is_stated_with_what_a_signal_needs() {
    let found = evidence(&["excitation.G=1"], |_| (1e-7, Some(0.0), None));
    let text = found.text(Fault::NoSignal);
    for part in [
        "read at most 1e-7 m, the base 0 m",
        "0.00084 m (phase_lock.lock.response_min) with a share of 0.5",
        "phase_lock.signal_timeout allows 125.66 s without it",
        "`vines check`",
    ] {
        assert!(text.contains(part), "{part} is not in: {text}");
    }
}

#[test]
fn readings_that_are_refused_are_stated() {
    let found = evidence(&["phase_lock.residual_max=0.2"], |n| {
        (if n == 149 { f64::NAN } else { 0.4 }, None, None)
    });
    let text = found.text(Fault::Sensor);
    assert!(text.starts_with("the response read NaN m. "), "{text}");
    let text = found.text(Fault::Implausible);
    let expected = "read NaN m; in the last period at most 0.4 m; phase_lock.residual_max allows 0.2 of the amplitude as the difference";
    assert!(text.contains(expected), "{text}");
}
