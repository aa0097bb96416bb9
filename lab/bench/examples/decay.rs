use vines_testbench::comparison::ExactCurve;
use vines_testbench::experiment::{self, Plan};
use vines_testbench::identification::decay_points;
use vines_testbench::rig::{BuiltIn, Chain, Simulated};
use vines_testbench::scene::{Override, Scene};
use vines_model::theory::SlowFlow;
fn main() {
    let overrides: Vec<Override> = std::env::args().skip(1).map(|s| s.parse().unwrap()).collect();
    let text = include_str!("../../../scenes/dimensionless.toml");
    let scene = Scene::parse("d", text, &overrides).unwrap();
    let d = scene.dimensionless();
    let mut rig = Chain::around(Box::new(Simulated::new(scene.plant, scene.start).unwrap()), &scene.chain, &d, scene.controller.samples_per_period);
    let mut controller = BuiltIn::new(&scene.controller_config()).unwrap();
    let r = experiment::run(rig.as_mut(), &mut controller, &Plan::of(&scene), |_, _, _| {}).unwrap();
    let curve = ExactCurve::of(&d);
    let flow = SlowFlow::new(d.lambda, d.r);
    let p = decay_points(&r, &scene);
    let (mut a, mut b, mut n) = (0.0, 0.0, 0.0);
    let mut d0 = 0.0;
    for i in 4..p.len()-4 {
        let rate = (p[i+4].c - p[i-4].c) / (p[i+4].tau - p[i-4].tau);
        let before = (p[i].c - p[i-4].c) / (p[i].tau - p[i-4].tau);
        let after = (p[i+4].c - p[i].c) / (p[i+4].tau - p[i].tau);
        let second = (after - before) / (0.5 * (p[i+4].tau - p[i-4].tau));
        let Some(e) = curve.distance(p[i].c, p[i].sigma, 1.0) else { continue };
        let Some(raw) = e.sigma else { continue };
        let Some(k) = flow.drift(p[i].c) else { continue };
        let k2 = second / (2.0 * d.epsilon * p[i].c);
        let cor = raw - k.sigma * rate - k2;
        if p[i].c > 0.2 { a += raw * raw; b += cor * cor; n += 1.0; }
        if i % 8 == 0 { println!("C {:.4} s {:.4} raw {:+.4} rate {:+.5} lag {:+.4} second {:+.4} G {:.3} cor {:+.4}", p[i].c, p[i].sigma, raw, rate, k.sigma * rate, k2, k.g*rate, cor); }
        d0 = p[i].tau;
    }
    println!("RMS raw {:.4} corrected {:.4} n {n} {d0}", f64::sqrt(a / n), f64::sqrt(b / n));
}
