//! The page: one file of HTML that needs nothing else.

use std::fmt::Write;

use super::section::{Block, Section};
use super::theme;
use crate::scene::Scene;

const STYLE: &str = include_str!("page.css");

/// Puts the sections together. `work_precision` is a picture of run time against error, as SVG, where there is one.
#[must_use]
pub fn page(scene: &Scene, sections: &[Section], work_precision: Option<&str>) -> String {
    let p = scene.dimensionless();
    let mut body = String::new();
    let _ = write!(
        body,
        "<h1>Nonlinear modal test of an oscillator with a vibro-impact nonlinear energy sink</h1>\n<p class=\"scene\">\
         ε = {:.6}, λ = {:.4}, r = {}, G = {:.4}; b = {} m, ω₀ = {:.4} rad/s</p>\n",
        p.epsilon, p.lambda, p.r, p.g, p.b, p.omega0
    );
    body += "<section><h2>What was found</h2>\n<ul>\n";
    for section in sections {
        let _ = writeln!(body, "<li>{}</li>", escaped(&section.finding));
    }
    body += "</ul></section>\n";
    let mut pictures = 0;
    for section in sections {
        let _ = writeln!(body, "<section><h2>{}</h2>", escaped(&section.title));
        for block in &section.blocks {
            body += &rendered(block, &mut pictures);
        }
        body += "</section>\n";
    }
    if let Some(svg) = work_precision {
        pictures += 1;
        let _ = writeln!(
            body,
            "<section><h2>Run time against error</h2>\n<figure><img alt=\"Run time against error\" \
             src=\"data:image/svg+xml,{}\"><figcaption>Picture {pictures}. Run time against error, as the project's benchmark measured \
             it on its own machine; not part of this run.</figcaption></figure></section>",
            percent_encoded(svg)
        );
    }
    body += &budget(sections);
    let _ = writeln!(
        body,
        "<section><h2>Scene and versions</h2>\n<p>vines {}, {} on {}. Everything here follows from the scene and the version; the page \
         carries no date, so that the same input gives the same bytes.</p>\n<pre>{}</pre></section>",
        env!("CARGO_PKG_VERSION"),
        std::env::consts::ARCH,
        std::env::consts::OS,
        escaped(&serde_json::to_string_pretty(scene).unwrap_or_default())
    );
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" content=\"width=device-width, \
         initial-scale=1\">\n<link rel=\"icon\" href=\"data:,\">\n<title>vines: report</title>\n<style>\n{STYLE}\n@media screen and \
         (prefers-color-scheme: dark){{{}}}\n</style>\n</head>\n<body>\n{body}</body>\n</html>\n",
        theme::dark_rules()
    )
}

fn rendered(block: &Block, pictures: &mut u32) -> String {
    match block {
        Block::Words(text) => format!("<p>{}</p>\n", escaped(text)),
        Block::Picture { caption, svg, .. } => {
            *pictures += 1;
            let caption = escaped(caption);
            // Inside a page the drawing has no prologue, and says what it is to who cannot see it.
            let start = svg.find("<svg").unwrap_or(0);
            let named = svg[start..].replacen(
                "<svg ",
                &format!("<svg role=\"img\" aria-label=\"{caption}\" "),
                1,
            );
            format!(
                "<figure>{named}<figcaption>Picture {pictures}. {caption}</figcaption></figure>\n"
            )
        }
        Block::Table {
            caption,
            headings,
            rows,
        } => table(caption, headings, rows),
    }
}

fn table(caption: &str, headings: &[String], rows: &[Vec<String>]) -> String {
    // Columns of numbers are set to the right.
    let numbers: Vec<bool> = (0..headings.len())
        .map(|n| rows.iter().all(|row| is_number(&row[n])))
        .collect();
    let cells = |tag: &str, cells: &[String]| -> String {
        cells
            .iter()
            .zip(&numbers)
            .map(|(cell, number)| {
                let class = if *number { " class=\"number\"" } else { "" };
                format!("<{tag}{class}>{}</{tag}>", escaped(cell))
            })
            .collect()
    };
    let rows: String = rows
        .iter()
        .map(|row| format!("<tr>{}</tr>\n", cells("td", row)))
        .collect();
    format!(
        "<table><caption>{}</caption>\n<thead><tr>{}</tr></thead>\n<tbody>\n{rows}</tbody></table>\n",
        escaped(caption),
        cells("th", headings)
    )
}

fn is_number(cell: &str) -> bool {
    cell == "–" || cell.trim_end_matches(" %").parse::<f64>().is_ok()
}

fn budget(sections: &[Section]) -> String {
    let rows: Vec<Vec<String>> = sections
        .iter()
        .flat_map(|section| &section.budget)
        .map(|one| vec![one.what.clone(), one.size.clone(), one.why.clone()])
        .collect();
    let headings = ["what", "how far off", "why, and from where"].map(String::from);
    format!(
        "<section class=\"budget\"><h2>What the numbers are worth</h2>\n{}<p>M, k, c and m of the default scene are those of a published rig of this kind, for \
         the study that it follows leaves ε and λ to a reference that could not be opened; b is this project’s choice, on which \
         no dimensionless result depends.</p></section>\n",
        table("The error budget.", &headings, &rows)
    )
}

/// Text for HTML.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

fn percent_encoded(text: &str) -> String {
    text.bytes().fold(String::new(), |mut sum, byte| {
        if byte.is_ascii_alphanumeric() || b"-_.~".contains(&byte) {
            sum.push(char::from(byte));
        } else {
            let _ = write!(sum, "%{byte:02X}");
        }
        sum
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_cannot_become_markup() {
        assert_eq!(escaped("a < b & \"c\""), "a &lt; b &amp; &quot;c&quot;");
        assert_eq!(percent_encoded("<a b=\"#\">"), "%3Ca%20b%3D%22%23%22%3E");
    }
}
