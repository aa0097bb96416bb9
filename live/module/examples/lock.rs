//! Prints the sample at which the default scene has settled, the bits of the frequency there, and the least time for a sample, ns:
//! what the page is compared with.

use std::hint::black_box;
use std::time::Instant;

use vines_live::bench::Bench;
use vines_live::message::Message;

/// Blocks that are timed, and samples in each.
const BLOCKS: usize = 200;
const SAMPLES: usize = 1000;

fn main() -> Result<(), Message> {
    let mut bench = Bench::new(Bench::default_settings())?;
    while !bench.output.settled {
        bench.run(1, |_| {})?;
    }
    let (samples, bits) = (bench.samples, bench.output.omega.to_bits());
    let mut least = f64::INFINITY;
    for _ in 0..BLOCKS {
        let start = Instant::now();
        bench.run(SAMPLES, |row| _ = black_box(row))?;
        least = least.min(start.elapsed().as_nanos() as f64 / SAMPLES as f64);
    }
    println!("{samples} {bits:016x} {least:.0}");
    Ok(())
}
