//! What lies in an FMU for its reader: one page and a picture.
//!
//! The page is made from `modelDescription.xml`, so that nothing is said twice; what an equation says better than a
//! description is kept beside the picture, in `pictures/`.

use std::fmt::Write;

use roxmltree::{Document, Node};

/// The files for the reader of an FMU: name inside, content. A component that has no picture gets the page alone.
///
/// # Errors
/// A description that is no XML.
pub fn documentation(
    identifier: &str,
    description: &str,
) -> Result<Vec<(String, Vec<u8>)>, roxmltree::Error> {
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
    td:nth-child(n+2):nth-child(-n+4){white-space:nowrap}code{font-size:.95em}h2{margin-top:2.2rem}";

fn page(xml: &str, material: Option<&Material>) -> Result<String, roxmltree::Error> {
    let document = Document::parse(xml)?;
    let root = document.root_element();
    let said = |name: &str| escape(root.attribute(name).unwrap_or_default());
    let name = said("modelName");
    let mut out = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<title>{name}</title>\n\
         <style>{STYLE}</style>\n</head>\n<body>\n<h1>{name}</h1>\n<p>{}.</p>\n",
        said("description")
    );
    if let Some(material) = material {
        let _ = write!(out, "{}\n{}", material.svg, material.text);
    }
    let _ = writeln!(
        out,
        "<p>Version {}; FMI {}; {}. Default experiment: {}.</p>",
        said("version"),
        said("fmiVersion"),
        interfaces(root).join(" and "),
        experiment(root),
    );
    for (causality, heading) in SECTIONS {
        table(&mut out, root, causality, heading);
    }
    out += "</body>\n</html>\n";
    Ok(out)
}

/// Causalities in the order in which a reader wants them.
const SECTIONS: [(&str, &str); 5] = [
    ("parameter", "Parameters"),
    ("calculatedParameter", "Calculated parameters"),
    ("input", "Inputs"),
    ("output", "Outputs"),
    ("local", "Local variables"),
];

fn interfaces(root: Node) -> Vec<&'static str> {
    let all = [
        ("CoSimulation", "co-simulation"),
        ("ModelExchange", "model exchange"),
    ];
    let there = |name: &str| root.children().any(|child| child.has_tag_name(name));
    let found = all.into_iter().filter(|(element, _)| there(element));
    found.map(|(_, words)| words).collect()
}

fn experiment(root: Node) -> String {
    let element = root
        .children()
        .find(|c| c.has_tag_name("DefaultExperiment"));
    let said = |name| element.and_then(|e| e.attribute(name)).unwrap_or("?");
    format!(
        "{} s to {} s in steps of {} s",
        escape(said("startTime")),
        escape(said("stopTime")),
        escape(&rounded(said("stepSize")))
    )
}

/// A number as a reader wants it: no more than six digits. The description has them all.
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

fn table(out: &mut String, root: Node, causality: &str, heading: &str) {
    let variables = root
        .descendants()
        .filter(|node| node.has_tag_name("ScalarVariable"))
        .filter(|node| node.attribute("causality").unwrap_or("local") == causality);
    let mut rows = variables.map(row).peekable();
    if rows.peek().is_none() {
        return;
    }
    let _ = writeln!(
        out,
        "<h2>{heading}</h2>\n<table>\n<tr><th>name</th><th>start</th><th>unit</th><th>variability</th><th>meaning</th></tr>"
    );
    rows.for_each(|row| out.push_str(&row));
    *out += "</table>\n";
}

fn row(variable: Node) -> String {
    let said = |name| escape(variable.attribute(name).unwrap_or_default());
    let content = variable.children().find(Node::is_element);
    let value = |name| escape(content.and_then(|c| c.attribute(name)).unwrap_or_default());
    let start = content
        .and_then(|c| c.attribute("start"))
        .unwrap_or_default();
    let unit = value("unit");
    format!(
        "<tr><td><code>{}</code></td><td>{}</td><td>{unit}</td><td>{}</td><td>{}</td></tr>\n",
        said("name"),
        escape(&rounded(start)),
        said("variability"),
        said("description"),
    )
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pack::components;

    #[test]
    fn the_page_has_every_variable_and_the_picture() {
        for component in components() {
            let xml = &component.description;
            let files = documentation(component.identifier, xml).unwrap();
            let names: Vec<_> = files.iter().map(|(name, _)| name.as_str()).collect();
            assert_eq!(names, ["documentation/index.html", "model.png"]);
            let page = std::str::from_utf8(&files[0].1).unwrap();
            let document = Document::parse(xml).unwrap();
            let variables = document.descendants();
            for variable in variables.filter(|n| n.has_tag_name("ScalarVariable")) {
                let name = variable.attribute("name").unwrap();
                assert!(page.contains(&format!("<code>{name}</code>")), "{name}");
                let description = escape(variable.attribute("description").unwrap());
                assert!(page.contains(&description), "{name}");
            }
            assert!(page.contains("<svg") && files[1].1.starts_with(b"\x89PNG"));
        }
    }

    #[test]
    fn every_real_variable_shows_its_unit() {
        for component in components() {
            let files = documentation(component.identifier, &component.description).unwrap();
            let page = std::str::from_utf8(&files[0].1).unwrap();
            for row in page.lines().filter(|line| line.starts_with("<tr><td>")) {
                let cells: Vec<_> = row.split("</td><td>").collect();
                let whole =
                    ["impacts", "contact"].map(|name| format!("<tr><td><code>{name}</code>"));
                let is_real =
                    component.identifier == "LoViNes" && !whole.contains(&cells[0].into());
                assert!(!is_real || !cells[2].is_empty(), "{row}");
            }
        }
    }

    #[test]
    fn numbers_have_no_more_digits_than_a_reader_wants() {
        for (exact, shown) in [
            ("0.0011343573395537938", "0.00113436"),
            ("9.246125558182298e-05", "9.24613e-5"),
            ("-1.5707963267948966", "-1.5708"),
            ("11680", "11680"),
            ("1e-6", "1e-6"),
            ("true", "true"),
            ("", ""),
        ] {
            assert_eq!(rounded(exact), shown);
        }
    }

    #[test]
    fn a_component_without_a_picture_gets_a_page() {
        let files = documentation("Tiny", "<fmiModelDescription modelName=\"a &lt; b\"/>").unwrap();
        assert_eq!(files.len(), 1);
        let page = String::from_utf8(files[0].1.clone()).unwrap();
        assert!(page.contains("<h1>a &lt; b</h1>"));
    }
}
