//! What a person and a program get to see: files, pictures, a short table.

mod backbone;
mod chart;
mod manifold;
mod table;

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::files::temporary;
use crate::identification::Identification;

pub use table::table;

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
pub fn write(found: &Identification, out: &Path) -> Result<Vec<PathBuf>, ReportError> {
    let format = |name| move |message: String| ReportError::Format { name, message };
    let json = serde_json::to_string_pretty(found)
        .map_err(|error| format("identification.json")(error.to_string()))?;
    let files = [
        ("identification.json", json + "\n"),
        ("backbone.csv", csv(found).map_err(format("backbone.csv"))?),
        (
            "backbone.svg",
            backbone::draw(found).map_err(format("backbone.svg"))?,
        ),
        ("sim.svg", manifold::draw(found).map_err(format("sim.svg"))?),
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

/// The decay as a table, one row a point.
fn csv(found: &Identification) -> Result<String, String> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    for point in &found.decay {
        writer.serialize(point).map_err(|error| error.to_string())?;
    }
    let bytes = writer.into_inner().map_err(|error| error.to_string())?;
    String::from_utf8(bytes).map_err(|error| error.to_string())
}
