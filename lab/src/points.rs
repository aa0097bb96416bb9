//! Measured points of a backbone in files: tables of any program (CSV), and what `vines identify` and `vines backbone` write (CSV and JSON).

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use serde_json::Value;
use thiserror::Error;

use crate::ArgumentError;
use crate::fit::MeasuredPoint;
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
    #[error("{} has neither a locked point (`lock`) nor `points`: expected identification.json, tracked.json, or a table (CSV)", path.display())]
    NoPoints { path: PathBuf },
}

/// A row of a table: values by the names of the columns.
type Row = BTreeMap<String, String>;

/// The points of a file, and the number of points that are left out: not settled, or of another regime than symmetric 1:1.
///
/// # Errors
/// A file that cannot be read, without one of the columns, or with a value that is not a number.
pub fn read(path: &Path, columns: &[Column]) -> Result<(Vec<MeasuredPoint>, usize), PointsError> {
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
