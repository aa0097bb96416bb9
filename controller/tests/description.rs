//! The FMU's start values are those of the core.

use phase_lock::{Config, LockCriterion};

const DESCRIPTION: &str = include_str!("../fmu/modelDescription.xml");

fn start(name: &str) -> f64 {
    let variable = DESCRIPTION
        .split("<ScalarVariable ")
        .find(|text| text.starts_with(&format!("name=\"{name}\"")))
        .unwrap_or_else(|| panic!("no variable {name}"));
    let value = variable.split("start=\"").nth(1).expect("a start value");
    value
        .split('"')
        .next()
        .and_then(|text| text.parse().ok())
        .expect("a number")
}

#[test]
fn the_fmu_starts_as_the_core_would_for_the_same_resonance() {
    let (omega, amplitude) = (start("omega_start"), start("amplitude"));
    assert!((omega - (11.68e3_f64 / 3.807).sqrt()).abs() < 1e-12);
    let config = Config::for_resonance(omega, amplitude);
    let LockCriterion { dwell, .. } = config.lock;
    for (name, expected) in [
        ("sample_time", config.sample_time),
        ("omega_min", config.omega_min),
        ("omega_max", config.omega_max),
        ("omega_rate", config.omega_rate),
        ("amplitude_max", config.amplitude_max),
        ("ramp_time", config.ramp_time),
        ("release_time", config.release_time),
        ("base_bandwidth", config.base_bandwidth),
        ("phase_target", config.phase_target),
        ("bandwidth", config.bandwidth),
        ("delay", config.delay),
        ("lock.phase_tolerance", config.lock.phase_tolerance),
        ("lock.unlock_tolerance", config.lock.unlock_tolerance),
        ("lock.frequency_drift", config.lock.frequency_drift),
        ("lock.amplitude_drift", config.lock.amplitude_drift),
        ("lock.dwell", dwell.into()),
        ("lock.coherence_min", config.lock.coherence_min),
        ("lock.response_min", config.lock.response_min),
        ("response_max", config.response_max),
        ("acquire_timeout", config.acquire_timeout),
    ] {
        let value = start(name);
        assert!(
            (value - expected).abs() <= 1e-12 * expected.abs(),
            "{name}: {value}, {expected}"
        );
    }
}
