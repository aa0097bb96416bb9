//! What a person and a program get to see: files, pictures, a short table.

mod approach;
mod backbone;
mod backbones;
mod chart;
mod history;
mod lines;
mod manifold;
mod map;
mod page;
mod period;
mod responses;
mod section;
mod sections;
mod study;
mod table;
mod theme;
mod tracked;
mod tracking;
mod tracking_picture;

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use serde::Serialize;
use thiserror::Error;

use crate::comparison::Comparison;
use crate::files::temporary;
use crate::map::{Cell, Map, Point};

pub use section::{Attachment, Block, Budget, Section};
pub use sections::{Maker, SECTIONS, Subject};
pub use study::{Progress, Report, write_report};
pub use table::table;
pub use theme::dark;
pub use tracking::{tracking_table, write_tracking};

/// Why a report could not be written.
#[derive(Debug, Error)]
pub enum ReportError {
    /// The file system refused.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// What was being written.
        path: PathBuf,
        /// Why not.
        source: io::Error,
    },
    /// The numbers could not be put in the form wanted.
    #[error("cannot write {name}: {message}")]
    Format {
        /// What was being written.
        name: &'static str,
        /// Why not.
        message: String,
    },
}

/// Writes `identification.json`, `backbone.csv`, `backbone.svg` and `sim.svg` into `out` and returns their paths.
///
/// All of it is made before the first file is written, and each file is complete or absent.
///
/// # Errors
/// A folder or file that cannot be written.
pub fn write(found: &Comparison, out: &Path) -> Result<Vec<PathBuf>, ReportError> {
    let json = serde_json::to_string_pretty(found)
        .map_err(|error| format("identification.json")(error.to_string()))?;
    let files = [
        ("identification.json", json + "\n"),
        (
            "backbone.csv",
            decay_csv(found).map_err(format("backbone.csv"))?,
        ),
        (
            "backbone.svg",
            backbone::draw(found).map_err(format("backbone.svg"))?,
        ),
        ("sim.svg", manifold::draw(found).map_err(format("sim.svg"))?),
    ];
    write_files(out, &files)
}

/// Writes `map.csv`, `map.svg` and `map-dark.svg` into `out` and returns their paths, as [`write()`] does.
///
/// # Errors
/// A folder or file that cannot be written.
pub fn write_map(map: &Map, out: &Path) -> Result<Vec<PathBuf>, ReportError> {
    let rows = map.cells.iter().map(map_row);
    let picture = map::draw(map).map_err(format("map.svg"))?;
    let files = [
        ("map.csv", csv(rows).map_err(format("map.csv"))?),
        ("map-dark.svg", dark(&picture)),
        ("map.svg", picture),
    ];
    write_files(out, &files)
}

fn format(name: &'static str) -> impl Fn(String) -> ReportError {
    move |message| ReportError::Format { name, message }
}

fn write_files(out: &Path, files: &[(&str, String)]) -> Result<Vec<PathBuf>, ReportError> {
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

/// One row of the map's table.
#[derive(Serialize)]
struct MapRow {
    sigma: f64,
    #[serde(rename = "G")]
    g: f64,
    r: f64,
    regime: &'static str,
    impacts_per_period: f64,
    impacts: usize,
    periods: u32,
    synchrony: f64,
    growth: Option<f64>,
    theory_stable: bool,
}

fn map_row(cell: &Cell) -> MapRow {
    let Point {
        regime,
        impacts_per_period,
        impacts,
        periods,
        synchrony,
        growth,
    } = cell.point;
    MapRow {
        sigma: cell.sigma,
        g: cell.g,
        r: cell.r,
        regime: regime.name(),
        impacts_per_period,
        impacts,
        periods,
        synchrony,
        growth,
        theory_stable: cell.theory_stable,
    }
}

/// The points along a decay.
fn decay_csv(found: &Comparison) -> Result<String, String> {
    #[derive(Serialize)]
    struct Theory {
        sigma_theory: Option<f64>,
    }
    csv(found.decay.iter().map(|one| {
        let sigma_theory = one.sigma_theory;
        (one.point, Theory { sigma_theory })
    }))
}

/// A table, one row an item.
fn csv<T: Serialize>(rows: impl IntoIterator<Item = T>) -> Result<String, String> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    for row in rows {
        writer.serialize(row).map_err(|error| error.to_string())?;
    }
    let bytes = writer.into_inner().map_err(|error| error.to_string())?;
    String::from_utf8(bytes).map_err(|error| error.to_string())
}
