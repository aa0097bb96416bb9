//! Control of the response amplitude.

mod rig;
use phase_lock::{Config, Move};
use rig::{AMPLITUDE, Bench, OMEGA_0, ZETA, config};

fn relative(a: f64, b: f64) -> f64 {
    (a / b - 1.0).abs()
}

#[test]
fn the_response_amplitude_is_controlled_and_moved_to_another_setpoint() {
    let mut bench = Bench::new(Config {
        amplitude_max: Some(4.0 * AMPLITUDE),
        damping_rate: Some(ZETA * OMEGA_0),
        ..config()
    });
    bench.run_to_lock(2000).expect("a lock");
    let before = AMPLITUDE / (2.0 * ZETA);
    for (share, drive) in [(0.8, -0.2 * AMPLITUDE), (1.3, 0.0)] {
        let to = Move {
            response: share * before,
            duration: 0.5,
            amplitude: drive,
            ..Move::default()
        };
        bench
            .controller
            .hold_response(&mut bench.state, to)
            .expect("a closed loop");
        // A free transient would decay by a factor of 2.6 in 30 periods.
        let output = bench.run(30);
        println!("{share}: {:.5}", output.response_amplitude / before);
        assert!(relative(output.response_amplitude, share * before) < 0.02);
        assert!(output.locked && output.response_target == Some(share * before));
        let output = bench.run(200);
        assert!(relative(output.response_amplitude, share * before) < 1e-5);
        assert!(relative(output.amplitude, share * AMPLITUDE) < 1e-5);
        assert!(output.settled);
    }
    // The drive returns to its own setpoint.
    bench.controller.hold_drive(&mut bench.state);
    let output = bench.run(30);
    assert_eq!((output.response_target, output.amplitude), (None, AMPLITUDE));
    bench
        .controller
        .hold_response(&mut bench.state, Move { response: before, ..Move::default() })
        .unwrap();
    assert!(bench.sample().response_target.is_some());
    // Switching the drive off ends the control of the response.
    bench.active = false;
    assert_eq!(bench.sample().response_target, None);
}

#[test]
fn the_response_cannot_be_controlled_without_a_limit_of_the_drive_or_in_an_open_loop() {
    let to = Move { response: 0.01, ..Move::default() };
    let mut bench = Bench::new(Config { amplitude_max: None, ..config() });
    bench.run(10);
    let refusal = |bench: &mut Bench, to| {
        let refused = bench.controller.hold_response(&mut bench.state, to);
        refused.expect_err("must be refused").to_string()
    };
    assert!(refusal(&mut bench, to).starts_with("amplitude_max = none is refused"));
    let mut bench = Bench::new(Config { amplitude_max: Some(1.0), ..config() });
    assert!(refusal(&mut bench, to).starts_with("state = 0 is refused"));
    bench.run(10);
    assert!(refusal(&mut bench, Move::default()).starts_with("response = 0 m"));
}
