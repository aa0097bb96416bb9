use lovines::{Drive, Parameters, Plant, State};
use std::f64::consts::TAU;
use std::time::Instant;
fn plant() -> Plant {
    let start = State { q1: -0.42, dq1: 0.01, q2: -0.99, dq2: -0.86 };
    let p = Parameters { primary_mass: 3.807, stiffness: 11.68e3, damping: 2.53, particle_mass: 0.032, half_width: 0.01, restitution: 0.65 };
    let w0 = p.natural_frequency();
    let s = State { q1: start.q1*0.01, dq1: start.dq1*0.01*w0, q2: start.q2*0.01, dq2: start.dq2*0.01*w0 };
    Plant::new(p, s).unwrap()
}
fn drive(g: f64, sigma: f64) -> (Drive, f64) {
    let eps = 0.032/3.807; let w0 = (11.68e3f64/3.807).sqrt();
    let om = w0*(1.0+sigma*eps);
    (Drive::harmonic(g*eps*0.01, om), TAU/om)
}
fn timed(f: impl Fn()) -> f64 { let mut best = f64::INFINITY; for _ in 0..80 { let t = Instant::now(); f(); best = best.min(t.elapsed().as_secs_f64()); } best*1e9 }
fn cell(g: f64, sigma: f64) -> (f64, f64, f64) {
    let mut p = plant();
    let (d, t) = drive(g, sigma);
    p.advance(d, 300.0*t).unwrap();
    let mut q = p; let o = q.advance(d, 200.0*t).unwrap();
    let n = o.impacts;
    let ns = timed(|| { let mut q = p; std::hint::black_box(q.advance(d, 200.0*t).unwrap()); });
    (ns/(n.max(200) as f64), n as f64/200.0, o.evaluations as f64/(n.max(1) as f64))
}
fn main() {
    println!("size {}", std::mem::size_of::<Plant>());
    let lock = cell(1.1, -1.14).0;
    println!("lock {lock:.1} ns per impact");
    let (d, t) = drive(1.1, -1.14);
    let p = plant(); let mut p0 = p; p0.advance(d, 300.0*t).unwrap();
    let ns = timed(|| { let mut q = p0; for _ in 0..500 { q.advance(d, t).unwrap(); std::hint::black_box(q.state()); } });
    println!("a step per period, read: {:.1} ns per impact", ns/1000.0);
    let ns = timed(|| { let mut q = p0; for _ in 0..500 { q.advance(d, t).unwrap(); } std::hint::black_box(q.state()); });
    println!("a step per period, not read: {:.1} ns per impact", ns/1000.0);
    for n in [100.0, 1e4, 1e6] {
    let ns = timed(|| { let mut q = p0; for _ in 0..10000 { q.advance(d, t/n).unwrap(); std::hint::black_box(q.state()); } });
    println!("step of 1/{n} period, same drive: {:.1} ns per step", ns/10000.0);
    }
    let ns = timed(|| { let mut q = p0; for k in 0..10000 { let mut e = d; e.omega *= 1.0 + 1e-7*f64::from(k%7); e.amplitude *= 1.0 + 1e-7*f64::from(k%5); q.advance(e, t/100.0).unwrap(); std::hint::black_box(q.state()); } });
    println!("changing drive: {:.1} ns per step", ns/10000.0);
    let ns = timed(|| { let mut q = p0; for k in 0..10000 { let e = Drive::held(d.amplitude*(f64::from(k)*0.0628).sin()); q.advance(e, t/100.0).unwrap(); std::hint::black_box(q.state()); } });
    println!("held samples (with sin): {:.1} ns per step", ns/10000.0);
    let quiet = { let pp = *p.parameters(); Plant::new(pp, State{dq2:1e-8,..State::default()}).unwrap() };
    let ns = timed(|| { let mut q = quiet; for _ in 0..10000 { q.advance(d, t/100.0).unwrap(); std::hint::black_box(q.state()); } });
    println!("no impact, same drive: {:.1} ns per step", ns/10000.0);
    if std::env::args().nth(1).is_none() { return; }
    println!("G\\sigma: ns ratio to lock (impacts per period; evaluations per impact)");
    let mut worst: Vec<(f64,f64,f64)> = vec![];
    for g in [1.1, 1.2, 1.5, 2.0, 2.5, 3.0] {
        print!("{g:4} ");
        for sigma in [-3.0, -2.0, -1.14, -0.5, 0.0, 0.5, 1.0, 2.0, 3.0] {
            let (ns, n, e) = cell(g, sigma);
            worst.push((ns/lock, g, sigma));
            print!("{:5.1} ({n:4.2};{e:4.1})", ns/lock);
        }
        println!();
    }
    worst.sort_by(|a,b| a.0.total_cmp(&b.0));
    println!("median {:.2} worst {:?}", worst[worst.len()/2].0, worst.last());
}
