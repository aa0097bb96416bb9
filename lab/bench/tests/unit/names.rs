//! Tests of `names`.

use super::*;

#[test]
fn names_have_units_or_factors_and_mistakes_are_named() {
    let text = "response = \"y\"\nbase = { name = \"x\", unit = \"mm\" }\nE = { name = \"A\", factor = -0.5 }";
    let names: Names = toml::from_str(text).unwrap();
    let seen = ["response", "base", "E", "omega"].map(|ours| names.of(ours));
    assert_eq!(seen.each_ref().map(|one| one.factor), [1.0, 1e-3, -0.5, 1.0]);
    assert_eq!(seen.each_ref().map(|one| &*one.name), ["y", "x", "A", "omega"]);
    assert_eq!(names.unknown(&["response", "base"]), Some("E"));
    for (text, reason) in [
        ("a = { name = \"x\", unit = \"furlong\" }", "unknown"),
        ("a = { name = \"x\", unit = \"m\", factor = 2 }", "not both"),
        ("a = { name = \"x\", factor = 0.0 }", "other than 0"),
    ] {
        let refused = toml::from_str::<Names>(text).unwrap_err().to_string();
        assert!(refused.contains(reason), "{refused}");
    }
}
