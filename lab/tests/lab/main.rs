//! Guards the lab as its users meet it. Each file has the tests of one part; what several of them need is here.

mod command_line;
mod endpoints;
mod map;
mod packing;
mod pair;
mod report;
mod results;
#[cfg(target_os = "linux")]
mod signals;
mod watch;

use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use serde_json::Value;
use tempfile::TempDir;
use vines::rig::{BuiltIn, Rig, Simulated};
use vines::scene::{Override, Scene};

const PROGRAM: &str = env!("CARGO_BIN_EXE_vines");

/// Runs a command line; its words have no spaces.
fn vines(line: &str) -> Output {
    Running::start(&words(line)).output()
}

fn words(line: &str) -> Vec<&str> {
    line.split_whitespace().collect()
}

/// The JSON that a command prints.
fn json(line: &str) -> Value {
    let output = vines(line);
    assert!(output.status.success(), "{output:?}");
    serde_json::from_slice(&output.stdout).expect("JSON")
}

/// All that a command prints, which succeeds.
fn printed(line: &str) -> String {
    let output = vines(line);
    assert!(output.status.success(), "{line}: {output:?}");
    text(&output)
}

/// All that a program has printed.
fn text(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr)
}

/// The error must be one message on stderr, with nothing on stdout.
fn fails(line: &str, code: i32, part: &str) {
    is_failure(&vines(line), code, part);
}

fn is_failure(output: &Output, code: i32, part: &str) {
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{part}: {message}");
    let is_one_message = message.contains("error: ") && !message.contains("panicked");
    assert!(is_one_message, "{message}");
    assert!(message.contains(part), "`{part}` is not in: {message}");
    assert!(output.stdout.is_empty());
}

/// A program in a process of its own; it ends by itself, or where this is dropped.
struct Running(Child, #[expect(dead_code, reason = "removed with it")] TempDir);

impl Running {
    fn start(arguments: &[&str]) -> Self {
        Self::spawn(Command::new(PROGRAM), arguments)
    }

    /// With the system's reactions to signals, where what started the test ignores some, as `nohup` does.
    #[cfg(unix)]
    fn start_with_default_signals(arguments: &[&str]) -> Self {
        let mut command = Command::new("env");
        command.args(["--default-signal", PROGRAM]);
        Self::spawn(command, arguments)
    }

    fn spawn(mut command: Command, arguments: &[&str]) -> Self {
        // A folder of its own: two runs do not write into the same `out`.
        let folder = tempfile::tempdir().unwrap();
        command.args(arguments).current_dir(folder.path());
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        Self(command.spawn().unwrap(), folder)
    }

    /// The last word of the next line of its stdout.
    fn word(&mut self) -> String {
        last_word(self.0.stdout.as_mut().unwrap())
    }

    /// Sends a signal, if it is still running.
    fn signal(&mut self, signal: &str) {
        if self.0.try_wait().unwrap().is_none() {
            let id = self.0.id().to_string();
            Command::new("kill").args(["-s", signal, &id]).status().unwrap();
        }
    }

    /// All that it has printed since, once it has ended.
    fn output(mut self) -> Output {
        let [mut stdout, mut stderr] = [Vec::new(), Vec::new()];
        // Messages fit into the pipe.
        self.0.stdout.take().unwrap().read_to_end(&mut stdout).unwrap();
        self.0.stderr.take().unwrap().read_to_end(&mut stderr).unwrap();
        let status = self.0.wait().unwrap();
        Output { status, stdout, stderr }
    }
}

/// Waits until a recording that grows has this many rows. A row has about 100 bytes; a generous time catches a run that hangs.
fn wait_for_rows(file: &Path, rows: u64) {
    let began = Instant::now();
    while fs::metadata(file).map_or(0, |file| file.len()) < 100 * rows {
        assert!(began.elapsed() < Duration::from_secs(120), "{file:?} does not grow");
        sleep(Duration::from_millis(20));
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// The last word of a line, read without what follows it.
fn last_word(stream: &mut dyn Read) -> String {
    let mut line = String::new();
    BufReader::with_capacity(1, stream).read_line(&mut line).unwrap();
    line.trim().rsplit(' ').next().unwrap().to_string()
}

fn overrides(settings: &str) -> Vec<Override> {
    words(settings).into_iter().map(|word| word.parse().unwrap()).collect()
}

/// The plant of a scene behind its measurement chain.
fn rig(scene: &Scene) -> Box<dyn Rig> {
    Simulated::of(scene).unwrap()
}

fn built_in(scene: &Scene) -> BuiltIn {
    BuiltIn::new(&scene.plan().lock).unwrap()
}
