use vines_testbench::comparison::ExactCurve;
use vines_model::Dimensionless;
fn main() { let d = Dimensionless::new(0.0307, 0.374, 0.887, 1.0); let c = ExactCurve::of(&d); println!("{}", c.orbits().len());
 for (n, o) in c.orbits().iter().enumerate() { if n < 12 || (o.c - 0.139).abs() < 0.006 { println!("{n} b {:.5} c {:.5} s {:.5} g {:.5}", o.b, o.c, o.sigma, o.g); } } }
