//! Many sequences of calls on both libraries: `stress [sequences] [seed] [libraries]`.

use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread;
use std::time::{Duration, Instant};

use fmi2_boundary::{Fmu, fuzz};

/// The seed of the sequence under way.
static SEED: AtomicU64 = AtomicU64::new(0);
/// A sequence that takes longer hangs; under valgrind everything takes fifty times as long.
const PATIENCE: Duration = Duration::from_secs(300);

/// Ends the program, telling the seed, where a sequence does not end; goes when `done` does.
fn watch(done: &Receiver<()>) {
    let mut seen = (SEED.load(Ordering::Relaxed), Instant::now());
    while done.recv_timeout(Duration::from_secs(1)) == Err(RecvTimeoutError::Timeout) {
        let seed = SEED.load(Ordering::Relaxed);
        if seed != seen.0 {
            seen = (seed, Instant::now());
        } else if seen.1.elapsed() > PATIENCE {
            eprintln!("the sequence of seed {seed} does not end");
            std::process::exit(1);
        }
    }
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let mut next = |default| match arguments.next().map(|text| text.parse::<u64>()) {
        None => default,
        Some(Ok(number)) => number,
        Some(Err(_)) => {
            eprintln!(
                "usage: stress [sequences] [seed] [folder of LoViNes and PhaseLock as packed], the first two whole numbers"
            );
            std::process::exit(2);
        }
    };
    let (sequences, seed) = (next(100_000), next(1));
    let libraries = match arguments.next() {
        Some(folder) => Fmu::packed(Path::new(&folder)),
        None => [Fmu::plant(), Fmu::controller()],
    };
    println!("{sequences} sequences of calls, seed {seed}, on each library");
    println!(
        "library    sequences     calls        ok  warning  discard     error  fatal  harmless  longest call  time"
    );
    let (running, done) = channel();
    let watchdog = thread::spawn(move || watch(&done));
    for fmu in libraries {
        let began = Instant::now();
        let tally = (0..sequences)
            .map(|n| {
                let seed = seed.wrapping_mul(1 << 32).wrapping_add(n);
                SEED.store(seed, Ordering::Relaxed);
                fuzz::sequence(&fmu, seed)
            })
            .fold(fuzz::Tally::default(), |sum, one| sum.and(&one));
        let [ok, warning, discard, error, fatal, _] = tally.statuses;
        println!(
            "{:<9} {:>10} {:>9} {ok:>9} {warning:>8} {discard:>8} {error:>9} {fatal:>6} {:>9} {:>10.2} ms {:>4.0} s",
            fmu.name,
            tally.sequences,
            tally.calls(),
            tally.harmless,
            tally.longest.as_secs_f64() * 1e3,
            began.elapsed().as_secs_f64(),
        );
    }
    drop(running);
    watchdog.join().expect("the watchdog does not panic");
    println!("no crash, no panic, every error with its reason, no illegal call that changed anything");
}
