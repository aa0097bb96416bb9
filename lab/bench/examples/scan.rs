use vines_testbench::backbone::track;
use vines_testbench::comparison::TrackedComparison;
use vines_testbench::rig::{BuiltIn, Chain, Simulated};
use vines_testbench::scene::{Override, Scene};
fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let verbose = args.iter().any(|a| a == "-v");
    let overrides: Vec<Override> = args.iter().filter(|a| *a != "-v").map(|s| s.parse().unwrap()).collect();
    let text = include_str!("../../../scenes/dimensionless.toml");
    let scene = Scene::parse("d", text, &overrides).unwrap();
    let mut rig = Chain::around(Box::new(Simulated::new(scene.plant, scene.start).unwrap()), &scene.chain, &scene.dimensionless(), scene.controller.samples_per_period);
    let mut controller = BuiltIn::new(&scene.backbone_config()).unwrap();
    let t = track(rig.as_mut(), &mut controller, &scene, |_, _| {}).unwrap();
    let c = TrackedComparison::of(&t, &scene);
    let mut w = [0f64; 3];
    for p in &c.points {
        let Some(e) = p.exact else {println!("C {:.5} s {:.5} G/C {:.6} u {:.1e} {:.1e} per {:.1}", p.point.c, p.point.sigma, p.point.g/p.point.c, p.point.u_sigma, p.point.u_g, p.point.periods); continue};
        let (s, g) = (e.sigma.unwrap_or(f64::NAN), e.g.unwrap_or(f64::NAN));
        w[0] = w[0].max(e.nearest); w[1] = w[1].max(s.abs()); w[2] = w[2].max(g.abs());
        if verbose { print!("G/C {:.5} ", p.point.g/p.point.c); println!("{:.4} u {:.1e} {:.1e} {:.1e} C {:.5} s {:.5} G {:.5} per {:.1} avg {} near {:.1e} ds {:.1e} dG {:.1e} {} {:?}", p.point.level, p.point.u_c, p.point.u_sigma, p.point.u_g, p.point.c, p.point.sigma, p.point.g, p.point.periods, p.point.averaged, e.nearest, s, g, p.point.settled, p.point.regime_by_impacts); }
    }
    println!("{args:?}: {:.1} per point, nearest {:.1e} ds {:.1e} dG {:.1e}, lock {:.1}", c.periods_per_point(), w[0], w[1], w[2], c.periods_to_lock);
}
