//! Guards the loop around a resonator: whether it locks, at which frequency and how fast, ramps, the control of the response amplitude,
//! and refused configurations.

mod rig;
use phase_lock::{Config, Detector, Move};
use rig::{AMPLITUDE, Bench, OMEGA_0, ZETA, config, noise};

fn relative(a: f64, b: f64) -> f64 {
    (a / b - 1.0).abs()
}

#[test]
fn locks_at_the_natural_frequency_from_ten_percent_off() {
    for start in [0.9, 1.1] {
        let mut bench = Bench::new(Config { omega_start: start * OMEGA_0, ..config() });
        let (periods, output) = bench.run_to_lock(2000).expect("a lock");
        println!("from {start}: {periods} periods");
        assert!(relative(output.frequency, OMEGA_0) < 4e-5, "{output:?}");
        assert!(relative(output.response_amplitude, AMPLITUDE / (2.0 * ZETA)) < 5e-3);
        let output = bench.run(400);
        assert!(
            relative(output.frequency, OMEGA_0).max(relative(output.omega, OMEGA_0)) < 1e-6,
            "{output:?}"
        );
        assert!(output.locked && output.settled);
    }
}

#[test]
fn locks_with_either_detector_and_with_the_internal_oscillator_as_with_a_measured_reference() {
    for (detector, harmonics, odd_only) in [
        (Detector::Demodulator, 1, true),
        (Detector::Adaptive, 1, true),
        (Detector::Adaptive, 4, false),
    ] {
        let mut bench = Bench::new(Config { detector, harmonics, odd_only, ..config() });
        let (_, output) = bench.run_to_lock(2000).expect("a lock");
        assert!(relative(output.frequency, OMEGA_0) < 1e-4, "{detector:?} {output:?}");
    }
    let [own, measured] = [false, true].map(|measured_reference| {
        let mut bench = Bench { measured_reference, ..Bench::new(config()) };
        bench.run_to_lock(2000).expect("a lock");
        bench.run(400)
    });
    assert!(relative(own.frequency, measured.frequency) < 1e-9);
    assert!(relative(own.response_amplitude, measured.response_amplitude) < 1e-9);
}

/// Both sensors with a delay of one sample, as in FMI co-simulation.
fn locked_frequency_with_a_late_sensor(delay_samples: f64, measured_reference: bool) -> f64 {
    let mut bench = Bench::new(Config { delay: delay_samples * config().sample_time, ..config() });
    let mut late = (0.0, 0.0);
    let mut frequency = 0.0;
    for _ in 0..80_000 {
        let now = (bench.resonator.q, bench.resonator.base);
        let reference = measured_reference.then_some(late.1);
        frequency = bench.sample_reading(late.0, reference).frequency;
        late = now;
    }
    frequency
}

#[test]
fn a_stated_delay_is_compensated_and_one_common_to_both_sensors_cancels() {
    assert!(relative(locked_frequency_with_a_late_sensor(1.0, false), OMEGA_0) < 1e-6);
    assert!(relative(locked_frequency_with_a_late_sensor(0.0, false), OMEGA_0) > 1e-4);
    assert!(relative(locked_frequency_with_a_late_sensor(0.0, true), OMEGA_0) < 1e-6);
}

#[test]
fn follows_a_resonance_that_moves() {
    let mut bench = Bench::locked(config());
    for _ in 0..500 * 100 {
        bench.resonator.omega_0 -= 1e-5 * OMEGA_0 / 100.0;
        let output = bench.sample();
        assert!(output.locked && output.phase_error.unwrap().abs() < 0.02, "{output:?}");
    }
    assert!(relative(bench.run(400).frequency, 0.995 * OMEGA_0) < 1e-5);
}

#[test]
fn retuning_keeps_the_lock_settles_again_and_leaves_no_trace_of_the_values_before() {
    let mut bench = Bench::locked(config());
    let target = config().phase_target;
    bench.retune(0.9 * AMPLITUDE, target);
    let output = bench.sample();
    assert!(output.locked && !output.settled);
    let output = bench.run(400);
    assert!(output.locked && output.settled);
    assert!(relative(output.response_amplitude, 0.9 * AMPLITUDE / (2.0 * ZETA)) < 1e-3);

    let (ramp_rate, release_rate, amplitude_max) = (Some(AMPLITUDE), Some(0.1 * AMPLITUDE), Some(1.0));
    let config = Config { ramp_rate, release_rate, amplitude_max, ..config() };
    let mut retuned = config.build().unwrap();
    for amplitude in [100.0 * AMPLITUDE, 0.0, AMPLITUDE] {
        retuned.retune(amplitude, target).unwrap();
        assert_eq!(retuned, Config { amplitude, ..config }.build().unwrap());
    }
}

#[test]
fn the_base_amplitude_is_controlled_if_base_bandwidth_is_set() {
    let mut bench = Bench::new(Config { base_bandwidth: Some(0.02 * OMEGA_0), ..config() });
    let mut output = bench.sample();
    for _ in 0..60_000 {
        // A shaker with a gain of 0.8.
        output = bench.sample_through(|q, base| [q, 0.8 * base]);
    }
    assert!(relative(output.amplitude, AMPLITUDE / 0.8) < 1e-6, "{output:?}");
    assert!(output.locked);
}

#[test]
fn locks_through_sensor_noise() {
    // Within 2e-4 of the frequency at 40 dB, and ten times as far with ten times the noise.
    for (decibels, share, tolerance) in [(40, 0.01, 2e-4), (20, 0.1, 2e-3)] {
        let mut bench = Bench::new(config());
        let mut noise = noise(1);
        let amplitude = AMPLITUDE / (2.0 * ZETA);
        let mut locked = None;
        for n in 0..1000 * 100 {
            // Uniform within ±a has the power a²/3.
            let noise = share * amplitude * 1.5_f64.sqrt() * noise();
            let output = bench.sample_through(|q, base| [q + noise, base]);
            if output.locked {
                locked.get_or_insert(n / 100);
                assert!(relative(output.frequency, OMEGA_0) < tolerance);
            }
        }
        println!("{decibels} dB: locked after {locked:?} periods");
        assert!(locked.is_some());
    }
}

#[test]
fn a_new_phase_target_is_acquired_with_the_drive_on() {
    for change in [-0.5, -0.2, 0.2, 0.5] {
        let mut bench = Bench::locked(config());
        let amplitude = bench.controller.config().amplitude;
        let target = bench.controller.config().phase_target + change;
        bench.retune(amplitude, target);
        let output = bench.sample();
        assert!(!output.locked && output.amplitude == amplitude);
        let (_, output) = bench.run_to_lock(3000).expect("a lock");
        assert!(output.phase_error.unwrap().abs() < 0.01, "{change}: {output:?}");
        assert_eq!(output.amplitude, amplitude);
    }
}

#[test]
fn ramps_stay_within_their_rates_and_a_ramp_down_has_the_rate_of_the_ramp_up() {
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
    bench.retune(0.0, bench.controller.config().phase_target);
    let samples = (2.0 * 1.05 / sample_time) as usize;
    let outputs: Vec<_> = (0..samples).map(|_| bench.sample()).collect();
    assert!(outputs[samples / 2].amplitude > 0.4 * amplitude && outputs[samples - 1].amplitude == 0.0);
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
        // The number for an absent option.
        ("response_max", Config { response_max: Some(-1.0), ..config() }),
    ] {
        assert!(refusal(bad).starts_with(name), "{}", refusal(bad));
    }
}

#[test]
fn the_response_amplitude_is_controlled_and_moved_to_another_setpoint() {
    let (amplitude_max, damping_rate) = (Some(4.0 * AMPLITUDE), Some(ZETA * OMEGA_0));
    let mut bench = Bench::locked(Config { amplitude_max, damping_rate, ..config() });
    let before = AMPLITUDE / (2.0 * ZETA);
    for (share, drive) in [(0.8, -0.2 * AMPLITUDE), (1.3, 0.0)] {
        let response = share * before;
        bench.hold(Move { response, duration: 0.5, amplitude: drive, ..Move::default() });
        // A free transient would decay by a factor of 2.6 in 30 periods.
        let output = bench.run(30);
        assert!(relative(output.response_amplitude, response) < 0.02);
        assert!(output.locked && output.response_target == Some(response));
        let output = bench.run(200);
        assert!(relative(output.response_amplitude, response) < 1e-5);
        assert!(relative(output.amplitude, share * AMPLITUDE) < 1e-5);
        assert!(output.settled);
    }
    // The drive returns to its own setpoint.
    bench.controller.hold_drive(&mut bench.state);
    let output = bench.run(30);
    assert_eq!((output.response_target, output.amplitude), (None, AMPLITUDE));
    bench.hold(Move { response: before, ..Move::default() });
    assert!(bench.sample().response_target.is_some());
    // Switching the drive off ends the control of the response.
    bench.active = false;
    assert_eq!(bench.sample().response_target, None);
}

#[test]
fn the_response_cannot_be_controlled_without_a_limit_of_the_drive_or_in_an_open_loop() {
    let to = Move { response: 0.01, ..Move::default() };
    let refusal = |bench: &mut Bench, to| {
        let refused = bench.controller.hold_response(&mut bench.state, to);
        refused.expect_err("must be refused").to_string()
    };
    let mut bench = Bench::new(Config { amplitude_max: None, ..config() });
    bench.run(10);
    assert!(refusal(&mut bench, to).starts_with("amplitude_max = none is refused"));
    let mut bench = Bench::new(Config { amplitude_max: Some(1.0), ..config() });
    assert!(refusal(&mut bench, to).starts_with("state = 0 is refused"));
    bench.run(10);
    assert!(refusal(&mut bench, Move::default()).starts_with("response = 0 m"));
}
