//! Plain tables for a person to read.

use vines::scene::Dimensionless;

/// Right-aligned columns under their headings.
pub(super) fn table(headings: &[&str], rows: &[Vec<String>]) -> String {
    let widths: Vec<usize> = headings
        .iter()
        .enumerate()
        .map(|(i, heading)| {
            let cells = rows.iter().map(|row| row[i].chars().count());
            cells.chain([heading.chars().count()]).max().unwrap_or(0)
        })
        .collect();
    let line = |cells: Vec<&str>| {
        let padded: Vec<String> = cells
            .iter()
            .zip(&widths)
            .map(|(cell, width)| format!("{cell:>width$}"))
            .collect();
        format!("  {}\n", padded.join("  "))
    };
    let mut text = line(headings.to_vec());
    for row in rows {
        text += &line(row.iter().map(String::as_str).collect());
    }
    text
}

/// The numbers that a result belongs to, in one line.
pub(super) fn parameters(scene: &Dimensionless) -> String {
    let Dimensionless {
        epsilon,
        lambda,
        r,
        g,
        ..
    } = scene;
    format!("epsilon = {epsilon:.6}, lambda = {lambda:.4}, r = {r}, G = {g:.4}")
}

pub(super) fn number(value: f64) -> String {
    format!("{value:.6}")
}

pub(super) fn yes_no(value: bool) -> String {
    if value { "yes" } else { "no" }.into()
}
