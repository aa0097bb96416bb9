//! Guards partial derivatives, time derivatives and declared dependencies against difference quotients.
//!
//! One list of dependencies serves both interfaces of the plant: a dependency that is declared shows in one of them at least, and none
//! shows that is not declared.

use std::collections::{BTreeMap, BTreeSet};

use fmi2_boundary::Interface::{self, CoSimulation, ModelExchange};
use fmi2_boundary::{Fmu, Master, call, refused};
use fmi2_component::Status;
use fmi2_component::abi::EventInfo;
use fmi2_description::{Causality, Description, FmiType, Initial, ModelStructure, ScalarVariable, Unknown};

/// An unknown and a known, by place in the list of variables, which begins at 1.
type Pair = (usize, usize);
/// One of the lists of the model structure.
type List = fn(&ModelStructure) -> &Vec<Unknown>;

const INITIAL: List = |structure| &structure.initial_unknowns;
const OUTPUTS: List = |structure| &structure.outputs;
const DERIVATIVES: List = |structure| &structure.derivatives;

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

/// An instance in Initialization Mode, and its description.
struct Model {
    m: Master,
    d: Description,
}

impl Model {
    fn of(fmu: &Fmu, interface: Interface, values: &[(u32, f64)]) -> Self {
        let m = Master::with(fmu, interface, values);
        m.enter_initialization();
        Self { m, d: fmu.parsed() }
    }

    fn plant(interface: Interface, rig: &[f64; 13], stuck: bool) -> Self {
        let rest = if stuck { &AT_REST[..] } else { &[] };
        let rig = (0..).zip(rig.iter().copied());
        let values: Vec<_> = rig.chain(rest.iter().copied()).chain(FRICTION).collect();
        Self::of(&Fmu::plant(), interface, &values)
    }

    fn leave_initialization(&self) {
        let m = &self.m;
        m.well(call!(m.fmi2ExitInitializationMode()));
    }

    fn variable(&self, place: usize) -> &ScalarVariable {
        &self.d.variables[place - 1]
    }

    fn kind(&self, place: usize) -> FmiType {
        self.variable(place).content().unwrap().0
    }

    fn places(&self, wanted: fn(&ScalarVariable) -> bool) -> Vec<usize> {
        let places = 1..=self.d.variables.len();
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

    fn unknowns(&self, lists: &[List]) -> Vec<usize> {
        let all = lists.iter().flat_map(|list| list(&self.d.structure));
        all.map(|unknown| unknown.index).collect()
    }

    /// Declared dependencies with their kinds.
    fn declared(&self, lists: &[List]) -> BTreeMap<Pair, String> {
        let mut declared = BTreeMap::new();
        for unknown in lists.iter().flat_map(|list| list(&self.d.structure)) {
            let words = |text: &Option<String>| -> Vec<String> {
                let words = text.as_deref().unwrap_or_default().split_whitespace();
                words.map(str::to_owned).collect()
            };
            let kinds = words(&unknown.dependencies_kind).into_iter();
            let kinds = kinds.chain(std::iter::repeat("dependent".to_owned()));
            for (known, kind) in words(&unknown.dependencies).into_iter().zip(kinds) {
                declared.insert((unknown.index, known.parse().unwrap()), kind);
            }
        }
        declared
    }

    fn get(&self, place: usize) -> f64 {
        let vr = self.variable(place).value_reference;
        match self.kind(place) {
            FmiType::Real => self.m.real(vr),
            FmiType::Boolean => self.m.boolean(vr).into(),
            _ => self.m.integer(vr).into(),
        }
    }

    fn set(&self, place: usize, value: f64) {
        let (m, vr, whole) = (&self.m, self.variable(place).value_reference, value as i32);
        m.well(match self.kind(place) {
            FmiType::Real => m.set_real(vr, value),
            FmiType::Boolean => call!(m.fmi2SetBoolean(&vr, 1, &whole)),
            _ => m.set_integer(vr, whole),
        });
    }

    /// The change of an unknown over the change of a known, by value reference.
    fn partial(&self, unknown: u32, known: u32) -> f64 {
        let (m, mut slope) = (&self.m, f64::NAN);
        let status = call!(m.fmi2GetDirectionalDerivative(&unknown, 1, &known, 1, &2.0, &mut slope));
        m.well(status);
        slope / 2.0
    }

    /// The change of each unknown over the change of a known, where it changes at all.
    fn slopes(&self, unknowns: &[usize], known: usize, at: [f64; 2], set: impl Fn(f64)) -> BTreeMap<Pair, f64> {
        let [before, after] = at.map(|value| {
            set(value);
            unknowns.iter().map(|&u| self.get(u)).collect::<Vec<_>>()
        });
        let changes = unknowns.iter().zip(before.into_iter().zip(after));
        let changes = changes.filter(|(_, (before, after))| before != after);
        let slope = |(&u, (before, after)): (&usize, (f64, f64))| ((u, known), (after - before) / (at[1] - at[0]));
        changes.map(slope).collect()
    }

    /// The slopes around the present value of a known of type Real, against the partial derivatives of the FMU.
    fn compared(&self, unknowns: &[usize], known: usize, set: impl Fn(f64)) -> BTreeMap<Pair, f64> {
        let value = self.get(known);
        if self.kind(known) != FmiType::Real || value == 0.0 {
            return BTreeMap::new();
        }
        let h = 1e-6 * value.abs().max(0.01);
        let slopes = self.slopes(unknowns, known, [value - h, value + h], &set);
        set(value);
        for &unknown in unknowns.iter().filter(|&&unknown| self.kind(unknown) == FmiType::Real) {
            let quotient = slopes.get(&(unknown, known)).copied().unwrap_or(0.0);
            let [unknown, known] = [unknown, known].map(|place| self.variable(place).value_reference);
            let derivative = self.partial(unknown, known);
            let error = (derivative - quotient).abs() / (1.0 + quotient.abs());
            assert!(error < 1e-7, "{unknown} by {known}: {derivative} is not {quotient}");
        }
        slopes
    }

    /// Derivatives of the unknowns by several knowns, each compared with its difference quotient.
    fn compared_by(&self, knowns: &[usize], unknowns: &[usize]) -> BTreeMap<Pair, f64> {
        let slopes = knowns
            .iter()
            .flat_map(|&n| self.compared(unknowns, n, |value| self.set(n, value)));
        slopes.collect()
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
    let both = [CoSimulation, ModelExchange].map(|interface| Model::plant(interface, &RIGS[0], false));
    let seen = both
        .iter()
        .flat_map(|p| p.compared_by(&p.knowns(), &p.unknowns(&[INITIAL])).into_keys());
    compare(&seen.collect(), &both[0].declared(&[INITIAL]));
}

/// In continuous-time mode, free or stuck, by inputs and by states.
fn exchanged(rig: &[f64; 13], stuck: bool) -> BTreeMap<Pair, f64> {
    let p = Model::plant(ModelExchange, rig, stuck);
    p.leave_initialization();
    let (m, mut x) = (&p.m, [0.0; 5]);
    m.well(call!(m.fmi2NewDiscreteStates(&mut EventInfo::default())));
    m.well(call!(m.fmi2EnterContinuousTimeMode()));
    m.well(call!(m.fmi2GetContinuousStates(x.as_mut_ptr(), 5)));
    // Some way on: the energy lost to friction grows with the distance since the last event.
    if !stuck {
        x[0] += 1e-3 * (m.real(10) - m.real(12)).signum();
    }
    x[4] = 0.7;
    m.well(call!(m.fmi2SetContinuousStates(x.as_ptr(), 5)));
    assert_eq!(p.get(22), f64::from(u8::from(stuck)), "contact");
    let unknowns = p.unknowns(&[OUTPUTS, DERIVATIVES]);
    let mut slopes = p.compared_by(&p.inputs(), &unknowns);
    // The states in the order of the derivatives: q1, q2, u1, u2, phase.
    for (place, known) in [10, 12, 25, 27, 18].into_iter().enumerate() {
        let set = |value| {
            let mut x = x;
            x[place] = value;
            m.well(call!(m.fmi2SetContinuousStates(x.as_ptr(), 5)));
        };
        if stuck {
            slopes.extend(p.slopes(&unknowns, known, [x[place], x[place] + 1e-3], set));
            set(x[place]);
        } else {
            slopes.extend(p.compared(&unknowns, known, set));
        }
    }
    slopes
}

#[test]
fn outputs_and_derivatives_of_the_plant() {
    let declared = Model::plant(ModelExchange, &RIGS[0], false).declared(&[OUTPUTS, DERIVATIVES]);
    let all: Vec<_> = (RIGS.iter())
        .flat_map(|rig| [false, true].map(|stuck| exchanged(rig, stuck)))
        .collect();
    let seen = all.iter().flat_map(|slopes| slopes.keys().copied());
    compare(&seen.collect(), &declared);
    // A constant factor is the same in every rig, a fixed one in every instant of one rig: 0 and 1, 2 and 3.
    for (pair, kind) in &declared {
        let alike: &[[usize; 2]] = match kind.as_str() {
            "constant" => &[[0, 1], [0, 2], [2, 3]],
            "fixed" => &[[0, 1], [2, 3]],
            _ => continue,
        };
        for factors in alike.iter().map(|two| two.map(|n| all[n][pair])) {
            let alike = (factors[0] - factors[1]).abs() < 1e-6;
            assert!(alike, "{pair:?} is not {kind}: {factors:?}");
        }
    }
}

#[test]
fn between_steps_velocities_of_the_plant_do_not_depend_on_its_inputs() {
    let p = Model::plant(CoSimulation, &RIGS[0], false);
    p.leave_initialization();
    p.m.well(p.m.step(0.0, 0.05));
    // base and energy by e and E, and nothing else: the kick of a jump of e comes with the next step.
    let seen = p.compared_by(&p.inputs(), &p.unknowns(&[OUTPUTS]));
    let seen: Vec<Pair> = seen.into_keys().collect();
    assert_eq!(seen, [(17, 7), (17, 8), (23, 7), (23, 8)]);
}

#[test]
fn in_the_first_event_mode_the_velocity_follows_the_base_and_discrete_outputs_have_no_slope() {
    let p = Model::plant(ModelExchange, &RIGS[0], false);
    p.leave_initialization();
    p.compared_by(&p.inputs(), &p.unknowns(&[OUTPUTS, DERIVATIVES]));
    // der(q1) = u1 + (c/M) base while the state is held. Some masters ask for all outputs, the Integers `impacts` and `contact` among them.
    for (unknown, slope) in [(10, 7.5 / 2.0), (9, 0.0), (18, 0.0), (16, 1.0), (21, 0.0)] {
        assert_eq!(p.partial(unknown, 6), slope, "{unknown}");
    }
    let m = Master::ready(&Fmu::plant());
    let refused = [
        (0, 6, "not an unknown"),
        (9, 13, "not a known"),
        (16, 18, ""),
        (99, 6, ""),
    ];
    for (unknown, known, word) in refused {
        refused!(m.fmi2GetDirectionalDerivative(&unknown, 1, &known, 1, &2.0, &mut 0.0) => word);
    }
}

#[test]
fn unknowns_of_the_controller() {
    let c = Model::of(&Fmu::controller(), CoSimulation, &[]);
    let look = |list: List, knowns: &[usize]| {
        let seen = knowns.iter().flat_map(|&known| {
            let value = c.get(known);
            let change = match c.kind(known) {
                FmiType::Real if value == 0.0 => 1e-2,
                // -1 is "none": the next value that is allowed.
                FmiType::Real if value == -1.0 => 2.0,
                FmiType::Real => 1e-3 * value.abs(),
                FmiType::Boolean => 1.0 - 2.0 * value,
                _ => 1.0,
            };
            // Back at the present value in the end.
            let at = [value + change, value];
            let slopes = c.slopes(&c.unknowns(&[list]), known, at, |value| c.set(known, value));
            slopes.into_keys()
        });
        compare(&seen.collect(), &c.declared(&[list]));
    };
    look(INITIAL, &c.knowns());
    c.leave_initialization();
    c.m.well(c.m.step(0.0, 0.1));
    look(OUTPUTS, &c.inputs());
}

#[test]
fn output_derivatives_are_those_of_the_motion_with_and_without_friction_and_tilt() {
    let (h, outputs) = (1e-4, [9, 10, 11, 12, 13, 14, 15, 16, 17, 19, 20, 22, 23]);
    let rig: Vec<_> = (0..).zip(RIGS[0]).collect();
    // With friction also stuck_time and friction_loss, and the first derivative alone.
    for (values, outputs, orders) in [
        (rig.clone(), outputs.to_vec(), 3),
        ([&rig[..], &FRICTION].concat(), [&outputs[..], &[45, 46]].concat(), 1),
    ] {
        let m = Master::started(&Fmu::plant(), CoSimulation, &values);
        // Each output and its derivatives after three steps.
        let [before, now, after] = [0.0, 1.0, 2.0].map(|n| {
            m.well(m.step(n * h, h));
            let derivative = |vr: &u32, order: i32| {
                let mut slope = m.real(*vr);
                if order > 0 {
                    m.well(call!(m.fmi2GetRealOutputDerivatives(vr, 1, &order, &mut slope)));
                }
                slope
            };
            let all = outputs.iter().map(|vr| [0, 1, 2, 3].map(|order| derivative(vr, order)));
            all.collect::<Vec<_>>()
        });
        assert_eq!(m.impacts(), 0, "an impact in between is a jump");
        for (place, vr) in outputs.iter().enumerate() {
            for order in 0..orders {
                let quotient = (after[place][order] - before[place][order]) / (2.0 * h);
                let derivative = now[place][order + 1];
                let error = (derivative - quotient).abs() / (1.0 + quotient.abs());
                assert!(error < 1e-4, "{vr}, order {order} + 1: {derivative} is not {quotient}");
            }
        }
        refused!(m.fmi2GetRealOutputDerivatives(&9, 1, &4, &mut 0.0));
    }
}
