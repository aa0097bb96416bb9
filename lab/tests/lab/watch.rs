//! Guards `--watch`: page and stream of a running experiment, as browsers get them, and what they must not change.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use serde_json::Value;

use crate::PROGRAM;

/// A program with its server, and the server's address.
struct Watched(Child, String);

impl Watched {
    fn start(arguments: &[&str]) -> Self {
        let mut child = Command::new(PROGRAM)
            .args(arguments)
            .arg("--watch")
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::with_capacity(1, child.stderr.as_mut().unwrap())
            .read_line(&mut line)
            .unwrap();
        let address = line.trim().trim_end_matches('/').rsplit('/').next().unwrap();
        assert!(address.starts_with("127.0.0.1:"), "{line}");
        let address = address.to_string();
        Self(child, address)
    }

    fn connect(&self, request: &str) -> TcpStream {
        let mut stream = TcpStream::connect(&self.1).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(30))).unwrap();
        write!(stream, "{request} HTTP/1.1\r\nHost: {}\r\n\r\n", self.1).unwrap();
        stream
    }

    /// The whole answer to a request.
    fn get(&self, request: &str) -> String {
        std::io::read_to_string(self.connect(request)).unwrap()
    }

    /// A browser that gets the events.
    fn browser(&self) -> impl Iterator<Item = Value> + use<> {
        let lines = BufReader::new(self.connect("GET /rows")).lines();
        lines.map_while(Result::ok).filter_map(|line| {
            let event = line.strip_prefix("data: ")?;
            Some(serde_json::from_str(event).unwrap())
        })
    }
}

impl Drop for Watched {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// The rows of some events.
fn rows(events: &[Value]) -> Vec<&Vec<Value>> {
    let rows = events.iter().flat_map(|event| event["rows"].as_array().unwrap());
    rows.map(|row| row.as_array().unwrap()).collect()
}

/// An experiment of few periods.
fn identify<'a>(out: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    let short = ["--set=record.hold_periods=10", "--set=record.decay_periods=25"];
    [
        &["identify", "--json", "--rig", "built-in", "--out", out],
        &short[..],
        more,
    ]
    .concat()
}

#[test]
fn an_experiment_is_the_same_with_browsers_and_they_get_it_to_its_end() {
    let folder = tempfile::tempdir().unwrap();
    let [alone, watched] = ["alone", "watched"].map(|name| folder.path().join(name));
    let alone_out = Command::new(PROGRAM)
        .args(identify(alone.to_str().unwrap(), &[]))
        .output()
        .unwrap();
    assert!(alone_out.status.success(), "{alone_out:?}");
    let mut experiment = Watched::start(&identify(watched.to_str().unwrap(), &[]));
    // One browser is closed after its first event, one gets everything.
    let [mut closed, browser] = [experiment.browser(), experiment.browser()];
    assert!(closed.next().is_some());
    drop(closed);
    let events: Vec<Value> = browser.collect();
    let mut stdout = String::new();
    experiment
        .0
        .stdout
        .as_mut()
        .unwrap()
        .read_to_string(&mut stdout)
        .unwrap();
    assert!(experiment.0.wait().unwrap().success());
    assert_eq!(stdout.as_bytes(), alone_out.stdout, "the results");
    for file in ["identification.json", "backbone.csv", "backbone.svg"] {
        let read = |folder: &std::path::Path| std::fs::read(folder.join(file)).unwrap();
        assert!(read(&alone) == read(&watched), "{file}");
    }
    let rows = rows(&events);
    assert!(rows.len() > 1000, "{} rows", rows.len());
    let times: Vec<f64> = rows.iter().map(|row| row[0].as_f64().unwrap()).collect();
    assert!(times.windows(2).all(|pair| pair[0] < pair[1]), "rows in order");
    // At the lock, the picture shows what the experiment measures.
    let found: Value = serde_json::from_str(&stdout).unwrap();
    let lock = rows.iter().rfind(|row| row[6].as_f64() > Some(0.0)).unwrap();
    let omega = std::f64::consts::TAU * found["lock"]["f_Hz"].as_f64().unwrap();
    assert!((lock[5].as_f64().unwrap() / omega - 1.0).abs() < 1e-4, "{lock:?}");
    let amplitude = found["lock"]["A_m"].as_f64().unwrap();
    assert!((lock[7].as_f64().unwrap() / amplitude - 1.0).abs() < 1e-3, "{lock:?}");
    // The particle stays between its walls, b = 0.01 m, within the rounding of a sampled response.
    let reach = rows
        .iter()
        .map(|row| row[3].as_f64().unwrap().abs())
        .fold(0.0, f64::max);
    assert!((0.0095..0.0101).contains(&reach), "{reach} m");
    let decay = rows.iter().filter(|row| row[10] == 1.0).count();
    assert!(decay > 100, "{decay} rows of a free decay");
    let outcome = &events.last().unwrap()["outcome"];
    assert!(outcome["error"].is_null(), "{outcome}");
}

#[test]
fn an_experiment_that_fails_says_so_on_the_page() {
    let folder = tempfile::tempdir().unwrap();
    let short = ["--set", "phase_lock.acquire_timeout=3.4"];
    let experiment = Watched::start(&identify(folder.path().to_str().unwrap(), &short));
    let events: Vec<Value> = experiment.browser().collect();
    let outcome = &events.last().unwrap()["outcome"];
    let error = outcome["error"].as_str().unwrap();
    assert!(error.contains("no lock within"), "{error}");
}

#[test]
fn a_port_that_is_taken_is_refused_before_anything_is_driven() {
    let other = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = other.local_addr().unwrap().port();
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let refused = Command::new(PROGRAM)
        .args(identify(out.to_str().unwrap(), &[&format!("--watch={port}")]))
        .output()
        .unwrap();
    let message = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert_eq!(refused.status.code(), Some(1), "{message}");
    assert!(
        message.contains(&format!("127.0.0.1:{port}")) && message.contains("free port"),
        "{message}"
    );
    assert!(!out.exists());
}

#[test]
fn a_served_rig_shows_the_sessions_of_its_clients() {
    let mut rig = Watched::start(&["rig", "--listen", "127.0.0.1:0", "--lock-step", "--sessions", "1"]);
    let browser = rig.browser();
    let mut line = String::new();
    BufReader::with_capacity(1, rig.0.stdout.as_mut().unwrap())
        .read_line(&mut line)
        .unwrap();
    let address = line.trim().rsplit(' ').next().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let out = identify(folder.path().to_str().unwrap(), &[]);
    let out: Vec<&str> = out
        .into_iter()
        .map(|word| if word == "built-in" { address } else { word })
        .collect();
    assert!(Command::new(PROGRAM).args(out).output().unwrap().status.success());
    let events: Vec<Value> = browser.collect();
    assert!(rows(&events).len() > 1000);
    assert_eq!(events.last().unwrap()["outcome"], serde_json::json!({ "error": null }));
    // The rig does not know what the loop does.
    assert!(events.last().unwrap()["state"]["state"].is_null());
    assert!(events.last().unwrap()["state"]["impacts"].as_i64().unwrap() > 100);
}

#[test]
fn the_page_has_all_its_files_and_answers_at_its_own_address_only() {
    let rig = Watched::start(&["rig", "--listen=127.0.0.1:0", "--duration=60"]);
    let page = rig.get("GET /");
    assert!(
        page.starts_with("HTTP/1.1 200 OK") && page.contains("<title>vines: live bench</title>"),
        "{page}"
    );
    // Every script that the page or a script names is served.
    let mut names = vec!["main.js".to_string()];
    let mut next = 0;
    while let Some(name) = names.get(next).cloned() {
        let script = rig.get(&format!("GET /{name}"));
        assert!(
            script.starts_with("HTTP/1.1 200 OK") && script.contains("text/javascript"),
            "{name}"
        );
        for (_, import) in script
            .match_indices("from \"./")
            .map(|(at, found)| (at, &script[at + found.len()..]))
        {
            let import = import.split('"').next().unwrap().to_string();
            if !names.contains(&import) {
                names.push(import);
            }
        }
        next += 1;
    }
    assert!(names.len() > 10, "{names:?}");
    let body = rig.get("GET /settings.json");
    let table: Value = serde_json::from_str(body.split("\r\n\r\n").nth(1).unwrap()).unwrap();
    assert_eq!(table["watch"]["values"]["restitution"], 0.65);
    assert!(table["watch"]["exact"].as_array().unwrap().len() > 50);
    assert!(rig.get("GET /../Cargo.toml").starts_with("HTTP/1.1 404"));
    assert!(rig.get("POST /rows").starts_with("HTTP/1.1 405"));
    let mut other = TcpStream::connect(&rig.1).unwrap();
    write!(other, "GET / HTTP/1.1\r\nHost: example.org\r\n\r\n").unwrap();
    assert!(std::io::read_to_string(other).unwrap().starts_with("HTTP/1.1 403"));
}
