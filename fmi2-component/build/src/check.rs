//! What FMI 2.0 requires of a description beyond its schema; each fault is a line that says what is expected.

use std::collections::HashMap;

use fmi2_description::{Description, Unknown};

use crate::attributes::{Causality, Initial, Variability, allowed};
use crate::identifier::identifier;
use crate::table::{Kind, Table, Variable};

/// Appends every fault that it finds.
pub(crate) fn check(description: &Description, table: &Table, faults: &mut Vec<String>) {
    identity(description, table, faults);
    unique(table, faults);
    for variable in &table.variables {
        if let Err(fault) = legal(variable) {
            faults.push(format!("{}: {fault}", variable.name));
        }
    }
    units(description, table, faults);
    // Positions in the list are wrong if a part of it could not be read.
    if table.variables.len() == description.variables.len() {
        structure(description, table, faults);
    }
}

fn identity(description: &Description, table: &Table, faults: &mut Vec<String>) {
    if description.fmi_version != "2.0" {
        let version = &description.fmi_version;
        faults.push(format!("fmiVersion is {version:?}; expected \"2.0\""));
    }
    let identifier_like = |text: &str| identifier(text) == text;
    if description.co_simulation.is_none() {
        faults.push("CoSimulation is missing".into());
    } else if !identifier_like(&table.identifier) {
        let name = &table.identifier;
        faults.push(format!("modelIdentifier is {name:?}; expected a C identifier"));
    }
    if let (Some(exchange), Some(steps)) = (&description.model_exchange, &description.co_simulation)
        && exchange != steps
    {
        faults.push(format!(
            "ModelExchange has modelIdentifier {:?}; expected that of CoSimulation, {:?}",
            exchange, steps
        ));
    }
    if table.categories.len() > 64 {
        faults.push("LogCategories has more than 64 categories".into());
    }
    for category in &table.categories {
        if !identifier_like(category) {
            faults.push(format!("the category {category:?} is not a C identifier"));
        }
    }
}

fn unique(table: &Table, faults: &mut Vec<String>) {
    let mut names = HashMap::new();
    for variable in &table.variables {
        if names.insert(&variable.name, ()).is_some() {
            faults.push(format!("two variables have the name {}", variable.name));
        }
    }
    for kind in Kind::ALL {
        let mut references = HashMap::new();
        let mut identifiers = HashMap::new();
        for variable in table.of(kind) {
            let Variable { name, value_reference, .. } = variable;
            if let Some(other) = references.insert(value_reference, name) {
                faults.push(format!(
                    "{other} and {name} have the same valueReference {value_reference}"
                ));
            }
            let variant = identifier(name);
            if let Some(other) = identifiers.insert(variant.clone(), name) {
                faults.push(format!("{other} and {name} would both be the Rust variant {variant}"));
            }
        }
    }
}

fn legal(v: &Variable) -> Result<(), String> {
    let (causality, variability) = (v.causality, v.variability);
    let choices = allowed(causality, variability);
    if choices.is_empty() {
        return Err(format!(
            "the standard has no {causality:?} of variability {variability:?}"
        ));
    }
    if !choices.contains(&v.initial) {
        return Err(format!(
            "a {variability:?} {causality:?} cannot have initial {:?}",
            v.initial
        ));
    }
    if variability == Variability::Continuous && v.kind != Kind::Real {
        return Err(format!(
            "only a Real can be continuous, which is the default; a {:?} can be discrete",
            v.kind
        ));
    }
    let needs_start = matches!(v.initial, Some(Initial::Exact | Initial::Approx)) || causality == Causality::Input;
    if needs_start && v.start.is_none() {
        return Err("a start value is needed".into());
    }
    if !needs_start && v.start.is_some() {
        return Err("a start value is not allowed: the value is calculated".into());
    }
    let finite = |value: &Option<String>| {
        let number = value.as_ref().and_then(|v| v.parse::<f64>().ok());
        v.kind != Kind::Real || number.is_none_or(f64::is_finite)
    };
    if ![&v.start, &v.min, &v.max].into_iter().all(finite) {
        return Err("start, min and max must be finite".into());
    }
    Ok(())
}

fn units(description: &Description, table: &Table, faults: &mut Vec<String>) {
    let known = |unit: &str| description.units.iter().any(|known| known == unit);
    for variable in &table.variables {
        if let Some(unit) = variable.unit.as_deref().filter(|u| !known(u)) {
            let name = &variable.name;
            faults.push(format!("{name}: UnitDefinitions has no {unit:?}"));
        }
    }
}

fn structure(description: &Description, table: &Table, faults: &mut Vec<String>) {
    let structure = &description.structure;
    let outputs: Vec<_> = table.places(|v| v.causality == Causality::Output);
    exactly("Outputs", &outputs, &structure.outputs, table, faults);

    let initial_unknowns = &structure.initial_unknowns;
    let unknown_at_start = |v: &Variable| {
        let computed = matches!(v.causality, Causality::Output)
            && matches!(v.initial, Some(Initial::Approx | Initial::Calculated));
        computed || v.causality == Causality::CalculatedParameter
    };
    for place in table.places(unknown_at_start) {
        if !initial_unknowns.iter().any(|u| u.index == place) {
            faults.push(format!(
                "InitialUnknowns must list {} (index {place}): its initial value is not exact",
                table.variables[place - 1].name
            ));
        }
    }

    let derivatives: Vec<_> = (description.variables.iter().enumerate())
        .filter_map(|(i, v)| Some((i + 1, v.content.first()?.derivative?)))
        .collect();
    for &(_, state) in &derivatives {
        in_range("derivative", state, table, faults);
    }
    for unknown in &structure.derivatives {
        if !derivatives.iter().any(|&(place, _)| place == unknown.index) {
            faults.push(format!(
                "Derivatives lists index {}, which has no attribute derivative",
                unknown.index
            ));
        }
    }

    if description.model_exchange.is_some() {
        states(&derivatives, table, initial_unknowns, &structure.derivatives, faults);
    }

    let lists = [&structure.outputs, &structure.derivatives, &structure.initial_unknowns];
    for unknown in lists.into_iter().flatten() {
        dependencies(unknown, table, faults);
    }
}

/// What a master that integrates needs: every derivative listed, and the initial values that are computed.
fn states(
    derivatives: &[(usize, usize)],
    table: &Table,
    initial_unknowns: &[Unknown],
    listed: &[Unknown],
    faults: &mut Vec<String>,
) {
    for &(derivative, state) in derivatives {
        let name = &table.variables[derivative - 1].name;
        if listed.iter().filter(|u| u.index == derivative).count() != 1 {
            faults.push(format!("Derivatives must list {name} (index {derivative}) once"));
        }
        for place in [derivative, state] {
            let computed = (place.checked_sub(1))
                .and_then(|place| table.variables.get(place))
                .is_some_and(|v| matches!(v.initial, Some(Initial::Approx | Initial::Calculated)));
            if computed && !initial_unknowns.iter().any(|u| u.index == place) {
                faults.push(format!(
                    "InitialUnknowns must list index {place}, a state or derivative whose initial value is not exact"
                ));
            }
        }
    }
}

impl Table {
    /// Indices, from 1, of the variables that `wanted` selects.
    fn places(&self, wanted: impl Fn(&Variable) -> bool) -> Vec<usize> {
        let numbered = self.variables.iter().zip(1..);
        numbered
            .filter(|(variable, _)| wanted(variable))
            .map(|(_, place)| place)
            .collect()
    }
}

fn exactly(list: &str, expected: &[usize], unknowns: &[Unknown], table: &Table, faults: &mut Vec<String>) {
    for place in expected {
        if unknowns.iter().filter(|u| u.index == *place).count() != 1 {
            let name = &table.variables[place - 1].name;
            faults.push(format!("{list} must list {name} (index {place}) once"));
        }
    }
    for unknown in unknowns.iter().filter(|u| !expected.contains(&u.index)) {
        faults.push(format!(
            "{list} lists index {}, which is no such variable",
            unknown.index
        ));
    }
}

fn dependencies(unknown: &Unknown, table: &Table, faults: &mut Vec<String>) {
    in_range("Unknown", unknown.index, table, faults);
    let Some(dependencies) = &unknown.dependencies else {
        return;
    };
    let mut count = 0;
    for dependency in dependencies.split_whitespace() {
        count += 1;
        in_range("dependency", dependency.parse().unwrap_or(0), table, faults);
    }
    if let Some(kinds) = &unknown.dependencies_kind
        && kinds.split_whitespace().count() != count
    {
        faults.push(format!(
            "Unknown {}: dependenciesKind must have as many entries as dependencies",
            unknown.index
        ));
    }
}

fn in_range(what: &str, place: usize, table: &Table, faults: &mut Vec<String>) {
    let count = table.variables.len();
    if !(1..=count).contains(&place) {
        faults.push(format!(
            "{what} {place} is not the index of a variable; allowed are 1 to {count}"
        ));
    }
}
