//! Tests of `parameters`.

use super::*;

fn refused(change: impl Fn(&mut Parameters)) -> String {
    let mut parameters = Parameters::dimensionless(0.01, 1.0, 0.65);
    change(&mut parameters);
    parameters.validate().unwrap_err().to_string()
}

#[test]
fn an_invalid_value_is_named_with_its_unit_and_what_is_allowed() {
    let message = refused(|p| p.particle_mass = -0.5);
    assert_eq!(
        message,
        "m (particle mass) = -0.5 kg is refused; allowed is a number from 1e-100 to 1e100"
    );
    assert!(refused(|p| p.damping = 1e300).starts_with("c (damping) = 1e300 N.s/m is"));
    assert!(refused(|p| p.primary_mass = 0.0).starts_with("M (primary mass) = 0 kg is"));
    assert!(refused(|p| p.restitution = 1.5).contains("at most 1"));
    assert!(refused(|p| p.damping = -1e-9).contains("N.s/m"));
}

#[test]
fn rates_beyond_double_precision_are_refused() {
    assert!(refused(|p| p.damping = 1e300).contains("c (damping)"));
    assert!(refused(|p| p.damping = 1e99).contains("decay rate"));
    assert!(refused(|p| p.primary_mass = 1e-300).contains("primary mass"));
    assert!(refused(|p| p.damping = 2e12).contains("decay rate"));
    assert!(refused(|p| (p.primary_mass, p.stiffness) = (1e-100, 1e100)).contains("natural frequency"));
    assert!(refused(|p| p.stiffness = 1e-30).contains("natural frequency"));
}

#[test]
fn nan_and_infinity_are_refused_everywhere() {
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        refused(|p| p.primary_mass = bad);
        refused(|p| p.stiffness = bad);
        refused(|p| p.damping = bad);
        refused(|p| p.particle_mass = bad);
        refused(|p| p.half_width = bad);
        refused(|p| p.restitution = bad);
    }
}
