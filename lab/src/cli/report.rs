//! `vines report`: the other commands one after another, and what they print and draw on one page.

use std::path::{Path, PathBuf};

use clap::{Args, Parser};
use maud::{DOCTYPE, Markup, PreEscaped, html};
use vines::map::LIMIT;
use vines::report::summary::{ideal, parameters};
use vines::rig::BuiltIn;
use vines::scene::Scene;
use vines::sweep::{Axis, Map};

use super::output::{writable, written};
use super::{Cli, dispatch};
use super::{
    failure::{Failure, INTERRUPTED},
    options::SceneArguments,
};

const HELP: &str = "\
Runs `vines identify`, `backbone`, `theory`, `orbit --response`, `map` and `fit` on one scene, and writes report.html beside their files:
one page that opens offline in any browser and prints well. It has each command with its tables and figures, and all settings.

Examples:
  vines report --out report
  vines report --out r07 --set plant.r=0.7
  vines report --out report --x sigma=-2:1:121 --y G=0.8:1.8:101    a finer map";

/// Write a report on a scene: all results on one page
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(super) struct Arguments {
    #[command(flatten)]
    scene: SceneArguments,

    /// Folder for the report; created if it does not exist
    #[arg(long, value_name = "DIR", default_value = "report")]
    out: PathBuf,

    /// Horizontal axis of the regime map, as in `vines map`
    #[arg(long, value_name = "AXIS=FIRST:LAST:POINTS", default_value = "sigma=-5:5:101")]
    x: Axis,

    /// Vertical axis of the regime map
    #[arg(long, value_name = "AXIS=FIRST:LAST:POINTS", default_value = "G=0.1:3:59")]
    y: Axis,
}

/// A section: its title, its command (OUT, X and Y stand for the arguments), and its figures with their captions.
type Section = (&'static str, &'static str, &'static [(&'static str, &'static str)]);

const SECTIONS: [Section; 6] = [
    (
        "Lock and free decay",
        "identify --rig built-in --out OUT",
        &[
            (
                "history.svg",
                "Left: the loop searches for phase resonance and holds it. Right: the drive is off, and the motion decays along the \
                 backbone until the impacts lose synchrony at the fold. Times are in periods 2π/ω₀ of the oscillator alone.",
            ),
            (
                "backbone.svg",
                "Points along the decay, the locked point, the exact backbone and that of first-order theory. The decay lies beside the \
                 backbone, because the impacts follow a falling amplitude late; the exact plant, released alike, does the same.",
            ),
            (
                "sim.svg",
                "The decay on the slow invariant manifold, from the locked point down the right branch to the fold.",
            ),
        ],
    ),
    (
        "Backbone, level by level",
        "backbone --out OUT",
        &[(
            "tracked.svg",
            "The loop holds the response at one level after another until it has settled, and the amplitude of the drive follows.",
        )],
    ),
    ("First-order theory", "theory", &[]),
    (
        "Frequency response",
        "orbit --response --range=-5:5 --figure OUT/response.svg",
        &[(
            "response.svg",
            "Exact orbits and first-order theory at the scene's G, and the exact backbone near the maximum. Asymmetric motions branch \
             off where the symmetric ones lose their symmetry.",
        )],
    ),
    (
        "Regimes",
        "map --confirmations 0 --x X --y Y --out OUT",
        &[(
            "map.svg",
            "One start per cell: where several regimes are stable, the start decides. The border is that of the island in which \
             first-order theory has a stable symmetric 1:1 motion; the curves are exact bifurcations of the 1:1 motions.",
        )],
    ),
    (
        "Parameters from the backbone",
        "fit OUT/tracked.csv --figure OUT/fit.svg",
        &[(
            "fit.svg",
            "The levels of the tracked backbone beside the scene and the fitted rig.",
        )],
    ),
];

pub(super) fn run(arguments: &Arguments) -> Result<String, Failure> {
    // Invalid settings are refused before anything runs or is written.
    let scene = arguments.scene.load()?;
    Map::new(arguments.scene.family()?, &arguments.x, &arguments.y, None, LIMIT)?;
    BuiltIn::new(&scene.controller_config())?;
    writable(&arguments.out)?;
    let mut failed = Vec::new();
    let mut sections = Vec::new();
    for (title, line, figures) in SECTIONS {
        let words = words(arguments, line);
        eprintln!("{}", words.join(" "));
        let text = match dispatch(Cli::try_parse_from(&words).map_err(Failure::input)?.command) {
            Err(failure) if failure.code == INTERRUPTED => return Err(failure),
            Err(failure) => {
                failed.push(title);
                format!("error: {}", failure.message)
            }
            Ok(text) => text,
        };
        sections.push(section(title, &words.join(" "), &text, figures, &arguments.out));
    }
    let page = page(&scene, &sections).into_string();
    let text = written(&[vines::write_file(&arguments.out.join("report.html"), &page)?]);
    match &failed[..] {
        [] => Ok(text),
        titles => Err(Failure::run(format!("{text}without a result: {}", titles.join(", ")))),
    }
}

/// The words of a command on the scene of the report.
fn words(arguments: &Arguments, line: &str) -> Vec<String> {
    let Arguments { scene, out, x, y } = arguments;
    let out = out.display().to_string();
    let word = |word: &str| match word {
        "X" => x.to_string(),
        "Y" => y.to_string(),
        _ => word.replace("OUT", &out),
    };
    let words = ["vines"].into_iter().chain(line.split(' ')).map(word);
    words.chain(scene.words()).collect()
}

/// A section of the page. A figure that the command did not write is left out.
fn section(title: &str, line: &str, text: &str, figures: &[(&str, &str)], out: &Path) -> Markup {
    let lines = text.lines().filter(|line| !line.starts_with("Written: "));
    let text = lines.collect::<Vec<_>>().join("\n");
    let drawn = |name: &str| std::fs::read_to_string(out.join(name)).ok();
    let drawn = figures
        .iter()
        .filter_map(|(name, caption)| Some((drawn(name)?, caption)));
    html! {
        h2 { (title) }
        pre { b { (line) } "\n\n" (text.trim_end()) }
        @for (svg, caption) in drawn {
            figure { (PreEscaped(svg)) figcaption { (caption) } }
        }
    }
}

/// The page: one file of HTML that needs nothing else.
fn page(scene: &Scene, sections: &[Markup]) -> Markup {
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                link rel="icon" href="data:,";
                title { "vines: report" }
                style { (PreEscaped(include_str!("report.css"))) }
            }
            body {
                h1 { "Nonlinear modal test of an oscillator with a vibro-impact nonlinear energy sink" }
                p { (parameters(&scene.dimensionless())) }
                @if let Some(left_out) = scene.left_out() {
                    p { (ideal("Theory, exact orbits and the regime map on this page are", &left_out)) ". The measurements have it." }
                }
                @for section in sections { (section) }
                h2 { "Scene and version" }
                p {
                    "vines " (env!("CARGO_PKG_VERSION")) ", " (std::env::consts::ARCH) " on " (std::env::consts::OS)
                    ". The same scene and version give the same page. M, k, c and m of the default scene are those of a published rig of this kind, \
                     because the study that it follows takes ε and λ from a reference that was not available; b is this project’s choice, on \
                     which no dimensionless result depends."
                }
                pre.settings { (serde_json::to_string_pretty(scene).unwrap_or_default()) }
            }
        }
    }
}
