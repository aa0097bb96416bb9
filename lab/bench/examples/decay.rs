use vines_testbench::comparison::Comparison;
use vines_testbench::experiment::{self, Plan};
use vines_testbench::identification::identify;
use vines_testbench::rig::{BuiltIn, Chain, Simulated};
use vines_testbench::scene::{Override, Scene};
fn main() {
    let overrides: Vec<Override> = std::env::args().skip(1).map(|s| s.parse().unwrap()).collect();
    let text = include_str!("../../../scenes/dimensionless.toml");
    let scene = Scene::parse("d", text, &overrides).unwrap();
    let d = scene.dimensionless();
    let mut rig = Chain::around(Box::new(Simulated::new(scene.plant, scene.start).unwrap()), &scene.chain, &d, scene.controller.samples_per_period);
    let mut controller = BuiltIn::new(&scene.controller_config()).unwrap();
    let r = experiment::run(rig.as_mut(), &mut controller, &Plan::of(&scene), |_, _, _| {}).unwrap();
    let c = Comparison::of(&identify(&r, &scene).unwrap(), &scene);
    let (mut n, mut k, mut m, mut w) = (0, 0, 0, 0f64);
    for p in c.decay.iter().filter(|p| p.point.c > 0.2) {
        if let (Some(s), Some(e), Some(u)) = (p.point.sigma_steady, p.sigma_exact, p.point.u_sigma_steady) { n += 1; let a = (s - e).abs() / u; w = w.max(a); k += (a < 1.96) as usize; m += 1; if m % 6 == 0 && !scene.chain.snr.is_some() { println!("C {:.3} raw {:+.4} steady {:+.4} u {:.4} {:.4}", p.point.c, p.point.sigma - e, s - e, p.point.u_sigma, u); } }
    }
    println!("{:?} rms theory {:?} exact {:?} steady {:?} cover {k} of {n} worst {w:.1} decay {} periods, last C {:?}", c.decay_end, c.rms_sigma_error, c.rms_sigma_exact, c.rms_steady_exact, r.decay().len() / 100, c.decay.last().map(|p| p.point.c));
}
