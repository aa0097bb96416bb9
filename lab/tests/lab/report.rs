//! Guards `vines report`: complete, self-contained, the same bytes from the same input, and readable by a browser.

use std::path::Path;
use std::process::Command;

use crate::{Running, text, vines, words};

/// The page of a scene with few levels, on a coarse map.
fn report(folder: &Path) -> String {
    let scene = "--scene scenes/dimensionless.toml --set backbone.points=8";
    let scene = scene.replace("scenes/", concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/"));
    let out = folder.display();
    let done = vines(&format!("report {scene} --x sigma=-2:1:7 --y G=0.8:1.8:6 --out {out}"));
    assert!(done.status.success(), "{}", text(&done));
    std::fs::read_to_string(folder.join("report.html")).unwrap()
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
    let page = folder.path().join("report.html");
    let html = report(folder.path());
    for words in ["history backbone sim tracked response map fit"].map(words).concat() {
        assert!(folder.path().join(format!("{words}.svg")).is_file(), "{words}");
    }
    assert_eq!(html.matches("<figure>").count(), 7);
    for words in [
        "measured at the lock",
        "periods per point",
        "fold at B",
        "1 component",
        "inside the theory",
        "chi-square",
    ] {
        assert!(html.contains(words), "{words}");
    }
    // Nothing is fetched: no address but the names of XML's vocabularies.
    let fetched = html.replace("http://www.w3.org/2000/svg", "");
    assert!(!fetched.contains("http://") && !fetched.contains("https://") && !fetched.contains("<script"));

    assert!(report(folder.path()) == html);

    let Some((console, seen)) = browser(&page, &["--dump-dom"]) else {
        eprintln!("skipped: chromium is not installed, so the page was opened by no browser");
        return;
    };
    assert!(!console.contains("CONSOLE"), "{console}");
    assert_eq!(seen.matches("<figure>").count(), 7);
    let print = folder.path().join("report.pdf");
    let (console, _) = browser(
        &page,
        &[&format!("--print-to-pdf={}", print.display()), "--no-pdf-header-footer"],
    )
    .unwrap();
    assert!(!console.contains("CONSOLE"), "{console}");
    assert!(std::fs::read(&print).unwrap().starts_with(b"%PDF"));
}

#[test]
fn a_report_says_which_commands_failed_and_shows_why() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("of today");
    let out = out.to_str().unwrap();
    let idle = "--set start.dq2=0 --set phase_lock.acquire_timeout=3 --x sigma=-2:1:3 --y G=0.8:1.8:3";
    let line = format!("report {idle} --out");
    let done = Running::start(&[words(&line), vec![out]].concat()).output();
    assert_eq!(done.status.code(), Some(1));
    assert!(
        text(&done).contains("error: without a result: Lock and free decay, "),
        "{}",
        text(&done)
    );
    let html = std::fs::read_to_string(folder.path().join("of today/report.html")).unwrap();
    assert!(html.contains("error: no lock within"));
    // As a shell needs it.
    assert!(
        html.contains(&format!("vines backbone --out '{out}' --set=start.dq2=0")),
        "{html}"
    );
}
