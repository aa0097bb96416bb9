//! Colours of the figures on white paper, from the table `styles.csv`. The figures of the book are drawn with the same table, and the live
//! page has its colours, also those for a dark screen.
//!
//! A line is dashed where its motion is unstable. Regimes differ in lightness, so that they remain distinct in grey.

use std::sync::LazyLock;

pub const PAPER: &str = "paper";
pub const INK: &str = "ink";
pub const CAPTION: &str = "caption";
pub const GRID: &str = "grid";
pub const THEORY: &str = "theory";
pub const EXACT: &str = "exact";
pub const MEASURED: &str = "measured";
pub const PARTICLE: &str = "particle";
pub const PREDICTED: &str = "predicted";
/// Beside lines on a map.
pub const HALO: &str = "halo";
pub const BORDER: &str = "theory border";

/// Rows of the table: name, colour on white paper, and on a dark screen.
static STYLES: LazyLock<Vec<[&str; 3]>> = LazyLock::new(|| {
    let rows = include_str!("styles.csv").lines().skip(1);
    rows.map(|row| {
        let mut cells = row.split(',');
        [(); 3].map(|()| cells.next().unwrap_or_default())
    })
    .collect()
});

/// The colour of a name, as `#RRGGBB`; the names are those of this file, of regimes and of bifurcations.
pub fn colour(name: &str) -> &'static str {
    let style = STYLES.iter().find(|row| row[0] == name);
    style.unwrap_or_else(|| panic!("styles.csv has no row `{name}`"))[1]
}

/// The name of the colour of unstable motions.
pub fn unstable(name: &'static str) -> &'static str {
    match name {
        THEORY => "theory unstable",
        EXACT => "exact unstable",
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::orbit::Bifurcation;
    use crate::regime::Regime;

    /// Relative luminance of a colour `#RRGGBB`, from 0 to 1 (WCAG 2.2).
    fn luminance(colour: &str) -> f64 {
        let channel = |from: usize| {
            let value = f64::from(u8::from_str_radix(&colour[from..from + 2], 16).unwrap()) / 255.0;
            match value <= 0.04045 {
                true => value / 12.92,
                false => ((value + 0.055) / 1.055).powf(2.4),
            }
        };
        0.2126 * channel(1) + 0.7152 * channel(3) + 0.0722 * channel(5)
    }

    #[test]
    fn regimes_differ_in_lightness() {
        let mut lightness = Regime::SIMULATED.map(|regime| luminance(colour(regime.name())));
        lightness.sort_by(f64::total_cmp);
        for pair in lightness.windows(2) {
            assert!(pair[1] / pair[0] > 1.15, "{lightness:?}");
        }
    }

    #[test]
    fn lines_stand_out_from_their_background() {
        let contrast = |first: &str, second: &str| {
            let [first, second] = [first, second].map(|name| luminance(colour(name)) + 0.05);
            first.max(second) / first.min(second)
        };
        for name in [INK, CAPTION, THEORY, EXACT, MEASURED, PARTICLE, PREDICTED] {
            for line in [name, unstable(name)] {
                assert!(contrast(line, PAPER) > 3.0, "{line}");
            }
        }
        use Bifurcation::{Fold, NeimarkSacker, PeriodDoubling, SymmetryBreaking};
        let curves = [Fold, SymmetryBreaking, PeriodDoubling, NeimarkSacker].map(|kind| kind.name());
        for curve in curves.into_iter().chain([BORDER]) {
            assert!(contrast(curve, HALO) > 4.5, "{curve}");
        }
    }

    #[test]
    fn the_live_page_has_the_colours_of_the_table() {
        let style = include_str!("../../page/style.css").to_uppercase();
        let (light, dark) = style.split_once("@MEDIA (PREFERS-COLOR-SCHEME: DARK)").unwrap();
        let mut found = 0;
        for [name, on_paper, on_screen] in STYLES.iter() {
            let property = format!("--{}: ", name.replace([' ', ':'], "-").to_uppercase());
            let value = |sheet: &str| Some(sheet.split_once(&property)?.1[..7].to_string());
            let Some(colour) = value(light) else { continue };
            assert_eq!(colour, *on_paper, "{name}");
            assert_eq!(value(dark).unwrap_or(colour), *on_screen, "{name} on a dark screen");
            found += 1;
        }
        assert_eq!(found, 10, "rows of the table that the page has");
    }
}
