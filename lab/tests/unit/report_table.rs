//! Tests of `report/table`.

use super::*;

fn table() -> Table {
    Table::new("what | C").rows([["a < b", "0.5"], ["c", "-10.25"]].map(|row| row.map(String::from)))
}

#[test]
fn words_are_set_to_the_left_and_numbers_to_the_right() {
    assert_eq!(table().text(), "  what        C\n  a < b     0.5\n  c      -10.25\n");
}

#[test]
fn markdown_has_a_rule_below_the_headings() {
    assert_eq!(
        table().markdown(),
        "| what | C |\n|---|---|\n| a < b | 0.5 |\n| c | -10.25 |\n"
    );
}

#[test]
fn text_cannot_become_markup() {
    let html = table().html("\"x\" & y").into_string();
    assert!(html.contains("<caption>&quot;x&quot; &amp; y</caption>"), "{html}");
    assert!(
        html.contains("<td>a &lt; b</td><td class=\"number\">0.5</td>"),
        "{html}"
    );
}
