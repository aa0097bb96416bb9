//! Couples plant and controller and prints a digest of every state and output bit: `couple [samples] [libraries]`.
//!
//! Platforms with the same digest compute the same, bit by bit.

use std::path::Path;

use fmi2_boundary::{Fmu, pair};

fn main() {
    let mut arguments = std::env::args().skip(1);
    let samples = arguments.next().map_or(Ok(40_000), |text| text.parse::<u32>());
    let (Ok(samples), folder, None) = (samples, arguments.next(), arguments.next()) else {
        eprintln!("usage: couple [samples] [folder of LoViNes and PhaseLock as packed]");
        std::process::exit(2);
    };
    let [plant, controller] = match &folder {
        Some(folder) => Fmu::packed(Path::new(folder)),
        None => [Fmu::plant(), Fmu::controller()],
    };
    let mut pair = pair::Pair::new(&plant, &controller);
    for _ in 0..samples {
        pair.step(pair::SAMPLE_TIME);
        pair.digest();
    }
    println!(
        "{samples} samples, {} impacts, locked: {}",
        pair.impacts(),
        pair.is_locked()
    );
    println!("sha256 {}", pair.hash());
}
