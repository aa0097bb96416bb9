use vines_testbench::calibration::*;
use vines_testbench::scene::Scene;
fn main() {
    let a: Vec<u64> = std::env::args().skip(1).map(|s| s.parse().unwrap()).collect();
    let rigs = if a.get(2) == Some(&1) { OTHER_RIGS } else { RIGS };
    let text = include_str!("../../../scenes/dimensionless.toml");
    let c = calibrate(|o| Scene::parse("d", text, o), &rigs, a[0]..a[1], |_| {}).unwrap();
    for snr in RATIOS { for (k, q) in [(Kind::Lock, "sigma"), (Kind::Lock, "C"), (Kind::Lock, "B"), (Kind::Lock, "G"), (Kind::Lock, "phase"), (Kind::Tracked, "sigma"), (Kind::Tracked, "G"), (Kind::Decay, "sigma")] {
        println!("{snr} {k:?} {q} {:?}", Coverage::of(c.outcomes.iter().filter(|o| o.snr == snr && o.kind == k && o.quantity == q)));
    } }
    println!("all {:?}", Coverage::of(c.outcomes.iter()));
    println!("{} failures", c.failures.len());
    for f in c.failures.iter().take(12) { println!("{f}"); }
}
