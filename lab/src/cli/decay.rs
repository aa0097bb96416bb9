//! `vines decay`: accuracy of the estimators of the decay.

use clap::Args;
use vines::estimators::{self, Quality};
use vines::report::Table;
use vines::scene::Estimator;

use super::{failure::Failure, output::output, scene_arguments::SceneArguments};

const HELP: &str = "\
Locks the built-in plant, releases it, and estimates sigma along the decay with every estimator and window, on clean data and
with noise (of constant power, relative to the held response; 20 seeds). Prints the RMS error of sigma over the points with
C > 0.2. The reference is the time between zero crossings of the plant itself, located in closed form.

Examples:
  vines decay
  vines decay --set plant.r=0.8 --json";

/// Show the bias and the noise sensitivity of the estimators of the decay
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(super) struct Arguments {
    #[command(flatten)]
    scene: SceneArguments,

    /// Print a JSON array instead of a table
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<String, Failure> {
    let scene = arguments.scene.load()?;
    if scene.chain.is_on() {
        return Err(Failure::input(
            "[chain] has no effect here: the noise of 60, 50 and 40 dB is added to clean samples; switch its stages off (\"none\")",
        ));
    }
    let qualities = estimators::qualities(&scene).map_err(Failure::run)?;
    output(arguments.json, &qualities, || table(&qualities).markdown())
}

/// One row per estimator and window, with a column for each noise level.
fn table(qualities: &[Quality]) -> Table {
    let rows = qualities.chunk_by(|one, other| (one.estimator, one.window) == (other.estimator, other.window));
    Table::new("estimator | window, periods | clean: bias | clean: RMS | 60 dB | 50 dB | 40 dB").rows(rows.map(|row| {
        let name = match row[0].estimator {
            Estimator::Fit => "least squares",
            Estimator::Crossings => "zero crossings",
        };
        let mut cells = vec![
            name.to_string(),
            row[0].window.to_string(),
            format!("{:+.4}", row[0].bias),
        ];
        cells.extend(row.iter().map(|one| format!("{:.4}", one.rms)));
        cells
    }))
}
