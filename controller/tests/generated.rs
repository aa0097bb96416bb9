//! The parity of the C interface and of the FMU's `modelDescription.xml` with the core: types, settings, inputs, outputs and operations.
//! (Here and not in `capi/`, which compiles only with a field for every setting.)

use std::collections::BTreeSet;
use std::path::Path;

use fmi2_description::{Causality, Description};
use phase_lock::{INPUTS, MOVE, OUTPUTS, PARAMETERS, Parameter};

/// The members of a type in a source, each with its description.
fn members(text: &str, kind: &str) -> Vec<(String, String)> {
    let (_, rest) = text.split_once(&format!("pub {kind} {{\n")).unwrap();
    let (body, _) = rest.split_once("\n}\n").unwrap();
    let (mut members, mut about) = (Vec::new(), Vec::new());
    for line in body.lines().map(str::trim) {
        if let Some(words) = line.strip_prefix("/// ") {
            about.push(words);
        } else if line.ends_with(',') {
            let name = line.trim_start_matches("pub ").split([':', ' ', ',']).next().unwrap();
            members.push((name.to_owned(), in_c(&std::mem::take(&mut about).join(" "))));
        }
    }
    members
}

/// The words of a description, for C.
fn in_c(text: &str) -> String {
    let text = text
        .replace(". `None`", ". Not present")
        .replace("`None`", "not present");
    text.replace("[`", "").replace("`]", "").replace('`', "")
}

/// The settings, each with its description; the unit follows the name of the quantity, before its explanation.
fn settings() -> Vec<(String, String)> {
    let row = |parameter: &Parameter| {
        let description = parameter.description();
        let (quantity, rest) = description.split_at(description.find([';', ':']).unwrap_or(description.len() - 1));
        let unit = if parameter.unit.is_empty() { "" } else { ", " };
        let name = parameter.name.trim_start_matches("lock.").to_owned();
        (name, format!("{quantity}{unit}{}{rest}", parameter.unit))
    };
    PARAMETERS.iter().map(row).collect()
}

#[test]
fn types_of_c_have_the_members_of_the_core_and_their_descriptions() {
    let [signals, supervisor, amplitude_loop] = [
        include_str!("../src/signals.rs"),
        include_str!("../src/supervisor.rs"),
        include_str!("../src/amplitude_loop.rs"),
    ];
    let mut faults = members(supervisor, "enum Fault");
    faults.insert(0, ("None".into(), "No fault.".into()));
    for (name, expected) in [
        ("struct PhaseLockInput", members(signals, "struct Input")),
        ("struct PhaseLockOutput", members(signals, "struct Output")),
        ("struct PhaseLockMove", members(amplitude_loop, "struct Move")),
        ("enum PhaseLockStage", members(supervisor, "enum LoopState")),
        ("enum PhaseLockFault", faults),
        ("struct PhaseLockConfig", settings()),
    ] {
        assert_eq!(members(include_str!("../capi/src/types.rs"), name), expected, "{name}");
    }
}

#[test]
fn the_header_of_c_follows_from_the_sources() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("capi");
    let config = cbindgen::Config::from_file(folder.join("cbindgen.toml")).unwrap();
    let builder = cbindgen::Builder::new().with_config(config);
    let builder = builder.with_src(folder.join("src/lib.rs"));
    let mut header = Vec::new();
    builder.generate().unwrap().write(&mut header);
    if std::env::var_os("UPDATE").is_some() {
        std::fs::write(folder.join("include/phase_lock.h"), &header).unwrap();
    }
    assert!(
        String::from_utf8(header).unwrap() == HEADER,
        "phase_lock.h is out of date: run this test with UPDATE=1"
    );
}

const DESCRIPTION: &str = include_str!("../modelDescription.xml");
const HEADER: &str = include_str!("../capi/include/phase_lock.h");

#[test]
fn inputs_and_outputs_of_the_fmu_are_those_of_the_core() {
    let description = Description::parse(DESCRIPTION).unwrap();
    // The unit of a number is 1.
    let pair = |name: &str, unit: &str| (name.to_owned(), unit.trim_end_matches('1').to_owned());
    let described = |causality| -> BTreeSet<_> {
        let variables = description.variables.iter().filter(|v| v.causality == causality);
        let unit = |v: &fmi2_description::ScalarVariable| v.content().unwrap().1.unit.clone().unwrap_or_default();
        variables.map(|v| pair(&v.name, &unit(v))).collect()
    };
    let inputs = INPUTS.iter().map(|(name, unit)| pair(name, unit));
    let moves = MOVE.iter().map(|(name, unit)| pair(&format!("move.{name}"), unit));
    let expected: BTreeSet<_> = inputs.chain(moves).chain([pair("hold_response", "")]).collect();
    assert_eq!(described(Causality::Input), expected);
    let values = OUTPUTS.iter().map(|signal| pair(signal.name, signal.unit));
    let flags = OUTPUTS.iter().filter_map(|signal| signal.present);
    let expected: BTreeSet<_> = values.chain(flags.map(|name| pair(name, ""))).collect();
    assert_eq!(described(Causality::Output), expected);
}

#[test]
fn the_c_interface_has_every_operation_of_the_core() {
    let core = include_str!("../src/controller.rs");
    let public = core.split("pub fn ").skip(1).filter_map(|rest| rest.split('(').next());
    // The configuration and what follows from it are in the hands of the caller; the output before the first sample is all zeros.
    for name in public.filter(|name| !["build", "config", "gains", "idle"].contains(name)) {
        let in_c = match name {
            "start" => "reset",
            "process" => "sample",
            name => name,
        };
        assert!(HEADER.contains(&format!("int phase_lock_{in_c}(")), "{name}");
    }
}
