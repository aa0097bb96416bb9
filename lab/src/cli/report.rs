//! `vines report`: the other commands one after another, and what they print and draw on one page.

use std::path::{Path, PathBuf};

use clap::{Args, Parser};
use maud::{DOCTYPE, Markup, PreEscaped, html};
use vines::fmu::process::TemporaryFolder;
use vines::map::LIMIT;
use vines::regime_map::{Axis, Map};
use vines::rig::BuiltIn;
use vines::scene::Scene;

use super::output::{results, written};
use super::shell::quoted;
use super::summary::{ideal, parameters};
use super::{Cli, backbone, dispatch, failure::Failure, identify, map, options::SceneArguments, signals};

const HELP: &str = "\
Runs `vines identify`, `backbone`, `theory`, `orbit --response`, `map` and `fit` on one scene, and writes report.html beside their files:
one page that opens offline in any browser and prints well. It has each command with its tables and figures, and all settings. Of a scene with
[structure] it has `vines structure` in place of the map.

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

/// A section: its title, its command (OUT, X and Y stand for the arguments), what it shows, and its figures.
type Section = (&'static str, &'static str, &'static str, &'static [&'static str]);

const SECTIONS: [Section; 6] = [
    (
        "Lock and free decay",
        "identify --rig built-in --out OUT",
        "The loop searches for phase resonance and holds it. Then the drive is off, and the motion decays along the manifold until the impacts \
         lose synchrony at the fold. The decay lies beside the backbone, because the impacts follow a falling amplitude late.",
        &["history.svg", "sim.svg", "backbone.svg"],
    ),
    (
        "Backbone, level by level",
        "backbone --out OUT",
        "The loop holds the response at one level after another until it has settled, and the amplitude of the drive follows.",
        &["tracked.svg"],
    ),
    (
        "First-order theory",
        "theory",
        "The slow invariant manifold, resonance at the scene's G, and the drives from which impacts begin.",
        &[],
    ),
    (
        "Frequency response",
        "orbit --response --range=-5:5 --figure OUT/response.svg",
        "Exact orbits at the scene's G. Asymmetric motions branch off where the symmetric ones lose their symmetry.",
        &["response.svg"],
    ),
    (
        "Regimes",
        "map --confirmations 0 --x X --y Y --out OUT",
        "One start per cell: where several regimes are stable, the start decides. The curves are exact bifurcations of the 1:1 motions.",
        &["map.svg"],
    ),
    (
        "Parameters from the backbone",
        "fit OUT/tracked.csv --figure OUT/fit.svg",
        "The levels of the tracked backbone beside the scene and the fitted rig.",
        &["fit.svg"],
    ),
];

/// Of a structure, in place of the regimes, which are those of one oscillator.
const STRUCTURE_SECTION: Section = (
    "Modes and stability",
    "structure --figure OUT/structure.svg",
    "The modes, and where the exact backbone is stable with the driven mode alone and with all modes.",
    &["structure.svg"],
);

pub(super) fn run(arguments: &Arguments) -> Result<String, Failure> {
    // Invalid settings are refused before anything runs or is written.
    let scene = arguments.scene.load()?;
    let is_structure = scene.structure.is_some();
    if !is_structure {
        Map::new(arguments.scene.family()?, &arguments.x, &arguments.y, None, LIMIT)?;
    }
    BuiltIn::new(&scene.plan().lock)?;
    let of_commands = [&identify::FILES[..], &backbone::FILES, &map::FILES].concat();
    let own = ["report.html", "response.svg", "structure.svg", "fit.svg"];
    let folder = results(&arguments.out, &[&own[..], &of_commands].concat())?;
    // The files of all commands are put in place together.
    let new = TemporaryFolder::new(tempfile::Builder::new().prefix(".vines-").tempdir_in(&arguments.out)?);
    let mut failed = Vec::new();
    let mut sections = Vec::new();
    for section in SECTIONS {
        let is_map = section.1.starts_with("map ");
        let (title, line, shows, figures) = if is_map && is_structure {
            STRUCTURE_SECTION
        } else {
            section
        };
        // The detunings are those of the structure.
        let line = if is_structure {
            line.replace(" --range=-5:5", "")
        } else {
            line.into()
        };
        let shown: Vec<String> = words(arguments, &line, &arguments.out)
            .iter()
            .map(|word| quoted(word))
            .collect();
        let shown = shown.join(" ");
        super::say(&shown);
        let command = Cli::try_parse_from(words(arguments, &line, new.path())).map_err(Failure::input)?;
        let (mut text, failure) = match dispatch(command.command) {
            Ok(results) => results.texts(),
            Err(failure) => (String::new(), Some(failure)),
        };
        if let Some(failure) = failure {
            if signals::arrived().is_some() {
                return Err(failure);
            }
            failed.push(title);
            text += &format!("error: {}", failure.message);
        }
        let figures = figures
            .iter()
            .map(|name| std::fs::read_to_string(new.path().join(name)));
        let lines = text.lines().filter(|line| !line.starts_with("Written: "));
        sections.push(html! {
            h2 { (title) }
            p { (shows) }
            pre { b { (shown) } "\n\n" (lines.collect::<Vec<_>>().join("\n").trim_end()) }
            // A figure that the command did not write is left out.
            @for svg in figures.flatten() { figure { (PreEscaped(svg)) } }
        });
    }
    let page = page(&scene, &sections).into_string();
    let mut files = vec![("report.html".into(), page.into_bytes())];
    for entry in std::fs::read_dir(new.path())? {
        let entry = entry?;
        files.push((entry.file_name(), std::fs::read(entry.path())?));
    }
    let text = written(&folder.replace(files)?[..1]);
    match &failed[..] {
        [] => Ok(text),
        titles => Err(Failure::run(format!(
            "without a result: {}\n{}",
            titles.join(", "),
            text.trim_end()
        ))),
    }
}

/// The words of a command on the scene of the report.
fn words(arguments: &Arguments, line: &str, out: &Path) -> Vec<String> {
    let Arguments { scene, x, y, .. } = arguments;
    let out = out.display().to_string();
    let word = |word: &str| match word {
        "X" => x.to_string(),
        "Y" => y.to_string(),
        _ => word.replace("OUT", &out),
    };
    let words = ["vines"].into_iter().chain(line.split(' ')).map(word);
    words.chain(scene.words()).collect()
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
                h1 { "Nonlinear modal test of " (if scene.structure.is_some() { "a structure" } else { "an oscillator" }) " with a vibro-impact nonlinear energy sink" }
                p { (parameters(&scene.dimensionless())) }
                @if let Some(left_out) = scene.left_out() {
                    @let results = if scene.structure.is_some() { "Theory and the fit" } else { "Theory, exact orbits and the regime map" };
                    p { (ideal(&format!("{results} on this page are"), &left_out)) ". The measurements have it." }
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
