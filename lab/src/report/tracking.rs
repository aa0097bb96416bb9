//! What a person and a program get to see of a tracked backbone.

use std::io::Write;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::{ReportError, tracking_picture as picture};
use crate::backbone::{Distance, ExactCurve, Point, Tracked};
use crate::files::temporary;
use crate::scene::{Dimensionless, Scene};

/// A tracked backbone beside the exact one.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TrackedReport {
    /// The numbers all of this belongs to.
    pub parameters: Dimensionless,
    /// Periods from the start to the closed loop.
    pub periods_to_lock: f64,
    /// All periods, from the start to the last point.
    pub periods: f64,
    /// The points, each beside the exact curve.
    pub points: Vec<Compared>,
    #[serde(skip)]
    curve: ExactCurve,
}

/// A point and its distance from the exact backbone; absent where there is none to compare with.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Compared {
    /// The point.
    #[serde(flatten)]
    pub point: Point,
    /// Its distance.
    pub exact: Option<Distance>,
}

/// The columns that the CSV file has beside those of a point.
#[derive(Serialize)]
struct Compare {
    distance: Option<f64>,
    sigma_less_exact: Option<f64>,
    #[serde(rename = "G_less_exact")]
    g_less_exact: Option<f64>,
}

impl TrackedReport {
    /// Puts the points beside the exact backbone of the scene; that is for phase resonance only.
    #[must_use]
    pub fn new(tracked: &Tracked, scene: &Scene) -> Self {
        let parameters = scene.dimensionless();
        let curve = ExactCurve::of(&parameters);
        let at_resonance = scene.controller.phase_target == -90.0;
        let compare = |point: &Point| Compared {
            point: *point,
            exact: at_resonance
                .then(|| curve.distance(point.c, point.sigma, point.g))
                .flatten(),
        };
        Self {
            points: tracked.points.iter().map(compare).collect(),
            periods_to_lock: tracked.periods_to_lock,
            periods: tracked.periods,
            parameters,
            curve,
        }
    }

    /// All periods, the lock included, over the number of points.
    #[must_use]
    pub fn periods_per_point(&self) -> f64 {
        self.periods / self.points.len() as f64
    }

    /// Largest distance of a point from the exact backbone.
    #[must_use]
    pub fn worst(&self) -> Option<f64> {
        let distances = self.points.iter().filter_map(|one| one.exact);
        distances.map(|exact| exact.nearest).reduce(f64::max)
    }

    /// The exact backbone beside which the points are put.
    #[must_use]
    pub fn exact(&self) -> &ExactCurve {
        &self.curve
    }

    /// The points in a table, and what they cost.
    #[must_use]
    pub fn table(&self) -> String {
        let p = &self.parameters;
        let mut lines = vec![
            format!(
                "epsilon = {:.6}, lambda = {:.4}, r = {}",
                p.epsilon, p.lambda, p.r
            ),
            String::new(),
            format!(
                "  {:>9} {:>10} {:>9} {:>8} {:>9} {:>9}  {}",
                "C",
                "sigma",
                "G",
                "periods",
                "averaged",
                "distance",
                "regime by response / by impacts"
            ),
        ];
        for Compared { point, exact } in &self.points {
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
            self.points.len(),
            self.periods,
            self.periods_to_lock,
            self.periods_per_point()
        ));
        if let Some(worst) = self.worst() {
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
    pub fn write(&self, out: &Path) -> Result<Vec<PathBuf>, ReportError> {
        let format = |name| move |message: String| ReportError::Format { name, message };
        let json = serde_json::to_string_pretty(self)
            .map_err(|error| format("tracked.json")(error.to_string()))?;
        let files = [
            ("tracked.json", json + "\n"),
            ("tracked.csv", self.csv().map_err(format("tracked.csv"))?),
            (
                "tracked.svg",
                picture::draw(self).map_err(format("tracked.svg"))?,
            ),
        ];
        let refused = |path: &Path| {
            let path = path.to_path_buf();
            move |source| ReportError::Write { path, source }
        };
        std::fs::create_dir_all(out).map_err(refused(out))?;
        let mut written = Vec::new();
        for (name, text) in files {
            let path = out.join(name);
            let mut file = temporary(out).map_err(refused(&path))?;
            file.write_all(text.as_bytes()).map_err(refused(&path))?;
            file.persist(&path)
                .map_err(|error| refused(&path)(error.error))?;
            written.push(path);
        }
        Ok(written)
    }

    fn csv(&self) -> Result<String, String> {
        let mut writer = csv::Writer::from_writer(Vec::new());
        for Compared { point, exact } in &self.points {
            let compare = Compare {
                distance: exact.map(|exact| exact.nearest),
                sigma_less_exact: exact.and_then(|exact| exact.sigma),
                g_less_exact: exact.and_then(|exact| exact.g),
            };
            writer
                .serialize((point, compare))
                .map_err(|error| error.to_string())?;
        }
        let bytes = writer.into_inner().map_err(|error| error.to_string())?;
        String::from_utf8(bytes).map_err(|error| error.to_string())
    }
}
