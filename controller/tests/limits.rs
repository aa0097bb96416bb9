//! Limits of the outputs, and refused configurations.

mod rig;

use phase_lock::{Config, Input, LoopState, Move};
use proptest::prelude::*;
use rig::{AMPLITUDE, Bench, OMEGA_0, config};

#[test]
fn ramps_stay_within_their_rates() {
    let mut bench = Bench::new(Config {
        ramp_rate: Some(0.5 * AMPLITUDE),
        omega_rate: Some(0.5),
        omega_start: 0.97 * OMEGA_0,
        ..config()
    });
    let Config { sample_time, amplitude, .. } = *bench.controller.config();
    let mut before = bench.sample();
    for _ in 0..60_000 {
        let output = bench.sample();
        let (omega, level) = (output.omega - before.omega, output.amplitude - before.amplitude);
        assert!(omega.abs() <= 0.5 * sample_time * (1.0 + 1e-9));
        assert!(level.abs() <= amplitude * sample_time / 2.0 * (1.0 + 1e-9));
        before = output;
    }
    assert!(before.locked);
}

#[test]
fn an_invalid_configuration_is_refused_by_name() {
    let refusal = |config: Config| config.build().expect_err("must be refused").to_string();
    assert_eq!(
        refusal(Config { sample_time: f64::NAN, ..config() }),
        "sample_time = NaN s is refused; allowed is above 0 (1e-30 to 1e30)"
    );
    for (name, bad) in [
        ("omega_max", Config { omega_max: 1.0, ..config() }),
        ("omega_start", Config { omega_start: 1e3, ..config() }),
        ("amplitude", Config { amplitude: -1.0, ..config() }),
        ("bandwidth", Config { bandwidth: 1e4, ..config() }),
        ("phase_target", Config { phase_target: 4.0, ..config() }),
        ("sample_time", Config { sample_time: 0.05, bandwidth: 0.1, ..config() }),
        ("delay", Config { delay: f64::INFINITY, ..config() }),
    ] {
        assert!(refusal(bad).starts_with(name), "{}", refusal(bad));
    }
}

fn reading() -> impl Strategy<Value = f64> {
    prop_oneof![
        8 => -1.0..1.0_f64,
        2 => Just(0.0),
        2 => -1e100..1e100_f64,
        1 => any::<f64>(),
        1 => prop_oneof![Just(f64::NAN), Just(f64::INFINITY), Just(f64::NEG_INFINITY)],
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn outputs_are_finite_and_within_limits_for_any_input(
        readings in prop::collection::vec((reading(), prop::option::of(reading()), prop::bool::weighted(0.9)), 1..400),
        bandwidth in 0.02..1.0_f64,
        ramp_time in prop::option::of(0.01..1.0_f64),
        base_bandwidth in prop::option::of(1e-4..0.02_f64),
        demodulate: bool,
        hold: bool,
    ) {
        let mut config = Config {
            bandwidth: bandwidth * OMEGA_0,
            base_bandwidth: base_bandwidth.map(|wide| wide * OMEGA_0),
            ramp_rate: ramp_time.map(|time| AMPLITUDE / time),
            ..config()
        };
        if demodulate {
            config.detector = phase_lock::Detector::Demodulator;
        }
        if hold {
            config.amplitude_max = Some(3.0 * config.amplitude);
        }
        let controller = config.build().unwrap();
        let mut state = controller.start();
        for (n, (response, reference, active)) in readings.into_iter().enumerate() {
            if hold && n % 50 == 40 {
                // Refused while the loop is open; otherwise the outputs must stay within the limits.
                let to = Move { response: 0.01, duration: 0.1, amplitude: 1.0, omega: -500.0, growth: 0.0 };
                let _ = controller.hold_response(&mut state, to);
            }
            let output = controller.process(&mut state, Input { response, reference, active });
            prop_assert!((config.omega_min..=config.omega_max).contains(&output.omega));
            prop_assert!((config.omega_min..=config.omega_max).contains(&output.frequency));
            prop_assert!((0.0..=config.amplitude_max.unwrap_or(f64::INFINITY)).contains(&output.amplitude));
            prop_assert!(output.drive.abs() <= output.amplitude);
            prop_assert!(output.phase_error.is_none_or(|error| error.abs() <= std::f64::consts::PI));
            prop_assert!(output.response_amplitude.is_finite() && output.reference_amplitude.is_finite());
            prop_assert!((0.0..=1.0).contains(&output.coherence));
            prop_assert!(!output.locked || output.state == LoopState::Locked);
        }
    }
}
