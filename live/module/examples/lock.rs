//! Prints the sample at which the default scene has settled, and the bits of the frequency there: what the page must reproduce.

use vines_live::bench::Bench;

fn main() -> Result<(), String> {
    let mut bench = Bench::new(Bench::default_settings())?;
    while !bench.output.settled {
        bench.sample()?;
    }
    println!("{} {:016x}", bench.samples, bench.output.omega.to_bits());
    Ok(())
}
