//! Guards outputs: any configuration that is accepted gives finite ones, whatever the sensors read. In double precision, and, as a test of the package
//! `phase-lock-f32`, in single precision.

#[cfg(feature = "f32")]
extern crate phase_lock_f32 as phase_lock;

use phase_lock::{Config, Input, LoopState, Move, Output, PARAMETERS, PhaseLock, State, Value};
use proptest::prelude::*;

#[cfg(feature = "f32")]
use std::f32::consts::PI;
#[cfg(not(feature = "f32"))]
use std::f64::consts::PI;

#[cfg(not(feature = "f32"))]
type Real = f64;
#[cfg(feature = "f32")]
type Real = f32;

/// A number of a common size, of any size, or a special one.
fn number() -> impl Strategy<Value = Real> {
    let positive = |exponents: std::ops::Range<f64>| exponents.prop_map(|x| 10_f64.powf(x) as Real);
    prop_oneof![
        4 => positive(-6.0..6.0),
        4 => positive(f64::from(Real::MIN_10_EXP)..f64::from(Real::MAX_10_EXP)),
        2 => prop::sample::select(vec![0.0, -1.0, Real::MAX, Real::MIN_POSITIVE, 1e-9, 1e9, 1e-30, 1e30]),
    ]
}

/// A number that is mostly of a common size: a move has five of them, and all must be valid.
fn mostly_common() -> impl Strategy<Value = Real> {
    prop_oneof![7 => (-6.0..6.0).prop_map(|x: f64| 10_f64.powf(x) as Real), 1 => number()]
}

/// A number of either sign.
fn signed() -> impl Strategy<Value = Real> {
    (mostly_common(), any::<bool>()).prop_map(|(x, negative)| if negative { -x } else { x })
}

/// A configuration for a structure of any size, in which a few parameters have any values.
fn configuration() -> impl Strategy<Value = Config> {
    let change = (0..PARAMETERS.len(), number(), any::<i32>(), any::<bool>());
    let resonance = prop_oneof![(-2.0..5.0), (-30.0..30.0)].prop_map(|x: f64| 10_f64.powf(x) as Real);
    let amplitude = prop_oneof![(-9.0..0.0), (-30.0..30.0)].prop_map(|x: f64| 10_f64.powf(x) as Real);
    let options = (any::<bool>(), any::<bool>(), any::<bool>(), any::<bool>());
    (resonance, amplitude, options, prop::collection::vec(change, 0..5)).prop_map(
        |(omega, amplitude, options, changes)| {
            let mut config = Config::for_resonance(omega, amplitude);
            let (ramp, reference, limit, short) = options;
            config.ramp_rate = config.ramp_rate.filter(|_| ramp);
            config.amplitude_max = config.amplitude_max.filter(|_| limit);
            config.reference_connected = reference;
            config.residual_max = None;
            if short {
                // Few samples in a period, and a lock after a few periods.
                config.sample_time *= 8.0;
                config.lock.dwell = 1;
                (config.lock.frequency_drift, config.lock.amplitude_drift) = (1.0, 1.0);
                (config.lock.phase_tolerance, config.lock.unlock_tolerance) = (3.0, 3.0);
                config.lock.coherence_min = 1e-3;
            }
            for (n, real, integer, boolean) in changes {
                let value = match PARAMETERS[n].get(&config) {
                    Value::Real(_) => Value::Real(real),
                    Value::Integer(_) => Value::Integer(integer % 10),
                    Value::Boolean(_) => Value::Boolean(boolean),
                };
                let _ = PARAMETERS[n].set(&mut config, value);
            }
            config
        },
    )
}

/// Readings of a part of a run: sines of these amplitudes, m, with a share of noise, or numbers that no sensor should read.
#[derive(Clone, Debug)]
struct Part {
    response: Real,
    reference: Real,
    noise: Vec<(Real, Real)>,
    to: Move,
    amplitude: Real,
}

fn part() -> impl Strategy<Value = Part> {
    let invalid = || prop::sample::select(vec![Real::NAN, Real::INFINITY, Real::NEG_INFINITY, Real::MAX]);
    let response = prop_oneof![20 => -1.0..1.0 as Real, 1 => invalid()];
    let noise = prop::collection::vec((response, prop_oneof![20 => signed(), 1 => invalid()]), 0..3);
    let to = (mostly_common(), mostly_common(), signed(), signed(), signed());
    (signed(), signed(), noise, to, number()).prop_map(|(response, reference, noise, to, amplitude)| Part {
        response,
        reference,
        noise,
        to: Move {
            response: to.0,
            duration: to.1,
            amplitude: to.2,
            omega: to.3,
            growth: to.4,
        },
        amplitude,
    })
}

fn check(output: &Output, config: &Config) -> Result<(), TestCaseError> {
    let limit = config.amplitude_max.unwrap_or(Real::MAX);
    let frequencies = config.omega_min..=config.omega_max;
    prop_assert!(
        frequencies.contains(&output.omega) && frequencies.contains(&output.frequency),
        "{output:?}"
    );
    prop_assert!((0.0..=limit).contains(&output.amplitude), "{output:?}");
    prop_assert!(output.drive.abs() <= output.amplitude, "{output:?}");
    let numbers = [
        output.phase_error.unwrap_or(0.0),
        output.response_amplitude,
        output.response_target.unwrap_or(0.0),
        output.reference_amplitude,
        output.coherence,
        output.response_mean,
    ];
    prop_assert!(numbers.iter().all(|number| number.is_finite()), "{output:?}");
    prop_assert!(
        numbers[0].abs() <= PI && (0.0..=1.0).contains(&output.coherence),
        "{output:?}"
    );
    prop_assert!(!output.locked || output.state == LoopState::Locked, "{output:?}");
    Ok(())
}

/// Runs `samples` of a part.
fn run(lock: &mut PhaseLock, state: &mut State, part: &Part, samples: u32) -> Result<(), TestCaseError> {
    let config = *lock.config();
    let turn = config.omega_start * config.sample_time;
    for n in 0..samples {
        let phase = n as Real * turn;
        let mut input = Input {
            response: -part.response * phase.cos(),
            reference: Some(part.reference * phase.sin()),
            active: true,
        };
        if let Some((response, reference)) = part.noise.get(n as usize % 50) {
            input.response *= 1.0 + response;
            input.reference = Some(*reference).filter(|_| n % 2 == 0);
        }
        let output = lock.process(state, input);
        check(&output, lock.config())?;
        if n == samples / 3 {
            let _ = lock.hold_response(state, part.to);
        }
        if n == 2 * samples / 3 {
            let _ = lock.retune(part.amplitude, config.phase_target);
        }
        if output.state.is_latched() {
            let idle = lock.process(state, Input { active: false, ..input });
            prop_assert_eq!(idle.state, LoopState::Idle);
        }
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig {
        failure_persistence: None,
        cases: 4 * ProptestConfig::default().cases,
        ..ProptestConfig::default()
    })]
    #[test]
    fn outputs_are_finite_for_every_configuration_that_is_accepted(
        config in configuration(),
        parts in prop::collection::vec(part(), 1..4),
    ) {
        let Ok(mut lock) = config.build() else {
            return Ok(());
        };
        let mut state = lock.start();
        for part in &parts {
            run(&mut lock, &mut state, part, 240)?;
        }
    }
}
