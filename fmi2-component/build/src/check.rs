//! What a correct table needs. Everything else that FMI 2.0 requires of a description is for a validator to check.

use std::collections::HashMap;

use fmi2_description::{Causality, Description, Initial, Variability};

use crate::source::identifier;
use crate::table::{Kind, Table, Variable};

/// Appends every fault that it finds.
pub(crate) fn check(description: &Description, table: &Table, faults: &mut Vec<String>) {
    if description.fmi_version != "2.0" {
        let version = &description.fmi_version;
        faults.push(format!("fmiVersion is {version:?}; expected \"2.0\""));
    }
    if description.co_simulation.is_none() {
        return faults.push("CoSimulation is missing".into());
    }
    // The shell keeps the categories that are on as bits of a word.
    if table.categories.len() > 64 {
        faults.push("LogCategories has more than 64 categories".into());
    }
    for name in table.categories.iter().chain([&table.identifier]) {
        if identifier(name) != *name {
            faults.push(format!("{name:?} is not a C identifier"));
        }
    }
    for kind in Kind::ALL {
        let (mut references, mut variants) = (HashMap::new(), HashMap::new());
        for Variable { name, value_reference, .. } in table.of(kind) {
            if let Some(other) = references.insert(value_reference, name) {
                faults.push(format!(
                    "{other} and {name} have the same valueReference {value_reference}"
                ));
            }
            let variant = identifier(name);
            if let Some(other) = variants.insert(variant.clone(), name) {
                faults.push(format!("{other} and {name} would both be the Rust variant {variant}"));
            }
        }
    }
    for variable in &table.variables {
        if let Err(fault) = legal(variable) {
            faults.push(format!("{}: {fault}", variable.name));
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
        let kind = v.kind;
        return Err(format!(
            "only a Real can be continuous, which is the default; a {kind:?} can be discrete"
        ));
    }
    let needs_start = matches!(v.initial, Some(Initial::Exact | Initial::Approx)) || causality == Causality::Input;
    match (needs_start, v.start.is_some()) {
        (true, false) => Err("a start value is needed".into()),
        (false, true) => Err("a start value is not allowed: the value is calculated".into()),
        _ => Ok(()),
    }
}

/// The values of `initial` that a causality and a variability allow, the default first; none where the standard forbids
/// the pair (FMI 2.0, clause 2.2.7). `None` stands for the attribute being absent.
pub(crate) fn allowed(causality: Causality, variability: Variability) -> &'static [Option<Initial>] {
    use Causality as C;
    use Initial::{Approx, Calculated, Exact};
    use Variability as V;
    match (causality, variability) {
        (C::Output | C::Local, V::Constant) => &[Some(Exact)],
        (C::Parameter, V::Fixed | V::Tunable) => &[Some(Exact)],
        (C::CalculatedParameter | C::Local, V::Fixed | V::Tunable) => &[Some(Calculated), Some(Approx)],
        (C::Input, V::Discrete | V::Continuous) | (C::Independent, V::Continuous) => &[None],
        (C::Output | C::Local, V::Discrete | V::Continuous) => &[Some(Calculated), Some(Exact), Some(Approx)],
        _ => &[],
    }
}
