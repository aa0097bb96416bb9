//! Random scenes with friction, tilt, unequal gaps and all laws of restitution.

use crate::common::{Scene, scene};
use crate::random::{balances, of_kind};
use crate::table::Table;
use lovines::{Cavity, Drive, Restitution};
use proptest::prelude::*;

/// A scene with any of the effects. Gravity is from negligible to overwhelming against the accelerations of the rig.
pub fn strategy() -> BoxedStrategy<Scene> {
    let decades = |from: f64, to: f64| (from..to).prop_map(|x| 10f64.powf(x));
    let law = || {
        prop_oneof![
            2 => Just(None),
            1 => (0.05..=1.0f64).prop_map(|r| Some(Restitution::Constant(r))),
            1 => decades(-3.0, 0.0).prop_map(|k| Some(Restitution::Viscoelastic(k))),
            1 => decades(-1.5, 0.5).prop_map(|v| Some(Restitution::Plastic(v))),
        ]
    };
    let friction = prop_oneof![
        2 => Just((0.0, None)),
        3 => decades(-4.0, 0.5).prop_map(|mu| (mu, None)),
        2 => (decades(-4.0, 0.5), 1.0..2.0f64).prop_map(|(mu, more)| (mu, Some(mu * more))),
    ];
    let tilt = prop_oneof![
        2 => Just(0.0),
        1 => Just(core::f64::consts::FRAC_PI_2),
        2 => -1.5..1.5f64,
        1 => decades(-9.0, 0.0),
    ];
    let gap = || prop_oneof![1 => Just(None), 1 => (0.2..3.0f64).prop_map(Some)];
    let scatter = prop_oneof![2 => Just(0.0), 1 => decades(-3.0, 0.0)];
    let least = prop_oneof![2 => Just(0.0), 1 => 0.0..1.0f64];
    let cavity = (
        friction,
        tilt,
        (gap(), gap()),
        (law(), law()),
        scatter,
        least,
        any::<u64>(),
    );
    (
        any::<bool>().prop_flat_map(scene),
        cavity,
        decades(-1.0, 5.0),
        -1.0..1.0f64,
    )
        .prop_map(
            |(mut s, ((mu, held), tilt, (plus, minus), (law, other), scatter, least, seed), stiffness, place)| {
                // The same motion in another time.
                let rate = f64::sqrt(stiffness);
                s.parameters.cavity = Cavity {
                    b_plus: plus,
                    b_minus: minus,
                    tilt,
                    kinetic_friction: mu,
                    static_friction: held,
                    restitution: [law, other].map(|law| match law {
                        // Below its yield speed a wall takes no energy: slow particles would hop on it for ever.
                        Some(Restitution::Plastic(v)) => Some(Restitution::Plastic(v * rate)),
                        law => law,
                    }),
                    least_restitution: least,
                    scatter,
                    seed,
                };
                s.parameters.stiffness = stiffness;
                s.parameters.damping *= rate;
                (s.start.dq1, s.start.dq2) = (s.start.dq1 * rate, s.start.dq2 * rate);
                s.drive.omega *= rate;
                s.step = s.step.min(10.0) / rate;
                let [plus, minus] = s.parameters.gaps();
                let w = if place > 0.95 {
                    plus
                } else if place < -0.95 {
                    -minus
                } else {
                    0.5 * (plus - minus)
                };
                s.start.q2 = s.start.q1 - w;
                if s.drive.amplitude == 0.0 {
                    // Undamped and undriven: the energy is to stay.
                    (s.drive, s.parameters.damping) = (Drive::default(), 0.0);
                }
                s
            },
        )
        .boxed()
}

/// Follows this number of scenes, and the energy balance of a tenth of it with damper and base.
pub fn scenes(n: usize, table: &mut Table) {
    of_kind("cavity", n, table).rows(table);
    balances("cavity", n / 10, strategy, table);
}
