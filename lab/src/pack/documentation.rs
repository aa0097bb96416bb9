//! Documentation inside an FMU: one page and a figure.
//!
//! The tables of the page come from `modelDescription.xml`; equations and explanations are in `pictures/`.

use fmi2_description::{Causality, Description, Error};
use maud::{DOCTYPE, PreEscaped, html};

use crate::report::Table;

/// The files: name inside the FMU, content. A component without a figure gets the page only.
pub fn documentation(identifier: &str, description: &str) -> Result<Vec<(String, Vec<u8>)>, Error> {
    let material = MATERIAL.iter().find(|one| one.identifier == identifier);
    let page = page(description, material)?;
    let mut files = vec![("documentation/index.html".to_owned(), page.into_bytes())];
    if let Some(material) = material {
        files.push(("model.png".to_owned(), material.png.to_vec()));
    }
    Ok(files)
}

/// What a description cannot say.
struct Material {
    identifier: &'static str,
    svg: &'static str,
    png: &'static [u8],
    /// The model and where it holds, as HTML.
    text: &'static str,
}

const MATERIAL: [Material; 2] = [
    Material {
        identifier: "LoViNes",
        svg: include_str!("pictures/LoViNes.svg"),
        png: include_bytes!("pictures/LoViNes.png"),
        text: include_str!("pictures/LoViNes.html"),
    },
    Material {
        identifier: "PhaseLock",
        svg: include_str!("pictures/PhaseLock.svg"),
        png: include_bytes!("pictures/PhaseLock.png"),
        text: include_str!("pictures/PhaseLock.html"),
    },
];

const STYLE: &str = "body{font:16px/1.5 system-ui,sans-serif;color:#1f2933;max-width:62rem;margin:2rem auto;padding:0 1rem}\
    svg{max-width:100%;height:auto}table{border-collapse:collapse;width:100%}\
    th,td{text-align:left;vertical-align:top;padding:.3rem .6rem;border-bottom:1px solid #d9e2ec}\
    td:nth-child(n+2):nth-child(-n+4){white-space:nowrap}td:first-child,code{font:.95em monospace}\
    h2{margin-top:2.2rem}caption{font-size:1.5em;font-weight:bold;text-align:left;margin-top:2.2rem}";

fn page(xml: &str, material: Option<&Material>) -> Result<String, Error> {
    let description = Description::parse(xml)?;
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
                style { (PreEscaped(STYLE)) }
            }
            body {
                h1 { (description.model_name) }
                p { (description.description) "." }
                @if let Some(material) = material { (PreEscaped(material.svg)) (PreEscaped(material.text)) }
                p {
                    "Version " (description.version) "; FMI " (description.fmi_version) "; " (interfaces.join(" and "))
                    ". Default experiment: " (start) " s to " (stop) " s in steps of " (step) " s."
                }
                @for (causality, heading) in SECTIONS {
                    @let table = table(&description, causality);
                    @if !table.is_empty() { (table.html(heading)) }
                }
            }
        }
    };
    Ok(page.into_string())
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
