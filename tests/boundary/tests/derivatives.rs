//! Guards partial derivatives, time derivatives and declared dependencies against difference quotients.
//!
//! One list of dependencies serves both interfaces of the plant: a dependency that is declared shows in one of them at least, and none
//! shows that is not declared.

use std::collections::{BTreeMap, BTreeSet};

use fmi2_boundary::{Fmu, Interface, Master, call};
use fmi2_component::Status;
use fmi2_component::abi::EventInfo;
use fmi2_description::{Causality, Description, FmiType, Initial, ModelStructure, ScalarVariable, Unknown};

/// An unknown and a known, by place in the list of variables, which begins at 1.
type Pair = (usize, usize);

/// The first value references are M, k, c, m, b, r, e, E, omega, q1, der(q1), q2, der(q2): a rig with no two numbers alike,
/// and another one.
#[rustfmt::skip]
const RIGS: [[f64; 13]; 2] = [
    [2.0, 300.0, 7.5, 0.5, 0.2, 0.7, 0.013, 0.021, 12.0, -0.05, -0.3, 0.02, 0.4],
    [1.3, 170.0, 2.5, 0.3, 0.3, 0.8, 0.017, 0.013, 14.0, 0.07, 0.2, -0.1, -0.2],
];
/// Tilt and kinetic friction.
const FRICTION: [(u32, f64); 2] = [(35, 0.1), (36, 0.2)];
/// What makes a particle rest on its wall: it is there, and is pressed against it.
const AT_REST: [(u32, f64); 5] = [(4, 0.2), (9, -0.08), (10, 0.0), (11, -0.28), (12, 0.0)];

fn plant(interface: Interface, rig: &[f64; 13], stuck: bool) -> Master {
    let rest = if stuck { &AT_REST[..] } else { &[] };
    let rig = (0..).zip(rig.iter().copied());
    let values: Vec<_> = rig.chain(rest.iter().copied()).chain(FRICTION).collect();
    let m = Master::with(&Fmu::plant(), interface, &values);
    m.enter_initialization();
    m
}

fn leave_initialization(m: &Master) {
    m.well(call!(m.fmi2ExitInitializationMode()));
}

/// The change of an unknown over the change of a known.
fn partial(m: &Master, unknown: u32, known: u32) -> (Status, f64) {
    let mut slope = f64::NAN;
    let status = call!(m.fmi2GetDirectionalDerivative(&unknown, 1, &known, 1, &2.0, &mut slope));
    (status, slope / 2.0)
}

struct Model(Description);

impl Model {
    fn of(fmu: &Fmu) -> Self {
        Self(Description::parse(fmu.description).unwrap())
    }

    fn variable(&self, place: usize) -> &ScalarVariable {
        &self.0.variables[place - 1]
    }

    fn kind(&self, place: usize) -> FmiType {
        self.variable(place).content().unwrap().0
    }

    fn places(&self, wanted: fn(&ScalarVariable) -> bool) -> Vec<usize> {
        let places = 1..=self.0.variables.len();
        places.filter(|place| wanted(self.variable(*place))).collect()
    }

    /// Parameters and inputs, and outputs with start values.
    fn knowns(&self) -> Vec<usize> {
        self.places(|v| {
            let start = v.causality == Causality::Output && v.initial == Some(Initial::Exact);
            start || matches!(v.causality, Causality::Parameter | Causality::Input)
        })
    }

    fn inputs(&self) -> Vec<usize> {
        self.places(|v| v.causality == Causality::Input)
    }

    fn unknowns(&self, of: fn(&ModelStructure) -> &Vec<Unknown>) -> Vec<usize> {
        of(&self.0.structure).iter().map(|unknown| unknown.index).collect()
    }

    /// Declared dependencies with their kinds.
    fn declared(&self, of: fn(&ModelStructure) -> &Vec<Unknown>) -> BTreeMap<Pair, String> {
        let mut declared = BTreeMap::new();
        for Unknown { index, dependencies, dependencies_kind } in of(&self.0.structure) {
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
    }

    fn get(&self, m: &Master, place: usize) -> f64 {
        let (vr, mut whole) = (self.variable(place).value_reference, 0);
        match self.kind(place) {
            FmiType::Real => m.real(vr),
            FmiType::Boolean => {
                m.well(call!(m.fmi2GetBoolean(&vr, 1, &mut whole)));
                f64::from(whole)
            }
            _ => f64::from(m.integer(vr)),
        }
    }

    fn set(&self, m: &Master, place: usize, value: f64) {
        let (vr, whole) = (self.variable(place).value_reference, value as i32);
        m.well(match self.kind(place) {
            FmiType::Real => m.set_real(vr, value),
            FmiType::Boolean => call!(m.fmi2SetBoolean(&vr, 1, &whole)),
            _ => m.set_integer(vr, whole),
        });
    }

    /// The change of each unknown over the change of a known, where it changes at all.
    fn slopes(
        &self,
        m: &Master,
        unknowns: &[usize],
        known: usize,
        at: [f64; 2],
        set: impl Fn(f64),
    ) -> BTreeMap<Pair, f64> {
        let [before, after] = at.map(|value| {
            set(value);
            unknowns.iter().map(|&u| self.get(m, u)).collect::<Vec<_>>()
        });
        let changes = unknowns.iter().zip(before.into_iter().zip(after));
        let changes = changes.filter(|(_, (before, after))| before != after);
        changes
            .map(|(&u, (before, after))| ((u, known), (after - before) / (at[1] - at[0])))
            .collect()
    }

    /// The slopes around the present value of a known of type Real, against the partial derivatives of the FMU.
    fn compared(&self, m: &Master, unknowns: &[usize], known: usize, set: impl Fn(f64)) -> BTreeMap<Pair, f64> {
        let value = self.get(m, known);
        if self.kind(known) != FmiType::Real || value == 0.0 {
            return BTreeMap::new();
        }
        let h = 1e-6 * value.abs().max(0.01);
        let slopes = self.slopes(m, unknowns, known, [value - h, value + h], &set);
        set(value);
        for &unknown in unknowns.iter().filter(|&&unknown| self.kind(unknown) == FmiType::Real) {
            let quotient = slopes.get(&(unknown, known)).copied().unwrap_or(0.0);
            let [unknown, known] = [unknown, known].map(|place| self.variable(place).value_reference);
            let (status, derivative) = partial(m, unknown, known);
            m.well(status);
            let error = (derivative - quotient).abs() / (1.0 + quotient.abs());
            assert!(error < 1e-7, "{unknown} by {known}: {derivative} is not {quotient}");
        }
        slopes
    }
}

/// Asserts that what was seen is what is declared.
#[track_caller]
fn compare(seen: &BTreeSet<Pair>, declared: &BTreeMap<Pair, String>) {
    let declared: BTreeSet<_> = declared.keys().copied().collect();
    let missing: Vec<_> = seen.difference(&declared).collect();
    let idle: Vec<_> = declared.difference(seen).collect();
    assert!(missing.is_empty(), "not declared (unknown, known): {missing:?}");
    assert!(idle.is_empty(), "declared and never seen (unknown, known): {idle:?}");
}

#[test]
fn initial_unknowns_of_the_plant() {
    let d = Model::of(&Fmu::plant());
    let initial = d.unknowns(|s| &s.initial_unknowns);
    let mut seen = BTreeSet::new();
    for interface in [Interface::CoSimulation, Interface::ModelExchange] {
        let m = plant(interface, &RIGS[0], false);
        for known in d.knowns() {
            seen.extend(
                d.compared(&m, &initial, known, |value| d.set(&m, known, value))
                    .into_keys(),
            );
        }
    }
    compare(&seen, &d.declared(|s| &s.initial_unknowns));
}

/// In continuous-time mode, free or stuck, by inputs and by states.
fn exchanged(d: &Model, rig: &[f64; 13], stuck: bool) -> BTreeMap<Pair, f64> {
    let m = plant(Interface::ModelExchange, rig, stuck);
    leave_initialization(&m);
    let mut x = [0.0; 5];
    m.well(call!(m.fmi2NewDiscreteStates(&mut EventInfo::default())));
    m.well(call!(m.fmi2EnterContinuousTimeMode()));
    m.well(call!(m.fmi2GetContinuousStates(x.as_mut_ptr(), 5)));
    // Some way on: the energy lost to friction grows with the distance since the last event.
    x[0] += if stuck {
        0.0
    } else {
        1e-3 * (m.real(10) - m.real(12)).signum()
    };
    x[4] = 0.7;
    m.well(call!(m.fmi2SetContinuousStates(x.as_ptr(), 5)));
    assert_eq!(d.get(&m, 22), f64::from(u8::from(stuck)), "contact");
    let unknowns = [d.unknowns(|s| &s.outputs), d.unknowns(|s| &s.derivatives)].concat();
    let mut slopes = BTreeMap::new();
    for known in d.inputs() {
        slopes.extend(d.compared(&m, &unknowns, known, |value| d.set(&m, known, value)));
    }
    // The states in the order of the derivatives: q1, q2, u1, u2, phase.
    for (place, known) in [10, 12, 25, 27, 18].into_iter().enumerate() {
        let set = |value| {
            let mut x = x;
            x[place] = value;
            m.well(call!(m.fmi2SetContinuousStates(x.as_ptr(), 5)));
        };
        if stuck {
            let at = [x[place], x[place] + 1e-3];
            slopes.extend(d.slopes(&m, &unknowns, known, at, set));
            set(x[place]);
        } else {
            slopes.extend(d.compared(&m, &unknowns, known, set));
        }
    }
    slopes
}

#[test]
fn outputs_and_derivatives_of_the_plant() {
    let d = Model::of(&Fmu::plant());
    let mut declared = d.declared(|s| &s.outputs);
    declared.extend(d.declared(|s| &s.derivatives));
    let all: Vec<_> = RIGS
        .iter()
        .flat_map(|rig| [false, true].map(|stuck| exchanged(&d, rig, stuck)))
        .collect();
    compare(
        &all.iter().flat_map(|slopes| slopes.keys().copied()).collect(),
        &declared,
    );
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
    let d = Model::of(&Fmu::plant());
    let m = plant(Interface::CoSimulation, &RIGS[0], false);
    leave_initialization(&m);
    m.well(m.step(0.0, 0.05));
    let outputs = d.unknowns(|s| &s.outputs);
    let inputs = d.inputs().into_iter();
    let slopes = inputs.flat_map(|known| d.compared(&m, &outputs, known, |value| d.set(&m, known, value)));
    // base and energy by e and E, and nothing else: the kick of a jump of e comes with the next step.
    let seen: BTreeSet<Pair> = slopes.map(|(pair, _)| pair).collect();
    assert_eq!(seen, BTreeSet::from([(17, 7), (17, 8), (23, 7), (23, 8)]));
}

#[test]
fn in_the_first_event_mode_the_velocity_follows_the_base_and_discrete_outputs_have_no_slope() {
    let d = Model::of(&Fmu::plant());
    let m = plant(Interface::ModelExchange, &RIGS[0], false);
    leave_initialization(&m);
    let unknowns = [d.unknowns(|s| &s.outputs), d.unknowns(|s| &s.derivatives)].concat();
    for known in d.inputs() {
        d.compared(&m, &unknowns, known, |value| d.set(&m, known, value));
    }
    // der(q1) = u1 + (c/M) base while the state is held. Some masters ask for all outputs, the Integers `impacts` and `contact` among them.
    for (unknown, slope) in [(10, 7.5 / 2.0), (9, 0.0), (18, 0.0), (16, 1.0), (21, 0.0)] {
        assert_eq!(partial(&m, unknown, 6), (Status::Ok, slope), "{unknown}");
    }
    let m = Master::ready(&Fmu::plant());
    for (unknown, known, word) in [
        (0, 6, "not an unknown"),
        (9, 13, "not a known"),
        (16, 18, ""),
        (99, 6, ""),
    ] {
        assert_eq!(partial(&m, unknown, known).0, Status::Error);
        m.heard_one(&[word]);
    }
}

#[test]
fn unknowns_of_the_controller() {
    let d = Model::of(&Fmu::controller());
    let m = Master::new(&Fmu::controller(), Interface::CoSimulation);
    m.enter_initialization();
    let look = |unknowns: &[usize], knowns: &[usize]| {
        let slopes = knowns.iter().flat_map(|&known| {
            let value = d.get(&m, known);
            let change = match d.kind(known) {
                FmiType::Real if value == 0.0 => 1e-2,
                // -1 is "none": the next value that is allowed.
                FmiType::Real if value == -1.0 => 2.0,
                FmiType::Real => 1e-3 * value.abs(),
                FmiType::Boolean => 1.0 - 2.0 * value,
                _ => 1.0,
            };
            // Back at the present value in the end.
            d.slopes(&m, unknowns, known, [value + change, value], |value| {
                d.set(&m, known, value)
            })
        });
        slopes.map(|(pair, _)| pair).collect::<BTreeSet<Pair>>()
    };
    let seen = look(&d.unknowns(|s| &s.initial_unknowns), &d.knowns());
    compare(&seen, &d.declared(|s| &s.initial_unknowns));
    leave_initialization(&m);
    m.well(m.step(0.0, 0.1));
    let seen = look(&d.unknowns(|s| &s.outputs), &d.inputs());
    compare(&seen, &d.declared(|s| &s.outputs));
}

/// Asserts that each output derivative is the difference quotient of the one before, in three steps of `h` from `time` on.
#[track_caller]
fn motion(m: &Master, outputs: &[u32], [time, h]: [f64; 2], orders: usize) {
    let impacts = m.impacts();
    let look = |n: i32| {
        m.well(m.step(time + f64::from(n) * h, h));
        let derivatives = |vr: &u32| -> Vec<f64> {
            let higher = (1..=3).map(|order| {
                let mut slope = f64::NAN;
                m.well(call!(m.fmi2GetRealOutputDerivatives(vr, 1, &order, &mut slope)));
                slope
            });
            std::iter::once(m.real(*vr)).chain(higher).collect()
        };
        outputs.iter().map(derivatives).collect::<Vec<_>>()
    };
    let [before, now, after] = [0, 1, 2].map(look);
    assert_eq!(m.impacts(), impacts, "an impact in between is a jump");
    for (place, vr) in outputs.iter().enumerate() {
        for order in 0..orders {
            let quotient = (after[place][order] - before[place][order]) / (2.0 * h);
            let derivative = now[place][order + 1];
            let error = (derivative - quotient).abs() / (1.0 + quotient.abs());
            assert!(
                error < 1e-4,
                "{vr}, order {}: {derivative} is not {quotient}",
                order + 1
            );
        }
    }
}

#[test]
fn output_derivatives_are_those_of_the_motion_with_and_without_friction_and_tilt() {
    let outputs = [9, 10, 11, 12, 13, 14, 15, 16, 17, 19, 20, 22, 23];
    let values: Vec<_> = (0..).zip(RIGS[0]).collect();
    let m = Master::with(&Fmu::plant(), Interface::CoSimulation, &values);
    m.start();
    motion(&m, &outputs, [0.0, 1e-4], 3);
    let mut answer = 0.0;
    let status = call!(m.fmi2GetRealOutputDerivatives(&9, 1, &4, &mut answer));
    assert_eq!(status, Status::Error);
    // With stuck_time and friction_loss.
    let m = Master::with(
        &Fmu::plant(),
        Interface::CoSimulation,
        &[&values[..], &FRICTION].concat(),
    );
    m.start();
    motion(&m, &[&outputs[..], &[45, 46]].concat(), [0.0, 1e-4], 1);
}
