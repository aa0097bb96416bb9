//! Guards `vines report`: complete, self-contained, the same bytes from the same input, and readable by a browser.

use std::path::Path;
use std::process::Command;

use vines::{map::LIMIT, report::write_report, scene::Family, sweep::Map};

use crate::{overrides, words};

/// Writes a report on a coarse map, after an early lock.
fn write(out: &Path) {
    let overrides = overrides("phase_lock.lock.amplitude_drift=3e-4 phase_lock.lock.dwell=5");
    let text = include_str!("../../../scenes/dimensionless.toml");
    let family = Family::parse("dimensionless.toml", Some(text), &overrides).unwrap();
    let [x, y] = ["sigma=-2:1:7", "G=0.8:1.8:6"].map(|axis| axis.parse().unwrap());
    let mut map = Map::new(family, &x, &y, None, LIMIT).unwrap();
    write_report(&mut map, out, &|_, _| {}).unwrap();
}

/// Debian's Chromium, if it is here, on a page: what it says on the console, and what it makes of the page.
fn browser(page: &Path, arguments: &[&str]) -> Option<(String, String)> {
    let profile = tempfile::tempdir().unwrap();
    let options = "--headless --no-sandbox --disable-gpu --enable-logging=stderr --virtual-time-budget=2000";
    let output = Command::new("chromium")
        .args(words(options))
        .arg(format!("--user-data-dir={}", profile.path().display()))
        .args(arguments)
        .arg(format!("file://{}", page.display()))
        .output()
        .ok()?;
    assert!(output.status.success(), "{output:?}");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    Some((text(&output.stderr), text(&output.stdout)))
}

#[test]
fn a_report_is_complete_reproducible_and_opens_in_a_browser() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path());
    let page = folder.path().join("report.html");
    let html = std::fs::read_to_string(&page).unwrap();
    let figures =
        words("history tracked-backbone approach decay-on-sim identified-backbone backbones responses period regimes");
    for file in figures
        .iter()
        .flat_map(|name| [format!("{name}.svg"), format!("{name}-dark.svg")])
    {
        assert!(folder.path().join(&file).is_file(), "{file}");
    }
    assert_eq!(html.matches("<figure>").count(), figures.len());
    for words in ["What was found", "symmetric 1:1", "Error budget", "published rig"] {
        assert!(html.contains(words), "{words}");
    }
    // Nothing is fetched: no address but the names of XML's vocabularies.
    let fetched = html.replace("http://www.w3.org/2000/svg", "");
    assert!(!fetched.contains("http://") && !fetched.contains("https://") && !fetched.contains("<script"));

    write(folder.path());
    assert_eq!(std::fs::read_to_string(&page).unwrap(), html);

    let Some((console, seen)) = browser(&page, &["--dump-dom"]) else {
        eprintln!("skipped: chromium is not installed, so the page was opened by no browser");
        return;
    };
    assert!(!console.contains("CONSOLE"), "{console}");
    assert_eq!(seen.matches("<figcaption>").count(), 9);
    let print = folder.path().join("report.pdf");
    let (console, _) = browser(
        &page,
        &[&format!("--print-to-pdf={}", print.display()), "--no-pdf-header-footer"],
    )
    .unwrap();
    assert!(!console.contains("CONSOLE"), "{console}");
    assert!(std::fs::read(&print).unwrap().starts_with(b"%PDF"));
}
