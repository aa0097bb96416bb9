//! The ranges of two rigs with plastic impacts (drawn by studies/hypotheses.rs, at 60 and 40 dB). Their points were fitted by motions of a plant far from
//! the truth: in one the largest had lost its symmetry, which made its interval 500 times too narrow; in the other all were so fast that no rig keeps
//! them.

use std::f64::consts::FRAC_PI_2;

use lovines::{Cavity, Parameters};
use vines_identify::{Data, Hypothesis, MeasuredPoint, Quantity};
use vines_model::numerics::Estimate;
use vines_model::{Definition, Sensor};

/// f0, zeta, b and epsilon of the rigs, and M, k, c, m, b and r of what was expected of them.
const RIGS: [([f64; 4], [f64; 6]); 2] = [
    (
        [10.172_012_9, 0.009_000_063_74, 3.809_159_75e-3, 9.637_124_79e-3],
        [
            1.0,
            4121.4346,
            0.928_963_187,
            0.010_738_471_4,
            4.019_639_42e-3,
            0.693_924_495,
        ],
    ),
    (
        [2.610_913_39, 0.005_476_954_36, 7.361_588_5e-3, 4.824_342_35e-3],
        [
            1.0,
            273.724_976,
            0.185_572_565,
            5.364_397_66e-3,
            7.904_011_71e-3,
            0.800_629_598,
        ],
    ),
];

#[test]
fn the_ranges_of_rigs_with_plastic_impacts_hold_them_though_their_points_resemble_motions_that_no_rig_keeps() {
    for (n, (truth, [primary_mass, stiffness, damping, particle_mass, half_width, restitution])) in
        RIGS.into_iter().enumerate()
    {
        let row = |line: &str| {
            let numbers: Vec<f64> = line.split(',').map(|number| number.parse().unwrap()).collect();
            let estimate = |i: usize| Estimate { value: numbers[i], uncertainty: numbers[i + 1] };
            let point = MeasuredPoint {
                response: estimate(1),
                omega: estimate(3),
                drive: estimate(5),
                phase: -FRAC_PI_2,
            };
            (numbers[0] == n as f64).then_some(point)
        };
        let data = Data {
            points: include_str!("plastic.csv").lines().skip(1).filter_map(row).collect(),
            definition: Definition { sensor: Sensor::Q1, ..Definition::default() },
            calibration: 0.01,
            ..Data::default()
        };
        let expected = Parameters {
            primary_mass,
            stiffness,
            damping,
            particle_mass,
            half_width,
            restitution,
            cavity: Cavity::IDEAL,
        };
        let found = data.hypotheses(&expected, |_| {}).unwrap();
        let plastic = found
            .fits
            .iter()
            .find(|fit| fit.hypothesis == Hypothesis::Plastic)
            .unwrap();
        assert!(plastic.excluded.is_none(), "{:?}", plastic.excluded);
        let quantities = [Quantity::F0, Quantity::Zeta, Quantity::B, Quantity::Epsilon];
        for (quantity, truth) in quantities.into_iter().zip(truth) {
            let Estimate { value, uncertainty } = found.range(quantity).unwrap();
            let off = (value - truth).abs() / uncertainty;
            assert!(off < 2.5, "rig {n}, {quantity:?}: {value} ± {uncertainty}, {truth}");
        }
    }
}
