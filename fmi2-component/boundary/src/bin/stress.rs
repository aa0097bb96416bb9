//! Many sequences of calls on both libraries: `stress [sequences] [seed]`.

use std::time::Instant;

use fmi2_boundary::{Fmu, fuzz};

fn main() {
    let mut arguments = std::env::args().skip(1).map(|text| text.parse::<u64>());
    let mut next = |default| match arguments.next() {
        None => default,
        Some(Ok(number)) => number,
        Some(Err(_)) => {
            eprintln!("usage: stress [sequences] [seed], two whole numbers");
            std::process::exit(2);
        }
    };
    let (sequences, seed) = (next(100_000), next(1));
    println!("{sequences} sequences of calls, seed {seed}, on each library");
    println!(
        "library    sequences     calls        ok  warning  discard     error  fatal  harmless  longest call  time"
    );
    for fmu in [Fmu::plant(), Fmu::controller()] {
        let began = Instant::now();
        let tally = (0..sequences)
            .map(|n| fuzz::sequence(&fmu, seed.wrapping_mul(1 << 32).wrapping_add(n)))
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
    println!(
        "no crash, no panic, every error with its reason, no illegal call that changed anything"
    );
}
