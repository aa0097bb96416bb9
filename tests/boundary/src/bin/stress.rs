//! Many sequences of calls on both libraries: `stress [sequences] [seed] [libraries]`.

use std::path::Path;
use std::time::Instant;

use fmi2_boundary::{Fmu, fuzz::Fuzzer};

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
    let libraries = Fmu::pair(arguments.next().as_deref().map(Path::new));
    println!("{sequences} sequences of calls, seed {seed}, on each library");
    println!("library    sequences     calls        ok  warning  discard     error  harmless  longest call  time");
    for fmu in libraries {
        let began = Instant::now();
        let mut fuzzer = Fuzzer::new(fmu);
        (0..sequences).for_each(|n| fuzzer.sequence(seed.wrapping_mul(1 << 32).wrapping_add(n)));
        let [ok, warning, discard, error, ..] = fuzzer.statuses;
        println!(
            "{:<9} {sequences:>10} {:>9} {ok:>9} {warning:>8} {discard:>8} {error:>9} {:>9} {:>10.2} ms {:>4.0} s",
            fmu.name,
            fuzzer.statuses.iter().sum::<u64>(),
            fuzzer.harmless,
            fuzzer.longest.as_secs_f64() * 1e3,
            began.elapsed().as_secs_f64(),
        );
    }
    println!("no crash, no panic, every error with its reason, no illegal call that changed anything");
}
