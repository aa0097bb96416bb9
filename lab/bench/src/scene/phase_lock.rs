//! The `[phase_lock]` section: parameters of the controller that no other key sets, in SI units and by their names in `PhaseLock.fmu`.

use phase_lock::{Config, ConfigError, NONE, PARAMETERS, Parameter, Value as Setting};
use serde::{Deserialize, Serialize, Serializer};
use toml::{Table, Value};
use vines_model::ArgumentError;

/// The parameters that other keys of a scene set, in units that suit any plant.
pub const KEYS: [(&str, &str); 18] = [
    ("sample_time", "controller.samples_per_period"),
    ("omega_start", "controller.omega_start"),
    ("omega_min", "controller.omega_min"),
    ("omega_max", "controller.omega_max"),
    ("amplitude", "excitation.G"),
    ("amplitude_max", "controller.G_max"),
    ("ramp_rate", "controller.ramp_periods"),
    ("release_rate", "controller.release_periods"),
    ("phase_target", "controller.phase_target"),
    ("bandwidth", "controller.bandwidth"),
    ("delay", "controller.delay"),
    ("lock.phase_tolerance", "controller.phase_tolerance"),
    ("lock.frequency_drift", "controller.frequency_tolerance"),
    ("lock.amplitude_drift", "controller.amplitude_tolerance"),
    ("lock.dwell", "controller.dwell_periods"),
    ("response_max", "controller.C_max"),
    ("acquire_timeout", "record.lock_periods"),
    ("reference_connected", "chain.reference"),
];

/// The key of the scene that sets a parameter of the controller.
pub fn key(name: &str) -> String {
    let key = KEYS.iter().find(|(parameter, _)| *parameter == name);
    key.map_or_else(|| format!("phase_lock.{name}"), |(_, key)| (*key).to_string())
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
        if !table.is_empty() && !cfg!(feature = "parameters") {
            return Err("the section [phase_lock] needs the feature `parameters`"
                .to_string()
                .into());
        }
        let mut flat = Table::new();
        for (name, value) in table {
            match value {
                Value::Table(group) => flat.extend(group.into_iter().map(|(key, one)| (format!("{name}.{key}"), one))),
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
                Setting::Boolean(one) => Value::from(one),
            };
            (name, value)
        }))
    }
}

impl PhaseLock {
    /// The configuration with these values. Without the feature `parameters` there are none, and nothing that sets them is compiled.
    pub(super) fn apply(&self, mut config: Config) -> Config {
        let settings = if cfg!(feature = "parameters") { &self.0[..] } else { &[] };
        for (name, setting) in settings {
            // Names, types and whole numbers were checked when the scene was read; `Config::build` checks the rest.
            let _ = Parameter::find(name).map(|parameter| parameter.set(&mut config, *setting));
        }
        config
    }
}

/// Name and value of a parameter, from the name and the value in the file.
fn setting(name: &str, value: &Value) -> Result<(&'static str, Setting), ArgumentError> {
    if let Some((_, key)) = KEYS.iter().find(|(parameter, _)| *parameter == name) {
        return Err(format!("phase_lock.{name} is set by {key}").into());
    }
    let parameter = Parameter::find(name).ok_or_else(|| {
        let free = PARAMETERS.iter().map(|one| one.name);
        let free: Vec<&str> = free.filter(|one| KEYS.iter().all(|(name, _)| name != one)).collect();
        format!(
            "the controller has no parameter `{name}`; expected one of {}",
            free.join(", ")
        )
    })?;
    let mut config = Config::for_resonance(1.0, 1.0);
    let setting = match (parameter.get(&config), value) {
        (Setting::Real(_), Value::Float(number)) => Setting::Real(*number),
        (Setting::Real(_), Value::Integer(number)) => Setting::Real(*number as f64),
        (Setting::Real(_), Value::String(word)) if word == "none" => Setting::Real(NONE),
        (Setting::Real(_), Value::Boolean(false)) => Setting::Real(NONE),
        (Setting::Integer(_), Value::Integer(number)) => Setting::Integer(i32::try_from(*number).unwrap_or(i32::MAX)),
        (Setting::Boolean(_), Value::Boolean(one)) => Setting::Boolean(*one),
        _ => {
            let (allowed, given) = (parameter.range.allowed(), value.type_str());
            return Err(format!("phase_lock.{name} is a {given}, which is refused; allowed is {allowed}").into());
        }
    };
    let accepted = parameter.set(&mut config, setting);
    accepted.map_err(|error| format!("phase_lock.{error}"))?;
    Ok((parameter.name, setting))
}
