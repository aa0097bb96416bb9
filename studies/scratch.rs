mod common;
use vines_model::orbit::resonant_motion;
use vines_testbench::fit::*;
use common::*;
fn main() {
    let a = arguments();
    let n: usize = a[0].parse().unwrap();
    let mut uniform = uniform(4711);
    let (mut zs, mut cross): (Vec<[f64; 3]>, f64) = (Vec::new(), 0.0);
    let _ = &mut cross;
    for _ in 0..n {
        let ratios = [uniform(2e-3_f64.ln(), 0.03_f64.ln()).exp(), uniform(0.4, 2.5), uniform(0.4, 0.9)];
        let noise = uniform(0.0, 1e6) as u64;
        let Ok((t, scene)) = tracked(ratios, noise, &a[1], [0.0; 5]) else { continue };
        let truth = rig(ratios);
        for p in t.points.iter().filter(is_kept) {
            let m: MeasuredPoint = (&p.at).into();
            let Ok(one) = resonant_motion(&truth, scene.resonance, m.response.value, None) else { continue };
            let Ok(two) = resonant_motion(&truth, scene.resonance, m.response.value * 1.0001, None) else { continue };
            let s = [(two.omega - one.omega), (two.amplitude - one.amplitude)].map(|d| d / (1e-4 * m.response.value) * m.response.uncertainty);
            let e = [m.omega.value - one.omega, m.drive.value - one.amplitude];
            let u = [m.omega.uncertainty, m.drive.uncertainty];
            zs.push([e[0] / u[0], e[1] / u[1], 0.0]);
            if zs.len() % 23 == 0 { println!("{ratios:.4?} C {:.3} ez {:.2?} slope part/u {:.2?} n {} u/value {:.1e} {:.1e}", m.response.value, [e[0]/u[0], e[1]/u[1]], [s[0]/u[0], s[1]/u[1]], p.averaged, u[0], u[1]/m.drive.value); }
        }
    }
    for i in 0..2 { let v: Vec<f64> = zs.iter().map(|z| z[i]).collect(); let m = v.iter().sum::<f64>() / v.len() as f64; let ms = v.iter().map(|x| x*x).sum::<f64>() / v.len() as f64; println!("{i}: n {} mean {m:.3} rms {:.3}, within 1.96 {:.3}", v.len(), ms.sqrt(), share(&v.iter().map(|x| x.abs()).collect::<Vec<_>>(), 1.96)); }
}
