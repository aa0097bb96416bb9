//! Guards the values of scenes, the keys of the plant and of the controller's settings, and the messages for mistakes.

use phase_lock::{Config, NONE, PARAMETERS, Parameter, Range, Value};
use vines_bench::scene::{
    ControllerSettings, Definition, KEYS, Measurand, Override, RecordSettings, Reference, Scene, SceneError, Sensor,
    plant_keys,
};

use super::{paper, preset, says};

fn set(arguments: &[&str]) -> Vec<Override> {
    arguments.iter().map(|one| one.parse().unwrap()).collect()
}

/// The default scene with each of these settings is an error, which contains the parts behind the arrow.
fn refused(cases: &[&str]) {
    for case in cases {
        let (setting, parts) = case.split_once(" => ").unwrap();
        says(Scene::load(None, &set(&[setting])), parts);
    }
}

#[test]
fn the_default_scene_is_the_paper_file_and_a_dimensionless_one_its_own_model() {
    let scene = preset("dimensionless", &[]).unwrap();
    let numbers = scene.dimensionless();
    assert_eq!((numbers.omega0, numbers.b), (1.0, 1.0));
    assert_eq!((numbers.epsilon, scene.plant.damping), (0.0084, 0.0084 * 1.43));
    assert!((numbers.lambda - 1.43).abs() < 1e-14 && (numbers.g - 1.1).abs() < 1e-14);
    let embedded = paper(&[]);
    assert_eq!(embedded, preset("paper", &[]).unwrap());
    let numbers = embedded.dimensionless();
    assert!((numbers.epsilon - 0.0084).abs() < 1e-5, "{numbers:?}");
    assert!((numbers.lambda - 1.43).abs() < 5e-3, "{numbers:?}");
    assert!((numbers.g - 1.1).abs() < 1e-14, "{numbers:?}");
    assert_eq!(embedded.controller, ControllerSettings::default());
    assert_eq!(embedded.record, RecordSettings::default());
    assert_eq!(numbers.definition, Definition::default());
    assert_eq!(paper(&["plant.b=1"]).plan().levels[..3], [0.7, 0.68, 0.66]);
}

#[test]
fn settings_replace_values_and_what_makes_no_sense_is_named_with_unit_and_range() {
    assert_eq!(paper(&["excitation.E=1e-4"]).amplitude, 1e-4);
    let text = "[plant]\nepsilon = 0.01\nlambda = 1\nr = 0.65\n[excitation]\nE = 0.02";
    let scene = Scene::parse("s.toml", text, &set(&["excitation.G=1.5"])).unwrap();
    assert!((scene.dimensionless().g - 1.5).abs() < 1e-14);
    let both = Scene::load(None, &set(&["excitation.E=1e-4", "excitation.G=1"]));
    says(both, "excitation.G is set as well");
    for settings in [
        &["plant.c=0"][..],
        &["plant.c=0", "plant.r=1", "excitation.G=0"],
        &["start.q2=0.01"],
        &["start.q2=-0.01"],
    ] {
        paper(settings);
    }
    says(preset("dimensionless", &["plant.M=2"]), "mixes | epsilon, lambda");
    refused(&[
        "plant.epsilon=0.01 => mixes SI keys (M, k, c, m, b)",
        "plant.mass=1 => --set plant.mass=1 | `mass` | `M` | `r`",
        "plants.r=1 => `plants` | `plant` | `record`",
        "record.lock_periods=5 => `hold_periods`",
        "plant.M=0 => M (primary mass) = 0 kg | from 1e-100 to 1e100",
        "plant.k=-1 => k (stiffness) = -1 N/m | from 1e-100 to 1e100",
        "plant.m=nan => m (particle mass) = NaN kg | from 1e-100 to 1e100",
        "plant.b=inf => b (half-width of the cavity) = inf m | from 1e-100 to 1e100",
        "plant.c=-0.1 => c (damping) = -0.1 N | from 0 to 1e100",
        "plant.r=0 => r (coefficient of restitution) = 0 | at most 1",
        "plant.r=1.01 => r (coefficient of restitution) = 1.01 | at most 1",
        "start.q2=0.02 => q1 - q2 | -0.02 m",
        "start.q1=inf => q1 (displacement of the primary mass) = inf m | finite",
        "start.dq2=1e300 => der(q2) | = 1e300 m/s",
        "excitation.G=-1 => excitation.G = -1 (dimensionless) | zero or positive",
        "controller.omega_max=0.5 => controller.omega_max = 0.5 (omega0) | omega_min = 0.9",
        "controller.bandwidth=1e300 => controller.bandwidth = 1e300 (omega0) | at most 2.274",
        "record.decay_periods=-1 => record.decay_periods = -1 (natural periods) | must be positive",
        // A record too long for the memory, with the time limit of the lock.
        "record.hold_periods=2e5 => phase_lock.acquire_timeout and of all periods of [record] | at most 20 million",
        "chain.adc_bits=40 => chain.adc_bits | 40",
        "chain.dac_bits=12 => chain.dac_bits | chain.hold",
        "chain.filter=80.0 => chain.filter | 80",
        "chain.jitter=0.5 => chain.jitter | 0.5",
        "chain.snr=-100 => chain.snr | -100",
        "chain.response_noise=-1e-6 => chain.response_noise = -1e-6 m | zero or positive",
        "chain.response_noise=nan => chain.response_noise = NaN m | zero or positive",
        "chain.reference_noise=-1e-6 => chain.reference_noise = -1e-6 m | zero or positive",
        "chain.reference_noise=inf => chain.reference_noise = inf m | finite",
        "chain.response_range=0 => chain.response_range | 0",
        "phase_lock.omega_start=70 => phase_lock.omega_start | omega_max",
        "phase_lock.amplitude_max=8e-5 => phase_lock.amplitude_max = 8e-5 m: at least the drive of [excitation], 9.2461e-5 m",
        "phase_lock.amplitude_max=-2.0 => phase_lock.amplitude_max = -2 m, or N behind a force, is refused | above 0",
        "phase_lock.harmonics=99 => harmonics = 99 | 1 to 8",
        "phase_lock.harmonics=2.5 => harmonics is a float | 1 to 8",
        "phase_lock.nothing=1 => no parameter `nothing` | base_bandwidth",
        "phase_lock.omega_min=1.0 => phase_lock.omega_min | controller.omega_min",
        "phase_lock.base_bandwidth=99.0 => phase_lock.base_bandwidth: base_bandwidth = 99 rad/s | bandwidth is controller.bandwidth",
    ]);
}

/// Every rule that joins keys: a scene, the settings that break it, and parts of the message. Of two that are broken the upper one in the list of ranges is
/// reported, and ranges before rules.
const RULES: &str = r#"
paper: chain.adc_bits=12 chain.base_range=1.0 => chain.base_range = 1 (over b epsilon) | at least G = 1.1
paper: resonance.reference=force chain.reference=false => switch it on
paper: resonance.reference=force resonance.reference_quantity=velocity => take the reference "base"
paper: resonance.sensor_quantity=velocity => which no sensor on the structure reads | set resonance.sensor
paper: chain.reference=false resonance.reference_quantity=velocity => no sensor reads the base
paper: resonance.sensor=q1 resonance.sensor_quantity=acceleration chain.response_noise=-1 => chain.response_noise = -1 m/s² | zero or positive
paper: resonance.reference=force chain.reference_noise=-1 => chain.reference_noise = -1 N | zero or positive
paper: chain.reference=false chain.reference_noise=1e-6 => chain.reference_noise | no sensor reads the reference
paper: chain.jitter=1 backbone.precision=0 resonance.sensor_quantity=velocity => backbone.precision = 0
cantilever: resonance.reference=force => drop the key
cantilever: start.dq2=1e200 => 1e200
cantilever: plant.m=1e-12 => at a node of the driven mode
shaker-oscillator: chain.reference=false => needs the force cell
shaker-oscillator: excitation.G=1000 => lower the drive
shaker-oscillator: resonance.reference_quantity=velocity => drop the key
"#;

#[test]
fn keys_that_contradict_each_other_are_refused_and_without_the_last_of_them_a_scene_is_accepted() {
    for line in RULES.trim().lines() {
        let (rule, parts) = line.split_once(" => ").unwrap();
        let (scene, settings) = rule.split_once(": ").unwrap();
        let settings: Vec<&str> = settings.split(' ').collect();
        let message = says(preset(scene, &settings), parts);
        let is_range = message.starts_with("backbone.precision");
        let without = preset(scene, &settings[..settings.len() - 1]);
        assert!(is_range || without.is_ok(), "{rule}");
    }
}

#[test]
fn a_mistake_in_a_file_is_reported_with_its_line_and_missing_and_mixed_keys_with_those_needed() {
    says(preset("nowhere/at-all", &[]), "nowhere/at-all.toml");
    let plant = "[plant]\nepsilon = 0.01\nlambda = 1\nr = 0.5\n";
    let both = format!("{plant}[excitation]\nG = 1\nE = 1");
    for (text, parts) in [
        ("[plant]\nM = 1\nkk = 2\n", "my.toml | line 3 | `kk` | `k`"),
        ("[plant]\nM = \"heavy\"\n", "my.toml | line 2 | heavy"),
        ("", "my.toml | [plant] has no | epsilon"),
        ("[plant]\nM = 1\nr = 0.5", "[plant] has no `k`"),
        ("[plant]\nM = 1\nepsilon = 0.5", "mixes"),
        (plant, "[excitation] has no key"),
        (&both, "[excitation] has G and E | give either G"),
    ] {
        says(Scene::parse("my.toml", text, &[]), parts);
    }
}

#[test]
fn text_on_the_command_line_needs_no_quotes_and_what_is_no_assignment_is_refused() {
    let sensors = ["resonance.sensor=q1", "resonance.sensor_quantity=acceleration"];
    let scene = paper(
        &[
            &sensors[..],
            &["resonance.reference=\"force\"", "chain.adc_bits = none"],
        ]
        .concat(),
    );
    let Definition { reference, sensor, sensor_quantity, .. } = scene.dimensionless().definition;
    let found = (reference, sensor, sensor_quantity, scene.chain.adc_bits);
    assert_eq!(found, (Reference::Force, Sensor::Q1, Measurand::Acceleration, None));
    refused(&[
        "plant.r=0.7 m => plant.r=0.7 m | \"0.7 m\", expected a number",
        "plant.r= => plant.r= | expected a number",
        "backbone.points=many => backbone.points=many | expected a whole number from 0",
        "chain.hold=1 => chain.hold=1 | expected true or false",
        "resonance.sensor=q3 => resonance.sensor=q3 | `q3` | `v` or `q1`",
        "resonance.sensor_quantity=jerk => `jerk` | `displacement`, `velocity`, `acceleration`",
        "resonance.sensor=1 => resonance.sensor=1 | expected a word in quotes",
    ]);
    for argument in ["plant.r", "r=0.7", "plant.r=1\nx=2"] {
        assert!(argument.parse::<Override>().is_err(), "{argument}");
    }
}

#[test]
fn names_have_units_or_factors_and_mistakes_are_named() {
    let names = "rig.names={ response = 'y', base = { name = 'x', unit = 'mm' }, E = { name = 'A', factor = -0.5 } }";
    let names = paper(&[names]).rig_names;
    let found = ["response", "base", "E", "omega"].map(|ours| names.of(ours));
    assert_eq!(found.each_ref().map(|one| one.factor), [1.0, 1e-3, -0.5, 1.0]);
    assert_eq!(found.each_ref().map(|one| &*one.name), ["y", "x", "A", "omega"]);
    assert_eq!(names.unknown(&["response", "base"]), Some("E"));
    refused(&[
        "rig.names.a={ name = 'x', unit = 'furlong' } => unknown",
        "rig.names.a={ name = 'x', unit = 'm', factor = 2 } => not both",
        "rig.names.a={ name = 'x', factor = 0.0 } => other than 0",
    ]);
}

// The settings of the controller: every parameter of its table has a key, and its options are absent, `false` or "none", never 0.

#[test]
fn limits_follow_from_the_numbers_of_the_rig() {
    let scene = paper(&[]);
    let (config, d) = (scene.plan().lock, scene.dimensionless());
    assert!((d.excitation(config.amplitude_max.unwrap()) - 4.0 * 1.1 * d.lambda).abs() < 1e-9);
    assert_eq!(config.response_max, Some(4.0 * d.b));
    assert!(config.acquire_timeout.is_some() && config.signal_timeout.is_some());
    let tracking = scene.plan().tracking.amplitude_max.unwrap();
    assert!((tracking - d.amplitude(4.0)).abs() < 1e-18);
    // Below and above what a tracked backbone may use without a limit.
    for limit in [2e-4, 5e-4] {
        let limited = paper(&[&format!("phase_lock.amplitude_max={limit}")]);
        let both = [limited.plan().lock, limited.plan().tracking];
        assert_eq!(both.map(|config| config.amplitude_max), [Some(limit); 2]);
    }
}

fn config(setting: &str) -> Result<Config, SceneError> {
    Ok(Scene::load(None, &set(&[setting]))?.plan().lock)
}

#[test]
fn every_parameter_of_the_controller_has_exactly_one_key_of_the_scene() {
    let before = paper(&[]).plan().lock;
    for parameter in &PARAMETERS {
        let name = parameter.name;
        let key = KEYS.iter().find(|(parameter, ..)| *parameter == name);
        let value = match (name, parameter.get(&before)) {
            ("reference_connected", _) => "false".into(),
            ("phase_target", _) => "-80.0".into(),
            ("detector", _) => "2".into(),
            (_, Value::Boolean(one)) => (!one).to_string(),
            (_, Value::Integer(_)) => "5".into(),
            ("sample_time", _) => "120.0".into(),
            ("omega_max" | "amplitude", _) => "1.2".into(),
            ("omega_start", _) => "56.0".into(),
            ("omega_min", _) => "0.8".into(),
            ("bandwidth" | "delay" | "lock.phase_tolerance", _) => "0.12".into(),
            ("acquire_timeout", _) => "2500".into(),
            ("lock.unlock_tolerance" | "lock.coherence_min" | "lock.response_min", _) => "0.3".into(),
            _ => "3.5".to_owned(),
        };
        let own = format!("phase_lock.{name}={value}");
        let setting = key.map_or_else(|| own.clone(), |(_, key, _)| format!("{key}={value}"));
        let after = config(&setting).unwrap();
        assert_ne!(parameter.get(&after), parameter.get(&before), "{setting}");
        assert_eq!(config(&own).is_err(), key.is_some(), "{own}");
    }
    // Two parameters of one group are set one after the other.
    let group = [
        "phase_lock.lock.coherence_min=0.25",
        "phase_lock.lock.response_min=0.125",
    ];
    let lock = paper(&group).plan().lock.lock;
    assert_eq!((lock.coherence_min, lock.response_min), (0.25, 0.125));
}

#[test]
fn an_option_is_switched_off_by_none_or_false_and_not_by_zero() {
    for name in ["response_max", "base_bandwidth", "damping_rate"] {
        let parameter = Parameter::find(name).unwrap();
        assert_eq!(parameter.range, Range::Optional);
        let key = format!("phase_lock.{name}");
        for off in ["'none'", "false"] {
            let config = config(&format!("{key}={off}")).unwrap();
            assert_eq!(parameter.get(&config), Value::Real(NONE), "{key}={off}");
        }
        for wrong in ["0", "true", "'off'"] {
            refused(&[&format!("{key}={wrong} => {name}")]);
        }
    }
    let chain = |setting: &str| Ok::<_, SceneError>(Scene::load(None, &set(&["chain.hold=true", setting]))?.chain);
    for (key, on) in [
        ("adc_bits", 12),
        ("dac_bits", 12),
        ("filter", 10),
        ("snr", 40),
        ("response_noise", 1),
        ("reference_noise", 1),
    ] {
        let with = chain(&format!("chain.{key}={on}.0").replace("12.0", "12")).unwrap();
        for off in ["'none'", "false"] {
            let without = chain(&format!("chain.{key}={off}")).unwrap();
            assert!(without != with && without == chain("chain.delay=0").unwrap());
        }
        // 0 dB is a ratio, and a sensor may have no noise; 0 bits or a cut-off of 0 are none.
        let zero = chain(&format!("chain.{key}=0"));
        let is_number = ["snr", "response_noise", "reference_noise"].contains(&key);
        assert_eq!(zero.is_ok(), is_number, "{key}");
    }
}

// A real cavity.

#[test]
fn every_effect_of_a_cavity_has_a_key_that_the_plant_checks_and_settings_repeat() {
    let settings = "b_plus=0.011 b_minus=0.009 theta=0.1 mu_k=0.05 mu_s=0.07 r_law=plastic r_plus=0.2 r_minus=0.3 r_min=0.1 r_scatter=0.02";
    let settings: Vec<String> = settings.split(' ').map(|one| format!("plant.{one}")).collect();
    let settings: Vec<&str> = settings.iter().map(|one| &**one).chain(["plant.seed=7"]).collect();
    let scene = paper(&settings);
    let written = serde_json::to_value(&scene).unwrap()["plant"].clone();
    for setting in &settings {
        let (key, value) = setting["plant.".len()..].split_once('=').unwrap();
        assert_eq!(written[key].to_string().trim_matches('"'), value, "{key}");
    }
    // What is written is a scene again, and what an FMU gets has the same names.
    let plant = plant_keys(&scene.plant).into_iter();
    let plant: String = plant.map(|(key, value)| format!("{key} = {value}\n")).collect();
    let again = Scene::parse("again.toml", &format!("[plant]\n{plant}[excitation]\nG = 1.1\n"), &[]);
    assert_eq!(again.unwrap().plant, scene.plant);
    let names: Vec<&str> = scene.start_values().iter().map(|(name, _)| *name).collect();
    for name in written.as_object().unwrap().keys() {
        assert!(names.contains(&name.as_str()), "{name}");
    }
    for (setting, allowed) in [
        ("plant.b_plus=-1", "1e-100"),
        ("plant.theta=2", "pi/2"),
        ("plant.mu_k=-0.1", "0 to 100"),
        ("plant.mu_s=0.01", "mu_k"),
        ("plant.r_law=rubber", "viscoelastic"),
        ("plant.r_plus=0", "from 1e-100"),
        ("plant.r_min=2", "0 to 1"),
        ("plant.r_scatter=-1", "0 to 1"),
        ("plant.seed=-1", "whole number"),
    ] {
        // All but the seed.
        let all = set(&[&settings[..10], &[setting]].concat());
        says(Scene::load(None, &all), allowed);
    }
    refused(&["plant.r_law=plastic => give r_plus"]);
}

#[test]
fn what_theory_leaves_out_of_a_cavity_is_named_and_of_an_ideal_one_it_is_nothing() {
    let ideal = paper(&["plant.mu_k=0", "plant.theta=0"]);
    assert_eq!(ideal, paper(&[]));
    let written = serde_json::to_value(&ideal).unwrap();
    assert_eq!(written["plant"].as_object().unwrap().len(), 6);
    assert_eq!((ideal.left_out(), ideal.knowledge().is_symmetric), (None, true));
    let several = "plant.mu_k=0.05 plant.theta=0.1 plant.b_plus=0.011";
    for (settings, named) in [
        ("plant.mu_k=0.05", "friction"),
        (several, "friction, the gaps b_plus and b_minus and tilt"),
        (
            "plant.r_minus=0.7",
            "the restitution of r_law, r_plus, r_minus and r_min",
        ),
        ("plant.r_scatter=0.01", "the scatter of the restitution"),
    ] {
        let settings: Vec<&str> = settings.split(' ').collect();
        assert_eq!(paper(&settings).left_out().unwrap(), named);
    }
    assert!(!paper(&["plant.r_minus=0.7"]).knowledge().is_symmetric);
}
