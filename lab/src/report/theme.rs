//! Colours on white paper and on a dark screen, from the table `styles.csv`. The figures of the book are drawn with the same table.
//!
//! A line is dashed where its motion is unstable. Regimes differ in lightness, so that they remain distinct in grey.

use std::sync::LazyLock;

use crate::regime::Regime;

pub const PAPER: &str = "paper";
pub const INK: &str = "ink";
pub const CAPTION: &str = "caption";
pub const GRID: &str = "grid";
pub const THEORY: &str = "theory";
pub const EXACT: &str = "exact";
pub const MEASURED: &str = "measured";
pub const PARTICLE: &str = "particle";
pub const MODULATION: &str = "modulation";
/// Beside lines and below letters on a map, which has the same colours on dark screens.
pub const HALO: &str = "halo";
pub const BORDER: &str = "theory border";

/// Rows of the table: name, colour on white paper, colour on a dark screen; letter on a map, and the name of the letter's colour.
static STYLES: LazyLock<Vec<[&str; 5]>> = LazyLock::new(|| {
    let rows = include_str!("styles.csv").lines().skip(1);
    rows.map(|row| {
        let mut cells = row.split(',');
        [(); 5].map(|()| cells.next().unwrap_or_default())
    })
    .collect()
});

/// The row of a name; the names are those of this file, of regimes and of bifurcations.
fn row(name: &str) -> [&'static str; 5] {
    let style = STYLES.iter().find(|row| row[0] == name);
    *style.unwrap_or_else(|| panic!("styles.csv has no row `{name}`"))
}

/// The colour of a name on white paper, as `#RRGGBB`.
pub fn colour(name: &str) -> &'static str {
    row(name)[1]
}

/// The name of the colour of unstable motions.
pub fn unstable(name: &'static str) -> &'static str {
    match name {
        THEORY => "theory unstable",
        EXACT => "exact unstable",
        other => other,
    }
}

/// The letter of a regime on the map, and the name of the letter's colour.
pub fn letter(regime: Regime) -> (&'static str, &'static str) {
    let [_, _, _, letter, colour] = row(regime.name());
    (letter, colour)
}

/// A figure for dark screens.
pub fn dark(svg: &str) -> String {
    // Every colour is in quotes, and each is replaced once.
    let replaced = |part| STYLES.iter().find(|row| row[1] == part).map_or(part, |row| row[2]);
    svg.split('"').map(replaced).collect::<Vec<_>>().join("\"")
}

/// Style rules that give figures inside a page their dark colours.
pub fn dark_rules() -> String {
    let changed = STYLES.iter().filter(|[_, light, dark, ..]| light != dark);
    changed
        .flat_map(|[_, light, dark, ..]| {
            ["fill", "stroke"].map(|what| format!("svg [{what}=\"{light}\"]{{{what}:{dark}}}"))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::orbit::Bifurcation;

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
    fn lines_and_letters_stand_out_from_their_background_in_light_and_dark() {
        let contrast = |first: &str, second: &str| {
            let [first, second] = [first, second].map(|colour| luminance(colour) + 0.05);
            first.max(second) / first.min(second)
        };
        for name in [INK, CAPTION, THEORY, EXACT, MEASURED, PARTICLE, MODULATION] {
            for line in [name, unstable(name)] {
                for shade in [1, 2] {
                    let ratio = contrast(row(line)[shade], row(PAPER)[shade]);
                    assert!(ratio > 3.0, "{line}: {ratio}");
                }
            }
        }
        use Bifurcation::{Fold, PeriodDoubling, SymmetryBreaking, Torus};
        for curve in [Fold, SymmetryBreaking, PeriodDoubling, Torus]
            .map(|kind| kind.name())
            .into_iter()
            .chain([BORDER])
        {
            assert!(contrast(colour(curve), colour(HALO)) > 4.5, "{curve}");
        }
        for regime in Regime::SIMULATED {
            for shade in [1, 2] {
                let ratio = contrast(row(letter(regime).1)[shade], row(regime.name())[shade]);
                assert!(ratio > 4.2, "{regime:?}: {ratio}");
            }
        }
    }

    #[test]
    fn the_live_page_has_the_colours_of_the_table() {
        let style = include_str!("../../../live/page/style.css").to_uppercase();
        let (light, dark) = style.split_once("@MEDIA (PREFERS-COLOR-SCHEME: DARK)").unwrap();
        let mut found = 0;
        for [name, on_paper, on_screen, ..] in STYLES.iter() {
            let property = format!("--{}: ", name.replace([' ', ':'], "-").to_uppercase());
            let value = |sheet: &str| Some(sheet.split_once(&property)?.1[..7].to_string());
            let Some(colour) = value(light) else { continue };
            assert_eq!(colour, *on_paper, "{name}");
            assert_eq!(value(dark).unwrap_or(colour), *on_screen, "{name} on a dark screen");
            found += 1;
        }
        assert_eq!(found, 10, "rows of the table that the page has");
    }

    #[test]
    fn colours_are_changed_once_each() {
        let light = r##"<g fill="#000000" stroke="#FFFFFF" x="3"/>"##;
        assert_eq!(dark(light), r##"<g fill="#ECECEC" stroke="#14171A" x="3"/>"##);
        assert!(dark_rules().contains(r##"svg [fill="#000000"]{fill:#ECECEC}"##));
    }
}
