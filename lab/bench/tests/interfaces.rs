//! The scene offers every parameter of the controller's table, and its options are absent, `false` or "none", never 0.

use phase_lock::{Config, NONE, PARAMETERS, Parameter, Range, Value};
use vines_testbench::scene::{KEYS, Scene, refusal};

fn config(settings: &[String]) -> Result<Config, String> {
    let overrides = settings.iter().map(|one| one.parse().unwrap()).collect::<Vec<_>>();
    let scene = Scene::load(None, &overrides).map_err(|error| error.to_string())?;
    let config = scene.controller_config();
    config.build().map_err(|error| refusal(&error))?;
    Ok(config)
}

/// The parameters whose values differ.
fn changed(setting: &str) -> Vec<&'static str> {
    let (before, after) = (config(&[]).unwrap(), config(&[setting.into()]).unwrap());
    let differ = PARAMETERS.iter().filter(|one| one.get(&before) != one.get(&after));
    differ.map(|one| one.name).collect()
}

#[test]
fn every_parameter_of_the_controller_has_exactly_one_key_of_the_scene() {
    for parameter in &PARAMETERS {
        let name = parameter.name;
        let key = KEYS
            .iter()
            .find(|(parameter, _)| *parameter == name)
            .map(|(_, key)| *key);
        let value = match (name, parameter.get(&config(&[]).unwrap())) {
            ("reference_connected", _) => "false".into(),
            ("phase_target", _) => "-80.0".into(),
            ("detector", _) => "2".into(),
            (_, Value::Boolean(one)) => (!one).to_string(),
            (_, Value::Integer(_)) => "5".into(),
            ("sample_time", _) => "120.0".into(),
            ("omega_max", _) => "1.2".into(),
            ("omega_start", _) => "1.01".into(),
            ("omega_min", _) => "0.8".into(),
            ("bandwidth", _) => "0.12".into(),
            ("amplitude", _) => "1.2".into(),
            ("amplitude_max", _) => "7.0".into(),
            ("acquire_timeout", _) => "2500".into(),
            ("lock.unlock_tolerance" | "lock.coherence_min" | "lock.response_min", _) => "0.3".into(),
            _ => "3.5".to_owned(),
        };
        let setting = key.map_or_else(|| format!("phase_lock.{name}={value}"), |key| format!("{key}={value}"));
        assert!(changed(&setting).contains(&name), "{setting}: {:?}", changed(&setting));
        let twice = config(&[format!("phase_lock.{name}={value}")]);
        assert_eq!(twice.is_err(), key.is_some(), "{name}: {twice:?}");
    }
}

#[test]
fn an_option_of_the_controller_is_switched_off_by_none_or_false_and_not_by_zero() {
    for (key, name) in [
        ("controller.C_max", "response_max"),
        ("phase_lock.base_bandwidth", "base_bandwidth"),
        ("phase_lock.damping_rate", "damping_rate"),
    ] {
        let parameter = Parameter::find(name).unwrap();
        assert_eq!(parameter.range, Range::Optional);
        for off in ["'none'", "false"] {
            let config = config(&[format!("{key}={off}")]).unwrap();
            assert_eq!(parameter.get(&config), Value::Real(NONE), "{key}={off}");
        }
        let refused = config(&[format!("{key}=0")]).unwrap_err();
        assert!(refused.contains(key.rsplit('.').next().unwrap()), "{refused}");
        assert!(config(&[format!("{key}=true")]).is_err() && config(&[format!("{key}='off'")]).is_err());
    }
}

#[test]
fn a_stage_of_the_chain_is_switched_off_by_none_or_false_and_not_by_zero() {
    let chain = |setting: &str| {
        let overrides = ["chain.hold=true", setting].map(|one| one.parse().unwrap());
        Scene::load(None, &overrides).map(|scene| scene.chain)
    };
    for (key, on) in [
        ("adc_bits", "12"),
        ("dac_bits", "12"),
        ("filter", "10.0"),
        ("snr", "40"),
    ] {
        let with = chain(&format!("chain.{key}={on}")).unwrap();
        for off in ["'none'", "false"] {
            assert_ne!(chain(&format!("chain.{key}={off}")).unwrap(), with);
            assert_eq!(
                chain(&format!("chain.{key}={off}")).unwrap(),
                chain("chain.delay=0").unwrap()
            );
        }
        // 0 dB is a ratio, 0 bits or a cut-off of 0 are none.
        let zero = chain(&format!("chain.{key}=0"));
        assert_eq!(zero.is_err(), key != "snr", "{key}");
    }
}

#[test]
fn two_parameters_of_one_group_are_set_one_after_the_other() {
    let settings = [
        "phase_lock.lock.coherence_min=0.25",
        "phase_lock.lock.response_min=0.125",
    ];
    let config = config(&settings.map(String::from)).unwrap();
    assert_eq!((config.lock.coherence_min, config.lock.response_min), (0.25, 0.125));
}

#[test]
fn a_mistake_in_the_section_of_the_controller_names_the_parameter_and_what_is_allowed() {
    for (setting, words) in [
        (
            "controller.G_max=1.0",
            ["excitation.G: amplitude = 9.", "amplitude_max is controller.G_max"],
        ),
        (
            "controller.bandwidth=1e300",
            ["controller.bandwidth = 1e300 (omega0)", "at most 2.274"],
        ),
        ("phase_lock.harmonics=9", ["harmonics = 9", "1 to 8"]),
        ("phase_lock.harmonics=2.5", ["harmonics is a float", "1 to 8"]),
        ("phase_lock.nothing=1", ["no parameter `nothing`", "base_bandwidth"]),
        (
            "phase_lock.omega_min=1.0",
            ["phase_lock.omega_min", "controller.omega_min"],
        ),
        (
            "phase_lock.base_bandwidth=99.0",
            [
                "phase_lock.base_bandwidth: base_bandwidth = 99 rad/s",
                "bandwidth is controller.bandwidth",
            ],
        ),
    ] {
        let refused = config(&[setting.into()]).unwrap_err();
        assert!(words.iter().all(|word| refused.contains(word)), "{setting}: {refused}");
    }
}
