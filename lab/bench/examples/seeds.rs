use vines_testbench::backbone::track;
use vines_testbench::comparison::{ExactCurve, TrackedComparison};
use vines_testbench::rig::{BuiltIn, Chain, Simulated};
use vines_testbench::scene::{Override, Scene};
fn main() {
    let mut args: Vec<String> = std::env::args().skip(1).collect();
    let (from, to): (u64, u64) = (args.remove(0).parse().unwrap(), args.remove(0).parse().unwrap());
    let text = include_str!("../../../scenes/dimensionless.toml");
    let (mut worst, mut bad, mut ratio, mut cover, mut n, mut pp, mut unsettled) = (0f64, 0, 0f64, [0usize; 2], 0usize, 0f64, 0);
    let mut sq = [0f64; 2];
    let mut wpp = 0f64; let mut lv = std::collections::BTreeMap::<i64, [f64; 6]>::new();
    for seed in from..to {
        let mut all = args.clone();
        all.push(format!("chain.seed={seed}"));
        let overrides: Vec<Override> = all.iter().map(|s| s.parse().unwrap()).collect();
        let scene = Scene::parse("d", text, &overrides).unwrap();
        let mut rig = Chain::around(Box::new(Simulated::new(scene.plant, scene.start).unwrap()), &scene.chain, &scene.dimensionless(), scene.controller.samples_per_period);
        let mut controller = BuiltIn::new(&scene.backbone_config()).unwrap();
        let t = track(rig.as_mut(), &mut controller, &scene, |_, _| {}).unwrap();
        thread_local! { static CURVE: std::cell::RefCell<Option<ExactCurve>> = const { std::cell::RefCell::new(None) }; }
        let curve = CURVE.with_borrow_mut(|c| c.get_or_insert_with(|| ExactCurve::of(&scene.dimensionless())).clone());
        let _ = TrackedComparison::of;
        let mut w = 0f64;
        for p in &t.points {
            let Some(d) = curve.distance(p.c, p.sigma, p.g) else { continue };
            let (Some(s), Some(g)) = (d.sigma, d.g) else { continue };
            if !p.settled { unsettled += 1; continue }
            w = w.max(d.nearest);
            let (a, b) = (s.abs() / p.u_sigma, g.abs() / p.u_g);
            let e = lv.entry((p.level * 1e3).round() as i64).or_default(); e[0] += 1.0; e[1] += a * a; e[2] += b * b; e[3] += p.u_sigma; e[4] += p.u_g; e[5] += p.averaged as f64;
            n += 1; cover[0] += (a < 1.96) as usize; cover[1] += (b < 1.96) as usize;
            sq[0] += a * a; sq[1] += b * b;
            if a.max(b) > 4.0 { println!("seed {seed} level {:.3} s {:+.2e} u {:.1e} G {:+.2e} u {:.1e} avg {}", p.level, s, p.u_sigma, g, p.u_g, p.averaged); }
            ratio = ratio.max(a).max(b);
        }
        let per = t.periods / t.points.len() as f64; pp += per; wpp = wpp.max(per);
        if w > 5e-3 { bad += 1 }
        worst = worst.max(w);
    }
    for (l, e) in &lv { println!("{l}: pulls sigma {:.2} G {:.2} mean u {:.1e} {:.1e} avg {:.1}", (e[1] / e[0]).sqrt(), (e[2] / e[0]).sqrt(), e[3] / e[0], e[4] / e[0], e[5] / e[0]); }
    let k = (to - from) as f64;
    println!("{args:?}: {:.1} per point (max {wpp:.1}), worst nearest {worst:.1e}, {bad} bad seeds, coverage sigma {:.3} G {:.3} of {n}, rms {:.2} {:.2}, ratio {ratio:.1}, unsettled {unsettled}", pp / k, cover[0] as f64 / n as f64, cover[1] as f64 / n as f64, (sq[0]/n as f64).sqrt(), (sq[1]/n as f64).sqrt());
}
