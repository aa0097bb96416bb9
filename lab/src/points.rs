//! Measurements in files: points of a backbone, from tables of any program (CSV) and from what `vines identify` and `vines backbone` write (CSV and
//! JSON); and recordings, two channels over time (CSV).

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use serde_json::Value;
use thiserror::Error;

use crate::ArgumentError;
use crate::fit::{MeasuredPoint, Recording};
use crate::identification::Regime;
use crate::numerics::Estimate;
use crate::scene::Name;

/// Quantities of a point, and the columns that have them: SI units but for the frequency, in Hz.
const COLUMNS: [(&str, &str, f64); 6] = [
    ("f", "f_Hz", std::f64::consts::TAU),
    ("A", "A_m", 1.0),
    ("E", "E_m", 1.0),
    ("u_f", "u_f_Hz", std::f64::consts::TAU),
    ("u_A", "u_A_m", 1.0),
    ("u_E", "u_E_m", 1.0),
];

/// A column of a user's table; parse it from `A=amplitude:mm`: the quantity, the name of the column, and its unit.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    quantity: &'static str,
    name: Name,
}

impl FromStr for Column {
    type Err = ArgumentError;

    fn from_str(text: &str) -> Result<Self, ArgumentError> {
        let quantities = COLUMNS.map(|(quantity, ..)| quantity).join(", ");
        let form = || {
            format!(
                "`{text}`: expected QUANTITY=COLUMN:UNIT, for instance A=amplitude:mm, with a quantity of {quantities}"
            )
        };
        let (quantity, column) = text.split_once('=').ok_or_else(form)?;
        let (name, unit) = column.rsplit_once(':').ok_or_else(form)?;
        let (quantity, ..) = COLUMNS
            .into_iter()
            .find(|(known, ..)| *known == quantity.trim())
            .ok_or_else(form)?;
        Ok(Self { quantity, name: Name::with_unit(name.trim(), unit.trim())? })
    }
}

/// Why points cannot be read.
#[derive(Debug, Error)]
#[expect(missing_docs, reason = "the messages explain the variants")]
pub enum PointsError {
    #[error("cannot read {}: {reason}", path.display())]
    Read { path: PathBuf, reason: String },
    #[error(
        "{} has no column `{column}`; it has {}. Name the column of {quantity} with --column {quantity}=NAME:UNIT. A fit needs the standard \
         uncertainties u_f, u_A and u_E as well as f, A and E",
        path.display(), columns.join(", ")
    )]
    NoColumn {
        path: PathBuf,
        column: String,
        quantity: &'static str,
        columns: Vec<String>,
    },
    #[error("{}, row {row}: {column} = `{value}` is not a finite number", path.display())]
    NotANumber {
        path: PathBuf,
        row: usize,
        column: String,
        value: String,
    },
    #[error(
        "{} has no channel `{channel}`; it has {}. Name the channel with {option} NAME:UNIT; a recording needs the response and the displacement of \
         the base",
        path.display(), channels.join(", ")
    )]
    NoChannel {
        path: PathBuf,
        channel: String,
        option: &'static str,
        channels: Vec<String>,
    },
    #[error("{} has no column `time` (s): give the samples a second with --rate", path.display())]
    NoTime { path: PathBuf },
    #[error(
        "{}, row {row}: the time goes from {from} s to {to} s, where a step is {step:.6e} s: the recording is interrupted there. Fit the parts as \
         files of their own, `vines fit one.csv two.csv`",
        path.display()
    )]
    Uneven {
        path: PathBuf,
        row: usize,
        from: f64,
        to: f64,
        step: f64,
    },
    #[error(
        "{}: this program reads recordings as CSV. `python -m vines fit {}` with the same options reads MAT, HDF5, TDMS and UFF58; install it with \
         `pip install './python[io]'`",
        path.display(), path.display()
    )]
    Python { path: PathBuf },
    #[error("{} has neither a locked point (`lock`) nor `points`: expected identification.json, tracked.json, or a table (CSV)", path.display())]
    NoPoints { path: PathBuf },
}

/// A row of a table: values by the names of the columns.
type Row = BTreeMap<String, String>;

/// A channel of a recording; parse it from `y`, `y:mm`, or `y:-0.5`: its name, and its unit or metres per unit.
#[derive(Debug, Clone, PartialEq)]
pub struct Channel(Name);

impl FromStr for Channel {
    type Err = ArgumentError;

    fn from_str(text: &str) -> Result<Self, ArgumentError> {
        let Some((name, unit)) = text.rsplit_once(':') else {
            return Ok(Self(Name { name: text.into(), factor: 1.0 }));
        };
        Ok(Self(match unit.parse::<f64>() {
            Ok(factor) if factor.is_finite() && factor != 0.0 => Name { name: name.into(), factor },
            _ => Name::with_unit(name, unit)?,
        }))
    }
}

/// How a recording is read.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Channels {
    /// The response; its column is named `response` otherwise.
    pub response: Option<Channel>,
    /// The displacement of the base; its column is named `reference` otherwise.
    pub drive: Option<Channel>,
    /// Samples a second; otherwise the column `time` has the time in seconds.
    pub rate: Option<f64>,
}

/// What a file contains.
#[derive(Debug)]
pub enum Measurement {
    /// Points, and the number of points that are left out: not settled, or of another regime than symmetric 1:1.
    Points(Vec<MeasuredPoint>, usize),
    /// Two channels over time.
    Recording(Recording),
}

/// What is measured in a file: a recording if its channels are named, or if it has the columns that `vines` writes.
///
/// # Errors
/// A file that cannot be read, without one of the columns, or with a value that is not a number.
pub fn read(path: &Path, columns: &[Column], channels: &Channels) -> Result<Measurement, PointsError> {
    let extension = path
        .extension()
        .map(|one| one.to_string_lossy().to_lowercase())
        .unwrap_or_default();
    if PYTHON.contains(&&*extension) {
        return Err(PointsError::Python { path: path.into() });
    }
    let is_recording = || -> Option<bool> {
        let headers = csv::Reader::from_path(path).ok()?.headers().ok()?.clone();
        let has = |name: &str| headers.iter().any(|one| one.trim() == name);
        Some(has("response") && (has("reference") || has("E")))
    };
    if channels.response.is_some() || channels.drive.is_some() || is_recording() == Some(true) {
        return Ok(Measurement::Recording(recording(path, channels)?));
    }
    let (points, left_out) = points(path, columns)?;
    Ok(Measurement::Points(points, left_out))
}

/// Formats that the Python package reads.
const PYTHON: [&str; 8] = ["mat", "h5", "hdf5", "hdf", "tdms", "uff", "unv", "uf"];
/// Largest relative difference of a time step from the mean one.
const UNEVEN: f64 = 0.01;

/// Two channels of a table.
fn recording(path: &Path, channels: &Channels) -> Result<Recording, PointsError> {
    let failed = |error: csv::Error| PointsError::Read { path: path.into(), reason: error.to_string() };
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .from_path(path)
        .map_err(failed)?;
    let headers = reader.headers().map_err(failed)?.clone();
    let rows: Vec<csv::StringRecord> = reader.records().collect::<Result<_, _>>().map_err(failed)?;
    let number = |row: usize, column: usize| {
        let text = rows[row].get(column).unwrap_or("");
        text.parse::<f64>().map_err(|_| PointsError::NotANumber {
            path: path.into(),
            row: row + 2,
            column: headers[column].into(),
            value: text.into(),
        })
    };
    let values = |column: usize, factor: f64| -> Result<Vec<f64>, PointsError> {
        (0..rows.len()).map(|row| Ok(factor * number(row, column)?)).collect()
    };
    let column = |name: &str| headers.iter().position(|one| one == name);
    let channel = |given: &Option<Channel>, option: &'static str, usual: &str| {
        let Name { name, factor } = given
            .clone()
            .map_or(Name { name: usual.into(), factor: 1.0 }, |one| one.0);
        let missing = || PointsError::NoChannel {
            path: path.into(),
            channel: name.clone(),
            option,
            channels: headers.iter().map(String::from).collect(),
        };
        Ok((column(&name).ok_or_else(missing)?, factor, name))
    };
    let sample_time = match (channels.rate, column("time")) {
        (Some(rate), _) => 1.0 / rate,
        (None, None) => return Err(PointsError::NoTime { path: path.into() }),
        (None, Some(time)) => {
            let times: Vec<f64> = values(time, 1.0)?;
            let last = times.len().saturating_sub(1).max(1);
            let step = (times.last().unwrap_or(&0.0) - times.first().unwrap_or(&0.0)) / last as f64;
            let is_uneven = |pair: &[f64]| ((pair[1] - pair[0]) / step - 1.0).abs() > UNEVEN || step <= 0.0;
            if let Some(n) = times.windows(2).position(is_uneven) {
                return Err(PointsError::Uneven {
                    path: path.into(),
                    row: n + 3,
                    from: times[n],
                    to: times[n + 1],
                    step,
                });
            }
            step
        }
    };
    let (response, factor, response_name) = channel(&channels.response, "--response", "response")?;
    let response = values(response, factor)?;
    // A run of `vines` without a base sensor has the drive that was commanded instead.
    let is_silent = |column: usize| rows.iter().all(|row| row.get(column).is_none_or(str::is_empty));
    let reference = column("reference").filter(|column| !is_silent(*column));
    let (drive, drive_name) = match (&channels.drive, reference, column("omega").zip(column("E"))) {
        (None, None, Some((omega, amplitude))) => {
            let (omegas, amplitudes): (Vec<f64>, Vec<f64>) = (values(omega, 1.0)?, values(amplitude, 1.0)?);
            let mut phase = 0.0;
            let mut before = amplitudes.first().copied().unwrap_or(0.0);
            let base = omegas.iter().zip(&amplitudes).map(|(omega, amplitude)| {
                let value = before * f64::sin(phase);
                (phase, before) = (phase + omega * sample_time, *amplitude);
                value
            });
            (base.collect(), "E".into())
        }
        _ => {
            let (drive, factor, name) = channel(&channels.drive, "--drive", "reference")?;
            (values(drive, factor)?, name)
        }
    };
    Ok(Recording {
        origin: path.display().to_string(),
        channels: [response_name, drive_name],
        sample_time,
        response,
        drive,
    })
}

/// The points of a file, and the number of points that are left out.
fn points(path: &Path, columns: &[Column]) -> Result<(Vec<MeasuredPoint>, usize), PointsError> {
    let read = |error: &dyn std::fmt::Display| PointsError::Read { path: path.into(), reason: error.to_string() };
    let text = std::fs::read_to_string(path).map_err(|error| read(&error))?;
    let rows: Vec<Row> = if text.trim_start().starts_with('{') {
        let value: Value = serde_json::from_str(&text).map_err(|error| read(&error))?;
        objects(&value).ok_or_else(|| PointsError::NoPoints { path: path.into() })?
    } else {
        let mut reader = csv::ReaderBuilder::new()
            .trim(csv::Trim::All)
            .from_reader(text.as_bytes());
        reader
            .deserialize()
            .collect::<Result<_, _>>()
            .map_err(|error| read(&error))?
    };
    let kept: Vec<(usize, &Row)> = rows.iter().enumerate().filter(|(_, row)| is_symmetric(row)).collect();
    let points = kept.iter().map(|(n, row)| point(path, n + 1, row, columns));
    Ok((points.collect::<Result<_, _>>()?, rows.len() - kept.len()))
}

/// The locked point of `vines identify`, or the points of `vines backbone`.
fn objects(value: &Value) -> Option<Vec<Row>> {
    let row = |object: &Value| -> Option<Row> {
        let text = |value: &Value| value.as_str().map_or_else(|| value.to_string(), String::from);
        Some(
            object
                .as_object()?
                .iter()
                .map(|(key, value)| (key.clone(), text(value)))
                .collect(),
        )
    };
    match (value.get("lock"), value.get("points")) {
        (Some(lock), _) => Some(vec![row(lock)?]),
        (None, Some(Value::Array(points))) => points.iter().map(row).collect(),
        _ => None,
    }
}

/// Whether a row is a settled point of symmetric 1:1 motion; a table without these columns has only such points.
fn is_symmetric(row: &Row) -> bool {
    let is_not_false = |key: &str| row.get(key).is_none_or(|value| value != "false");
    let regimes = [Regime::Symmetric, Regime::Unresolved].map(|regime| serde_json::to_value(regime).ok());
    let is_regime = |value: &String| regimes.contains(&Some(Value::String(value.clone())));
    is_not_false("settled") && is_not_false("reached") && row.get("regime").is_none_or(is_regime)
}

fn point(path: &Path, number: usize, row: &Row, columns: &[Column]) -> Result<MeasuredPoint, PointsError> {
    let value = |quantity: &str| -> Result<f64, PointsError> {
        let (quantity, column, factor) = COLUMNS[COLUMNS.iter().position(|(one, ..)| *one == quantity).unwrap_or(0)];
        let named = columns.iter().rfind(|column| column.quantity == quantity);
        let (column, factor) = named.map_or((column, factor), |named| (&named.name.name, named.name.factor));
        let text = row.get(column).ok_or_else(|| PointsError::NoColumn {
            path: path.into(),
            column: column.into(),
            quantity,
            columns: row.keys().cloned().collect(),
        })?;
        let number_of = text.parse::<f64>().ok().filter(|value| value.is_finite());
        number_of
            .map(|value| factor * value)
            .ok_or_else(|| PointsError::NotANumber {
                path: path.into(),
                row: number,
                column: column.into(),
                value: text.clone(),
            })
    };
    let estimate = |quantity: &str, u: &str| Ok(Estimate { value: value(quantity)?, uncertainty: value(u)? });
    Ok(MeasuredPoint {
        omega: estimate("f", "u_f")?,
        response: estimate("A", "u_A")?,
        drive: estimate("E", "u_E")?,
    })
}
