//! Rust identifiers from structured names (FMI 2.0, clause 2.2.9).

/// The name itself, with every run of other characters than letters, digits and `_` made one `_`, and none at the end:
/// `der(q1)` becomes `der_q1`. `M` and `m` remain two. A keyword gets a trailing `_`.
pub(crate) fn identifier(name: &str) -> String {
    let parts = name.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_'));
    let parts: Vec<_> = parts.filter(|part| !part.is_empty()).collect();
    let mut identifier = parts.join("_");
    if !identifier.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_') {
        identifier.insert(0, '_');
    }
    if identifier == "_" || KEYWORDS.contains(&identifier.as_str()) {
        identifier.push('_');
    }
    identifier
}

const KEYWORDS: &[&str] = &[
    "Self", "abstract", "as", "async", "await", "become", "box", "break", "const", "continue", "crate", "do", "dyn",
    "else", "enum", "extern", "false", "final", "fn", "for", "gen", "if", "impl", "in", "let", "loop", "macro",
    "match", "mod", "move", "mut", "override", "priv", "pub", "ref", "return", "self", "static", "struct", "super",
    "trait", "true", "try", "type", "typeof", "unsafe", "unsized", "use", "virtual", "where", "while", "yield",
];

#[cfg(test)]
mod tests {
    use super::identifier;

    #[test]
    fn a_variant_is_named_as_its_variable() {
        for (name, expected) in [
            ("M", "M"),
            ("m", "m"),
            ("impact_time", "impact_time"),
            ("der(q1)", "der_q1"),
            ("der(x[2],3)", "der_x_2_3"),
            ("rig.motor.speed", "rig_motor_speed"),
            ("loop", "loop_"),
            ("2nd", "_2nd"),
            ("_", "__"),
            ("'+'", "__"),
        ] {
            assert_eq!(identifier(name), expected);
        }
    }
}
