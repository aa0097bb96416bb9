//! Tables of numbers as text, as people have them: the delimiter, the decimal mark, the encoding, the names and the units are found.

use std::path::Path;

use chrono::{NaiveDateTime, Timelike};
use csv::StringRecord;
use encoding_rs::{Encoding, UTF_8, UTF_16BE, UTF_16LE, WINDOWS_1252};

use super::channels::{Channel, Contents};
use super::recording::RecordingError;
use crate::scene::unit;

/// A table.
#[derive(Debug, Clone)]
pub struct Table {
    origin: String,
    /// How it was read, for messages.
    layout: String,
    decimal: char,
    names: Vec<String>,
    units: Vec<String>,
    rows: Vec<StringRecord>,
    first_line: usize,
}

/// Delimiters and decimal marks. Of two that read a table equally well it is the first.
const LAYOUTS: [(u8, char); 8] = [
    (b',', '.'),
    (b';', '.'),
    (b';', ','),
    (b'\t', '.'),
    (b'\t', ','),
    (b' ', '.'),
    (b' ', ','),
    (b'|', '.'),
];
/// Number of rows, at the end of the table, by which the layout is found: a preamble is at the beginning.
const JUDGED: usize = 200;
/// Format of a date, ISO 8601, with a space for its T.
const DATE: &str = "%Y-%m-%d %H:%M:%S%.f";

/// What rows say about a layout.
struct Judgement {
    /// Number of fields of most rows.
    width: usize,
    /// Which columns have numbers in most of these rows.
    is_number: Vec<bool>,
    /// Share of the cells of all rows that are numbers, or empty, in rows of this width.
    share: f64,
}

impl Table {
    /// Reads a file.
    ///
    /// # Errors
    /// A file that cannot be read, is empty, or has no row of numbers.
    pub fn read(path: &Path) -> Result<Self, RecordingError> {
        let bytes = std::fs::read(path)
            .map_err(|error| RecordingError::new(format!("cannot read {}: {error}", path.display())))?;
        Self::parse(&path.display().to_string(), &bytes)
    }

    /// Reads the content of the file `origin`.
    ///
    /// # Errors
    /// As [`Table::read`].
    pub fn parse(origin: &str, bytes: &[u8]) -> Result<Self, RecordingError> {
        let refused = |message: &str| Err(RecordingError::new(format!("{origin}{message}")));
        let (encoding, skipped) = Encoding::for_bom(bytes).unwrap_or_else(|| (guessed(bytes), 0));
        let (text, _) = encoding.decode_without_bom_handling(&bytes[skipped..]);
        let text = without_comments(&text);
        if text.trim().is_empty() {
            return refused(" is empty: it has no row of numbers");
        }
        let judged = LAYOUTS.map(|(delimiter, decimal)| {
            let rows = tail(&text, delimiter);
            (delimiter, decimal, judged(&rows, decimal))
        });
        let best = judged
            .into_iter()
            .rev()
            .max_by(|(.., one), (.., other)| one.share.total_cmp(&other.share).then(one.width.cmp(&other.width)));
        let Some((delimiter, decimal, judgement)) = best.filter(|(.., one)| one.is_number.contains(&true)) else {
            let lines = text.lines().filter(|line| !line.is_empty()).take(3);
            let lines: Vec<String> = lines
                .map(|line| format!("\n  {}", line.chars().take(100).collect::<String>()))
                .collect();
            return refused(&format!(" has no table of numbers. It begins with{}", lines.concat()));
        };
        let mut rows = records(&text, delimiter);
        let Judgement { width, is_number, .. } = judgement;
        let is_data = |row: &StringRecord| {
            let mut cells = row.iter().zip(&is_number);
            row.len() == width
                && cells.all(|(cell, is_number)| !is_number || cell.is_empty() || number(cell, decimal).is_some())
        };
        let first = (0..rows.len()).find(|n| is_data(&rows[*n]) && rows.get(n + 1).is_none_or(is_data));
        let Some(first) = first else {
            return refused(" has no two rows of numbers in sequence");
        };
        let mut layout = format!(
            "{}, delimiter {}, decimal mark `{decimal}`",
            encoding.name(),
            shown(delimiter)
        );
        if rows.len() > first + 1 && !is_data(&rows[rows.len() - 1]) {
            rows.pop();
            layout += ", the last row is cut off and left out";
        }
        // A row that is cut off has lost its last field, or a delimiter stands at the end of all others.
        let header = |row: &StringRecord| row.len().abs_diff(width) <= 1;
        let above = rows[..first]
            .iter()
            .rev()
            .take_while(|row| header(row))
            .take(2)
            .collect::<Vec<_>>();
        let cells = |row: &StringRecord| {
            (0..width)
                .map(|n| row.get(n).unwrap_or("").to_string())
                .collect::<Vec<_>>()
        };
        let are_units = |row: &StringRecord| {
            row.iter().any(unit::is_unit) && row.iter().all(|cell| cell.is_empty() || unit::is_unit(cell))
        };
        let (names, units) = match above[..] {
            [row, names] if are_units(row) => (cells(names), cells(row)),
            [names, ..] => (cells(names), vec![String::new(); width]),
            [] => ((1..=width).map(|n| n.to_string()).collect(), vec![String::new(); width]),
        };
        let split = |(name, unit): (String, String)| {
            let (short, stated) = unit::split(&name);
            let unit = stated.map_or(unit.as_str(), |unit| unit);
            (short.to_string(), unit.trim_matches(['[', ']', '(', ')']).to_string())
        };
        let (names, units) = names.into_iter().zip(units).map(split).unzip();
        let rows = rows.split_off(first);
        let line = |row: &StringRecord| row.position().map_or(0, |position| position.line() as usize);
        let first_line = rows.first().map_or(0, line);
        if let Some(row) = rows.iter().find(|row| row.len() != width) {
            return refused(&format!(
                ", row {}: it has {} values, and the table {width} columns ({layout}); repair the row, or cut the file there",
                line(row),
                row.len()
            ));
        }
        Ok(Self {
            origin: origin.into(),
            layout,
            decimal,
            names,
            units,
            rows,
            first_line,
        })
    }

    /// The unit that the head of the column with this name states, empty without one; `None` without such a column.
    #[must_use]
    pub fn unit(&self, name: &str) -> Option<&str> {
        let column = self.names.iter().position(|one| one == name);
        column.map(|column| &*self.units[column])
    }

    /// The rows: cells with a point as decimal mark, by the names of the columns.
    pub fn rows(&self) -> impl Iterator<Item = Vec<(&str, String)>> {
        self.rows.iter().map(|row| {
            let cell = |cell: &str| match self.decimal {
                ',' if number(cell, ',').is_some() => cell.replace(',', "."),
                _ => cell.into(),
            };
            self.names
                .iter()
                .map(String::as_str)
                .zip(row.iter().map(cell))
                .collect()
        })
    }

    /// The columns as channels. What is no number is NaN; dates are seconds.
    #[must_use]
    pub fn contents(&self) -> Contents {
        let channel = |(column, name): (usize, &String)| Channel {
            name: name.clone(),
            unit: self.units[column].clone(),
            values: self
                .rows
                .iter()
                .map(|row| number(&row[column], self.decimal).unwrap_or(f64::NAN))
                .collect(),
            clock: None,
        };
        Contents {
            origin: self.origin.clone(),
            layout: self.layout.clone(),
            channels: self.names.iter().enumerate().map(channel).collect(),
            first_line: self.first_line,
        }
    }
}

/// The encoding of a file without a byte order mark: every second byte of UTF-16 is 0 in a table of numbers.
fn guessed(bytes: &[u8]) -> &'static Encoding {
    let zeros = |from: usize| {
        bytes
            .iter()
            .skip(from)
            .step_by(2)
            .take(JUDGED)
            .filter(|byte| **byte == 0)
            .count()
    };
    match [zeros(0), zeros(1)] {
        [even, odd] if odd > JUDGED.min(bytes.len() / 2) / 2 && odd > even => UTF_16LE,
        [even, _] if even > JUDGED.min(bytes.len() / 2) / 2 => UTF_16BE,
        // A file that is cut off may end within a character.
        _ if std::str::from_utf8(bytes).map_or_else(|error| error.error_len().is_none(), |_| true) => UTF_8,
        _ => WINDOWS_1252,
    }
}

/// The text with empty lines for comments. Those at the beginning may be the header: they lose only their sign.
fn without_comments(text: &str) -> String {
    let mut is_beginning = true;
    let line = |line: &str| {
        let rest = ["#", "%", "//"]
            .into_iter()
            .find_map(|sign| line.trim_start().strip_prefix(sign));
        is_beginning &= rest.is_some() || line.trim().is_empty();
        let kept = rest.map_or(line, |rest| if is_beginning { rest.trim() } else { "" });
        format!("{kept}\n")
    };
    text.lines().map(line).collect()
}

/// The rows that a layout is judged by, without the last one, which may be cut off.
fn tail(text: &str, delimiter: u8) -> Vec<StringRecord> {
    let lines: Vec<&str> = text
        .lines()
        .rev()
        .filter(|line| !line.is_empty())
        .take(JUDGED + 1)
        .collect();
    let skipped = usize::from(lines.len() > 3);
    let kept: Vec<&str> = lines.into_iter().skip(skipped).collect();
    records(&kept.join("\n"), delimiter)
}

fn records(text: &str, delimiter: u8) -> Vec<StringRecord> {
    let spaced;
    let (text, delimiter) = if delimiter == b' ' {
        let line = |line: &str| line.split_whitespace().collect::<Vec<_>>().join("\t") + "\n";
        spaced = text.lines().map(line).collect::<String>();
        (&*spaced, b'\t')
    } else {
        (text, delimiter)
    };
    let mut reader = csv::ReaderBuilder::new();
    let reader = reader
        .delimiter(delimiter)
        .flexible(true)
        .has_headers(false)
        .trim(csv::Trim::All);
    // The text is UTF-8, and rows may have any length: there are no errors.
    reader
        .from_reader(text.as_bytes())
        .into_records()
        .filter_map(Result::ok)
        .collect()
}

fn judged(rows: &[StringRecord], decimal: char) -> Judgement {
    let mut widths: Vec<usize> = rows.iter().map(StringRecord::len).collect();
    widths.sort_unstable();
    let width = widths
        .chunk_by(|one, other| one == other)
        .max_by_key(|alike| alike.len());
    let width = width.map_or(0, |alike| alike[0]);
    let cells: usize = rows.iter().map(StringRecord::len).sum();
    let rows: Vec<&StringRecord> = rows.iter().filter(|row| row.len() == width).collect();
    let count = |column: usize, is_it: &dyn Fn(&str) -> bool| rows.iter().filter(|row| is_it(&row[column])).count();
    let numbers: Vec<usize> = (0..width)
        .map(|n| count(n, &|cell| number(cell, decimal).is_some()))
        .collect();
    let empty: usize = (0..width).map(|n| count(n, &str::is_empty)).sum();
    Judgement {
        width,
        is_number: numbers.iter().map(|numbers| 2 * numbers > rows.len()).collect(),
        share: (numbers.iter().sum::<usize>() + empty) as f64 / cells.max(1) as f64,
    }
}

/// A number, a date or a time of the day, in seconds.
fn number(cell: &str, decimal: char) -> Option<f64> {
    let replaced = if decimal == ',' {
        cell.replace(',', ".")
    } else {
        cell.into()
    };
    if let Ok(number) = replaced.parse() {
        return Some(number);
    }
    if !cell.contains(':') {
        return None;
    }
    let text = replaced.trim_end_matches('Z').replacen('T', " ", 1);
    // The first day of the epoch gives the seconds of a day.
    let of_day = format!("1970-01-01 {text}");
    let mut dates = [&text, &of_day].into_iter();
    let date = dates.find_map(|text| NaiveDateTime::parse_from_str(text, DATE).ok())?;
    Some(date.and_utc().timestamp() as f64 + 1e-9 * f64::from(date.nanosecond()))
}

fn shown(delimiter: u8) -> String {
    match delimiter {
        b'\t' => "tab".into(),
        b' ' => "space".into(),
        other => format!("`{}`", char::from(other)),
    }
}
