//! What a person and a program get to see of a tracked backbone.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::{ReportError, csv, tracking_picture, write_files};
use crate::comparison::{TrackedComparison, TrackedPoint};

/// The columns that the CSV file has beside those of a point.
#[derive(Serialize)]
struct Compared {
    distance: Option<f64>,
    sigma_less_exact: Option<f64>,
    #[serde(rename = "G_less_exact")]
    g_less_exact: Option<f64>,
}

/// The points in a table, and what they cost.
#[must_use]
pub fn tracking_table(found: &TrackedComparison) -> String {
    let p = &found.parameters;
    let mut lines = vec![
        format!(
            "epsilon = {:.6}, lambda = {:.4}, r = {}",
            p.epsilon, p.lambda, p.r
        ),
        String::new(),
        format!(
            "  {:>9} {:>10} {:>9} {:>8} {:>9} {:>9}  {}",
            "C", "sigma", "G", "periods", "averaged", "distance", "regime by response / by impacts"
        ),
    ];
    for TrackedPoint { point, exact } in &found.points {
        let distance = exact.map_or("-".into(), |exact| format!("{:.1e}", exact.nearest));
        let regime = match point.regime_by_impacts {
            Some(by_impacts) => format!("{} / {by_impacts}", point.regime),
            None => point.regime.to_string(),
        };
        let settled = if point.settled { "" } else { "; not settled" };
        lines.push(format!(
            "  {:>9.6} {:>10.6} {:>9.6} {:>8.1} {:>9} {distance:>9}  {regime}{settled}",
            point.c, point.sigma, point.g, point.periods, point.averaged
        ));
    }
    lines.push(String::new());
    lines.push(format!(
            "{} points in {:.0} periods, {:.1} of which before the loop held the response: {:.1} periods per point",
            found.points.len(),
            found.periods,
            found.periods_to_lock,
            found.periods_per_point()
        ));
    if let Some(worst) = found.worst() {
        lines.push(format!(
                "Largest distance from the exact backbone (largest of the differences in C, sigma and G): {worst:.1e}"
            ));
    }
    lines.join("\n") + "\n"
}

/// Writes `tracked.json`, `tracked.csv` and `tracked.svg` into `out` and returns their paths. All of it is made before
/// the first file is written, and each file is complete or absent.
///
/// # Errors
/// A folder or file that cannot be written.
pub fn write_tracking(found: &TrackedComparison, out: &Path) -> Result<Vec<PathBuf>, ReportError> {
    let format = |name| move |message: String| ReportError::Format { name, message };
    let json = serde_json::to_string_pretty(found)
        .map_err(|error| format("tracked.json")(error.to_string()))?;
    let rows = found.points.iter().map(|TrackedPoint { point, exact }| {
        let compared = Compared {
            distance: exact.map(|exact| exact.nearest),
            sigma_less_exact: exact.and_then(|exact| exact.sigma),
            g_less_exact: exact.and_then(|exact| exact.g),
        };
        (point, compared)
    });
    let files = [
        ("tracked.json", json + "\n"),
        ("tracked.csv", csv(rows).map_err(format("tracked.csv"))?),
        (
            "tracked.svg",
            tracking_picture::draw(found).map_err(format("tracked.svg"))?,
        ),
    ];
    write_files(out, &files)
}
