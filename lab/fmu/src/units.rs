//! What the unit that an FMU declares for a variable means in SI units.

use std::f64::consts::TAU;

use fmi2_description::BaseUnit;
use vines_testbench::scene::Name;

/// Value in SI units = factor times value + offset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Scale {
    pub factor: f64,
    pub offset: f64,
}

impl Scale {
    pub const SI: Self = Self { factor: 1.0, offset: 0.0 };
}

/// Exponents of kg, m, s and rad.
type Dimension = [i32; 4];

/// Symbols in units, and their dimensions.
const SYMBOLS: [(&str, Dimension); 14] = [
    ("kg", [1, 0, 0, 0]),
    ("m", [0, 1, 0, 0]),
    ("mm", [0, 1, 0, 0]),
    ("um", [0, 1, 0, 0]),
    ("s", [0, 0, 1, 0]),
    ("ms", [0, 0, 1, 0]),
    ("min", [0, 0, 1, 0]),
    ("rad", [0, 0, 0, 1]),
    ("deg", [0, 0, 0, 1]),
    ("Hz", [0, 0, -1, 1]),
    ("N", [1, 1, -2, 0]),
    ("J", [1, 2, -2, 0]),
    ("1", [0, 0, 0, 0]),
    ("", [0, 0, 0, 0]),
];

/// The dimension of a unit such as `N.s/m` or `rad/s2`.
fn dimension(unit: &str) -> Option<Dimension> {
    let mut sum = [0; 4];
    for (n, part) in unit.split('/').enumerate() {
        for factor in part.split('.') {
            let symbol = factor.trim_end_matches(|c: char| c.is_ascii_digit());
            let (symbol, exponent) = match factor {
                "1" => ("1", 1),
                _ => (symbol, factor[symbol.len()..].parse().unwrap_or(1)),
            };
            let (_, exponents) = SYMBOLS.into_iter().find(|(known, _)| *known == symbol)?;
            for (sum, each) in sum.iter_mut().zip(exponents) {
                *sum += each * exponent * if n == 0 { 1 } else { -1 };
            }
        }
    }
    Some(sum)
}

/// Whether a quantity in the SI unit `given` can be one in `ours`, as far as both are known.
pub(crate) fn is_unit_of(given: &str, ours: &str) -> bool {
    let given = dimension(&given.replace('²', "2"));
    dimension(ours).is_none_or(|ours| given == Some(ours))
}

/// The scale of a declared unit, with its definition where the description has one; `ours` is the SI unit of the bench. `None`: the two
/// cannot be converted into each other. Without a definition, the units of a scene are known; any other is taken as `ours`.
pub(crate) fn scale(declared: &str, base: Option<&BaseUnit>, ours: &str) -> Option<Scale> {
    let needed = dimension(ours).filter(|_| !ours.is_empty());
    let Some(base) = base else {
        let same = || declared.is_empty() || declared == ours;
        return match (Name::with_unit("", declared), needed) {
            _ if same() => Some(Scale::SI),
            (Ok(_), Some(needed)) if dimension(declared) != Some(needed) => None,
            (Ok(unit), _) => Some(Scale { factor: unit.factor, offset: 0.0 }),
            (Err(_), _) => Some(Scale::SI),
        };
    };
    let scale = Scale { factor: base.factor, offset: base.offset };
    let Some([kg, m, s, rad]) = needed else {
        return Some(scale);
    };
    let others = [base.ampere, base.kelvin, base.mol, base.cd];
    if [base.kg, base.m, base.s] != [kg, m, s] || others != [0; 4] || !scale.factor.is_normal() {
        return None;
    }
    // Angles are written with and without rad. A frequency without it is one of cycles, unless its name says otherwise.
    let is_frequency = (s, rad, base.rad) == (-1, 1, 0) && !declared.starts_with("rad");
    match declared {
        "1/s" | "s-1" | "s^-1" if is_frequency => None,
        _ if is_frequency => Some(Scale { factor: TAU * scale.factor, ..scale }),
        _ => Some(scale),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_with_and_without_a_definition_are_converted_and_those_of_another_dimension_are_not() {
        let defined = |s, m, rad, factor| BaseUnit { s, m, rad, factor, ..BaseUnit::default() };
        let cases = [
            ("Hz", Some(defined(-1, 0, 0, 1.0)), "rad/s", Some(TAU)),
            ("Hz", Some(defined(-1, 0, 1, TAU)), "rad/s", Some(TAU)),
            ("rpm", Some(defined(-1, 0, 0, 1.0 / 60.0)), "rad/s", Some(TAU / 60.0)),
            ("rad/s", Some(defined(-1, 0, 0, 1.0)), "rad/s", Some(1.0)),
            ("1/s", Some(defined(-1, 0, 0, 1.0)), "rad/s", None),
            ("1/s", Some(defined(-1, 0, 0, 1.0)), "1/s", Some(1.0)),
            ("mm", Some(defined(0, 1, 0, 1e-3)), "m", Some(1e-3)),
            ("deg", Some(defined(0, 0, 0, 0.017)), "rad", Some(0.017)),
            ("m", Some(defined(0, 1, 0, 1.0)), "rad/s", None),
            ("mm", None, "m", Some(1e-3)),
            ("Hz", None, "rad/s", Some(TAU)),
            ("Hz", None, "m", None),
            ("N.s/m", None, "N.s/m", Some(1.0)),
            ("furlong", None, "m", Some(1.0)),
        ];
        for (declared, base, ours, factor) in cases {
            let found = scale(declared, base.as_ref(), ours).map(|scale| scale.factor);
            assert_eq!(found, factor, "{declared} for {ours}");
        }
    }
}
