//! The parameters of a scene, under the names of the FMUs' variables, as SSP writes them.

use std::fmt::Write;

use phase_lock::{Config, Detector};

use crate::{
    pack::PackError,
    rig::{configuration, start_values},
    scene::Scene,
};

/// A value of a variable.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Value {
    Real(f64),
    Integer(i64),
    Boolean(bool),
}

use Value::{Boolean, Integer, Real};

type Named = (&'static str, Value);

/// Parameters and start of the plant. The start goes by its parameters: some masters set no start value of an output.
pub(super) fn plant(scene: &Scene) -> Vec<Named> {
    start_values(scene)
        .map(|(name, value)| {
            let parameter = match name {
                "q1" => "q1_start",
                "der(q1)" => "der_q1_start",
                "q2" => "q2_start",
                "der(q2)" => "der_q2_start",
                other => other,
            };
            (parameter, Real(value))
        })
        .to_vec()
}

/// The communication step: the controller's sample time, s.
pub(super) fn step(scene: &Scene) -> f64 {
    configuration(scene).sample_time
}

/// Parameters of the controller, which is armed from the start.
pub(super) fn controller(scene: &Scene) -> Result<Vec<Named>, PackError> {
    let config = configuration(scene);
    config.build()?;
    let Config { lock, .. } = config;
    let (detector, harmonics, odd_only) = match config.detector {
        Detector::Adaptive {
            harmonics,
            odd_only,
        } => (1, harmonics, odd_only),
        Detector::Demodulator => (2, 1, true),
    };
    Ok(vec![
        ("sample_time", Real(config.sample_time)),
        ("omega_start", Real(config.omega_start)),
        ("omega_min", Real(config.omega_min)),
        ("omega_max", Real(config.omega_max)),
        ("omega_rate", Real(config.omega_rate)),
        ("amplitude", Real(config.amplitude)),
        ("amplitude_max", Real(config.amplitude_max)),
        ("ramp_time", Real(config.ramp_time)),
        ("release_time", Real(config.release_time)),
        ("base_bandwidth", Real(config.base_bandwidth)),
        ("phase_target", Real(config.phase_target)),
        ("detector", Integer(detector)),
        ("harmonics", Integer(harmonics.into())),
        ("odd_only", Boolean(odd_only)),
        ("bandwidth", Real(config.bandwidth)),
        ("damping_rate", Real(config.damping_rate)),
        ("delay", Real(config.delay)),
        ("lock.phase_tolerance", Real(lock.phase_tolerance)),
        ("lock.unlock_tolerance", Real(lock.unlock_tolerance)),
        ("lock.frequency_drift", Real(lock.frequency_drift)),
        ("lock.amplitude_drift", Real(lock.amplitude_drift)),
        ("lock.dwell", Integer(lock.dwell.into())),
        ("lock.coherence_min", Real(lock.coherence_min)),
        ("lock.response_min", Real(lock.response_min)),
        ("response_max", Real(config.response_max)),
        ("acquire_timeout", Real(config.acquire_timeout)),
        ("active", Boolean(true)),
    ])
}

/// A file of parameter values. Each has a name of its own, since some masters merge sets of one name.
pub(super) fn parameter_set(name: &str, values: &[Named]) -> String {
    let mut text = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<ssv:ParameterSet version=\"1.0\" name=\"{name}\" \
         generationTool=\"vines\"\n  xmlns:ssv=\"http://ssp-standard.org/SSP1/SystemStructureParameterValues\">\n  \
         <ssv:Parameters>\n",
    );
    for (name, value) in values {
        let value = match value {
            Real(number) => format!("<ssv:Real value=\"{number}\"/>"),
            Integer(number) => format!("<ssv:Integer value=\"{number}\"/>"),
            Boolean(truth) => format!("<ssv:Boolean value=\"{truth}\"/>"),
        };
        let _ = writeln!(
            text,
            "    <ssv:Parameter name=\"{name}\">{value}</ssv:Parameter>"
        );
    }
    text + "  </ssv:Parameters>\n</ssv:ParameterSet>\n"
}
