//! Guards the build step: what it reads from a description, what it refuses, and what the GUID depends on.

use fmi2_component_build::{Error, describe, guid_of, source_of};

const TANK: &str = include_str!("../../example/modelDescription.xml");

#[track_caller]
fn change(from: &str, to: &str) -> String {
    assert!(TANK.contains(from), "no {from:?} in the description");
    TANK.replacen(from, to, 1)
}

/// Asserts that the table holds parts of entries: a line each, `variable | part`.
#[track_caller]
fn has(xml: &str, lines: &str) {
    let source = source_of(xml).unwrap();
    for line in lines.trim().lines() {
        let (name, part) = line.trim().split_once(" | ").unwrap();
        let entry = &source[source.find(&format!("name: {name:?}")).unwrap()..];
        let entry = entry[..entry.find("},").unwrap()].replace("::core::option::Option::", "");
        let entry = entry.replace("::fmi2_component::", "");
        assert!(entry.contains(part), "no {part:?} in {entry}");
    }
}

#[test]
fn every_attribute_that_the_table_holds_is_read_a_declared_type_lends_its_own_and_an_enumeration_is_an_integer() {
    let xml = change(
        r#"<Real unit="m2" start="2" min="0"/>"#,
        r#"<Real quantity="Area" unit="m2" displayUnit="m2" start="2e3" min="0.5" max="1e4" nominal="3" unbounded="false"/>"#,
    );
    has(
        &xml,
        r#"
        area | value_reference: 0,
        area | causality: Causality::Parameter,
        area | variability: Variability::Fixed,
        area | initial: Some(Initial::Exact),
        area | start: Some(2000.0),
        area | min: Some(0.5),
        area | max: Some(10000.0),
        area | unit: Some("m2"),
        area | description: "Area of the ground",
        level | initial: Some(Initial::Exact)
        level | unit: Some("m")
        level | min: Some(0.0)
        inflow | variability: Variability::Continuous
        inflow | initial: None
        full | variability: Variability::Discrete
        full | initial: Some(Initial::Calculated)
        valve | start: Some(true)
        label | start: Some("A \"tank\"")
        "#,
    );
    let types = r#"<SimpleType name="Fill"><Enumeration><Item name="part" value="1"/></Enumeration></SimpleType>"#;
    let xml = change("<TypeDefinitions>", &format!("<TypeDefinitions>{types}"));
    let xml = xml.replace(r#"<Integer/>"#, r#"<Enumeration declaredType="Fill" max="2"/>"#);
    has(&xml, "overflows | max: Some(2)");
    assert!(source_of(&xml).unwrap().contains("pub enum Integer {"));
}

#[test]
fn a_variant_is_named_as_its_variable() {
    for (name, variant) in [
        ("M", "M"),
        ("impact_time", "impact_time"),
        ("der(x[2],3)", "der_x_2_3"),
        ("rig.motor.speed", "rig_motor_speed"),
        ("loop", "loop_"),
        ("2nd", "_2nd"),
        ("_", "__"),
        ("'+'", "__"),
    ] {
        let source = source_of(&change(r#"name="height""#, &format!("name=\"{name}\""))).unwrap();
        for variant in [variant, "der_level"] {
            assert!(source.contains(&format!("\n    {variant},")), "{name}");
        }
    }
}

/// Text, what replaces it, and parts of the reason why that is refused.
const REFUSED: &str = r#"
<Integer/> | <Int/> | overflows: it needs one of Real, Integer
initial="exact" | initial="exactly" | `approx`
="input" | ="inputs" | ScalarVariable[2].@causality | `calculatedParameter`
valueReference="0" | valueReference="-1" | ScalarVariable[0].@valueReference | invalid digit
start="2" | start="two" | start = "two" is not a finite value
start="2" | start="inf" | finite
declaredType="Length" start="1" | declaredType="Lenght" start="1" | Lenght
name="height" | name="der.level" | would both be the Rust variant der_level
valueReference="1" | valueReference="0" | same valueReference 0
derivative="4" | derivative="0" | Derivatives lists index 5
derivative="4" | derivative="44" | Derivatives lists index 5
"#;

#[test]
fn what_is_unknown_missing_or_given_twice_is_refused_by_element() {
    for line in REFUSED.trim().lines() {
        let parts: Vec<_> = line.split(" | ").collect();
        let error = match source_of(&change(parts[0], parts[1])) {
            Ok(_) => panic!("{line} was accepted"),
            Err(Error::Description(source)) => source.to_string(),
            Err(error) => error.to_string(),
        };
        assert!(parts[2..].iter().all(|part| error.contains(part)), "{line}: {error}");
    }
    assert!(["level", "<a/>"].iter().all(|text| source_of(text).is_err()));
}

#[test]
fn the_guid_follows_the_variables_and_not_the_words_or_elements_of_other_tools() {
    let guid = guid_of(TANK).unwrap();
    for (from, to) in [
        ("Area of the ground", "Ground area"),
        (r#"guid="derived""#, r#"guid="42""#),
        ("\n  <ModelVariables>", "<ModelVariables>"),
    ] {
        assert_eq!(guid_of(&change(from, to)).unwrap(), guid);
    }
    let other = "<Annotations><Tool name=\"t\"><a b=\"1\">text</a></Tool></Annotations>";
    for place in ["<Real", "</ScalarVariable>", "<ModelVariables>"] {
        let xml = TANK.replace(place, &format!("{other}{place}"));
        assert_eq!(source_of(&xml).unwrap(), source_of(TANK).unwrap());
    }
    for (from, to) in [
        (r#"start="2""#, r#"start="3""#),
        (r#"unit="m2" start"#, r#"unit="m" start"#),
        (r#"name="area""#, r#"name="ground""#),
        (r#"modelName="Tank""#, r#"modelName="Pool""#),
        (r#"variability="tunable""#, r#"variability="fixed""#),
    ] {
        assert_ne!(guid_of(&change(from, to)).unwrap(), guid, "{to}");
    }
}

#[test]
fn a_description_to_be_packed_has_the_derived_guid_in_the_place_of_the_only_one() {
    let (packed, guid) = (describe(TANK).unwrap(), guid_of(TANK).unwrap());
    assert_eq!(packed, change(r#"guid="derived""#, &format!("guid=\"{guid}\"")));
    assert_eq!(guid_of(&packed).unwrap(), guid);
    assert!(describe(&change(r#"guid="derived""#, "guid='derived'")).is_err());
    assert!(describe(&change("<CoSimulation", r#"<CoSimulation guid="derived""#)).is_err());
}
