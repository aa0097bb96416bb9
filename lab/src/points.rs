//! Measurements in files: points of a backbone, from tables of any program (CSV) and from what `vines identify` and `vines backbone` write (CSV and
//! JSON); and recordings, two channels over time (CSV).

use std::collections::BTreeMap;
use std::fmt::Display;
use std::path::Path;
use std::str::FromStr;

use serde_json::Value;

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
pub fn read(path: &Path, columns: &[Column], channels: &Channels) -> Result<Measurement, ArgumentError> {
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    if PYTHON.contains(&&*extension) {
        let file = path.display();
        return Err(format!(
            "{file}: this program reads recordings as CSV. `python -m vines fit {file}` with the same options reads MAT, HDF5, TDMS and UFF58; \
             install it with `pip install './python[io]'`"
        )
        .into());
    }
    let is_recording = || -> Option<bool> {
        let headers = csv::Reader::from_path(path).ok()?.headers().ok()?.clone();
        let has = |name: &str| headers.iter().any(|header| header.trim() == name);
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

fn cannot_read(path: &Path, reason: impl Display) -> ArgumentError {
    format!("cannot read {}: {reason}", path.display()).into()
}

fn not_a_number(path: &Path, row: usize, column: &str, value: &str) -> ArgumentError {
    let file = path.display();
    format!("{file}, row {row}: {column} = `{value}` is not a finite number").into()
}

/// Two channels of a table.
fn recording(path: &Path, channels: &Channels) -> Result<Recording, ArgumentError> {
    let (file, failed) = (path.display(), |error| cannot_read(path, error));
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .from_path(path)
        .map_err(failed)?;
    let headers = reader.headers().map_err(failed)?.clone();
    let rows: Vec<csv::StringRecord> = reader.records().collect::<Result<_, _>>().map_err(failed)?;
    let number = |row: usize, column: usize| {
        let text = rows[row].get(column).unwrap_or("");
        text.parse::<f64>()
            .map_err(|_| not_a_number(path, row + 2, &headers[column], text))
    };
    let values = |column: usize, factor: f64| -> Result<Vec<f64>, ArgumentError> {
        (0..rows.len()).map(|row| Ok(factor * number(row, column)?)).collect()
    };
    let column = |name: &str| headers.iter().position(|header| header == name);
    let channel = |given: &Option<Channel>, option: &str, usual: &str| {
        let usual = || Name { name: usual.into(), factor: 1.0 };
        let Name { name, factor } = given.clone().map_or_else(usual, |Channel(name)| name);
        let column = column(&name).ok_or_else(|| {
            let names: Vec<&str> = headers.iter().collect();
            format!(
                "{file} has no channel `{name}`; it has {}. Name the channel with {option} NAME:UNIT; a recording needs the response and the \
                 displacement of the base",
                names.join(", ")
            )
        });
        Ok::<_, ArgumentError>((values(column?, factor)?, name))
    };
    let sample_time = match (channels.rate, column("time")) {
        (Some(rate), _) => 1.0 / rate,
        (None, None) => {
            return Err(format!("{file} has no column `time` (s): give the samples a second with --rate").into());
        }
        (None, Some(time)) => {
            let times: Vec<f64> = values(time, 1.0)?;
            let last = times.len().saturating_sub(1).max(1);
            let step = (times.last().unwrap_or(&0.0) - times.first().unwrap_or(&0.0)) / last as f64;
            let is_uneven = |pair: &[f64]| ((pair[1] - pair[0]) / step - 1.0).abs() > UNEVEN || step <= 0.0;
            if let Some(n) = times.windows(2).position(is_uneven) {
                let (row, from, to) = (n + 3, times[n], times[n + 1]);
                return Err(format!(
                    "{file}, row {row}: the time goes from {from} s to {to} s, where a step is {step:.6e} s: the recording is interrupted there. \
                     Fit the parts as files of their own, `vines fit one.csv two.csv`"
                )
                .into());
            }
            step
        }
    };
    let (response, response_name) = channel(&channels.response, "--response", "response")?;
    // A run of `vines` without a base sensor has the drive that was commanded instead.
    let is_silent = |column: usize| rows.iter().all(|row| row.get(column).is_none_or(str::is_empty));
    let reference = column("reference").filter(|column| !is_silent(*column));
    let (drive, drive_name) = match (&channels.drive, reference, column("omega").zip(column("E"))) {
        (None, None, Some((omega, amplitude))) => {
            let (omegas, amplitudes) = (values(omega, 1.0)?, values(amplitude, 1.0)?);
            let mut phase = 0.0;
            let mut before = amplitudes.first().copied().unwrap_or(0.0);
            let base = omegas.iter().zip(&amplitudes).map(|(omega, amplitude)| {
                let value = before * f64::sin(phase);
                (phase, before) = (phase + omega * sample_time, *amplitude);
                value
            });
            (base.collect(), "E".into())
        }
        _ => channel(&channels.drive, "--drive", "reference")?,
    };
    Ok(Recording {
        origin: file.to_string(),
        channels: [response_name, drive_name],
        sample_time,
        response,
        drive,
    })
}

/// The points of a file, and the number of points that are left out.
fn points(path: &Path, columns: &[Column]) -> Result<(Vec<MeasuredPoint>, usize), ArgumentError> {
    let text = std::fs::read_to_string(path).map_err(|error| cannot_read(path, error))?;
    let rows: Vec<Row> = if text.trim_start().starts_with('{') {
        let value: Value = serde_json::from_str(&text).map_err(|error| cannot_read(path, error))?;
        objects(&value).ok_or_else(|| {
            format!(
                "{} has neither a locked point (`lock`) nor `points`: expected identification.json, tracked.json, or a table (CSV)",
                path.display()
            )
        })?
    } else {
        let mut reader = csv::ReaderBuilder::new()
            .trim(csv::Trim::All)
            .from_reader(text.as_bytes());
        let rows = reader.deserialize().collect::<Result<_, _>>();
        rows.map_err(|error| cannot_read(path, error))?
    };
    let kept: Vec<(usize, &Row)> = rows.iter().enumerate().filter(|(_, row)| is_symmetric(row)).collect();
    let points = kept.iter().map(|(n, row)| point(path, n + 1, row, columns));
    Ok((points.collect::<Result<_, _>>()?, rows.len() - kept.len()))
}

/// The locked point of `vines identify`, or the points of `vines backbone`.
fn objects(value: &Value) -> Option<Vec<Row>> {
    let text = |value: &Value| value.as_str().map_or_else(|| value.to_string(), String::from);
    let row = |object: &Value| -> Option<Row> {
        let values = object.as_object()?.iter();
        Some(values.map(|(key, value)| (key.clone(), text(value))).collect())
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

fn point(path: &Path, number: usize, row: &Row, columns: &[Column]) -> Result<MeasuredPoint, ArgumentError> {
    let value = |(quantity, column, factor): (&str, &str, f64)| {
        let named = columns.iter().rfind(|column| column.quantity == quantity);
        let (column, factor) = named.map_or((column, factor), |named| (&*named.name.name, named.name.factor));
        let text = row.get(column).ok_or_else(|| {
            let names: Vec<&str> = row.keys().map(String::as_str).collect();
            format!(
                "{} has no column `{column}`; it has {}. Name the column of {quantity} with --column {quantity}=NAME:UNIT. A fit needs the \
                 standard uncertainties u_f, u_A and u_E as well as f, A and E",
                path.display(),
                names.join(", ")
            )
        })?;
        let number_of = text.parse::<f64>().ok().filter(|value| value.is_finite());
        let refused = || not_a_number(path, number, column, text);
        number_of.map(|value| factor * value).ok_or_else(refused)
    };
    let estimate = |n: usize| {
        Ok::<_, ArgumentError>(Estimate {
            value: value(COLUMNS[n])?,
            uncertainty: value(COLUMNS[n + 3])?,
        })
    };
    let [omega, response, drive] = [estimate(0)?, estimate(1)?, estimate(2)?];
    Ok(MeasuredPoint { omega, response, drive })
}
