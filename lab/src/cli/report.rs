//! `vines report`: everything about a scene on one page.

use std::path::PathBuf;

use clap::Args;
use vines::map::LIMIT;
use vines::report::write_report;
use vines::rig::BuiltIn;
use vines::sweep::{Axis, Map};

use super::output::{progress_bar, writable};
use super::{failure::Failure, options::SceneArguments};

const HELP: &str = "\
Runs the experiment, tracks the backbone, follows the exact curves, studies the convergence, maps the regimes, and writes
report.html: one file that opens offline in any browser and prints well, with text, figures, tables, the scene and an error budget.
The figures (SVG, for light and dark backgrounds) and tables are also written as files.

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

pub(super) fn run(arguments: &Arguments) -> Result<String, Failure> {
    let mut map = Map::new(arguments.scene.family()?, &arguments.x, &arguments.y, None, LIMIT)?;
    // Invalid settings are refused before anything runs or is written.
    BuiltIn::new(&map.sweep.scene().controller_config())?;
    writable(&arguments.out)?;
    let bar = progress_bar(1000, "{msg:10} [{wide_bar}] {percent} %");
    let report = write_report(&mut map, &arguments.out, &|section, done| {
        if bar.message() != section {
            bar.set_message(section.to_string());
        }
        bar.set_position((1000.0 * done) as u64);
    });
    bar.finish_and_clear();
    let (findings, written) = report?;
    let findings: String = findings.iter().map(|finding| format!("- {finding}\n")).collect();
    let page = written.first().map(|page| page.display().to_string());
    Ok(format!(
        "{findings}\nWritten: {} and {} figures and tables\n",
        page.unwrap_or_default(),
        written.len() - 1
    ))
}
