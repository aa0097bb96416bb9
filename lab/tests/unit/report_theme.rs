//! Tests of `report/theme`.

use super::*;

#[test]
fn regimes_differ_in_lightness() {
    let mut lightness: Vec<f64> = Regime::SIMULATED
        .iter()
        .map(|one| {
            let (RGBColor(r, g, b), ..) = regime(*one);
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
