//! Colours on white paper and on a dark screen.
//!
//! Neighbouring colours differ in lightness, so that they remain distinct in grey; lines and marks also differ in shape.

use plotters::style::RGBColor;

use crate::orbit::Bifurcation;
use crate::regime::Regime;

pub const THEORY: RGBColor = RGBColor(40, 40, 40);
pub const UNSTABLE: RGBColor = RGBColor(150, 150, 150);
pub const EXACT: RGBColor = RGBColor(0, 114, 178);
/// Unstable parts of curves in [`EXACT`].
pub const FAINT: RGBColor = RGBColor(120, 170, 210);
pub const DECAY: RGBColor = RGBColor(213, 94, 0);
pub const LOCK: RGBColor = RGBColor(0, 0, 0);

/// The colour of a regime in the map: the darker, the less orderly its impacts.
pub fn regime(regime: Regime) -> RGBColor {
    match regime {
        Regime::NoImpacts => RGBColor(246, 246, 244),
        Regime::Symmetric => RGBColor(178, 217, 241),
        Regime::Asymmetric => RGBColor(240, 180, 70),
        Regime::Several => RGBColor(90, 174, 110),
        Regime::QuasiPeriodic => RGBColor(60, 130, 160),
        Regime::Modulated => RGBColor(190, 70, 45),
        Regime::Chaotic => RGBColor(106, 52, 128),
        Regime::Undecided => RGBColor(30, 32, 40),
        // The map shows none of these.
        Regime::Other | Regime::Unresolved | Regime::Unknown => UNSTABLE,
    }
}

/// The colour of a bifurcation curve on the map.
pub fn bifurcation(kind: Bifurcation) -> RGBColor {
    match kind {
        Bifurcation::Fold => RGBColor(20, 60, 160),
        Bifurcation::SymmetryBreaking => RGBColor(170, 90, 0),
        Bifurcation::PeriodDoubling => RGBColor(0, 95, 50),
        Bifurcation::Torus => RGBColor(200, 0, 60),
    }
}

/// The colour of a letter on it. Where the cell colour is the same on dark screens, so is that of the letter.
pub fn on_regime(regime: Regime) -> RGBColor {
    match regime {
        Regime::NoImpacts => RGBColor(0, 0, 0),
        Regime::Undecided => RGBColor(255, 255, 255),
        Regime::QuasiPeriodic | Regime::Modulated | Regime::Chaotic => RGBColor(254, 254, 254),
        _ => RGBColor(10, 10, 10),
    }
}

/// Colours on white paper, and on a dark screen.
const DARK: [(&str, &str); 9] = [
    ("#FFFFFF", "#14171A"),
    ("#000000", "#ECECEC"),
    ("#282828", "#DADADA"),
    ("#969696", "#868C93"),
    ("#0072B2", "#56B4E9"),
    ("#78AAD2", "#3F7099"),
    ("#D55E00", "#F28C40"),
    // No impacts is like the paper in both, undecided like the ink.
    ("#F6F6F4", "#23272B"),
    ("#1E2028", "#F2F2EE"),
];

/// A figure for dark screens.
#[must_use]
pub fn dark(svg: &str) -> String {
    // Every colour is in quotes, and each is replaced once.
    svg.split('"')
        .map(|part| {
            let pair = DARK.iter().find(|(light, _)| *light == part);
            pair.map_or(part, |(_, dark)| dark)
        })
        .collect::<Vec<_>>()
        .join("\"")
}

/// Style rules that do the same for figures inside a page.
#[must_use]
pub fn dark_rules() -> String {
    DARK.iter()
        .flat_map(|(light, dark)| ["fill", "stroke"].map(|what| format!("svg [{what}=\"{light}\"]{{{what}:{dark}}}")))
        .collect()
}

#[cfg(test)]
#[path = "../../tests/unit/report_theme.rs"]
mod tests;
