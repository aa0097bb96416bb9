//! Tests of `plant`.

use crate::{Drive, Parameters, Plant, State};

#[test]
fn a_plant_saved_and_restored_at_any_step_goes_on_with_the_same_bits() {
    let start = State { q1: -0.42, dq1: 0.01, q2: -0.99, dq2: -0.86 };
    for (step, wobble, slope, g) in [
        (0.063, 0.0, 0.0, 1.1),
        (0.063, 1e-4, 0.0, 1.1),
        (6.3, 0.0, 0.0, 1.1),
        (1.7, 1e-4, 0.0, 1.1),
        (0.3, 0.0, 1e-3, 1.1),
        (0.063, 0.0, 0.0, 2.5),
        (6.3, 1e-3, 0.0, 2.5),
    ] {
        let parameters = Parameters::dimensionless(0.0084, 1.43, 0.65);
        let mut plant = Plant::new(parameters, start).unwrap();
        let mut other = plant;
        for n in 0..3000 {
            let omega = 0.990_417 + wobble * f64::from(n % 7);
            let drive = Drive {
                signal: [0.0, slope, 0.0, 0.0],
                ..Drive::harmonic(0.0084 * g, omega)
            };
            let saved = postcard::to_stdvec(&other).unwrap();
            other = postcard::from_bytes(&saved).unwrap();
            assert_eq!(plant.advance(drive, step), other.advance(drive, step));
            assert_eq!(plant.state(), other.state(), "step {n} of {step} s");
        }
        assert!(plant.totals().impacts > 10);
        assert_eq!(plant.totals(), other.totals());
    }
}
