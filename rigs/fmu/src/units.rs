//! What the unit that an FMU declares for a variable means in SI units: as its description defines it, or as it is known here.

use std::f64::consts::TAU;

use fmi2_description::BaseUnit;
use vines_rig::Name;

/// Value in SI units = factor times value + offset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Scale {
    pub factor: f64,
    pub offset: f64,
}

impl Scale {
    pub const SI: Self = Self { factor: 1.0, offset: 0.0 };
}

/// Exponents of kg, m, s, A and rad.
type Dimension = [i32; 5];

/// Symbols in units: SI units per unit, and dimensions.
const SYMBOLS: [(&str, f64, Dimension); 16] = [
    ("kg", 1.0, [1, 0, 0, 0, 0]),
    ("m", 1.0, [0, 1, 0, 0, 0]),
    ("mm", 1e-3, [0, 1, 0, 0, 0]),
    ("um", 1e-6, [0, 1, 0, 0, 0]),
    ("s", 1.0, [0, 0, 1, 0, 0]),
    ("ms", 1e-3, [0, 0, 1, 0, 0]),
    ("min", 60.0, [0, 0, 1, 0, 0]),
    ("rad", 1.0, [0, 0, 0, 0, 1]),
    ("deg", TAU / 360.0, [0, 0, 0, 0, 1]),
    ("Hz", TAU, [0, 0, -1, 0, 1]),
    ("N", 1.0, [1, 1, -2, 0, 0]),
    ("J", 1.0, [1, 2, -2, 0, 0]),
    ("V", 1.0, [1, 2, -3, -1, 0]),
    // A count of periods is a number.
    ("periods", 1.0, [0, 0, 0, 0, 0]),
    ("1", 1.0, [0, 0, 0, 0, 0]),
    ("", 1.0, [0, 0, 0, 0, 0]),
];

/// A unit such as `N.s/m`, `rad/s2` or `deg/s`, as FMI and Modelica write it: SI units per unit, and its dimension.
fn parsed(unit: &str) -> Option<(f64, Dimension)> {
    let (mut scale, mut sum) = (1.0, [0; 5]);
    for (n, part) in unit.split('/').enumerate() {
        for factor in part.split(['.', '*']) {
            let symbol = factor.trim_end_matches(|c: char| c.is_ascii_digit() || "^-".contains(c));
            let (symbol, exponent) = match factor {
                "1" | "" => (factor, 1),
                _ if symbol.len() == factor.len() => (symbol, 1),
                _ => (symbol, factor[symbol.len()..].trim_start_matches('^').parse().ok()?),
            };
            let exponent = if n == 0 { exponent } else { -exponent };
            let (_, size, dimension) = SYMBOLS.into_iter().find(|(known, ..)| *known == symbol)?;
            scale *= size.powi(exponent);
            for (sum, each) in sum.iter_mut().zip(dimension) {
                *sum += each * exponent;
            }
        }
    }
    Some((scale, sum))
}

/// Whether a quantity in the SI unit `given` can be one in `ours`, as far as both are known.
pub(crate) fn is_unit_of(given: &str, ours: &str) -> bool {
    let dimension = |unit: &str| parsed(&unit.replace('²', "2")).map(|(_, dimension)| dimension);
    dimension(ours).is_none_or(|ours| dimension(given) == Some(ours))
}

/// The definition of a unit that the description does not define, if it is one of a scene, or is made of symbols that are known here.
fn known(unit: &str) -> Option<BaseUnit> {
    let of_scene = Name::with_unit("", unit).ok();
    let of_scene = of_scene.and_then(|unit| Some((unit.factor, parsed(&unit.si?.replace('²', "2"))?.1)));
    let (factor, [kg, m, s, ampere, rad]) = of_scene.or_else(|| parsed(unit))?;
    Some(BaseUnit { kg, m, s, ampere, rad, factor, ..BaseUnit::default() })
}

/// The scale of a declared unit, with its definition where the description has one; `ours` is the SI unit of the bench. `None`: the two
/// cannot be converted into each other, or nothing says what the declared one is.
pub(crate) fn scale(declared: &str, base: Option<&BaseUnit>, ours: &str) -> Option<Scale> {
    let base = match base {
        None if declared.is_empty() || declared == ours => return Some(Scale::SI),
        None => &known(declared)?,
        Some(base) => base,
    };
    let scale = Scale { factor: base.factor, offset: base.offset };
    let (_, [kg, m, s, ampere, rad]) = parsed(ours)?;
    let others = [base.kelvin, base.mol, base.cd];
    if [base.kg, base.m, base.s, base.ampere] != [kg, m, s, ampere] || others != [0; 3] || !scale.factor.is_normal() {
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
            ("mm.s-1", None, "m/s", Some(1e-3)),
            ("deg/s", None, "rad/s", Some(TAU / 360.0)),
            ("g", None, "m/s2", Some(9.806_65)),
            ("1", None, "", Some(1.0)),
            ("", None, "m", Some(1.0)),
            (
                "V",
                Some(BaseUnit { kg: 1, ampere: -1, ..defined(-3, 2, 0, 1.0) }),
                "V",
                Some(1.0),
            ),
            // Nothing says what these are.
            ("mil", None, "m", None),
            ("r/min", None, "rad/s", None),
            ("1/s", None, "rad/s", None),
            ("g", None, "kg", None),
            ("deg", None, "", Some(TAU / 360.0)),
            ("m", None, "", None),
            ("m", Some(defined(0, 1, 0, 1.0)), "", None),
            ("A", Some(BaseUnit { ampere: 1, ..BaseUnit::default() }), "", None),
        ];
        for (declared, base, ours, factor) in cases {
            let found = scale(declared, base.as_ref(), ours).map(|scale| scale.factor);
            assert_eq!(found, factor, "{declared} for {ours}");
        }
    }
}
