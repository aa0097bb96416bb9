//! Units of measured channels and of variables.

use std::f64::consts::{PI, TAU};

/// Symbols, SI units per unit, and the SI unit.
pub(crate) const UNITS: [(&str, f64, &str); 24] = [
    ("m", 1.0, "m"),
    ("cm", 1e-2, "m"),
    ("mm", 1e-3, "m"),
    ("um", 1e-6, "m"),
    // The micro sign, and the Greek letter.
    ("\u{b5}m", 1e-6, "m"),
    ("\u{3bc}m", 1e-6, "m"),
    ("nm", 1e-9, "m"),
    ("m/s", 1.0, "m/s"),
    ("mm/s", 1e-3, "m/s"),
    ("m/s2", 1.0, "m/s²"),
    ("m/s²", 1.0, "m/s²"),
    ("m/s^2", 1.0, "m/s²"),
    ("mm/s2", 1e-3, "m/s²"),
    ("mm/s²", 1e-3, "m/s²"),
    ("g", 9.806_65, "m/s²"),
    ("s", 1.0, "s"),
    ("ms", 1e-3, "s"),
    ("us", 1e-6, "s"),
    ("min", 60.0, "s"),
    ("rad", 1.0, "rad"),
    ("deg", PI / 180.0, "rad"),
    ("rad/s", 1.0, "rad/s"),
    ("Hz", TAU, "rad/s"),
    ("1/min", TAU / 60.0, "rad/s"),
];
/// Units that tables have beside these: without a sensitivity nothing follows from them.
const OTHERS: [&str; 14] = [
    "V", "mV", "\u{b5}V", "A", "mA", "N", "kN", "Pa", "%", "1", "-", "counts", "\u{b0}", "\u{b0}C",
];

/// SI units per unit, and the SI unit, of a unit, of a factor, or of the sensitivity of a sensor such as `100mV/g`. `stated`: the unit of the
/// file, which says whether it has V or mV; a factor has no unit.
#[must_use]
pub fn parse(text: &str, stated: &str) -> Option<(f64, &'static str)> {
    if let Ok(factor) = text.parse::<f64>() {
        return (factor.is_finite() && factor != 0.0).then_some((factor, ""));
    }
    if let Some((_, factor, unit)) = UNITS.into_iter().find(|(symbol, ..)| *symbol == text) {
        return Some((factor, unit));
    }
    let (sensitivity, per) = text.split_once('/')?;
    let number = sensitivity.trim_end_matches(char::is_alphabetic);
    let volts = |unit: &str| match unit.trim() {
        "V" => Some(1.0),
        "mV" => Some(1e-3),
        _ => None,
    };
    let volt = volts(&sensitivity[number.len()..])?;
    let number: f64 = number.trim().parse().ok()?;
    let (factor, unit) = parse(per.trim_matches(['(', ')']), "").filter(|(_, unit)| !unit.is_empty())?;
    let factor = factor * volts(stated).unwrap_or(volt) / (number * volt);
    factor.is_finite().then_some((factor, unit))
}

/// A name and its unit, from `y [mm]` or `y (mm)`.
#[must_use]
pub fn split(header: &str) -> (&str, Option<&str>) {
    let header = header.trim();
    let within = |open, close| header.strip_suffix(close)?.rsplit_once(open);
    match within('[', ']').or_else(|| within('(', ')')) {
        Some((name, unit)) if is_unit(unit) && !name.trim().is_empty() => (name.trim(), Some(unit.trim())),
        _ => (header, None),
    }
}

/// Whether the cell of a row of units has one.
#[must_use]
pub fn is_unit(cell: &str) -> bool {
    let cell = cell.trim().trim_matches(['[', ']', '(', ')']);
    UNITS.iter().any(|(symbol, ..)| *symbol == cell) || OTHERS.contains(&cell)
}
