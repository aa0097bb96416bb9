//! Guards `--watch`: page and stream of a running experiment, as browsers get them, and what they must not change.

use std::io::{BufRead, BufReader, Write};
use std::net::{TcpListener, TcpStream};
use std::time::Duration;

use serde_json::Value;

use crate::{Running, fails, last_word, vines, words};

/// A program with its server, and the server's address.
struct Watched(Running, String);

impl Watched {
    fn start(line: &str) -> Self {
        let mut program = Running::start(&words(&format!("{line} --watch")));
        let place = last_word(program.0.stderr.as_mut().unwrap());
        let address = place.trim_start_matches("http://").trim_end_matches('/');
        assert!(address.starts_with("127.0.0.1:"), "{place}");
        Self(program, address.into())
    }

    fn connect(&self, request: &str) -> TcpStream {
        let mut stream = TcpStream::connect(&self.1).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(120))).unwrap();
        // In one piece: the server waits for a request for a short time only.
        let request = format!("{request} HTTP/1.1\r\nHost: {}\r\n\r\n", self.1);
        stream.write_all(request.as_bytes()).unwrap();
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

/// The rows of some events.
fn rows(events: &[Value]) -> Vec<&Vec<Value>> {
    let rows = events.iter().flat_map(|event| event["rows"].as_array().unwrap());
    rows.map(|row| row.as_array().unwrap()).collect()
}

/// An experiment of few periods.
const IDENTIFY: &str = "identify --json --set=record.hold_periods=10 --set=record.decay_periods=25";

#[test]
fn an_experiment_is_the_same_with_browsers_and_they_get_it_to_its_end() {
    let folder = tempfile::tempdir().unwrap();
    let [alone, watched] = ["alone", "watched"].map(|name| folder.path().join(name));
    let [undisturbed, shown] =
        [&alone, &watched].map(|out| format!("{IDENTIFY} --rig built-in --out {}", out.display()));
    let undisturbed = vines(&undisturbed);
    assert!(undisturbed.status.success(), "{undisturbed:?}");
    let experiment = Watched::start(&shown);
    // One browser is closed after its first event, one gets everything.
    let [mut closed, browser] = [experiment.browser(), experiment.browser()];
    assert!(closed.next().is_some());
    drop(closed);
    let events: Vec<Value> = browser.collect();
    let output = experiment.0.output();
    assert!(
        output.status.success() && output.stdout == undisturbed.stdout,
        "{output:?}"
    );
    for file in ["identification.json", "backbone.csv", "backbone.svg"] {
        let [alone, watched] = [&alone, &watched].map(|folder| std::fs::read(folder.join(file)).unwrap());
        assert!(alone == watched, "{file}");
    }
    let rows = rows(&events);
    assert!(rows.len() > 1000, "{} rows", rows.len());
    let times: Vec<f64> = rows.iter().map(|row| row[0].as_f64().unwrap()).collect();
    assert!(times.windows(2).all(|pair| pair[0] < pair[1]), "rows in order");
    // At the lock, the picture shows what the experiment measures.
    let found: Value = serde_json::from_slice(&output.stdout).unwrap();
    let lock = rows.iter().rfind(|row| row[6].as_f64() > Some(0.0)).unwrap();
    for (column, key, unit, tolerance) in [(5, "f_Hz", std::f64::consts::TAU, 1e-4), (7, "A_m", 1.0, 1e-3)] {
        let measured = unit * found["lock"][key].as_f64().unwrap();
        assert!(
            (lock[column].as_f64().unwrap() / measured - 1.0).abs() < tolerance,
            "{lock:?}"
        );
    }
    // The particle stays between its walls, b = 0.01 m, within the rounding of a sampled response.
    let displacements = rows.iter().map(|row| row[3].as_f64().unwrap().abs());
    let reach = displacements.fold(0.0, f64::max);
    assert!((0.0095..0.0101).contains(&reach), "{reach} m");
    let decay = rows.iter().filter(|row| row[10] == 1.0).count();
    assert!(decay > 100, "{decay} rows of a free decay");
    let outcome = &events.last().unwrap()["outcome"];
    assert!(outcome["error"].is_null(), "{outcome}");
}

#[test]
fn an_experiment_that_fails_says_so_on_the_page() {
    let folder = tempfile::tempdir().unwrap();
    let short = format!("{IDENTIFY} --rig built-in --out {}", folder.path().display());
    let experiment = Watched::start(&format!("{short} --set phase_lock.acquire_timeout=3.4"));
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
    let line = format!("{IDENTIFY} --rig built-in --out {} --watch={port}", out.display());
    for part in [&*format!("127.0.0.1:{port}"), "free port"] {
        fails(&line, 1, part);
    }
    assert!(!out.exists());
}

#[test]
fn a_served_rig_shows_the_sessions_of_its_clients() {
    let mut rig = Watched::start("rig --listen 127.0.0.1:0 --lock-step --sessions 1");
    let browser = rig.browser();
    let folder = tempfile::tempdir().unwrap();
    let client = format!("{IDENTIFY} --rig {} --out {}", rig.0.word(), folder.path().display());
    assert!(vines(&client).status.success());
    let events: Vec<Value> = browser.collect();
    assert!(rows(&events).len() > 1000);
    assert_eq!(events.last().unwrap()["outcome"], serde_json::json!({ "error": null }));
    // The rig does not know what the loop does.
    assert!(events.last().unwrap()["state"]["state"].is_null());
    assert!(events.last().unwrap()["state"]["impacts"].as_i64().unwrap() > 100);
}

#[test]
fn the_page_has_all_its_files_and_answers_at_its_own_address_only() {
    let rig = Watched::start("rig --listen=127.0.0.1:0 --duration=60");
    let is_served = |name: &str, part: &str| {
        let answer = rig.get(&format!("GET /{name}"));
        assert!(
            answer.starts_with("HTTP/1.1 200 OK") && answer.contains(part),
            "{answer}"
        );
        answer
    };
    is_served("", "<title>vines: live bench</title>");
    // Every script that the page or a script names is served.
    let mut names = vec!["main.js".to_string()];
    let mut next = 0;
    while let Some(name) = names.get(next) {
        let script = is_served(name, "text/javascript");
        for import in script.split("from \"./").skip(1) {
            let import = import.split('"').next().unwrap().to_string();
            if !names.contains(&import) {
                names.push(import);
            }
        }
        next += 1;
    }
    assert!(names.len() > 10, "{names:?}");
    let body = is_served("settings.json", "application/json");
    let table: Value = serde_json::from_str(body.split("\r\n\r\n").nth(1).unwrap()).unwrap();
    assert_eq!(table["watch"]["values"]["restitution"], 0.65);
    assert!(table["watch"]["exact"].as_array().unwrap().len() > 50);
    assert!(rig.get("GET /../Cargo.toml").starts_with("HTTP/1.1 404"));
    assert!(rig.get("POST /rows").starts_with("HTTP/1.1 405"));
    let mut other = TcpStream::connect(&rig.1).unwrap();
    write!(other, "GET / HTTP/1.1\r\nHost: example.org\r\n\r\n").unwrap();
    assert!(std::io::read_to_string(other).unwrap().starts_with("HTTP/1.1 403"));
}

#[test]
fn the_page_of_a_shaker_has_the_exact_backbone_of_all_modes_and_the_drop_out_of_the_force() {
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/shaker-cantilever.toml");
    let rig = Watched::start(&format!("rig --scene={scene} --listen=127.0.0.1:0 --duration=60"));
    let body = rig.get("GET /settings.json");
    let table: Value = serde_json::from_str(body.split("\r\n\r\n").nth(1).unwrap()).unwrap();
    let host = &table["watch"]["host"];
    assert_eq!(
        (&host["drive"], &host["drop_out"]["unit"]),
        (&"force".into(), &"N".into())
    );
    // The sensor is at the cavity.
    assert!((host["gap"].as_f64().unwrap() - 10.0).abs() < 1e-12);
    let points: Vec<[f64; 2]> = serde_json::from_value(host["drop_out"]["points"].clone()).unwrap();
    let [hertz, least] = *points.iter().min_by(|one, other| one[1].total_cmp(&other[1])).unwrap();
    assert!((hertz / 8.815 - 1.0).abs() < 0.005, "{hertz} Hz");
    assert!(least < 0.8 * points[0][1], "{least} of {}", points[0][1]);
    // At C = 0.51 another mode takes the stability.
    let exact: Vec<[Option<f64>; 4]> = serde_json::from_value(table["watch"]["exact"].clone()).unwrap();
    let stable = exact.iter().filter(|point| point[2] == Some(1.0));
    let highest = stable.filter_map(|point| point[1]).fold(0.0, f64::max);
    assert!((0.45..0.52).contains(&highest), "{highest}");
}
