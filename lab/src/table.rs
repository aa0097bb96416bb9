//! Tables and lines: as text for a terminal; tables as HTML for a page.

use std::fmt::Display;

use maud::{Markup, html};

/// Headings, which may be absent, and rows of cells.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Table {
    headings: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Table {
    /// An empty table with these headings, separated by ` | `.
    pub fn new(headings: &str) -> Self {
        let headings = headings.split(" | ").map(String::from).collect();
        Self { headings, rows: Vec::new() }
    }

    /// An empty table without headings.
    pub fn plain() -> Self {
        Self::default()
    }

    /// With a row for each item; all have as many cells as there are headings.
    pub fn rows<R: IntoIterator<Item: Into<Cell>>>(mut self, rows: impl IntoIterator<Item = R>) -> Self {
        let texts = |row: R| row.into_iter().map(|cell| cell.into().0).collect();
        self.rows.extend(rows.into_iter().map(texts));
        self
    }

    /// The text under a line, or nothing without a row.
    pub fn text_under(&self, line: &str) -> String {
        match &self.rows[..] {
            [] => String::new(),
            _ => format!("{line}\n{}", self.text()),
        }
    }

    /// The text, or a line that says why there is no row.
    pub fn text_or(&self, none: &str) -> String {
        match &self.rows[..] {
            [] => format!("  {none}\n"),
            _ => self.text(),
        }
    }

    /// Columns under their headings, separated by two spaces; words to the left, numbers to the right.
    pub fn text(&self) -> String {
        let numbers = self.numbers();
        let all = || self.lines();
        let width = |n: usize| all().map(|row| row[n].chars().count()).max().unwrap_or(0);
        let widths: Vec<usize> = (0..numbers.len()).map(width).collect();
        let line = |cells: &Vec<String>| {
            let cells = cells.iter().zip(&widths).zip(&numbers);
            let padded: Vec<String> = cells
                .map(|((cell, width), number)| match number {
                    true => format!("{cell:>width$}"),
                    false => format!("{cell:<width$}"),
                })
                .collect();
            format!("  {}", padded.join("  ")).trim_end().to_string() + "\n"
        };
        all().map(line).collect()
    }

    /// An HTML table with its caption; columns of numbers are set to the right.
    pub fn html(&self, caption: &str) -> Markup {
        let numbers = self.numbers();
        let class = |n: usize| numbers[n].then_some("number");
        html! {
            table {
                caption { (caption) }
                thead { tr { @for (n, cell) in self.headings.iter().enumerate() { th class=[class(n)] { (cell) } } } }
                tbody {
                    @for row in &self.rows {
                        tr { @for (n, cell) in row.iter().enumerate() { td class=[class(n)] { (cell) } } }
                    }
                }
            }
        }
    }

    /// The headings, unless they are absent, and the rows.
    fn lines(&self) -> impl Iterator<Item = &Vec<String>> {
        let headings = std::iter::once(&self.headings);
        headings.filter(|headings| !headings.is_empty()).chain(&self.rows)
    }

    /// Which columns hold numbers only.
    fn numbers(&self) -> Vec<bool> {
        let is_number =
            |cell: &str| ["–", "-", ""].contains(&cell) || cell.trim_end_matches(" %").parse::<f64>().is_ok();
        let columns = self.lines().next().map_or(0, Vec::len);
        (0..columns)
            .map(|n| self.rows.iter().all(|row| is_number(&row[n])))
            .collect()
    }
}

/// Texts, a line each.
pub fn lines(texts: impl IntoIterator<Item: Display>) -> String {
    texts.into_iter().map(|text| format!("{text}\n")).collect()
}

/// A remark below a table.
pub fn note(text: impl Display) -> String {
    format!("  ({text})")
}

/// A number of a table; one that rounds to zero has no sign.
pub fn number(value: f64) -> String {
    let text = format!("{value:.6}");
    match text.as_str() {
        "-0.000000" => text[1..].into(),
        _ => text,
    }
}

/// A number of a table with its standard uncertainty.
pub fn with_uncertainty(value: f64, uncertainty: f64) -> String {
    format!("{value:.6} ± {uncertainty:.1e}")
}

/// A cell of a row: a word, a number, a number with its standard uncertainty, whether something holds, or nothing.
#[derive(Debug, Clone, PartialEq)]
pub struct Cell(String);

/// A row of cells of different kinds.
#[macro_export]
macro_rules! cells {
    ($($cell:expr),+ $(,)?) => { [$($crate::table::Cell::from($cell)),+] };
}

macro_rules! cell {
    ($($kind:ty: $value:pat => $text:expr,)+) => {$(
        impl From<$kind> for Cell {
            fn from($value: $kind) -> Self {
                Self($text)
            }
        }
    )+};
}

cell! {
    String: text => text,
    &str: text => text.into(),
    f64: value => number(value),
    (f64, f64): (value, uncertainty) => with_uncertainty(value, uncertainty),
    usize: count => count.to_string(),
    bool: holds => if holds { "yes" } else { "no" }.into(),
}

impl<T: Into<Cell>> From<Option<T>> for Cell {
    fn from(cell: Option<T>) -> Self {
        cell.map_or_else(|| "-".into(), Into::into)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> Table {
        Table::new("what | C").rows([["a < b", "0.5"], ["c", "-10.25"]])
    }

    #[test]
    fn words_are_set_to_the_left_and_numbers_to_the_right() {
        assert_eq!(table().text(), "  what        C\n  a < b     0.5\n  c      -10.25\n");
    }

    #[test]
    fn a_table_without_headings_has_its_rows_only() {
        let table = Table::plain().rows([["a", "G = 1"], ["bcd", "none"]]);
        assert_eq!(table.text(), "  a    G = 1\n  bcd  none\n");
        assert_eq!(lines(["a", "b"]), "a\nb\n");
    }

    #[test]
    fn a_row_has_cells_of_every_kind() {
        let row = cells!["a", -1e-9, (0.5, 0.012), 3, true, None::<f64>, Some("b")];
        let text = Table::new("1 | 2 | 3 | 4 | 5 | 6 | 7").rows([row]).text();
        assert_eq!(
            text.lines().nth(1),
            Some("  a  0.000000  0.500000 ± 1.2e-2  3  yes  -  b")
        );
    }

    #[test]
    fn text_cannot_become_markup() {
        let html = table().html("\"x\" & y").into_string();
        assert!(html.contains("<caption>&quot;x&quot; &amp; y</caption>"), "{html}");
        assert!(
            html.contains("<td>a &lt; b</td><td class=\"number\">0.5</td>"),
            "{html}"
        );
    }
}
