//! Guards safe behaviour for any sensor readings: no lock without a signal, faults and what they do to the drive, plausibility.

mod rig;

use phase_lock::{Config, Fault, LockCriterion, LoopState, Move, Output};
use rig::{AMPLITUDE, Bench, OMEGA_0, config, noise};

#[test]
fn never_locks_on_a_zero_signal_on_noise_or_without_a_drive() {
    let mut bench = Bench::new(config());
    for _ in 0..50_000 {
        let output = bench.sample_reading(0.0, None);
        assert!(!output.locked && !output.settled);
        assert_eq!(output.omega, OMEGA_0, "the loop has nothing to follow");
    }
    let mut bench = Bench::new(Config { amplitude: 0.0, ..config() });
    bench.resonator.q = 0.01;
    assert!((0..50_000).all(|_| !bench.sample().locked));
    // All tolerances are as wide as possible: only the coherence can prevent a lock.
    let lock = LockCriterion {
        phase_tolerance: 3.0,
        unlock_tolerance: 3.1,
        frequency_drift: 1.0,
        amplitude_drift: 1.0,
        response_min: 0.0,
        ..LockCriterion::default()
    };
    let (mut bench, mut noise) = (Bench::new(Config { lock, ..config() }), noise(7));
    for _ in 0..200_000 {
        let noise = noise();
        let output = bench.sample_through(|_, base| [noise, base]);
        assert!(!output.locked, "{output:?}");
    }
}

#[test]
fn an_invalid_reading_ramps_the_drive_down_and_latches() {
    // Also while the response is controlled.
    let benches = [Bench::locked, holding].map(|bench| bench(Config { ramp_rate: Some(AMPLITUDE), ..config() }));
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300] {
        for (bench, [response, reference]) in benches
            .iter()
            .flat_map(|bench| [(bench, [bad, 0.0]), (bench, [0.0, bad])])
        {
            let mut bench = *bench;
            let before = bench.sample().amplitude;
            let output = bench.sample_reading(response, Some(reference));
            assert_eq!((output.state, output.fault), (LoopState::Tripped, Some(Fault::Sensor)));
            assert_eq!(output.response_target, None);
            assert!(output.amplitude < before && output.amplitude > 0.9 * before, "gradual");
            let output = bench.run(100);
            assert_eq!((output.state, output.amplitude), (LoopState::Tripped, 0.0));
            bench.active = false;
            assert_eq!(bench.sample().state, LoopState::Idle);
            bench.active = true;
            assert_eq!(bench.sample().fault, None);
            assert!(bench.run_to_lock(2000).is_some(), "armed again, it locks again");
        }
    }
}

#[test]
fn too_large_a_response_and_a_search_that_lasts_too_long_trip() {
    let mut bench = Bench::new(Config { response_max: Some(50.0 * AMPLITUDE), ..config() });
    let Output { state, fault, .. } = bench.run(400);
    assert_eq!((state, fault), (LoopState::Tripped, Some(Fault::ResponseTooLarge)));
    // Only the time limit ends a search for a response of zero.
    let mut bench = Bench::new(Config { acquire_timeout: Some(0.5), residual_max: None, ..config() });
    let states: Vec<_> = (0..600).map(|_| bench.sample_reading(0.0, None).state).collect();
    assert_eq!((states[400], states[599]), (LoopState::Acquiring, LoopState::Tripped));
    assert_eq!(bench.sample().fault, Some(Fault::TimedOut));
}

#[test]
fn a_lost_lock_is_latched_and_a_disturbance_between_the_two_tolerances_does_not_lose_it() {
    let mut bench = Bench::locked(Config { residual_max: None, ..config() });
    bench.resonator.omega_0 *= 1.1;
    let Output { state, fault, .. } = bench.run(100);
    assert_eq!((state, fault), (LoopState::LockLost, Some(Fault::LockLost)));
    bench.resonator.omega_0 /= 1.1;
    let output = bench.run(500);
    assert_eq!((output.state, output.amplitude), (LoopState::LockLost, 0.0));

    let mut bench = Bench::locked(config());
    bench.resonator.omega_0 *= 1.0005;
    let errors = (0..100 * 100).map(|_| {
        let output = bench.sample();
        assert!(output.locked);
        output.phase_error.unwrap_or(0.0).abs()
    });
    let largest = errors.fold(0.0, f64::max);
    let LockCriterion { phase_tolerance, unlock_tolerance, .. } = config().lock;
    assert!(largest > phase_tolerance && largest < unlock_tolerance, "{largest}");
}

#[test]
fn the_drive_is_switched_off_at_once_or_with_a_ramp_as_configured() {
    for (release_rate, expected) in [(None, 0.0), (Some(0.1 * AMPLITUDE), 0.999)] {
        let mut bench = Bench::new(Config { release_rate, ..config() });
        let before = bench.run(10);
        bench.active = false;
        let output = bench.sample();
        assert_eq!(output.state, LoopState::ShutDown);
        assert!((output.amplitude / AMPLITUDE - expected).abs() < 1e-3);
        let after = bench.run(200);
        assert_eq!(after.amplitude, 0.0);
        assert!((after.omega - before.omega).abs() < 0.1, "the frequency stays constant");
    }
}

/// A bench with the response amplitude controlled at half of its value at the lock, and a limited drive.
fn holding(config: Config) -> Bench {
    let mut bench = Bench::locked(Config { amplitude_max: Some(2.0 * AMPLITUDE), ..config });
    let response = 0.5 * bench.sample().response_amplitude;
    bench.hold(Move {
        response,
        duration: 1.0,
        amplitude: -0.5 * AMPLITUDE,
        ..Move::default()
    });
    bench.run(200);
    bench
}

#[test]
fn a_response_that_fades_out_does_not_make_the_drive_exceed_its_limit_or_its_rate() {
    let mut bench = holding(Config { ramp_rate: Some(AMPLITUDE), residual_max: None, ..config() });
    let step = bench.controller.config().sample_time * AMPLITUDE;
    let mut before = bench.sample().amplitude;
    for n in 0..20_000 {
        // The reading decays to zero.
        let output = bench.sample_through(|q, base| [q * 0.999_f64.powi(n), base]);
        assert!((0.0..=2.0 * AMPLITUDE).contains(&output.amplitude));
        assert!((output.amplitude - before).abs() <= step * (1.0 + 1e-9));
        before = output.amplitude;
    }
    assert_eq!(bench.sample().state, LoopState::LockLost);
}

#[test]
fn a_sensor_that_stops_trips_within_half_a_period() {
    // The response stuck at zero or at its value, and the reference dead.
    for (response_stops, reference_stops, value) in [(true, false, 0.0), (true, false, 1.0), (false, true, 0.0)] {
        let mut bench = holding(Config { residual_max: None, ramp_rate: None, ..config() });
        let stuck = value * bench.resonator.q;
        let tripped = (0..200).find_map(|n| {
            let output = bench.sample_through(|q, base| {
                [
                    if response_stops { stuck } else { q },
                    if reference_stops { 0.0 } else { base },
                ]
            });
            (output.state == LoopState::Tripped).then_some((n, output))
        });
        let (samples, output) = tripped.expect("a trip");
        assert!(samples <= 52 && output.fault == Some(Fault::Sensor), "{samples}");
        assert_eq!(bench.sample().amplitude, 0.0);
    }
}

#[test]
fn a_base_that_rests_without_a_drive_is_not_a_failed_sensor() {
    // The response falls slower than asked, until the reference is lost.
    let mut bench = holding(Config { residual_max: None, ramp_rate: None, ..config() });
    let response = 0.3 * bench.sample().response_amplitude;
    bench.hold(Move { response, amplitude: -AMPLITUDE, ..Move::default() });
    let outputs: Vec<_> = (0..200).map(|_| bench.sample()).collect();
    let rested = outputs.iter().take_while(|output| output.fault.is_none());
    assert!(rested.filter(|output| output.amplitude == 0.0).count() > 50);
    assert_eq!(outputs[199].fault, Some(Fault::LockLost));
}

#[test]
fn a_sensor_that_reads_only_noise_trips_before_the_lock() {
    let mut bench = Bench::new(Config { response_max: None, residual_max: None, ..config() });
    let mut noise = noise(7);
    let tripped = (0..100 * 25).find(|_| {
        let noise = 0.01 * noise();
        bench.sample_through(|_, base| [noise, base]).state == LoopState::Tripped
    });
    assert!(tripped.is_some());
    assert_eq!(bench.sample().fault, Some(Fault::NoSignal));
}

#[test]
fn reversed_swapped_and_dead_sensors_trip_within_a_tenth_of_a_period() {
    let faults: [fn(f64, f64) -> [f64; 2]; 4] = [|q, e| [-q, e], |q, e| [q, -e], |q, e| [e, q], |_, e| [0.0, e]];
    for fault in faults {
        let mut bench = Bench::locked(config());
        assert!((0..=10).any(|_| bench.sample_through(fault).state == LoopState::Tripped));
    }
}

#[test]
fn the_plausibility_check_does_not_trip_at_a_change_of_the_drive() {
    let mut bench = Bench::new(Config { ramp_rate: None, ..config() });
    for amplitude in [1.0, 3.0, 0.2, 1.0] {
        bench.run(50);
        bench.retune(amplitude * AMPLITUDE, -1.5);
    }
    assert_eq!(bench.run(50).fault, None);
}

/// Periods until the trip of a bench at rest whose readings of response and base pass through `fault` from this period on.
fn periods_to_trip(from: u32, fault: impl Fn(f64, f64) -> [f64; 2]) -> Option<f64> {
    let mut bench = Bench::new(Config { damping_rate: Some(rig::ZETA * OMEGA_0), ..config() });
    for _ in 0..100 * from {
        bench.sample();
    }
    (0..100 * 20).find_map(|n| {
        let output = bench.sample_through(&fault);
        (output.state == LoopState::Tripped).then_some(f64::from(n) / 100.0)
    })
}

#[test]
fn reversed_swapped_and_dead_sensors_trip_in_the_first_periods_of_the_drive() {
    for from in 0..10 {
        let trips = |most: f64, fault: fn(f64, f64) -> [f64; 2]| {
            let periods = periods_to_trip(from, fault);
            assert!(periods.is_some_and(|periods| periods < most), "{from}: {periods:?}");
        };
        trips(3.0, |q, e| [-q, e]);
        trips(3.0, |q, e| [q, -e]);
        trips(3.0, |q, e| [e, q]);
        trips(10.0, |q, e| [3.0 * q, e]);
        trips(10.0, |q, e| [0.3 * q, e]);
    }
    // A response that impacts hold back or enhance.
    for factor in [0.7, 1.3] {
        assert_eq!(periods_to_trip(0, |q, e| [factor * q, e]), None, "{factor}");
    }
    assert!(periods_to_trip(0, |_, e| [0.0, e]).is_some_and(|periods| periods < 3.0));
    assert!(periods_to_trip(0, |q, _| [q, 0.0]).is_some_and(|periods| periods < 6.0));
    assert!(periods_to_trip(0, |_, _| [0.0, 0.0]).is_some_and(|periods| periods < 3.0));
}

#[test]
fn a_response_that_moves_before_the_drive_and_heavy_damping_that_is_not_known_are_no_faults() {
    for turns in [0.0, 0.2, 0.4, 0.7] {
        let mut bench = Bench::new(config());
        let (s, c) = (turns * std::f64::consts::TAU).sin_cos();
        (bench.resonator.q, bench.resonator.dq) = (60.0 * AMPLITUDE * s, 60.0 * AMPLITUDE * OMEGA_0 * c);
        assert_eq!(bench.run(200).fault, None);
    }
    for zeta in [0.02, 0.05, 0.1] {
        let mut bench = Bench::new(config());
        bench.resonator.zeta = zeta;
        assert_eq!(bench.run(200).fault, None, "{zeta}");
    }
}

#[test]
fn a_glitch_of_one_sample_is_ignored() {
    for size in [-5.0, 0.0, 5.0] {
        for channel in [0, 1] {
            for phase in [0, 10, 25, 60] {
                let mut bench = Bench::locked(config());
                (0..phase).for_each(|_| assert!(bench.sample().locked));
                let mut readings = [bench.resonator.q, bench.resonator.base];
                readings[channel] = size * [bench.sample().response_amplitude, AMPLITUDE][channel];
                bench.sample_reading(readings[0], Some(readings[1]));
                for _ in 0..500 {
                    let output = bench.sample();
                    let error = output.phase_error.unwrap_or(1.0);
                    assert!(output.locked && error.abs() < 0.02, "{output:?}");
                }
            }
        }
    }
}
