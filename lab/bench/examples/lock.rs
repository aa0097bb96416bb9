use vines_testbench::experiment::{self, Plan};
use vines_testbench::identification::identify;
use vines_testbench::rig::{BuiltIn, Chain, Simulated};
use vines_testbench::scene::{Override, Scene};
fn main() {
    let mut args: Vec<String> = std::env::args().skip(1).collect();
    let (from, to): (u64, u64) = (args.remove(0).parse().unwrap(), args.remove(0).parse().unwrap());
    let text = include_str!("../../../scenes/dimensionless.toml");
    let mut p = [0f64; 5]; let mut n = 0.0; let mut lk = 0f64; let mut us = 0f64;
    for seed in from..to {
        let mut all = args.clone();
        all.push(format!("chain.seed={seed}"));
        let overrides: Vec<Override> = all.iter().map(|s| s.parse().unwrap()).collect();
        let scene = Scene::parse("d", text, &overrides).unwrap();
        let d = scene.dimensionless();
        let mut rig = Chain::around(Box::new(Simulated::new(scene.plant, scene.start).unwrap()), &scene.chain, &d, scene.controller.samples_per_period);
        let mut controller = BuiltIn::new(&scene.controller_config()).unwrap();
        let r = match experiment::run(rig.as_mut(), &mut controller, &Plan::of(&scene), |_, _, _| {}) { Ok(r) => r, Err(e) => { println!("seed {seed}: {e}"); continue } };
        let l = match identify(&r, &scene) { Ok(i) => i.lock, Err(e) => { println!("seed {seed}: {e}"); continue } };
        let e = vines_model::orbit::phase_resonant(&d).into_iter().filter(|o| o.stable).min_by(|a, b| (a.c - l.c).abs().total_cmp(&(b.c - l.c).abs())).unwrap();
        let err = [l.sigma - e.sigma, l.c - e.c, l.b.unwrap() - e.b, l.g - e.g];
        let u = [l.u_sigma, l.u_c, l.u_b.unwrap(), l.u_g];
        if to - from < 6 { println!("{seed}: lock {:.0} avg {} s {:+.1e} u {:.1e} C {:+.1e} u {:.1e} B {:+.1e} u {:.1e} G {:+.1e} u {:.1e} phase {:.1e} u {:.1e}", l.periods_to_lock, l.averaged, err[0], u[0], err[1], u[1], err[2], u[2], err[3], u[3], l.phase_error_deg, l.u_phase_deg); }
        for i in 0..4 { p[i] += (err[i] / u[i]).powi(2); }
        n += 1.0; lk += l.periods_to_lock; us += l.u_sigma;
    }
    println!("{args:?}: n {n} lock {:.0} u_sigma {:.1e} pulls s {:.2} C {:.2} B {:.2} G {:.2}", lk / n, us / n, (p[0] / n).sqrt(), (p[1] / n).sqrt(), (p[2] / n).sqrt(), (p[3] / n).sqrt());
}
