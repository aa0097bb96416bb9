//! Conversions between the types of the header and those of the core.

use phase_lock::{Config, ConfigError, Detector, Fault, Input, LoopState, Move, Output, Parameter, Value};

use crate::types::{
    PhaseLockConfig, PhaseLockDetector, PhaseLockFault, PhaseLockInput, PhaseLockMove, PhaseLockOptional,
    PhaseLockOutput, PhaseLockReal, PhaseLockStage,
};

// Every parameter is a field of the same name.
macro_rules! read {
    (detector, $c:ident, $config:ident, $group:ident, $field:ident) => {
        if let Some(parameter) = Parameter::find(stringify!($field)) {
            parameter.set(&mut $config, Value::Integer($c.$field))?;
        }
    };
    (optional, $c:ident, $config:ident, config, $field:ident) => {
        $config.$field = $c.$field.into()
    };
    ($type:ident, $c:ident, $config:ident, config, $field:ident) => {
        $config.$field = $c.$field
    };
    ($type:ident, $c:ident, $config:ident, lock, $field:ident) => {
        $config.lock.$field = $c.$field
    };
}

macro_rules! write {
    (detector, $c:ident, $config:ident, $group:ident, $field:ident) => {
        $c.$field = match $config.$field {
            Detector::Adaptive => PhaseLockDetector::Adaptive,
            Detector::Demodulator => PhaseLockDetector::Demodulator,
        } as i32
    };
    (optional, $c:ident, $config:ident, config, $field:ident) => {
        $c.$field = $config.$field.into()
    };
    ($type:ident, $c:ident, $config:ident, config, $field:ident) => {
        $c.$field = $config.$field
    };
    ($type:ident, $c:ident, $config:ident, lock, $field:ident) => {
        $c.$field = $config.lock.$field
    };
}

impl From<PhaseLockOptional> for Option<PhaseLockReal> {
    fn from(c: PhaseLockOptional) -> Self {
        c.present.then_some(c.value)
    }
}

impl From<Option<PhaseLockReal>> for PhaseLockOptional {
    fn from(value: Option<PhaseLockReal>) -> Self {
        Self { present: value.is_some(), value: value.unwrap_or_default() }
    }
}

/// Conversions in both directions, from the table of the parameters.
macro_rules! conversions {
    ($($group:ident $field:ident: $type:ident, $unit:literal, $range:ident;)*) => {
        impl TryFrom<&PhaseLockConfig> for Config {
            type Error = ConfigError;

            fn try_from(c: &PhaseLockConfig) -> Result<Self, ConfigError> {
                let mut config = Self::for_resonance(1.0, 1.0);
                $(read!($type, c, config, $group, $field);)*
                Ok(config)
            }
        }

        impl From<&Config> for PhaseLockConfig {
            fn from(config: &Config) -> Self {
                let mut c = Self::default();
                $(write!($type, c, config, $group, $field);)*
                c
            }
        }
    };
}

phase_lock::parameters!(conversions);

impl From<&PhaseLockInput> for Input {
    fn from(input: &PhaseLockInput) -> Self {
        Self {
            response: input.response,
            reference: input.reference.into(),
            active: input.active,
        }
    }
}

impl From<&PhaseLockMove> for Move {
    fn from(to: &PhaseLockMove) -> Self {
        Self {
            response: to.response,
            duration: to.duration,
            amplitude: to.amplitude,
            omega: to.omega,
            growth: to.growth,
        }
    }
}

impl From<Output> for PhaseLockOutput {
    fn from(o: Output) -> Self {
        Self {
            omega: o.omega,
            amplitude: o.amplitude,
            drive: o.drive,
            phase_error: o.phase_error.into(),
            response_amplitude: o.response_amplitude,
            response_target: o.response_target.into(),
            reference_amplitude: o.reference_amplitude,
            coherence: o.coherence,
            frequency: o.frequency,
            response_mean: o.response_mean,
            state: match o.state {
                LoopState::Idle => PhaseLockStage::Idle,
                LoopState::Ramping => PhaseLockStage::Ramping,
                LoopState::Acquiring => PhaseLockStage::Acquiring,
                LoopState::Locked => PhaseLockStage::Locked,
                LoopState::LockLost => PhaseLockStage::LockLost,
                LoopState::Tripped => PhaseLockStage::Tripped,
                LoopState::ShutDown => PhaseLockStage::ShutDown,
            },
            fault: match o.fault {
                None => PhaseLockFault::None,
                Some(Fault::Sensor) => PhaseLockFault::Sensor,
                Some(Fault::ResponseTooLarge) => PhaseLockFault::ResponseTooLarge,
                Some(Fault::TimedOut) => PhaseLockFault::TimedOut,
                Some(Fault::LockLost) => PhaseLockFault::LockLost,
                Some(Fault::NoSignal) => PhaseLockFault::NoSignal,
                Some(Fault::Implausible) => PhaseLockFault::Implausible,
            },
            locked: o.locked,
            settled: o.settled,
        }
    }
}

#[cfg(test)]
mod tests {
    use phase_lock::PARAMETERS;

    use super::*;

    #[test]
    fn every_parameter_survives_the_way_to_c_and_back() {
        for detector in [Detector::Adaptive, Detector::Demodulator] {
            let mut config = Config::for_resonance(55.0, 1e-4);
            config.detector = detector;
            for (n, parameter) in PARAMETERS.iter().enumerate() {
                let value = match parameter.get(&config) {
                    Value::Real(_) => Value::Real(1.0 + n as PhaseLockReal),
                    Value::Integer(_) if parameter.name != "detector" => Value::Integer(5),
                    same => same,
                };
                parameter.set(&mut config, value).expect(parameter.name);
            }
            let c = PhaseLockConfig::from(&config);
            assert_eq!(Config::try_from(&c), Ok(config));
            assert_eq!(PhaseLockConfig::from(&config), c);
        }
    }

    #[test]
    fn a_detector_that_does_not_exist_is_refused() {
        let mut c = PhaseLockConfig::from(&Config::for_resonance(55.0, 1e-4));
        for detector in [-1, 0, 3, 4, 5, i32::MAX] {
            c.detector = detector;
            let refused = Config::try_from(&c).unwrap_err();
            assert_eq!(
                (refused.name, refused.value),
                ("detector", Some(detector as PhaseLockReal))
            );
        }
    }
}
