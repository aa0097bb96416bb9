//! Results for people and programs: files, figures, tables, and one page with all of them.

mod figure;
mod figures;
mod files;
mod sections;
pub mod summary;
mod table;
mod theme;

use std::path::{Path, PathBuf};

use maud::{DOCTYPE, PreEscaped, html};

use figure::Figure;
pub use files::{
    ReportError, decay_csv, map_csv, write, write_fit, write_interrupted, write_map, write_response, write_theory,
    write_tracked,
};
pub use table::{Table, number, row, with_uncertainty};

use crate::scene::Scene;
use crate::sweep::Map;

/// A section of the page, with its finding in a sentence or two.
#[derive(Debug, Clone, Default, PartialEq)]
struct Section {
    title: String,
    finding: String,
    /// Paragraphs, figures and tables, as HTML.
    content: String,
    /// Lines of the error budget: what is uncertain, by how much, and where that number comes from.
    budget: Vec<[String; 3]>,
    /// Names and contents of its figures, for light and dark backgrounds, and of tables for programs.
    files: Vec<(String, String)>,
}

impl Section {
    fn new(title: &str) -> Self {
        Self { title: title.into(), ..Self::default() }
    }

    /// Ends with a finding, in the summary and as a paragraph.
    fn concluded(mut self, finding: impl Into<String>) -> Self {
        self.finding = finding.into();
        self.words(self.finding.clone());
        self
    }

    fn words(&mut self, text: impl AsRef<str>) {
        self.content += &html! { p { (text.as_ref()) } }.into_string();
    }

    fn table(&mut self, caption: &str, table: &Table) {
        self.content += &table.html(caption).into_string();
    }

    /// A figure, with the name of its files without ending. On the page it has a label for readers who cannot see it.
    fn figure(&mut self, name: &str, caption: &str, figure: &Figure) {
        let svg = figure.svg();
        let label = html! { (caption) }.into_string();
        let labelled = svg.replacen("<svg", &format!("<svg role=\"img\" aria-label=\"{label}\""), 1);
        let figure = html! { figure { (PreEscaped(labelled)) figcaption { (caption) } } };
        self.content += &figure.into_string();
        self.attach(&format!("{name}-dark.svg"), theme::dark(&svg));
        self.attach(&format!("{name}.svg"), svg);
    }

    fn budget(&mut self, what: &str, size: String, why: &str) {
        self.budget.push([what.into(), size, why.into()]);
    }

    fn attach(&mut self, name: &str, text: String) {
        self.files.push((name.into(), text));
    }
}

/// Writes the report on the scene of `map` into `out`: `report.html`, each figure for light and dark backgrounds, and tables. The map is
/// computed. `progress` gets the name of the section being made, and the fraction of all sections that is done, from 0 to 1. Returns the
/// findings, a sentence per section, and the files; the page is the first.
pub fn write_report(
    map: &mut Map,
    out: &Path,
    progress: &(dyn Fn(&str, f64) + Sync),
) -> Result<(Vec<String>, Vec<PathBuf>), ReportError> {
    let mut sections = Vec::new();
    for (n, (name, make)) in sections::SECTIONS.into_iter().enumerate() {
        let at = |part: f64| progress(name, (n as f64 + part) / sections::SECTIONS.len() as f64);
        at(0.0);
        sections.push(make(map, &at)?);
    }
    let mut files = vec![("report.html".to_string(), page(map.sweep.scene(), &sections))];
    let mut findings = Vec::new();
    for section in sections {
        files.extend(section.files);
        findings.push(section.finding);
    }
    Ok((findings, crate::files::write(out, files)?))
}

/// Titles of the last two sections.
const BUDGET: &str = "Error budget";
const VERSIONS: &str = "Scene and versions";

/// The page: one file of HTML that needs nothing else.
fn page(scene: &Scene, sections: &[Section]) -> String {
    let (p, last) = (scene.dimensionless(), sections.len());
    let style = format!(
        "{}\n@media screen and (prefers-color-scheme: dark){{{}}}\n",
        include_str!("report/page.css"),
        theme::dark_rules()
    );
    let titles = sections.iter().map(|section| section.title.as_str());
    let json = serde_json::to_string_pretty(scene).unwrap_or_default();
    let budget = sections.iter().flat_map(|section| section.budget.clone());
    let budget = Table::new("quantity | difference | cause").rows(budget);
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                link rel="icon" href="data:,";
                title { "vines: report" }
                style { (PreEscaped(style)) }
            }
            body {
                h1 { "Nonlinear modal test of an oscillator with a vibro-impact nonlinear energy sink" }
                p.scene {
                    (format!("ε = {:.6}, λ = {:.4}, r = {}, G = {:.4}; ", p.epsilon, p.lambda, p.r, p.g))
                    (format!("b = {} m, ω₀ = {:.4} rad/s", p.b, p.omega0))
                }
                @if let Some(left_out) = scene.left_out() {
                    p {
                        (summary::ideal("Theory, exact orbits and the regime map on this page are", &left_out))
                        ". The measurements have it."
                    }
                }
                section {
                    h2 { "What was found" }
                    ul { @for section in sections { li { (section.finding) } } }
                }
                nav {
                    h2 { "Contents" }
                    ol {
                        @for (n, title) in (1..).zip(titles.chain([BUDGET, VERSIONS])) {
                            li { a href=(format!("#s{n}")) { (title) } }
                        }
                    }
                }
                @for (n, section) in (1..).zip(sections) {
                    section id=(format!("s{n}")) {
                        h2 { (n) " " (section.title) }
                        (PreEscaped(&section.content))
                    }
                }
                section.budget id=(format!("s{}", last + 1)) {
                    h2 { (last + 1) " " (BUDGET) }
                    (budget.html("Differences between results and references, with their causes."))
                    p {
                        "M, k, c and m of the default scene are those of a published rig of this kind, because the study that it follows \
                         takes ε and λ from a reference that was not available; b is this project’s choice, on which no dimensionless \
                         result depends."
                    }
                }
                section id=(format!("s{}", last + 2)) {
                    h2 { (last + 2) " " (VERSIONS) }
                    p {
                        "vines " (env!("CARGO_PKG_VERSION")) ", " (std::env::consts::ARCH) " on " (std::env::consts::OS)
                        ". Everything here follows from the scene and the version; the page carries no date, so that the same input \
                         gives the same bytes."
                    }
                    pre { (json) }
                }
            }
        }
    };
    page.into_string()
}
