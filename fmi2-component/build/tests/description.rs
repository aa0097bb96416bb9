//! Guards the build step: what it reads from a description, what it refuses, and what the GUID depends on.

use fmi2_component_build::{Error, describe, guid_of, source_of};

const TANK: &str = include_str!("../../example/modelDescription.xml");

#[track_caller]
fn change(from: &str, to: &str) -> String {
    assert!(TANK.contains(from), "no {from:?} in the description");
    TANK.replacen(from, to, 1)
}

#[track_caller]
fn refused(from: &str, to: &str, reason: &str) {
    let error = match source_of(&change(from, to)) {
        Ok(_) => panic!("{to:?} was accepted"),
        Err(Error::Description(source)) => source.to_string(),
        Err(error) => error.to_string(),
    };
    assert!(error.contains(reason), "{reason:?} is not in {error:?}");
}

/// The part of the table that tells of one variable.
fn entry(source: &str, name: &str) -> String {
    let start = source.find(&format!("name: {name:?}")).unwrap();
    let entry = &source[start..];
    let entry = &entry[..entry.find("},").unwrap()];
    entry
        .replace("::core::option::Option::", "")
        .replace("::fmi2_component::", "")
}

#[test]
fn every_attribute_that_the_table_holds_is_read() {
    let xml = change(
        r#"<Real unit="m2" start="2" min="0"/>"#,
        r#"<Real quantity="Area" unit="m2" displayUnit="m2" start="2e3" min="0.5" max="1e4" nominal="3" unbounded="false"/>"#,
    );
    let source = source_of(&xml).unwrap();
    let area = entry(&source, "area");
    for part in [
        "value_reference: 0,",
        "causality: Causality::Parameter,",
        "variability: Variability::Fixed,",
        "initial: Some(Initial::Exact),",
        "start: Some(2000.0),",
        "min: Some(0.5),",
        "max: Some(10000.0),",
        r#"unit: Some("m2"),"#,
        r#"description: "Area of the ground","#,
    ] {
        assert!(area.contains(part), "no {part:?} in {area}");
    }
    for (name, part) in [
        ("level", "initial: Some(Initial::Exact)"),
        ("inflow", "variability: Variability::Continuous"),
        ("inflow", "initial: None"),
        ("full", "variability: Variability::Discrete"),
        ("full", "initial: Some(Initial::Calculated)"),
        ("valve", "start: Some(true)"),
        ("label", r#"start: Some("A \"tank\"")"#),
    ] {
        let entry = entry(&source, name);
        assert!(entry.contains(part), "no {part:?} in {entry}");
    }
}

#[test]
fn a_declared_type_lends_what_a_variable_does_not_say() {
    let source = source_of(TANK).unwrap();
    let level = entry(&source, "level");
    assert!(level.contains(r#"unit: Some("m")"#) && level.contains("min: Some(0.0)"));
    refused(
        r#"declaredType="Length" start="1""#,
        r#"declaredType="Lenght" start="1""#,
        "Lenght",
    );
}

#[test]
fn an_enumeration_is_an_integer() {
    let xml = change(
        r#"<SimpleType name="Length">"#,
        r#"<SimpleType name="Fill"><Enumeration><Item name="part" value="1"/><Item name="full" value="2"/></Enumeration></SimpleType><SimpleType name="Length">"#,
    );
    let xml = xml.replace(r#"<Integer/>"#, r#"<Enumeration declaredType="Fill" max="2"/>"#);
    let source = source_of(&xml).unwrap();
    assert!(entry(&source, "overflows").contains("max: Some(2)"));
    assert!(source.contains("pub enum Integer {"));
}

#[test]
fn variants_are_named_as_their_variables() {
    let source = source_of(TANK).unwrap();
    for variant in ["\n    area,", "\n    der_level,"] {
        assert!(source.contains(variant));
    }
    refused(
        r#"name="height""#,
        r#"name="der.level""#,
        "would both be the Rust variant der_level",
    );
}

#[test]
fn an_unknown_type_or_value_of_an_attribute_is_refused() {
    refused("<Integer/>", "<Int/>", "overflows: it needs one of Real, Integer");
    refused(r#"initial="exact""#, r#"initial="exactly""#, "`approx`");
    refused(r#"causality="input""#, r#"causality="inputs""#, "calculatedParameter");
    refused(
        r#"start="2""#,
        r#"start="two""#,
        "start = \"two\" is not a finite value",
    );
    refused(r#"start="2""#, r#"start="inf""#, "finite");
}

#[test]
fn value_references_are_unique() {
    refused(
        r#"name="height" valueReference="1""#,
        r#"name="height" valueReference="0""#,
        "same valueReference 0",
    );
}

#[test]
fn a_derivative_has_a_state() {
    for state in ["0", "44"] {
        refused(
            r#"derivative="4""#,
            &format!("derivative=\"{state}\""),
            "Derivatives lists index 5",
        );
    }
}

#[test]
fn the_guid_follows_the_variables_and_not_the_words() {
    let guid = guid_of(TANK).unwrap();
    for (from, to) in [
        ("Area of the ground", "Ground area"),
        (r#"guid="derived""#, r#"guid="42""#),
        ("\n  <ModelVariables>", "<ModelVariables>"),
    ] {
        assert_eq!(guid_of(&change(from, to)).unwrap(), guid);
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
fn a_description_to_be_packed_has_the_derived_guid() {
    let packed = describe(TANK).unwrap();
    let guid = guid_of(TANK).unwrap();
    assert_eq!(packed, change(r#"guid="derived""#, &format!("guid=\"{guid}\"")));
    assert_eq!(guid_of(&packed).unwrap(), guid);
}

#[test]
fn a_guid_that_is_missing_or_not_the_only_one_cannot_be_replaced() {
    assert!(describe(&change(r#"guid="derived""#, "guid='derived'")).is_err());
    assert!(describe(&change("<CoSimulation", r#"<CoSimulation guid="derived""#)).is_err());
}
