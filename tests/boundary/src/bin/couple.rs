//! Couples plant and controller and prints a digest of every state and output bit: `couple [samples] [libraries]`.
//!
//! Platforms with the same digest compute the same, bit by bit.

use std::path::Path;

use fmi2_boundary::Fmu;
use fmi2_boundary::pair::{Pair, SAMPLE_TIME};

fn main() {
    let mut arguments = std::env::args().skip(1);
    let samples = arguments.next().map_or(Ok(40_000), |text| text.parse::<u32>());
    let (Ok(samples), folder, None) = (samples, arguments.next(), arguments.next()) else {
        eprintln!("usage: couple [samples] [folder of LoViNes and PhaseLock as packed]");
        std::process::exit(2);
    };
    let mut pair = Pair::new(&Fmu::pair(folder.as_deref().map(Path::new)));
    for _ in 0..samples {
        pair.step(SAMPLE_TIME);
        pair.digest();
    }
    let (impacts, locked) = (pair.impacts(), pair.is_locked());
    println!("{samples} samples, {impacts} impacts, locked: {locked}");
    println!("sha256 {}", pair.hash());
}
