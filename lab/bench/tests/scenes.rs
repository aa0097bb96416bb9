//! Scenes: their values, and the messages for mistakes.

use std::path::Path;

use vines_testbench::scene::{Override, Reference, Scene, SceneError, Sensor};

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
fn every_key_of_the_paper_file_has_its_default() {
    let scene = paper(&[]).unwrap();
    assert_eq!(scene.controller, vines_testbench::scene::ControllerSettings::default());
    assert_eq!(scene.record, vines_testbench::scene::RecordSettings::default());
}

#[test]
fn one_value_can_be_set() {
    let scene = paper(&["plant.r=0.7", "record.lock_periods=10", "start.dq2 = -0.4"]).unwrap();
    assert_eq!(scene.plant.restitution, 0.7);
    assert_eq!(scene.lock_periods(), 10.0);
    assert_eq!(scene.start.dq2, -0.4);
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
fn a_key_of_the_other_units_is_refused_with_advice() {
    says(
        &complaint(paper(&["plant.epsilon=0.01"])),
        &["--set plant.epsilon=0.01", "plant.m"],
    );
    let result = Scene::load(Some(&file("dimensionless.toml")), &set(&["plant.M=2"]));
    says(&complaint(result), &["--set plant.M=2", "plant.epsilon"]);
}

#[test]
fn an_unknown_key_is_named_with_those_allowed() {
    says(
        &complaint(paper(&["plant.mass=1"])),
        &["--set plant.mass=1", "`mass`", "`M`", "`r`"],
    );
    says(&complaint(paper(&["plants.r=1"])), &["`plants`", "`plant`", "`record`"]);
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
    use vines_testbench::scene::{Definition, Reference, Resonance, Sensor};
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
        (
            "controller.omega_start=2",
            ["controller.omega_start = 2 (omega0)", "omega_max = 1.1"],
        ),
        (
            "controller.omega_max=0.5",
            ["controller.omega_max = 0.5 (omega0)", "omega_min = 0.9"],
        ),
        (
            "record.decay_periods=-1",
            ["record.decay_periods = -1 (natural periods)", "must be positive"],
        ),
    ] {
        says(&complaint(paper(&[argument])), &parts);
    }
}

#[test]
fn a_start_on_the_wall_is_allowed() {
    assert!(paper(&["start.q2=0.01"]).is_ok() && paper(&["start.q2=-0.01"]).is_ok());
}

#[test]
fn missing_and_mixed_keys_are_reported() {
    let parse = |text| complaint(Scene::parse("my.toml", text, &[]));
    says(&parse(""), &["my.toml", "[plant] has no", "epsilon"]);
    says(&parse("[plant]\nM = 1\nr = 0.5"), &["[plant] has no `k`"]);
    says(&parse("[plant]\nM = 1\nepsilon = 0.5"), &["mixes"]);
    let plant = "[plant]\nepsilon = 0.01\nlambda = 1\nr = 0.5\n";
    says(&parse(plant), &["neither of G"]);
    says(&parse(&format!("{plant}[excitation]\nG = 1\nE = 1")), &["both of G"]);
}

#[test]
fn a_missing_file_is_named() {
    let result = Scene::load(Some(Path::new("nowhere/at-all.toml")), &[]);
    says(&complaint(result), &["nowhere/at-all.toml"]);
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
        ("resonance.sensor=1", "one of `v`, `q1`, `acceleration`"),
    ] {
        says(&complaint(paper(&[argument])), &[argument, allowed]);
    }
}

#[test]
fn a_scene_is_checked_completely_when_it_is_read() {
    for (settings, part) in [
        (&["phase_lock.harmonics=99"][..], "harmonics"),
        (&["controller.G_max=0.5"], "controller.G_max"),
        (&["start.dq2=1e300"], "= 1e300 m/s"),
    ] {
        says(&complaint(paper(settings)), &[part]);
    }
}

#[test]
fn a_plant_without_damping_is_accepted() {
    for settings in [&["plant.c=0"][..], &["plant.c=0", "plant.r=1", "excitation.G=0"]] {
        assert!(paper(settings).is_ok(), "{settings:?}");
    }
}

#[test]
fn levels_are_round_numbers() {
    let levels = paper(&["plant.b=1"]).unwrap().levels();
    assert_eq!(levels[..3], [0.7, 0.68, 0.66]);
}

#[test]
fn levels_and_limits_are_given_in_metres_instead() {
    let metres = ["backbone.A_from=0.0068", "backbone.E_max=2e-4", "controller.E_max=3e-4"];
    let scene = paper(&metres).unwrap();
    // The last level is that of the file, C = 0.14.
    assert_eq!((scene.levels()[0], scene.levels()[28]), (0.0068, 0.0014));
    assert_eq!(scene.controller_config().amplitude_max, Some(3e-4));
    assert_eq!(scene.backbone_config().amplitude_max, Some(2e-4));
    let set = complaint(paper(&["backbone.A_to=0.001", "backbone.C_to=0.1"]));
    says(&set, &["backbone.C_to is set as well"]);
    let text = "[plant]\nepsilon = 0.01\nlambda = 1.0\nr = 0.65\n[excitation]\nG = 1.0\n";
    for (section, keys) in [
        ("[backbone]\nC_from = 0.7\nA_from = 0.7\n", "both C_from and A_from"),
        ("[backbone]\nG_max = 4.0\nE_max = 0.04\n", "both G_max and E_max"),
        ("[controller]\nG_max = 4.0\nE_max = 0.04\n", "both G_max and E_max"),
    ] {
        says(
            &complaint(Scene::parse("mine.toml", &format!("{text}{section}"), &[])),
            &[keys],
        );
    }
}

#[test]
fn limits_follow_from_the_numbers_of_the_rig() {
    let scene = paper(&[]).unwrap();
    let (config, d) = (scene.controller_config(), scene.dimensionless());
    assert!((d.excitation(config.amplitude_max.unwrap()) - 4.0 * 1.1 * d.lambda).abs() < 1e-9);
    assert_eq!(config.response_max, Some(4.0 * d.b));
    assert!(config.acquire_timeout.is_some() && config.signal_timeout.is_some());
}

#[test]
fn a_number_in_place_of_a_word_lists_the_words_of_a_scene_file() {
    for (section, words) in [
        ("[chain]\nsnr_of = 3", "`signal` or `range`"),
        ("[resonance]\nreference = 1.5", "`base` or `force`"),
        ("[resonance]\nsensor = true", "`v`, `q1`"),
    ] {
        let message = complaint(Scene::parse("mine.toml", section, &[]));
        says(&message, &["mine.toml", "line 2", words]);
    }
}

#[test]
fn a_record_too_long_for_the_memory_counts_the_default_time_limit_of_the_lock() {
    let message = complaint(paper(&[
        "controller.samples_per_period=5000",
        "record.decay_periods=2000",
    ]));
    says(
        &message,
        &["samples_per_period times all periods", "at most 20 million"],
    );
}
