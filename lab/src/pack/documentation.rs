//! The page inside an FMU: its tables come from `modelDescription.xml`, figure, equations and explanations from `pictures/`.

use fmi2_description::{Causality, Description};
use maud::{DOCTYPE, PreEscaped, html};

use super::Component;
use crate::report::Table;

pub(super) fn page(component: &Component, description: &Description) -> String {
    let interfaces = [
        description.co_simulation.as_ref().map(|_| "co-simulation"),
        description.model_exchange.as_ref().map(|_| "model exchange"),
    ];
    let interfaces: Vec<_> = interfaces.into_iter().flatten().collect();
    let experiment = &description.default_experiment;
    let [start, stop, step] = [&experiment.start_time, &experiment.stop_time, &experiment.step_size]
        .map(|time| time.as_deref().map_or("?".into(), rounded));
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                title { (description.model_name) }
                style { (PreEscaped(include_str!("pictures/style.css"))) }
            }
            body {
                h1 { (description.model_name) }
                p { (description.description) "." }
                (PreEscaped(component.svg)) (PreEscaped(component.text))
                p {
                    "Version " (description.version) "; FMI " (description.fmi_version) "; " (interfaces.join(" and "))
                    ". Default experiment: " (start) " s to " (stop) " s in steps of " (step) " s."
                }
                @for (causality, heading) in SECTIONS {
                    @let table = table(description, causality);
                    @if !table.is_empty() { (table.html(heading)) }
                }
            }
        }
    };
    page.into_string()
}

/// Causalities in the order of the page.
const SECTIONS: [(Causality, &str); 5] = [
    (Causality::Parameter, "Parameters"),
    (Causality::CalculatedParameter, "Calculated parameters"),
    (Causality::Input, "Inputs"),
    (Causality::Output, "Outputs"),
    (Causality::Local, "Local variables"),
];

/// A number with at most six digits. The description has all digits.
fn rounded(text: &str) -> String {
    match text.parse::<f64>() {
        Ok(number) if text.len() > 8 => {
            let six: f64 = format!("{number:.5e}").parse().unwrap_or(number);
            if (1e-3..1e6).contains(&six.abs()) {
                format!("{six}")
            } else {
                format!("{six:e}")
            }
        }
        _ => text.to_owned(),
    }
}

/// The variables of one causality.
fn table(description: &Description, causality: Causality) -> Table {
    let variables = description.variables.iter();
    let rows = variables.filter(|one| one.causality == causality).map(|one| {
        let content = one.content().map(|(_, content)| content.clone()).unwrap_or_default();
        vec![
            one.name.clone(),
            rounded(&content.start.unwrap_or_default()),
            content.unit.unwrap_or_default(),
            format!("{:?}", one.variability).to_lowercase(),
            one.description.clone(),
        ]
    });
    Table::new("name | start | unit | variability | meaning").rows(rows)
}

#[cfg(test)]
#[path = "../../tests/unit/pack_documentation.rs"]
mod tests;
