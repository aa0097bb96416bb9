//! Units of measured channels and of variables, and values with their units.

use std::f64::consts::{PI, TAU};
use std::fmt::{self, Display, Formatter, LowerExp};

/// A value in the unit of its channel, as messages state it: with five digits, or with those that a format `e` asks for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quantity {
    /// The value.
    pub value: f64,
    /// Symbol of its unit.
    pub unit: &'static str,
}

impl Display for Quantity {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", short(self.value), self.unit)
    }
}

impl LowerExp for Quantity {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        LowerExp::fmt(&self.value, f)?;
        write!(f, " {}", self.unit)
    }
}

/// The number with this many digits after the first one.
#[must_use]
pub fn rounded(value: f64, decimals: usize) -> f64 {
    format!("{value:.decimals$e}").parse().unwrap_or(value)
}

/// Five digits, with an exponent if the number is very small or large.
#[must_use]
pub fn short(value: f64) -> String {
    format!("{:?}", rounded(value, 4)).trim_end_matches(".0").into()
}

/// Symbols, SI units per unit, and the SI unit.
pub(crate) const UNITS: [(&str, f64, &str); 40] = [
    ("m", 1.0, "m"),
    ("cm", 1e-2, "m"),
    ("mm", 1e-3, "m"),
    ("um", 1e-6, "m"),
    // The micro sign, and the Greek letter.
    ("\u{b5}m", 1e-6, "m"),
    ("\u{3bc}m", 1e-6, "m"),
    ("nm", 1e-9, "m"),
    ("m/s", 1.0, "m/s"),
    ("cm/s", 1e-2, "m/s"),
    ("mm/s", 1e-3, "m/s"),
    ("um/s", 1e-6, "m/s"),
    ("\u{b5}m/s", 1e-6, "m/s"),
    ("\u{3bc}m/s", 1e-6, "m/s"),
    ("m/s2", 1.0, "m/s²"),
    ("m/s²", 1.0, "m/s²"),
    ("m/s^2", 1.0, "m/s²"),
    ("m/s/s", 1.0, "m/s²"),
    ("mm/s2", 1e-3, "m/s²"),
    ("mm/s²", 1e-3, "m/s²"),
    ("mm/s^2", 1e-3, "m/s²"),
    ("g", 9.806_65, "m/s²"),
    ("mg", 9.806_65e-3, "m/s²"),
    ("N", 1.0, "N"),
    ("mN", 1e-3, "N"),
    ("kN", 1e3, "N"),
    ("V", 1.0, "V"),
    ("mV", 1e-3, "V"),
    ("\u{b5}V", 1e-6, "V"),
    ("\u{3bc}V", 1e-6, "V"),
    ("s", 1.0, "s"),
    ("ms", 1e-3, "s"),
    ("us", 1e-6, "s"),
    ("min", 60.0, "s"),
    ("rad", 1.0, "rad"),
    ("deg", PI / 180.0, "rad"),
    ("\u{b0}", PI / 180.0, "rad"),
    ("rad/s", 1.0, "rad/s"),
    ("Hz", TAU, "rad/s"),
    ("1/min", TAU / 60.0, "rad/s"),
    ("rpm", TAU / 60.0, "rad/s"),
];
/// Units that tables have beside these: without a sensitivity nothing follows from them.
const OTHERS: [&str; 8] = ["A", "mA", "Pa", "%", "1", "-", "counts", "\u{b0}C"];

/// SI units per unit, and the SI unit, of
/// - a unit, or a multiple of it: `mm`, `0.0024g`, `-1m/s²`;
/// - the sensitivity of a sensor, or its inverse: `100mV/g`, `8V/mm`, `125mm/s/V`;
/// - a factor, which has no unit: `-0.5`.
///
/// `stated`: the unit of the file. It says whether a channel has V or mV, and excludes a sensitivity if it is no voltage.
#[must_use]
pub fn parse(text: &str, stated: &str) -> Option<(f64, &'static str)> {
    let of = |symbol: &str| UNITS.into_iter().find(|(known, ..)| *known == symbol.trim());
    let usable = |factor: f64, unit| (factor.is_finite() && factor != 0.0).then_some((factor, unit));
    if let Ok(factor) = text.parse::<f64>() {
        return usable(factor, "");
    }
    let multiple = |text: &str| {
        let (number, symbol) = number_and_rest(text.trim());
        let (_, factor, unit) = of(symbol.trim_matches(['(', ')']))?;
        usable(number * factor, unit)
    };
    if let Some(found) = multiple(text) {
        return Some(found);
    }
    // The channel has volts as its file says, or as the sensitivity does.
    let volts = |in_sensitivity: f64| match of(stated) {
        Some((_, factor, "V")) => Some(factor),
        None if stated.is_empty() => Some(in_sensitivity),
        _ => None,
    };
    let is_voltage = |(_, unit): &(f64, &str)| *unit == "V";
    let inverse = text.rsplit_once('/').and_then(|(quantity, volt)| {
        let (_, unit_of_volt, _) = of(volt).filter(|(.., unit)| *unit == "V")?;
        let (factor, unit) = multiple(quantity).filter(|found| !is_voltage(found))?;
        usable(factor / unit_of_volt * volts(unit_of_volt)?, unit)
    });
    inverse.or_else(|| {
        let (sensitivity, quantity) = text.split_once('/')?;
        let (volt, _) = multiple(sensitivity).filter(is_voltage)?;
        let (factor, unit) = multiple(quantity).filter(|found| !is_voltage(found))?;
        let (number, _) = number_and_rest(sensitivity.trim());
        usable(factor / volt * volts(volt / number)?, unit)
    })
}

/// The number at the beginning of a text, 1 without one, and the rest.
fn number_and_rest(text: &str) -> (f64, &str) {
    let mut ends = text.char_indices().map(|(end, _)| end).rev();
    let split = ends.find_map(|end| Some((text[..end].trim().parse().ok()?, text[end..].trim())));
    split.unwrap_or((1.0, text))
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
