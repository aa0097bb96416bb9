//! Tests of `pack/documentation`.

use super::*;
use crate::pack::components;

#[test]
fn the_page_has_every_variable_and_the_picture() {
    for component in components() {
        let description = Description::parse(&component.xml).unwrap();
        let page = page(&component, &description);
        for variable in description.variables {
            let name = &variable.name;
            assert!(page.contains(&format!("<tr><td>{name}</td>")), "{name}");
            let description = html! { (variable.description) }.into_string();
            assert!(page.contains(&description), "{name}");
        }
        assert!(page.contains("<svg") && component.png.starts_with(b"\x89PNG"));
    }
}

#[test]
fn every_real_variable_shows_its_unit() {
    for component in components() {
        let page = page(&component, &Description::parse(&component.xml).unwrap());
        for row in page.lines().filter(|line| line.starts_with("<tr><td>")) {
            let cells: Vec<_> = row.split("</td>").collect();
            let whole = ["impacts", "contact"].map(|name| format!("<tr><td>{name}"));
            let is_real = component.identifier == "LoViNes" && !whole.contains(&cells[0].into());
            assert!(!is_real || !cells[2].ends_with('>'), "{row}");
        }
    }
}

#[test]
fn numbers_have_at_most_six_digits() {
    for (exact, shown) in [
        ("0.0011343573395537938", "0.00113436"),
        ("9.246125558182298e-05", "9.24613e-5"),
        ("-1.5707963267948966", "-1.5708"),
        ("11680", "11680"),
        ("1e-6", "1e-6"),
        ("true", "true"),
        ("", ""),
    ] {
        assert_eq!(rounded(exact), shown);
    }
}
