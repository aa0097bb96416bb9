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

/// A regime in the map: its colour (the darker, the less orderly its impacts), its letter, and the colour of the letter. The letter changes
/// its colour on dark screens only if the cell does.
pub fn regime(regime: Regime) -> (RGBColor, &'static str, RGBColor) {
    const DARK: RGBColor = RGBColor(10, 10, 10);
    const LIGHT: RGBColor = RGBColor(254, 254, 254);
    match regime {
        Regime::NoImpacts => (RGBColor(246, 246, 244), "O", RGBColor(0, 0, 0)),
        Regime::Symmetric => (RGBColor(178, 217, 241), "S", DARK),
        Regime::Asymmetric => (RGBColor(240, 180, 70), "A", DARK),
        Regime::Several => (RGBColor(90, 174, 110), "n", DARK),
        Regime::QuasiPeriodic => (RGBColor(60, 130, 160), "Q", LIGHT),
        Regime::Modulated => (RGBColor(190, 70, 45), "M", LIGHT),
        Regime::Chaotic => (RGBColor(106, 52, 128), "C", LIGHT),
        Regime::Undecided => (RGBColor(30, 32, 40), "U", RGBColor(255, 255, 255)),
        // The map shows none of these.
        Regime::Other | Regime::Unresolved | Regime::NotEstablished | Regime::Unknown => (UNSTABLE, "?", DARK),
    }
}

/// The colours of the bifurcation curves on the map.
pub const BIFURCATIONS: [(Bifurcation, RGBColor); 4] = [
    (Bifurcation::Fold, RGBColor(20, 60, 160)),
    (Bifurcation::SymmetryBreaking, RGBColor(170, 90, 0)),
    (Bifurcation::PeriodDoubling, RGBColor(0, 95, 50)),
    (Bifurcation::Torus, RGBColor(200, 0, 60)),
];

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

/// Style rules that give figures inside a page their dark colours.
pub fn dark_rules() -> String {
    DARK.iter()
        .flat_map(|(light, dark)| ["fill", "stroke"].map(|what| format!("svg [{what}=\"{light}\"]{{{what}:{dark}}}")))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn regimes_differ_in_lightness() {
        let mut lightness: Vec<f64> = Regime::SIMULATED
            .iter()
            .map(|shown| {
                let (RGBColor(r, g, b), ..) = regime(*shown);
                0.2126 * f64::from(r) + 0.7152 * f64::from(g) + 0.0722 * f64::from(b)
            })
            .collect();
        lightness.sort_by(f64::total_cmp);
        for pair in lightness.windows(2) {
            assert!(pair[1] - pair[0] > 15.0, "{lightness:?}");
        }
    }

    #[test]
    fn colours_are_changed_once_each() {
        let light = r##"<g fill="#000000" stroke="#FFFFFF" x="3"/>"##;
        assert_eq!(dark(light), r##"<g fill="#ECECEC" stroke="#14171A" x="3"/>"##);
        assert!(dark_rules().contains(r##"svg [fill="#000000"]{fill:#ECECEC}"##));
    }
}
