//! Guards the values of scenes, the keys of the controller's settings, and the messages for mistakes.

use std::path::Path;

use phase_lock::{Config, NONE, PARAMETERS, Parameter, Range, Value};
use vines_testbench::scene::{
    ControllerSettings, Definition, KEYS, Override, RecordSettings, Reference, Resonance, Scene, SceneError, Sensor,
    refusal,
};

fn set(arguments: &[&str]) -> Vec<Override> {
    arguments.iter().map(|one| one.parse().unwrap()).collect()
}

fn paper(arguments: &[&str]) -> Result<Scene, SceneError> {
    Scene::load(None, &set(arguments))
}

fn complaint(result: Result<Scene, SceneError>) -> String {
    result.expect_err("a mistake").to_string()
}

fn says(message: &str, parts: &[&str]) {
    for part in parts {
        assert!(message.contains(part), "`{part}` is not in: {message}");
    }
}

fn file(name: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes").join(name)
}

#[test]
fn the_default_scene_is_the_paper_file() {
    let embedded = paper(&[]).unwrap();
    assert_eq!(embedded, Scene::load(Some(&file("paper.toml")), &[]).unwrap());
    let numbers = embedded.dimensionless();
    assert!((numbers.epsilon - 0.0084).abs() < 1e-5, "{numbers:?}");
    assert!((numbers.lambda - 1.43).abs() < 5e-3, "{numbers:?}");
    assert!((numbers.g - 1.1).abs() < 1e-14, "{numbers:?}");
    assert_eq!(embedded.controller, ControllerSettings::default());
    assert_eq!(embedded.record, RecordSettings::default());
}

#[test]
fn a_dimensionless_scene_is_its_own_model() {
    let scene = Scene::load(Some(&file("dimensionless.toml")), &[]).unwrap();
    let numbers = scene.dimensionless();
    assert_eq!((numbers.omega0, numbers.b), (1.0, 1.0));
    assert_eq!((numbers.epsilon, scene.plant.damping), (0.0084, 0.0084 * 1.43));
    assert!((numbers.lambda - 1.43).abs() < 1e-14 && (numbers.g - 1.1).abs() < 1e-14);
}

#[test]
fn setting_e_replaces_g_and_back() {
    assert_eq!(paper(&["excitation.E=1e-4"]).unwrap().amplitude, 1e-4);
    let text = "[plant]\nepsilon = 0.01\nlambda = 1\nr = 0.65\n[excitation]\nE = 0.02";
    let scene = Scene::parse("s.toml", text, &set(&["excitation.G=1.5"])).unwrap();
    assert!((scene.dimensionless().g - 1.5).abs() < 1e-14);
    says(
        &complaint(paper(&["excitation.E=1e-4", "excitation.G=1"])),
        &["excitation.G is set as well"],
    );
}

#[test]
fn a_key_of_the_other_units_is_refused() {
    says(
        &complaint(paper(&["plant.epsilon=0.01"])),
        &["mixes SI keys (M, k, c, m, b)"],
    );
    let result = Scene::load(Some(&file("dimensionless.toml")), &set(&["plant.M=2"]));
    says(&complaint(result), &["mixes", "epsilon, lambda"]);
}

#[test]
fn an_unknown_key_is_named_with_those_allowed() {
    says(
        &complaint(paper(&["plant.mass=1"])),
        &["--set plant.mass=1", "`mass`", "`M`", "`r`"],
    );
    says(&complaint(paper(&["plants.r=1"])), &["`plants`", "`plant`", "`record`"]);
    says(
        &complaint(paper(&["record.lock_periods=5"])),
        &["`hold_periods`", "`lock_periods` is now phase_lock.acquire_timeout, s"],
    );
    let result = Scene::parse("my.toml", "[plant]\nM = 1\nkk = 2\n", &[]);
    says(&complaint(result), &["my.toml", "line 3", "`kk`", "`k`"]);
}

#[test]
fn a_value_of_the_wrong_type_is_named_with_its_line() {
    let result = Scene::parse("my.toml", "[plant]\nM = \"heavy\"\n", &[]);
    says(&complaint(result), &["my.toml", "line 2", "heavy"]);
}

#[test]
fn what_is_measured_reaches_theory_and_exact_orbits() {
    assert_eq!(paper(&[]).unwrap().dimensionless().definition, Definition::default());
    let set = [
        "resonance.definition='peak'",
        "resonance.reference='force'",
        "resonance.sensor='acceleration'",
    ];
    let definition = Definition {
        resonance: Resonance::Peak,
        reference: Reference::Force,
        sensor: Sensor::Acceleration,
    };
    assert_eq!(paper(&set).unwrap().dimensionless().definition, definition);
    says(
        &complaint(paper(&["resonance.sensor='w'"])),
        &["`w`", "`v`", "`q1`", "`acceleration`"],
    );
}

#[test]
fn values_that_make_no_sense_are_named_with_unit_and_range() {
    for (argument, parts) in [
        ("plant.M=0", ["M (primary mass) = 0 kg", "from 1e-100 to 1e100"]),
        ("plant.k=-1", ["k (stiffness) = -1 N/m", "from 1e-100 to 1e100"]),
        ("plant.m=nan", ["m (particle mass) = NaN kg", "from 1e-100 to 1e100"]),
        (
            "plant.b=inf",
            ["b (half-width of the cavity) = inf m", "from 1e-100 to 1e100"],
        ),
        ("plant.c=-0.1", ["c (damping) = -0.1 N", "from 0 to 1e100"]),
        ("plant.r=0", ["r (coefficient of restitution) = 0", "at most 1"]),
        ("plant.r=1.01", ["r (coefficient of restitution) = 1.01", "at most 1"]),
        ("start.q2=0.02", ["q1 - q2", "-0.02 m"]),
        (
            "start.q1=inf",
            ["q1 (displacement of the primary mass) = inf m", "finite"],
        ),
        (
            "excitation.G=-1",
            ["excitation.G = -1 (dimensionless)", "zero or positive"],
        ),
        ("phase_lock.omega_start=70", ["phase_lock.omega_start", "omega_max"]),
        (
            "controller.omega_max=0.5",
            ["controller.omega_max = 0.5 (omega0)", "omega_min = 0.9"],
        ),
        (
            "record.decay_periods=-1",
            ["record.decay_periods = -1 (natural periods)", "must be positive"],
        ),
        ("chain.adc_bits=40", ["chain.adc_bits", "40"]),
        ("chain.dac_bits=12", ["chain.dac_bits", "chain.hold"]),
        ("chain.filter=80.0", ["chain.filter", "80"]),
        ("chain.jitter=0.5", ["chain.jitter", "0.5"]),
        ("chain.snr=-100", ["chain.snr", "-100"]),
        ("chain.response_range=0", ["chain.response_range", "0"]),
        ("phase_lock.harmonics=99", ["harmonics", "99"]),
        (
            "phase_lock.amplitude_max=5e-5",
            ["phase_lock.amplitude_max", "excitation.G"],
        ),
        ("start.dq2=1e300", ["der(q2)", "= 1e300 m/s"]),
    ] {
        says(&complaint(paper(&[argument])), &parts);
    }
}

#[test]
fn a_missing_file_and_missing_and_mixed_keys_are_reported() {
    let result = Scene::load(Some(Path::new("nowhere/at-all.toml")), &[]);
    says(&complaint(result), &["nowhere/at-all.toml"]);
    let parse = |text| complaint(Scene::parse("my.toml", text, &[]));
    says(&parse(""), &["my.toml", "[plant] has no", "epsilon"]);
    says(&parse("[plant]\nM = 1\nr = 0.5"), &["[plant] has no `k`"]);
    says(&parse("[plant]\nM = 1\nepsilon = 0.5"), &["mixes"]);
    let plant = "[plant]\nepsilon = 0.01\nlambda = 1\nr = 0.5\n";
    says(&parse(plant), &["neither of G"]);
    says(&parse(&format!("{plant}[excitation]\nG = 1\nE = 1")), &["both of G"]);
}

#[test]
fn an_argument_that_is_no_assignment_is_refused() {
    for argument in ["plant.r", "r=0.7", "plant.r=1\nx=2"] {
        assert!(argument.parse::<Override>().is_err(), "{argument}");
    }
}

#[test]
fn text_on_the_command_line_needs_no_quotes() {
    let scene = paper(&[
        "resonance.sensor=q1",
        "chain.adc_bits = none",
        "resonance.reference=\"force\"",
    ])
    .unwrap();
    assert_eq!(scene.resonance.sensor, Sensor::Q1);
    assert_eq!(scene.chain.adc_bits, None);
    assert_eq!(scene.resonance.reference, Reference::Force);
    for (argument, allowed) in [
        ("plant.r=0.7 m", "\"0.7 m\", expected a number"),
        ("plant.r=", "expected a number"),
        ("backbone.points=many", "expected a whole number from 0"),
        ("chain.hold=1", "expected true or false"),
        ("resonance.sensor=q3", "one of `v`, `q1`, `acceleration`"),
        ("resonance.sensor=1", "expected a word in quotes"),
    ] {
        says(&complaint(paper(&[argument])), &[argument, allowed]);
    }
}

#[test]
fn no_damping_no_loss_and_a_start_on_the_wall_are_accepted() {
    for settings in [
        &["plant.c=0"][..],
        &["plant.c=0", "plant.r=1", "excitation.G=0"],
        &["start.q2=0.01"],
        &["start.q2=-0.01"],
    ] {
        assert!(paper(settings).is_ok(), "{settings:?}");
    }
}

#[test]
fn levels_are_round_numbers() {
    let levels = paper(&["plant.b=1"]).unwrap().levels();
    assert_eq!(levels[..3], [0.7, 0.68, 0.66]);
}

#[test]
fn limits_follow_from_the_numbers_of_the_rig() {
    let scene = paper(&[]).unwrap();
    let (config, d) = (scene.controller_config(), scene.dimensionless());
    assert!((d.excitation(config.amplitude_max.unwrap()) - 4.0 * 1.1 * d.lambda).abs() < 1e-9);
    assert_eq!(config.response_max, Some(4.0 * d.b));
    assert!(config.acquire_timeout.is_some() && config.signal_timeout.is_some());
    let limited = paper(&["phase_lock.amplitude_max=2e-4"]).unwrap();
    let [own, tracking] = [limited.controller_config(), limited.backbone_config()];
    assert_eq!([own.amplitude_max, tracking.amplitude_max], [Some(2e-4); 2]);
    let tracking = scene.backbone_config().amplitude_max.unwrap();
    assert!((tracking - d.amplitude(4.0)).abs() < 1e-18);
}

#[test]
fn a_record_too_long_for_the_memory_counts_the_default_time_limit_of_the_lock() {
    let message = complaint(paper(&[
        "controller.samples_per_period=5000",
        "record.decay_periods=2000",
    ]));
    says(
        &message,
        &[
            "phase_lock.acquire_timeout and of all periods of [record]",
            "at most 20 million",
        ],
    );
}

// The settings of the controller: every parameter of its table has a key, and its options are absent, `false` or "none", never 0.

fn config(settings: &[String]) -> Result<Config, String> {
    let settings: Vec<&str> = settings.iter().map(String::as_str).collect();
    let scene = paper(&settings).map_err(|error| error.to_string())?;
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
            ("omega_start", _) => "56.0".into(),
            ("omega_min", _) => "0.8".into(),
            ("bandwidth", _) => "0.12".into(),
            ("amplitude", _) => "1.2".into(),
            ("acquire_timeout", _) => "2500".into(),
            ("lock.phase_tolerance", _) => "0.1".into(),
            ("lock.unlock_tolerance" | "lock.coherence_min" | "lock.response_min", _) => "0.3".into(),
            _ => "3.5".to_owned(),
        };
        let setting = key.map_or_else(|| format!("phase_lock.{name}={value}"), |key| format!("{key}={value}"));
        assert!(changed(&setting).contains(&name), "{setting}: {:?}", changed(&setting));
        let twice = config(&[format!("phase_lock.{name}={value}")]);
        assert_eq!(twice.is_err(), key.is_some(), "{name}: {twice:?}");
    }
    // Two parameters of one group are set one after the other.
    let group = [
        "phase_lock.lock.coherence_min=0.25",
        "phase_lock.lock.response_min=0.125",
    ];
    let config = config(&group.map(String::from)).unwrap();
    assert_eq!((config.lock.coherence_min, config.lock.response_min), (0.25, 0.125));
}

#[test]
fn an_option_of_the_controller_is_switched_off_by_none_or_false_and_not_by_zero() {
    for (key, name) in [
        ("phase_lock.response_max", "response_max"),
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
    let chain = |setting: &str| paper(&["chain.hold=true", setting]).map(|scene| scene.chain);
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
fn a_mistake_in_the_section_of_the_controller_names_the_parameter_and_what_is_allowed() {
    for (setting, words) in [
        (
            "phase_lock.amplitude_max=8e-5",
            [
                "excitation.G: amplitude = 9.",
                "amplitude_max is phase_lock.amplitude_max",
            ],
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
