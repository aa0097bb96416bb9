//! Guards phase resonance relative to the base and to its force, of v, q1 and the acceleration.

use vines_model::{
    Definition, Dimensionless, Reference, Sensor,
    orbit::{Orbit, phase_resonant, symmetric_orbits},
    theory::resonant,
};

/// The default scene: M = 3.807 kg, k = 11.68e3 N/m, c = 2.53 N s/m, m = 0.032 kg.
fn scene(definition: Definition) -> Dimensionless {
    Dimensionless {
        definition,
        ..Dimensionless::new(0.032 / 3.807, 1.427_381, 0.65, 1.1)
    }
}

fn orbit(definition: Definition) -> Orbit {
    let orbits = phase_resonant(&scene(definition)).into_iter().filter(|one| one.stable);
    orbits.max_by(|one, other| one.c.total_cmp(&other.c)).expect("an orbit")
}

#[test]
fn definitions_differ_as_an_independent_computation_says() {
    let study = orbit(Definition::default());
    assert!((study.sigma + 1.1394).abs() < 1e-4);
    // The same motion, read by the other sensor.
    let q1 = scene(Definition { sensor: Sensor::Q1, ..Definition::default() });
    let distance = |one: &Orbit| (one.b - study.b).abs();
    let orbits = symmetric_orbits(&q1, study.sigma).into_iter();
    let q1 = orbits
        .min_by(|one, other| distance(one).total_cmp(&distance(other)))
        .unwrap();
    assert!((study.c - 0.4480).abs() < 1e-4 && (q1.c - 0.4394).abs() < 1e-4);
    // The force leads the base by 0.7 degrees.
    let force = orbit(Definition { reference: Reference::Force, ..Definition::default() });
    assert!((force.sigma - study.sigma).abs() > 1e-4);
}

#[test]
fn theory_approaches_the_exact_orbit_of_every_definition_at_any_phase() {
    let at_phases = |one: Definition| [-90.0_f64, -80.0, -105.0].map(|phase| one.at_phase(phase.to_radians()));
    for definition in Definition::all().into_iter().flat_map(at_phases) {
        // Theory less exact orbit, of sigma and C.
        let off = |epsilon: f64| {
            let scene = Dimensionless { epsilon, ..scene(definition) };
            let theory = resonant(&scene).into_iter().find(|point| point.stable()).unwrap();
            let exact = phase_resonant(&scene).into_iter().filter(|orbit| orbit.stable);
            let distance = |orbit: &Orbit| (orbit.b - theory.b).abs();
            let exact = exact
                .min_by(|one, other| distance(one).total_cmp(&distance(other)))
                .unwrap();
            [theory.sigma - exact.sigma, theory.c - exact.c]
        };
        let epsilon = scene(definition).epsilon;
        let [first, small] = [1.0, 0.0625].map(|part| off(part * epsilon));
        assert!(first[0].abs() < 0.1 && small[0].abs() < 0.1 * first[0].abs() + 1e-4);
        assert!(small[1].abs() < 0.1 * first[1].abs() + 1e-4);
        // The definition of the study: as epsilon.
        let is_linear = |i: usize| ((first[i] / small[i]).log2() / 4.0 - 1.0).abs() < 0.02;
        assert!(definition != Definition::default() || is_linear(0) && is_linear(1));
    }
}
