//! The `[controller]` section: the phase-locked loop.

use std::f64::consts::{PI, TAU};

use lovines::State;
use lovines::oscillator::Oscillator;
use phase_lock::{
    Config, ConfigError, LockCriterion, MAX_HARMONICS, NONE, Number, PARAMETERS, Parameter, Value as Setting,
};
use serde::{Deserialize, Serialize, Serializer};
use toml::{Table, Value};
use vines_model::ArgumentError;
use vines_rig::unit::rounded;

use crate::knowledge::Knowledge;
use crate::linear::{DRAWING, LinearResponse};
use crate::units::{Unit, Units};

use super::checks::{Range, Row};
use super::{Measurand, Scene, SceneError, given, is_none};

settings! {
    /// Settings of the phase-locked loop, relative to the natural frequency so that they suit any plant.
    pub struct ControllerSettings {
        /// Samples per natural period `2 pi/omega0`; behind a shaker, a scene without this key takes more where the force has sharp edges.
        samples_per_period: f64 = 100.0,
        /// Bandwidth of the phase detector, in units of omega0: the only tuning parameter; the gains of the loop follow from it.
        bandwidth: f64 = 0.1,
        /// Lowest frequency allowed, in units of omega0.
        omega_min: f64 = 0.9,
        /// Highest frequency allowed, in units of omega0.
        omega_max: f64 = 1.1,
        /// Phase of the response relative to the base, degrees, above pi in magnitude and below 180: -90 is phase resonance.
        phase_target: f64 = -90.0,
    }
}

/// Refuses a phase target, degrees, that is one in rad, or at which no drive holds a motion.
///
/// # Errors
/// A magnitude of pi or less, or of 180 degrees or more.
pub fn phase_target(key: &'static str, value: f64) -> Result<(), SceneError> {
    Row::new(key, value, "degrees", in_degrees(value)).check()
}

/// What is allowed of a phase target, degrees.
pub(super) fn in_degrees(value: f64) -> Range {
    let in_rad = match value.abs() > PI {
        true => String::new(),
        false => format!(". If it is in rad, write {:.4}", value.to_degrees()),
    };
    let allowed = format!("must be in degrees, above pi in magnitude and below 180; -90 is phase resonance{in_rad}");
    Range::If(value.abs() > PI && value.abs() < 180.0, allowed)
}

impl ControllerSettings {
    /// The detector at the natural frequency omega0 = 1.
    fn detector(&self) -> Config {
        Config {
            sample_time: TAU / self.samples_per_period,
            ..Config::for_resonance(1.0, 0.0)
        }
    }

    /// Largest bandwidth of the detector at this number of samples per period, in units of omega0.
    pub(super) fn bandwidth_max(&self) -> f64 {
        self.detector().bandwidth_max()
    }

    /// Fewest samples per period: two of the highest harmonic at omega_max.
    pub(super) fn fewest_samples(&self) -> f64 {
        (2.0 * self.detector().highest_harmonic() as f64 * self.omega_max).floor() + 1.0
    }
}

// A scene's settings in SI units, in the form that plant and controller use.

impl Scene {
    /// Parameters and start of the plant, under the names of the FMU's variables.
    pub fn start_values(&self) -> Vec<(&'static str, Setting)> {
        let State { q1, dq1, q2, dq2 } = self.start;
        let start = [("q1", q1), ("der(q1)", dq1), ("q2", q2), ("der(q2)", dq2)];
        let plant = given(&self.plant).into_iter().map(|(row, value)| {
            let setting = if row.range.is_whole() {
                Setting::Integer(value as i32)
            } else {
                Setting::Real(value)
            };
            (row.symbol, setting)
        });
        plant
            .chain(start.map(|(name, value)| (name, Setting::Real(value))))
            .collect()
    }

    /// Configuration of the controller for the scene's excitation.
    pub(crate) fn lock_config(&self, knowledge: &Knowledge) -> Config {
        let LinearResponse { omega0, damping_rate, .. } = knowledge.linear;
        let c = &self.controller;
        let period = knowledge.numbers.natural_period();
        let step = knowledge.sample_time;
        let delay = self.chain.total_delay(omega0 * step) / omega0;
        let Units { reference, response, .. } = self.units();
        let units = [reference, response];
        let defaults = Config {
            amplitude_max: Some((4.0 * self.drive_needed(knowledge)).min(self.drive_range())),
            response_max: Some(4.0 * knowledge.numbers.b),
            residual_max: Some(self.residual(knowledge)),
            lock: lock_criterion(&knowledge.linear),
            ..Config::for_resonance(omega0, self.amplitude)
        };
        let limits = self.phase_lock.apply(units, Self::behind_shaker(knowledge, defaults));
        self.phase_lock.apply(
            units,
            Config {
                sample_time: step,
                omega_min: c.omega_min * omega0,
                omega_max: c.omega_max * omega0,
                bandwidth: c.bandwidth * omega0,
                damping_rate: Some(damping_rate).filter(|rate| *rate > 0.0),
                phase_target: knowledge.target.phase_of_readings(),
                delay: delay + f64::from(u8::from(self.is_late())) * step,
                // The velocity of a base that moves with the largest amplitude.
                ramp_rate: limits.amplitude_max.map(|largest| largest * omega0),
                // The range in a period, or in half a time constant of the detector: the loop locks as fast as without a limit.
                omega_rate: Some((c.omega_max - c.omega_min) * omega0 * (2.0 * c.bandwidth * omega0).max(1.0 / period)),
                acquire_timeout: Some(self.lock_periods(&knowledge.linear) * period),
                reference_connected: self.chain.reference,
                ..limits
            },
        )
    }

    /// The configuration behind a shaker, whose force cell reads the harmonics of impacts beside a fundamental that falls near the resonance. The
    /// detector averages over `1/(bandwidth sample_time)` samples: at this coherence, without drop-out, it knows the fundamental to a third.
    fn behind_shaker(knowledge: &Knowledge, config: Config) -> Config {
        let Some(path) = knowledge.shaker else {
            return config;
        };
        let known_to_a_third = 10.0 * config.bandwidth * knowledge.sample_time;
        let coherence_min = config.lock.coherence_min.min(known_to_a_third) * path.drop_out().min(1.0).powi(2);
        Config {
            harmonics: MAX_HARMONICS as u8,
            lock: LockCriterion { coherence_min, ..config.lock },
            ..config
        }
    }

    /// Refuses a configuration that the controller refuses.
    ///
    /// # Errors
    /// The value that is refused, in the units of the scene.
    pub(crate) fn check_controller(&self) -> Result<(), SceneError> {
        let config = self.lock_config(&self.knowledge());
        let Err(error) = config.build() else { return Ok(()) };
        let unit = self.units().reference;
        // Five digits: the value has been multiplied and divided.
        let shown = |metres: f64| rounded(unit.of_metres(metres), 4);
        match config.amplitude_max {
            Some(limit) if error.name == "amplitude" => Err(SceneError::Value {
                key: "phase_lock.amplitude_max",
                value: shown(limit),
                unit: unit.symbol,
                allowed: format!(
                    "at least the drive of [excitation], {} {}",
                    Number(shown(self.amplitude)),
                    unit.symbol
                ),
            }),
            _ => Err(error.into()),
        }
    }

    /// Largest plausible difference between a reading and its prediction, as a share of the amplitude.
    fn residual(&self, knowledge: &Knowledge) -> f64 {
        let relative = self.drive_needed(knowledge) / knowledge.numbers.b;
        // Impacts change the velocity within a sample. Two in a period that balance the base amplitude E have the velocity pi omega0 E/2 each, and
        // the acceleration omega0^2 E samples/4; frequency and transients take a few times as much. The amplitude of the response is about b.
        let impulse = match self.resonance.sensor_quantity {
            Measurand::Displacement => 0.0,
            Measurand::Velocity => TAU * relative,
            Measurand::Acceleration => relative * self.controller.samples_per_period,
        };
        RESIDUAL + impulse + self.other_modes() + self.in_reference(knowledge)
    }

    /// Largest plausible response of a structure's other modes, over the smallest response of the backbone: the impacts on a particle of the
    /// speed b omega0 are impulses 2 m b omega0 of alternating sign. At worst they meet the mode in phase, which then sums them up to
    /// 1/(1 - exp(-pi zeta omega_n/omega0)) of one; here to the first order in the damping ratio.
    fn other_modes(&self) -> f64 {
        let Some(structure) = self.structure.as_ref() else {
            return 0.0;
        };
        let driven = structure.mode();
        let others = structure
            .modes
            .iter()
            .enumerate()
            .filter(|(n, _)| *n != structure.driven);
        let shares = others.map(|(_, mode)| {
            let at_sensor = mode.shape[structure.sensor] / driven.shape[structure.sensor];
            let at_cavity = structure.at_cavity(mode) * structure.at_cavity(driven) * self.plant.particle_mass;
            let ratio = mode.omega / driven.omega;
            // A sensor of velocities or accelerations shows fast modes more.
            let shown = ratio.powi(self.resonance.sensor_quantity.order());
            shown * (at_sensor * at_cavity).abs() * (2.0 / ratio) * (1.0 + 1.0 / (PI * mode.zeta * ratio))
        });
        let sum: f64 = shares.sum();
        // An undamped mode has no bound; the controller takes numbers only.
        (sum / self.backbone.c_from.min(self.backbone.c_to)).min(1e6)
    }

    /// Largest plausible change of the reference behind a shaker by impacts, over the smallest amplitude: half of the requested one holds the least
    /// response, and a move to a lower one takes four fifths of it away: a factor of 10. The impulses of [`Self::other_modes`] act on the force cell or
    /// table through structure and shaker. A faster mode adds up successive impulses, less what it loses between them; slower changes the detector
    /// follows.
    fn in_reference(&self, knowledge: &Knowledge) -> f64 {
        let Some((structure, shaker)) = self.shaken() else {
            return 0.0;
        };
        let omega = knowledge.linear.omega0;
        let impulse = 2.0 * self.plant.particle_mass * knowledge.numbers.b * omega;
        let [reference, inertia] = shaker.reference_and_inertia(structure.excitation);
        let rows = reference.iter().zip(&inertia).zip(structure.host.sections());
        let changes = rows.map(|((reference, inertia), section)| {
            let Oscillator { delta, omega0, reach, .. } = section.oscillator;
            let pair = [0, 1].map(|n| reference[n] + omega0 * omega0 * inertia[n]);
            let jump = pair[0] * section.kick[0] + pair[1] * section.kick[1];
            let change = jump.abs() + reach * section.velocity_per_impulse(pair).abs();
            let kept = if omega0 < 2.0 * omega {
                0.0
            } else {
                (-PI * delta / omega).exp()
            };
            change / (1.0 - kept)
        });
        // An acceleration is averaged over a sample period.
        let shock = structure.host.velocity_per_impulse(&inertia).abs() / knowledge.sample_time;
        let change = (changes.sum::<f64>() + shock) * impulse;
        10.0 * structure.units().reference.in_metres(change) / self.amplitude
    }

    /// The larger of the requested drive, m, and the one that holds the linear mode at the amplitude at which impacts certainly occur.
    fn drive_needed(&self, knowledge: &Knowledge) -> f64 {
        let linear = knowledge.linear.bandwidth().max(BANDWIDTH_MIN);
        // A particle at rest in the middle is hit at the amplitude b.
        self.amplitude.max((1.0 + DRAWING) * linear * knowledge.numbers.b)
    }

    /// Largest drive, m, that the converters of the base can show; infinite without them.
    pub(super) fn drive_range(&self) -> f64 {
        let chain = &self.chain;
        match chain.adc_bits.filter(|_| chain.reference).or(chain.dac_bits) {
            Some(_) => self.dimensionless().amplitude(chain.base_range),
            None => f64::INFINITY,
        }
    }

    /// Default time limit for the lock, natural periods: at least 3000, and 20 times the relaxation time.
    fn lock_periods(&self, linear: &LinearResponse) -> f64 {
        let relaxation = PI * linear.relaxation_periods();
        let samples_per_period = self.controller.samples_per_period;
        (20.0 * relaxation).max(3000.0).min(1e7 / samples_per_period)
    }

    /// Configuration of the controller for tracking: with a larger drive, unless `[phase_lock]` limits it, and a bandwidth at which the loops are
    /// not coupled.
    pub(crate) fn tracking_config(&self, knowledge: &Knowledge) -> Config {
        let config = self.lock_config(knowledge);
        let is_set = self.phase_lock.0.iter().any(|(given, _)| *given == "amplitude_max");
        let limit = config.amplitude_max.filter(|_| is_set);
        // Largest bandwidth of the loops of phase and amplitude, in units of omega0, at which their coupling is weak. A drive that changes shifts
        // the phase that the detectors read, and a frequency that changes shifts the amplitude. From loop to loop the gain is the cube of the
        // bandwidth times A/E, which is largest without impacts: the inverse of twice the damping ratio.
        let coupled = COUPLED * knowledge.linear.bandwidth().max(f64::MIN_POSITIVE).cbrt();
        Config {
            amplitude_max: limit.or(Some(knowledge.numbers.amplitude(TRACKED).min(self.drive_range()))),
            bandwidth: self.controller.bandwidth.min(coupled) * knowledge.linear.omega0,
            ..config
        }
    }
}

/// The lock criterion: phase errors up to 0.3 degrees, and the drifts that are left near the steady state, at the rate at which the response approaches
/// it. The frequency is within 2e-4 of the half-power bandwidth of the linear response, and the amplitude within 8e-5 of itself; noise widens both.
fn lock_criterion(linear: &LinearResponse) -> LockCriterion {
    let bandwidth = linear.bandwidth().max(BANDWIDTH_MIN);
    let approached = PI * bandwidth;
    LockCriterion {
        phase_tolerance: 0.3_f64.to_radians(),
        frequency_drift: 2e-4 * bandwidth * approached,
        amplitude_drift: 8e-5 * approached,
        ..LockCriterion::default()
    }
}

/// Bandwidth at which the loops are weakly coupled, over the cube root of E/A.
const COUPLED: f64 = 0.9;
/// Largest drive of a tracked backbone, base amplitude over `b epsilon`, without `phase_lock.amplitude_max`.
const TRACKED: f64 = 4.0;
/// Smallest half-power bandwidth over omega0 that counts for the lock criterion and the largest drive: with less, most of the energy is lost in
/// impacts.
const BANDWIDTH_MIN: f64 = 1e-4;
/// Share of the amplitude by which a reading may differ from its prediction: a resonant response changes slowly.
const RESIDUAL: f64 = 0.3;

// The `[phase_lock]` section: parameters of the controller that no other key sets, in SI units and by their names in `PhaseLock.fmu`.

/// The parameters that other keys of a scene set, these keys, and their units, which suit any plant.
pub const KEYS: [(&str, &str, &str); 7] = [
    (
        "sample_time",
        "controller.samples_per_period",
        "samples in a natural period",
    ),
    ("omega_min", "controller.omega_min", "over omega0"),
    ("omega_max", "controller.omega_max", "over omega0"),
    ("amplitude", "excitation.G", "over b epsilon"),
    ("phase_target", "controller.phase_target", "degrees"),
    ("bandwidth", "controller.bandwidth", "over omega0"),
    ("reference_connected", "chain.reference", ""),
];

/// The key of the scene that sets a parameter of the controller.
pub fn key(name: &str) -> String {
    let key = KEYS.iter().find(|(parameter, ..)| *parameter == name);
    key.map_or_else(|| format!("phase_lock.{name}"), |(_, key, _)| (*key).to_string())
}

/// The message for a refused configuration, with the keys of the scene.
pub fn refusal(error: &ConfigError) -> String {
    let mut text = format!("{}: {error}", key(error.name));
    let words = error.allowed.split([' ', ',', '(', ')']);
    for name in words.filter(|word| Parameter::find(word).is_some()) {
        text += &format!("; {name} is {}", key(name));
    }
    text
}

/// Checked values by the names of the controller's parameters.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(try_from = "Table")]
pub struct PhaseLock(Vec<(&'static str, Setting)>);

impl TryFrom<Table> for PhaseLock {
    type Error = ArgumentError;

    fn try_from(table: Table) -> Result<Self, ArgumentError> {
        let mut flat = Table::new();
        for (name, value) in table {
            match value {
                Value::Table(group) => {
                    flat.extend(group.into_iter().map(|(key, item)| (format!("{name}.{key}"), item)))
                }
                value => _ = flat.insert(name, value),
            }
        }
        let settings = flat.iter().map(|(name, value)| setting(name, value));
        Ok(Self(settings.collect::<Result<_, _>>()?))
    }
}

impl Serialize for PhaseLock {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|(name, setting)| {
            let value = match *setting {
                Setting::Real(NONE) => Value::from("none"),
                Setting::Real(number) => Value::from(number),
                Setting::Integer(number) => Value::from(number),
                Setting::Boolean(value) => Value::from(value),
            };
            (name, value)
        }))
    }
}

impl PhaseLock {
    /// The configuration with these values; drives and responses are in these units.
    fn apply(&self, [drive, response]: [Unit; 2], mut config: Config) -> Config {
        for (name, setting) in &self.0 {
            let unit = match *name {
                "amplitude_max" | "ramp_rate" | "release_rate" => drive,
                "response_max" => response,
                _ => Unit::METRE,
            };
            let setting = &match *setting {
                Setting::Real(value) if value != NONE => Setting::Real(unit.in_metres(value)),
                setting => setting,
            };
            // Names, types and whole numbers were checked when the scene was read; `Config::build` checks the rest.
            let _ = Parameter::find(name).map(|parameter| parameter.set(&mut config, *setting));
        }
        config
    }
}

/// Name and value of a parameter, from the name and the value in the file.
fn setting(name: &str, value: &Value) -> Result<(&'static str, Setting), ArgumentError> {
    if let Some((_, key, unit)) = KEYS.iter().find(|(parameter, ..)| *parameter == name) {
        let unit = if unit.is_empty() {
            String::new()
        } else {
            format!(" ({unit})")
        };
        return Err(format!("phase_lock.{name} is set by {key}{unit}").into());
    }
    let parameter = Parameter::find(name).ok_or_else(|| {
        let free = PARAMETERS.iter().map(|parameter| parameter.name);
        let free: Vec<&str> = free.filter(|key| KEYS.iter().all(|(name, ..)| name != key)).collect();
        format!(
            "the controller has no parameter `{name}`; expected one of {}",
            free.join(", ")
        )
    })?;
    let mut config = Config::for_resonance(1.0, 1.0);
    // The unit is that of the drive, which another section says.
    let unit = |unit| match parameter.name {
        "amplitude_max" => "m, or N behind a force,",
        "ramp_rate" | "release_rate" => "m/s, or N/s behind a force,",
        _ => unit,
    };
    let setting = match (parameter.get(&config), value) {
        (Setting::Real(_), Value::Float(number)) => Setting::Real(*number),
        (Setting::Real(_), Value::Integer(number)) => Setting::Real(*number as f64),
        (Setting::Real(_), value) if is_none(value) => Setting::Real(NONE),
        (Setting::Integer(_), Value::Integer(number)) => Setting::Integer(i32::try_from(*number).unwrap_or(i32::MAX)),
        (Setting::Boolean(_), Value::Boolean(value)) => Setting::Boolean(*value),
        _ => {
            let (allowed, given) = (parameter.range.allowed(), value.type_str());
            return Err(format!("phase_lock.{name} is a {given}, which is refused; allowed is {allowed}").into());
        }
    };
    let refused = |error: ConfigError| format!("phase_lock.{}", ConfigError { unit: unit(error.unit), ..error });
    // Before its number is converted to the units of the controller.
    if let Setting::Real(number) = setting
        && !parameter.range.contains(number)
    {
        let Parameter { name, unit, range, .. } = *parameter;
        let error = ConfigError { name, value: Some(number), unit, allowed: range.allowed() };
        return Err(refused(error).into());
    }
    parameter.set(&mut config, setting).map_err(refused)?;
    Ok((parameter.name, setting))
}
