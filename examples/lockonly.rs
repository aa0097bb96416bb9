//! One long run, for a profiler.
use lovines::{Drive, Parameters, Plant, State};
fn main() {
    let n: f64 = std::env::args().nth(1).unwrap().parse().unwrap();
    let mode = std::env::args().nth(2).unwrap();
    let start = State { q1: -0.42, dq1: 0.01, q2: -0.99, dq2: -0.86 };
    let mut p = Plant::new(Parameters::dimensionless(0.0084, 1.43, 0.65), start).unwrap();
    let (g, om) = if mode == "chaos" { (2.0, 1.0-0.5*0.0084) } else { (1.1, 0.990417) };
    let d = Drive::harmonic(0.0084 * g, om);
    let t = std::f64::consts::TAU / om;
    match mode.as_str() {
        "lock" | "chaos" => { p.advance(d, n * t).unwrap(); }
        "period" => for _ in 0..n as u64 { p.advance(d, t).unwrap(); std::hint::black_box(p.state()); },
        _ => for k in 0..(n*100.0) as u64 { let mut e = d; e.omega *= 1.0 + 1e-7*(k%7) as f64; e.amplitude *= 1.0+1e-7*(k%5) as f64; p.advance(e, t/100.0).unwrap(); std::hint::black_box(p.state()); },
    }
    println!("{:?} {}", p.state(), p.totals().impacts);
}
