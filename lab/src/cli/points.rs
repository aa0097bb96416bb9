//! Measurements in files: points of a backbone, from tables of any program (CSV) and from what `vines identify` and `vines backbone` write (CSV and
//! JSON); and recordings, two channels over time.

use std::collections::BTreeMap;
use std::fmt::Display;
use std::path::Path;
use std::str::FromStr;

use serde::Deserialize;
use serde_json::Value;
use vines::ArgumentError;
use vines::fit::{Contents, MeasuredPoint, Recording, Selection, plain_table, requires_sensor};
use vines::identification::Regime;
use vines::linear::MeasuredLinear;
use vines::numerics::Estimate;
use vines::scene::{Measurand, Name, Scene, phase_target};

use super::shell::quoted;

/// Quantities of a point, the columns that have them, and their units.
const COLUMNS: [(&str, &str, &str); 6] = [
    ("f", "f_Hz", "Hz"),
    ("A", "A_m", "m"),
    ("E", "E_m", "m"),
    ("u_f", "u_f_Hz", "Hz"),
    ("u_A", "u_A_m", "m"),
    ("u_E", "u_E_m", "m"),
];

/// Columns of results of `vines`, which only a scene gives.
const OWN: [&str; 2] = ["C", "sigma"];
/// Columns of a drive by force.
const FORCE: [(&str, &str, &str); 2] = [("E", "F_N", "N"), ("u_E", "u_F_N", "N")];

/// What a column measures, and SI units per unit. Amplitudes may be those of velocities and accelerations; of a force there is no measurand.
#[derive(Debug, Clone, Copy, PartialEq)]
struct ColumnUnit {
    measurand: Option<Measurand>,
    factor: f64,
}

impl ColumnUnit {
    fn of(quantity: &str, column: &str, unit: &str) -> Result<Self, ArgumentError> {
        let Name { factor, si, .. } = Name::with_unit(column, unit)?;
        let si = si.unwrap_or_default();
        let measurand = Measurand::of_unit(si);
        let of = quantity.trim_start_matches("u_");
        let is_possible = match of {
            "f" => si == "rad/s",
            "E" => measurand.is_some() || si == "N",
            _ => measurand.is_some(),
        };
        if !is_possible {
            let allowed = match of {
                "f" => "Hz, rad/s or 1/min",
                "E" => "a length (m, mm, µm), a velocity (m/s, mm/s), an acceleration (m/s², g) or a force (N)",
                _ => "a length (m, mm, µm), a velocity (m/s, mm/s) or an acceleration (m/s², g)",
            };
            return Err(format!("{column}: {quantity} in {unit} is not possible; allowed is {allowed}").into());
        }
        Ok(Self { measurand, factor })
    }
}

/// A column of a user's table; parse it from `A=amplitude:mm`: the quantity, the name of the column, and its unit.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Column {
    quantity: &'static str,
    name: String,
    unit: ColumnUnit,
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
        let name = name.trim().to_string();
        let unit = ColumnUnit::of(quantity, &name, unit.trim())?;
        Ok(Self { quantity, name, unit })
    }
}

/// A row of a table: values by the names of the columns.
type Row = BTreeMap<String, String>;

/// What a file contains.
#[derive(Debug)]
pub(super) enum Measurement {
    /// Points, the number of points that are left out (not settled, or of another regime than symmetric 1:1), and the linear response of the
    /// rig.
    Points(Vec<MeasuredPoint>, usize, Option<MeasuredLinear>),
    /// Two channels over time.
    Recording(Recording),
}

/// What a file contains.
#[derive(Debug)]
pub enum Source {
    /// Results of `vines` as JSON.
    Json(Vec<u8>),
    /// Columns of a table, or channels of another format.
    Channels(Contents),
}

/// Reads JSON or a plain table. Other files are refused with the command that reads them.
pub(super) fn plain(path: &Path) -> Result<Source, ArgumentError> {
    let file = path.display();
    let python = |reason: &str| {
        ArgumentError::from(format!(
            "{reason}\n`python -m vines fit {}` with the same options reads other tables, and MAT, HDF5, TDMS, UFF58 and LVM; install it with \
             `pip install './python[io]'`",
            quoted(&path.to_string_lossy())
        ))
    };
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    if PYTHON.contains(&&*extension) {
        return Err(python(&format!("{file}: this program reads recordings as plain CSV")));
    }
    let bytes = std::fs::read(path).map_err(|error| cannot_read(path, error))?;
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&bytes);
    if text.trim_ascii_start().starts_with(b"{") {
        return Ok(Source::Json(text.into()));
    }
    let table = plain_table(&file.to_string(), &bytes);
    table.map(Source::Channels).map_err(|error| python(&error.to_string()))
}

/// How the points of a file are read.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reading<'a> {
    /// Columns that the user names.
    pub columns: &'a [Column],
    /// At which phase points were measured that do not say it, rad.
    pub phase: f64,
    /// The scene, for the units of the channels.
    pub scene: &'a Scene,
    /// Whether files that `vines` has not written are read as well.
    pub beside_others: bool,
}

/// Whether `vines` wrote a file: a table of points, or a recording.
pub(super) fn is_own(contents: &Contents) -> bool {
    let has = |names: &[&str]| names.iter().all(|name| contents.unit(name).is_some());
    has(&OWN) || has(&["response", "omega", "E"])
}

/// What is measured in a file: points if it has one of their columns or `reading` names some, otherwise a recording.
pub(super) fn measurement(
    path: &Path,
    source: Source,
    reading: Reading<'_>,
    selection: &Selection,
) -> Result<Measurement, ArgumentError> {
    let contents = match source {
        Source::Channels(contents) => contents,
        Source::Json(bytes) => return of_json(path, &bytes, reading),
    };
    let has = |names: &[&str]| names.iter().all(|name| contents.unit(name).is_some());
    let own_points = has(&OWN);
    // Channels that a file of `vines` does not have are named for the files of others beside it.
    let is_beside = reading.beside_others && is_own(&contents);
    let mut named = [&selection.response, &selection.drive].into_iter().flatten();
    let is_named = named.any(|text| !is_beside || has(&[text.split(':').next().unwrap_or(text)]));
    let has_points = !reading.columns.is_empty() || COLUMNS.iter().any(|(_, name, _)| has(&[name]));
    if has_points && !is_named {
        if !own_points {
            requires_sensor(&contents.origin, reading.scene)?;
        }
        let row = |row: Vec<(&str, String)>| row.into_iter().map(|(name, cell)| (name.to_string(), cell)).collect();
        let rows: Vec<Row> = contents.rows().map(row).collect();
        return points(path, &rows, reading, rows.first().and_then(linear_of), |column| {
            contents.unit(column).unwrap_or_default()
        });
    }
    if !is_named && contents.unit("response").is_none() {
        let names = COLUMNS.map(|(_, name, _)| name).join(", ");
        return Err(contents.refusal(&format!(
            " has neither the channels of a recording nor columns of points ({names}). Name the channels with --response NAME:UNIT and --drive \
             NAME:UNIT, or the columns of points with --column"
        ))
        .into());
    }
    let of_itself = Selection { response: None, drive: None, ..selection.clone() };
    let selection = if is_beside && !is_named { &of_itself } else { selection };
    Ok(Measurement::Recording(Recording::of(&contents, selection)?))
}

/// Points in what `vines identify`, `backbone` and `check` write as JSON.
fn of_json(path: &Path, bytes: &[u8], reading: Reading<'_>) -> Result<Measurement, ArgumentError> {
    let file = path.display();
    let value: Value = serde_json::from_slice(bytes).map_err(|error| cannot_read(path, error))?;
    let linear = value
        .get("linear")
        .and_then(|linear| MeasuredLinear::deserialize(linear).ok());
    // A loop check has no points.
    let rows = objects(&value).or(linear.map(|_| Vec::new())).ok_or_else(|| {
        format!(
            "{file} has neither a locked point (`lock`) nor `points` nor a linear response (`linear`): expected identification.json, tracked.json, \
             the JSON of `vines check`, or a table (CSV)"
        )
    })?;
    points(path, &rows, reading, linear, |_| "")
}

/// Formats that the Python package reads.
const PYTHON: [&str; 10] = ["mat", "h5", "hdf5", "hdf", "nc", "tdms", "uff", "unv", "uf", "lvm"];

fn cannot_read(path: &Path, reason: impl Display) -> ArgumentError {
    format!("cannot read {}: {reason}", path.display()).into()
}

fn not_a_number(path: &Path, row: usize, column: &str, value: &str) -> ArgumentError {
    let file = path.display();
    format!("{file}, row {row}: {column} = `{value}` is not a finite number").into()
}

/// The points of a file, and the number of points that are left out.
fn points<'a>(
    path: &Path,
    rows: &[Row],
    reading: Reading<'_>,
    linear: Option<MeasuredLinear>,
    stated: impl Fn(&str) -> &'a str,
) -> Result<Measurement, ArgumentError> {
    let mut kept = Vec::new();
    for (n, row) in rows.iter().enumerate() {
        if is_symmetric(path, n + 1, row)? {
            kept.push(point(path, n + 1, row, reading, &stated)?);
        }
    }
    let left_out = rows.len() - kept.len();
    Ok(Measurement::Points(kept, left_out, linear))
}

/// The linear response in the columns of a table.
fn linear_of(row: &Row) -> Option<MeasuredLinear> {
    let values = MeasuredLinear::COLUMNS.map(|name| {
        let text = row.get(name)?;
        let value = text
            .parse::<f64>()
            .map_or_else(|_| Value::from(text.as_str()), Value::from);
        Some((name.strip_prefix("linear_")?.to_string(), value))
    });
    let object = values.into_iter().collect::<Option<serde_json::Map<_, _>>>()?;
    MeasuredLinear::deserialize(Value::Object(object)).ok()
}

/// A value without the quotes of a text.
fn text(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), String::from)
}

/// The locked point of `vines identify`, or the points of `vines backbone`.
fn objects(value: &Value) -> Option<Vec<Row>> {
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

/// A Boolean by the words that this program, Python, spreadsheets in English and German, and numbers have for it; `None` for others.
pub fn truth(word: &str) -> Option<bool> {
    match &*word.trim().to_lowercase() {
        "true" | "wahr" | "1" | "1.0" => Some(true),
        "false" | "falsch" | "0" | "0.0" => Some(false),
        _ => None,
    }
}

/// Boolean columns.
const FLAGS: [&str; 2] = ["settled", "reached"];
/// Columns of motions and regimes.
const MOTIONS: [&str; 2] = ["motion", "regime"];

/// Whether a row is a settled point whose motion may be the symmetric 1:1 one; a table without these columns has only such points.
fn is_symmetric(path: &Path, number: usize, row: &Row) -> Result<bool, ArgumentError> {
    let refused = |key: &str, value: &str, allowed: &str| {
        let file = path.display();
        Err(format!("{file}, row {number}: {key} = `{value}` is not known; allowed is {allowed}").into())
    };
    let mut is_kept = true;
    for (key, value) in FLAGS.into_iter().filter_map(|key| Some((key, row.get(key)?))) {
        match truth(value) {
            Some(is_true) => is_kept &= is_true,
            None => return refused(key, value, "true or false, WAHR or FALSCH, 1 or 0"),
        }
    }
    for (key, value) in MOTIONS.into_iter().filter_map(|key| Some((key, row.get(key)?))) {
        let word = |regime: &Regime| match key {
            "motion" => regime.motion(),
            _ => regime.word(),
        };
        let Some(regime) = Regime::ALL.iter().find(|regime| word(regime) == value.trim()) else {
            let mut all: Vec<&str> = Regime::ALL.iter().map(word).collect();
            all.dedup();
            return refused(key, value, &all.join("; "));
        };
        is_kept &= matches!(regime, Regime::Symmetric | Regime::Unresolved);
    }
    Ok(is_kept)
}

/// The column of the phase at which a point was measured, degrees.
const PHASE: &str = "phase_target_deg";

/// A point. `stated`: the unit that the head of a column states.
fn point<'a>(
    path: &Path,
    number: usize,
    row: &Row,
    Reading { columns, phase, scene, .. }: Reading<'_>,
    stated: &impl Fn(&str) -> &'a str,
) -> Result<MeasuredPoint, ArgumentError> {
    let units = scene.units();
    let is_forced = units.reference.symbol == "N";
    // The value in SI units, and how often a displacement is differentiated.
    let value = |(quantity, column, unit): (&str, &str, &str)| {
        let of_force = FORCE.into_iter().find(|(of, ..)| is_forced && *of == quantity);
        let (column, unit) = of_force.map_or((column, unit), |(_, column, unit)| (column, unit));
        let named = columns.iter().rfind(|column| column.quantity == quantity);
        let column = named.map_or(column, |named| &named.name);
        let unit = match (named, stated(column)) {
            (Some(named), _) => named.unit,
            (None, "") => ColumnUnit::of(quantity, column, unit)?,
            (None, stated) => ColumnUnit::of(quantity, column, stated)?,
        };
        if quantity.ends_with('E') && unit.measurand.is_none() != is_forced {
            let (driven, needs) = if is_forced {
                ("a force", "N")
            } else {
                ("the motion of a base", "no N")
            };
            return Err(
                format!("{column}: the scene is driven by {driven}, whose amplitude {quantity} is in {needs}").into(),
            );
        }
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
        let value = unit.factor * number_of.ok_or_else(refused)?;
        Ok::<_, ArgumentError>((value, unit.measurand.map_or(0, Measurand::order)))
    };
    let estimate = |n: usize, omega: f64| {
        let displacement = |(value, order): (f64, i32)| value / omega.powi(order);
        Ok::<_, ArgumentError>(Estimate {
            value: displacement(value(COLUMNS[n])?),
            uncertainty: displacement(value(COLUMNS[n + 3])?),
        })
    };
    let omega = estimate(0, 1.0)?;
    let [response, drive] = [estimate(1, omega.value)?, estimate(2, omega.value)?];
    let phase = match row.get(PHASE) {
        None => phase,
        Some(text) => {
            let value = text
                .parse::<f64>()
                .map_err(|_| not_a_number(path, number, PHASE, text))?;
            phase_target(PHASE, value).map_err(|error| format!("{}, row {number}: {error}", path.display()))?;
            value.to_radians()
        }
    };
    Ok(MeasuredPoint { omega, response, drive, phase }.in_metres(&units))
}
