//! Plain tables as text: UTF-8, any delimiter, point or comma as decimal mark, a row of names, perhaps with units in brackets or in a row of
//! their own. The Python package reads other dialects, and hands over the same [`Contents`].

use csv::StringRecord;

use super::{Channel, Contents};
use crate::scene::utf8;
use vines_rig::unit;

/// Number of rows, at the end of the table, by which the layout is found.
const JUDGED: usize = 200;

/// The table in the file `origin`, a channel per column. A column with a cell that is neither a number nor empty has texts as well.
///
/// # Errors
/// What is no plain table: another encoding, no row of numbers, or rows of different lengths. The message has the row.
pub fn plain_table(origin: &str, bytes: &[u8]) -> Result<Contents, String> {
    let refused = |message: String| Err(format!("{origin}{message}"));
    let text = match utf8(bytes) {
        Ok(text) => text,
        Err(encoding) => return refused(format!(" {encoding}")),
    };
    if text.trim().is_empty() {
        return refused(" is empty: it has no row of numbers".into());
    }
    let Some((delimiter, decimal)) = layout(text) else {
        let lines = text.lines().filter(|line| !line.is_empty()).take(3);
        let lines: Vec<String> = lines
            .map(|line| format!("\n  {}", line.chars().take(100).collect::<String>()))
            .collect();
        return refused(format!(" has no table of numbers. It begins with{}", lines.concat()));
    };
    let mut rows = records(text, delimiter);
    let width = rows.first().map_or(0, StringRecord::len);
    let (mut layout, rest) = (
        format!("delimiter {}, decimal mark `{decimal}`", shown(delimiter)),
        rows.len(),
    );
    let is_cut_off = rest > 2 && rows[rest - 1].len() < width;
    if is_cut_off {
        rows.pop();
        layout += ", the last row is cut off and left out";
    }
    if let Some(cell) = rows.first().and_then(|row| row.get(0))
        && (cell.starts_with(['#', '%']) || cell.starts_with("//"))
    {
        return refused(format!(
            ", row 1: `{cell}` begins a comment, and a plain table begins with the names"
        ));
    }
    let line = |row: &StringRecord| row.position().map_or(0, |position| position.line() as usize);
    if let Some(row) = rows.iter().find(|row| row.len() != width) {
        return refused(format!(
            ", row {}: it has {} values, and row 1 has {width} ({layout}); repair the row, or cut the file there",
            line(row),
            row.len()
        ));
    }
    let cells = |row: &StringRecord| row.iter().map(String::from).collect::<Vec<_>>();
    let has_names = rows[0]
        .iter()
        .any(|cell| !cell.is_empty() && number(cell, decimal).is_none());
    let names = match has_names {
        true => cells(&rows.remove(0)),
        false => (1..=width).map(|n| n.to_string()).collect(),
    };
    // The unit 1 is a number, too.
    let is_word = |cell: &str| unit::is_unit(cell) && number(cell, decimal).is_none();
    let are_units =
        |row: &StringRecord| row.iter().any(is_word) && row.iter().all(|cell| cell.is_empty() || unit::is_unit(cell));
    let units = match rows.first().is_some_and(|row| has_names && are_units(row)) {
        true => cells(&rows.remove(0)),
        false => vec![String::new(); width],
    };
    let mut grouped = rows.iter().flatten().filter(|cell| cell.contains(decimal));
    if delimiter != b','
        && grouped.clone().all(|cell| is_grouped(cell, decimal))
        && let Some(cell) = grouped.next()
    {
        return refused(format!(
            ": `{cell}` may be {} or {} ({layout}); write a number with another number of decimals",
            cell.replace(decimal, "."),
            cell.replace(decimal, "")
        ));
    }
    Ok(Contents {
        origin: origin.into(),
        layout,
        is_cut_off,
        channels: channels(names.into_iter().zip(units), &rows, decimal),
        first_line: rows.first().map_or(0, line),
        advice: "; `python -m vines fit` with the same options reads dates, thousands and units in cells",
        refused: Vec::new(),
    })
}

/// The columns of these names and units.
fn channels(heads: impl Iterator<Item = (String, String)>, rows: &[StringRecord], decimal: char) -> Vec<Channel> {
    let channel = |(column, (name, unit)): (usize, (String, String))| {
        let (short, stated) = unit::split(&name);
        let of = |row: &StringRecord| number(&row[column], decimal).unwrap_or(f64::NAN);
        let is_text = |row: &StringRecord| !row[column].is_empty() && number(&row[column], decimal).is_none();
        let texts = match rows.iter().any(is_text) {
            true => rows.iter().map(|row| row[column].into()).collect(),
            false => Vec::new(),
        };
        Channel {
            name: short.into(),
            unit: stated.unwrap_or(&unit).trim_matches(['[', ']', '(', ')']).into(),
            values: rows.iter().map(of).collect(),
            texts,
            clock: None,
        }
    };
    heads.enumerate().map(channel).collect()
}

/// Delimiter and decimal mark of which the largest share of the cells are numbers or empty, of several the ones with most columns, and of these the first.
/// `None` without a number.
fn layout(text: &str) -> Option<(u8, char)> {
    let layouts = b",;\t |"
        .iter()
        .flat_map(|delimiter| ['.', ','].map(|decimal| (*delimiter, decimal)));
    let layouts = layouts.filter(|(delimiter, decimal)| char::from(*delimiter) != *decimal);
    let judged = layouts.map(|(delimiter, decimal)| {
        let rows = tail(text, delimiter);
        let width = rows.first().map_or(0, StringRecord::len);
        let cells: usize = rows.iter().map(StringRecord::len).sum();
        let even = rows.iter().filter(|row| row.len() == width).flatten();
        let numbers = even.clone().filter(|cell| number(cell, decimal).is_some()).count();
        let empty = even.filter(|cell| cell.is_empty()).count();
        let share = (numbers + empty) as f64 / cells.max(1) as f64;
        ((delimiter, decimal), (share, width), numbers)
    });
    let compare = |one: (f64, usize), other: (f64, usize)| one.0.total_cmp(&other.0).then(one.1.cmp(&other.1));
    let best = judged.rev().max_by(|one, other| compare(one.1, other.1));
    best.filter(|(.., numbers)| *numbers > 0).map(|(layout, ..)| layout)
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

/// A number with this decimal mark and no other.
fn number(cell: &str, decimal: char) -> Option<f64> {
    match decimal {
        '.' => cell.parse().ok(),
        mark if !cell.contains('.') => cell.replace(mark, ".").parse().ok(),
        _ => None,
    }
}

/// Whether the mark may stand between thousands: one to three digits of which the first is not 0, and groups of three after the mark.
fn is_grouped(cell: &str, mark: char) -> bool {
    let digits = |group: &str| group.bytes().all(|byte| byte.is_ascii_digit());
    let mut groups = cell.trim_start_matches(['+', '-']).split(mark);
    let is_first = |group: &str| (1..=3).contains(&group.len()) && digits(group) && !group.starts_with('0');
    groups.next().is_some_and(is_first) && groups.all(|group| group.len() == 3 && digits(group))
}

fn shown(delimiter: u8) -> String {
    match delimiter {
        b'\t' => "tab".into(),
        b' ' => "space".into(),
        other => format!("`{}`", char::from(other)),
    }
}
