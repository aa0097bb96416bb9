//! Tests of `model_exchange/hybrid`.

use super::*;

const SPEED: f64 = 1e-4;

/// A particle `depth` half-widths behind the wall `w = b`, which it leaves; the spring presses the wall towards it.
fn behind_the_wall(depth: f64) -> Hybrid {
    let parameters = Parameters::dimensionless(0.1, 0.5, 0.5);
    let mut hybrid = Hybrid::new(parameters, State::default(), Drive::default()).unwrap();
    hybrid.states = States { q1: -3.0, q2: -4.0 - depth, u1: 0.0, u2: SPEED, phase: 0.0 };
    hybrid.begin_event();
    hybrid
}

fn resolved(hybrid: &mut Hybrid) -> Vec<Happening> {
    let mut happenings = Vec::new();
    hybrid.resolve(1.0, |happening| happenings.push(happening));
    happenings
}

#[test]
fn a_hop_that_the_integrator_does_not_resolve_ends_in_contact_and_its_energy_is_dissipated() {
    let mut hybrid = behind_the_wall(1e-9);
    let [Happening::Rest(rest)] = resolved(&mut hybrid)[..] else {
        panic!("a rest expected");
    };
    assert_eq!((hybrid.contact(), rest.wall), (Some(Wall::Plus), Wall::Plus));
    let energy = 0.5 * (0.1 / 1.1) * SPEED * SPEED;
    assert!((rest.energy / energy - 1.0).abs() < 1e-9 && (rest.hop / (SPEED * SPEED / 6.0) - 1.0).abs() < 1e-9);
    assert!((hybrid.totals().dissipated / energy - 1.0).abs() < 1e-9);
}

#[test]
fn a_particle_that_leaves_its_wall_without_a_hop_behind_it_goes_on() {
    let mut on_the_wall = behind_the_wall(0.0);
    let mut after_a_jump = behind_the_wall(1e-9);
    after_a_jump.drive.signal[0] = -1e-3;
    for hybrid in [&mut on_the_wall, &mut after_a_jump] {
        assert_eq!(resolved(hybrid), []);
        assert_eq!((hybrid.contact(), hybrid.instant().dq2), (None, SPEED));
    }
}
