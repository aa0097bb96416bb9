//! What the descriptions say of dependencies, against what changes when something is changed.
//!
//! One list serves both interfaces of the plant: a dependency that is declared is seen in one of them at least, and none
//! is seen that is not declared.

use std::collections::{BTreeMap, BTreeSet};

use fmi2_boundary::{Fmu, Interface, Master};
use fmi2_component::abi::EventInfo;
use fmi2_description::{Causality, FmiType, Initial, ScalarVariable, Unknown};

/// Unknowns and what they depend on, by place in the list of variables; with each dependency its kind.
type Structure = BTreeMap<(usize, usize), String>;

struct Description {
    /// The first is at index 1.
    variables: Vec<ScalarVariable>,
    outputs: Vec<usize>,
    derivatives: Vec<usize>,
    initial: Vec<usize>,
    declared: BTreeMap<&'static str, Structure>,
    parameters: Vec<usize>,
    inputs: Vec<usize>,
    /// Outputs whose start values are exact.
    starts: Vec<usize>,
}

fn read(xml: &str) -> Description {
    let fmi2_description::Description { variables, structure, .. } = fmi2_description::Description::parse(xml).unwrap();
    let places = |wanted: fn(&ScalarVariable) -> bool| -> Vec<usize> {
        let numbered = variables.iter().zip(1..);
        numbered.filter(|(v, _)| wanted(v)).map(|(_, i)| i).collect()
    };
    let indices = |unknowns: &[Unknown]| unknowns.iter().map(|unknown| unknown.index).collect();
    let declared = |unknowns: &[Unknown]| {
        let mut declared = Structure::new();
        for Unknown { index, dependencies, dependencies_kind } in unknowns {
            let words = |text: &Option<String>| -> Vec<String> {
                let words = text.as_deref().unwrap_or_default().split_whitespace();
                words.map(str::to_owned).collect()
            };
            let kinds = words(dependencies_kind).into_iter();
            let kinds = kinds.chain(std::iter::repeat("dependent".to_owned()));
            for (known, kind) in words(dependencies).into_iter().zip(kinds) {
                declared.insert((*index, known.parse().unwrap()), kind);
            }
        }
        declared
    };
    Description {
        outputs: indices(&structure.outputs),
        derivatives: indices(&structure.derivatives),
        initial: indices(&structure.initial_unknowns),
        declared: BTreeMap::from([
            ("Outputs", declared(&structure.outputs)),
            ("Derivatives", declared(&structure.derivatives)),
            ("InitialUnknowns", declared(&structure.initial_unknowns)),
        ]),
        parameters: places(|v| v.causality == Causality::Parameter),
        inputs: places(|v| v.causality == Causality::Input),
        starts: places(|v| v.causality == Causality::Output && v.initial == Some(Initial::Exact)),
        variables,
    }
}

impl Description {
    /// Type and value reference.
    fn variable(&self, place: usize) -> (FmiType, &u32) {
        let variable = &self.variables[place - 1];
        (variable.content().unwrap().0, &variable.value_reference)
    }

    fn start(&self, place: usize) -> f64 {
        let (_, content) = self.variables[place - 1].content().unwrap();
        let start = content.start.as_deref().unwrap();
        start.parse().unwrap_or(f64::from(u8::from(start == "true")))
    }

    fn get(&self, m: &Master, place: usize) -> f64 {
        let (kind, vr) = self.variable(place);
        let mut whole = 0;
        // SAFETY: one reference, one place; so below.
        match kind {
            FmiType::Real => return m.real(*vr),
            FmiType::Integer | FmiType::Enumeration => m.well(unsafe { (m.f.fmi2GetInteger)(m.c, vr, 1, &mut whole) }),
            _ => m.well(unsafe { (m.f.fmi2GetBoolean)(m.c, vr, 1, &mut whole) }),
        }
        f64::from(whole)
    }

    fn set(&self, m: &Master, place: usize, value: f64) {
        let (kind, vr) = self.variable(place);
        let whole = value as i32;
        m.well(match kind {
            FmiType::Real => m.set_real(*vr, value),
            FmiType::Integer | FmiType::Enumeration => unsafe { (m.f.fmi2SetInteger)(m.c, vr, 1, &whole) },
            _ => unsafe { (m.f.fmi2SetBoolean)(m.c, vr, 1, &whole) },
        });
    }

    /// How much each unknown changes, over the change of the known, where it changes at all.
    fn slopes(
        &self,
        m: &Master,
        unknowns: &[usize],
        known: usize,
        (value, change): (f64, f64),
        set: impl Fn(f64),
    ) -> BTreeMap<(usize, usize), f64> {
        let look = || unknowns.iter().map(|&u| self.get(m, u)).collect::<Vec<_>>();
        set(value + change);
        let after = look();
        set(value);
        let before = look();
        let pairs = unknowns.iter().zip(before.into_iter().zip(after));
        pairs
            .filter(|(_, (before, after))| before != after)
            .map(|(&u, (before, after))| ((u, known), (after - before) / change))
            .collect()
    }
}

/// Asserts that what was seen is what is declared.
#[track_caller]
fn compare(what: &str, seen: &BTreeSet<(usize, usize)>, declared: &Structure) {
    let declared: BTreeSet<_> = declared.keys().copied().collect();
    let missing: Vec<_> = seen.difference(&declared).collect();
    let idle: Vec<_> = declared.difference(seen).collect();
    assert!(missing.is_empty(), "{what}: not declared (unknown, known): {missing:?}");
    assert!(
        idle.is_empty(),
        "{what}: declared and never seen (unknown, known): {idle:?}"
    );
}

/// The first value references are M, k, c, m, b, r, e, E, omega, q1, der(q1), q2, der(q2): a rig with no two numbers alike,
/// and another one.
#[rustfmt::skip]
const RIGS: [[f64; 13]; 2] = [
    [2.0, 300.0, 7.5, 0.5, 0.2, 0.7, 0.013, 0.021, 12.0, -0.05, -0.3, 0.02, 0.4],
    [1.3, 170.0, 2.5, 0.3, 0.3, 0.8, 0.017, 0.013, 14.0, 0.07, 0.2, -0.1, -0.2],
];
/// Tilt and kinetic friction.
const THETA: u32 = 35;
const MU_K: u32 = 36;
/// What makes a particle rest on its wall: it is there, and is pressed against it.
const AT_REST: [(u32, f64); 5] = [(4, 0.2), (9, -0.08), (10, 0.0), (11, -0.28), (12, 0.0)];

fn plant(interface: Interface, rig: &[f64; 13], stuck: bool) -> Master {
    let m = Master::new(&Fmu::plant(), interface);
    let rest = if stuck { &AT_REST[..] } else { &[] };
    for (vr, &value) in (0..).zip(rig).chain(rest.iter().map(|(vr, value)| (*vr, value))) {
        m.well(m.set_real(vr, value));
    }
    m.well(m.set_real(THETA, 0.1));
    m.well(m.set_real(MU_K, 0.2));
    m
}

#[test]
fn initial_unknowns_of_the_plant() {
    let d = read(Fmu::plant().description);
    let mut seen = BTreeSet::new();
    for interface in [Interface::CoSimulation, Interface::ModelExchange] {
        let m = plant(interface, &RIGS[0], false);
        m.enter_initialization();
        for &known in [&d.parameters[..], &d.inputs, &d.starts].concat().iter() {
            let value = d.get(&m, known);
            let set = |value| d.set(&m, known, value);
            seen.extend(d.slopes(&m, &d.initial, known, (value, 1e-3 * value), set).into_keys());
        }
    }
    compare("InitialUnknowns", &seen, &d.declared["InitialUnknowns"]);
}

/// In continuous-time mode, free and stuck, by inputs and by states.
fn exchanged(d: &Description, rig: &[f64; 13], stuck: bool) -> BTreeMap<(usize, usize), f64> {
    let m = plant(Interface::ModelExchange, rig, stuck);
    m.start();
    let mut x = [0.0; 5];
    // SAFETY: arrays of five.
    unsafe {
        m.well((m.f.fmi2NewDiscreteStates)(m.c, &mut EventInfo::default()));
        m.well((m.f.fmi2EnterContinuousTimeMode)(m.c));
        m.well((m.f.fmi2GetContinuousStates)(m.c, x.as_mut_ptr(), 5));
        x[4] = 0.7;
        m.well((m.f.fmi2SetContinuousStates)(m.c, x.as_ptr(), 5));
    }
    assert_eq!(d.get(&m, 22), f64::from(u8::from(stuck)), "contact");
    let unknowns = [&d.outputs[..], &d.derivatives].concat();
    let mut slopes = BTreeMap::new();
    for &known in &d.inputs {
        let value = d.get(&m, known);
        let set = |value| d.set(&m, known, value);
        slopes.extend(d.slopes(&m, &unknowns, known, (value, 1e-3 * value), set));
    }
    // The states in the order of the derivatives: q1, q2, u1, u2, phase.
    for (place, known) in [10, 12, 25, 27, 18].into_iter().enumerate() {
        let set = |value| {
            let mut x = x;
            x[place] = value;
            // SAFETY: an array of five.
            m.well(unsafe { (m.f.fmi2SetContinuousStates)(m.c, x.as_ptr(), 5) });
        };
        slopes.extend(d.slopes(&m, &unknowns, known, (x[place], 1e-3), set));
    }
    slopes
}

#[test]
fn outputs_and_derivatives_of_the_plant() {
    let d = read(Fmu::plant().description);
    let mut declared = d.declared["Outputs"].clone();
    declared.extend(d.declared["Derivatives"].clone());
    let mut seen = BTreeSet::new();
    let mut all = Vec::new();
    for rig in &RIGS {
        for stuck in [false, true] {
            let slopes = exchanged(&d, rig, stuck);
            seen.extend(slopes.keys().copied());
            all.push(slopes);
        }
    }
    compare("Outputs and Derivatives", &seen, &declared);
    // A constant factor is the same in every rig, a fixed one in every instant of one rig: 0 and 1, 2 and 3.
    for (pair, kind) in &declared {
        let alike: &[[usize; 2]] = match kind.as_str() {
            "constant" => &[[0, 1], [0, 2], [2, 3]],
            "fixed" => &[[0, 1], [2, 3]],
            _ => continue,
        };
        for &[one, other] in alike {
            let (one, other) = (all[one][pair], all[other][pair]);
            assert!((one - other).abs() < 1e-6, "{pair:?} is not {kind}: {one}, {other}");
        }
    }
}

#[test]
fn between_steps_velocities_of_the_plant_do_not_depend_on_its_inputs() {
    let d = read(Fmu::plant().description);
    let m = plant(Interface::CoSimulation, &RIGS[0], false);
    m.start();
    m.well(m.step(0.0, 0.05));
    let mut seen = BTreeSet::new();
    for &known in &d.inputs {
        let value = d.get(&m, known);
        let set = |value| d.set(&m, known, value);
        seen.extend(d.slopes(&m, &d.outputs, known, (value, 1e-3 * value), set).into_keys());
    }
    // base and energy by e and E, and nothing else: the kick of a jump of e comes with the next step.
    assert_eq!(seen, BTreeSet::from([(17, 7), (17, 8), (23, 7), (23, 8)]));
}

#[test]
fn unknowns_of_the_controller() {
    let d = read(Fmu::controller().description);
    let m = Master::new(&Fmu::controller(), Interface::CoSimulation);
    m.enter_initialization();
    let look = |unknowns: &[usize], knowns: &[usize]| {
        let mut seen = BTreeSet::new();
        for &known in knowns {
            let ((kind, _), value) = (d.variable(known), d.start(known));
            let change = match kind {
                FmiType::Real if value == 0.0 => 1e-2,
                // -1 is "none": the next value that is allowed.
                FmiType::Real if value == -1.0 => 2.0,
                FmiType::Real => 1e-3 * value.abs(),
                FmiType::Boolean => 1.0 - 2.0 * value,
                _ => 1.0,
            };
            let set = |value| d.set(&m, known, value);
            seen.extend(d.slopes(&m, unknowns, known, (value, change), set).into_keys());
        }
        seen
    };
    let knowns = [&d.parameters[..], &d.inputs].concat();
    let seen = look(&d.initial, &knowns);
    compare("InitialUnknowns", &seen, &d.declared["InitialUnknowns"]);
    // SAFETY: the instance is alive.
    m.well(unsafe { (m.f.fmi2ExitInitializationMode)(m.c) });
    m.well(m.step(0.0, 0.1));
    let seen = look(&d.outputs, &d.inputs);
    compare("Outputs", &seen, &d.declared["Outputs"]);
}
