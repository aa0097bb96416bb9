//! The page: one file of HTML that needs nothing else.

use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::table::Table;
use super::{Block, Section, theme};
use crate::scene::Scene;

const STYLE: &str = include_str!("page.css");

/// Puts the sections together.
pub fn page(scene: &Scene, sections: &[Section]) -> String {
    let dark = theme::dark_rules();
    let style = format!("{STYLE}\n@media screen and (prefers-color-scheme: dark){{{dark}}}\n");
    let page = html! {
        (DOCTYPE) "\n"
        html lang="en" {
            "\n"
            head {
                "\n" meta charset="utf-8";
                "\n" meta name="viewport" content="width=device-width, initial-scale=1";
                "\n" link rel="icon" href="data:,";
                "\n" title { "vines: report" }
                "\n" style { "\n" (PreEscaped(style)) }
                "\n"
            }
            "\n"
            body {
                "\n"
                (body(scene, sections))
            }
            "\n"
        }
        "\n"
    };
    page.into_string()
}

fn body(scene: &Scene, sections: &[Section]) -> Markup {
    let p = scene.dimensionless();
    let mut figures = 0;
    let json = serde_json::to_string_pretty(scene).unwrap_or_default();
    html! {
        h1 { "Nonlinear modal test of an oscillator with a vibro-impact nonlinear energy sink" }
        "\n"
        p.scene {
            (format!("ε = {:.6}, λ = {:.4}, r = {}, G = {:.4}; ", p.epsilon, p.lambda, p.r, p.g))
            (format!("b = {} m, ω₀ = {:.4} rad/s", p.b, p.omega0))
        }
        "\n"
        section {
            h2 { "What was found" } "\n"
            ul { "\n" @for section in sections { li { (section.finding) } "\n" } }
        }
        "\n"
        @for section in sections {
            section {
                h2 { (section.title) } "\n"
                @for block in &section.blocks { (rendered(block, &mut figures)) }
            }
            "\n"
        }
        (budget(sections))
        section {
            h2 { "Scene and versions" } "\n"
            p {
                "vines " (env!("CARGO_PKG_VERSION")) ", " (std::env::consts::ARCH) " on " (std::env::consts::OS)
                ". Everything here follows from the scene and the version; the page carries no date, so that the same input \
                 gives the same bytes."
            }
            "\n"
            pre { (json) }
        }
        "\n"
    }
}

fn rendered(block: &Block, figures: &mut u32) -> Markup {
    match block {
        Block::Words(text) => html! { p { (text) } "\n" },
        Block::Table { caption, table } => table.html(caption),
        Block::Figure { caption, svg, .. } => {
            *figures += 1;
            // Inside a page the drawing has no prologue, and a label for readers who cannot see it.
            let start = svg.find("<svg").map_or(0, |start| start + "<svg".len());
            let label = html! { (caption) }.into_string();
            let labelled = format!("<svg role=\"img\" aria-label=\"{label}\"{}", &svg[start..]);
            html! {
                figure {
                    (PreEscaped(labelled))
                    figcaption { "Figure " (*figures) ". " (caption) }
                }
                "\n"
            }
        }
    }
}

fn budget(sections: &[Section]) -> Markup {
    let rows = sections.iter().flat_map(|section| section.budget.clone());
    let table = Table::new("quantity | difference | cause").rows(rows);
    html! {
        section.budget {
            h2 { "Error budget" } "\n"
            (table.html("Differences between results and references, with their causes."))
            p {
                "M, k, c and m of the default scene are those of a published rig of this kind, because the study that it follows \
                 takes ε and λ from a reference that was not available; b is this project’s choice, on which no dimensionless \
                 result depends."
            }
        }
        "\n"
    }
}
