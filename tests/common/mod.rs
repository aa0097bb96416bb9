//! Random scenes.

use lovines::{Drive, Parameters, State};
use proptest::prelude::*;

/// A rig, its start, and how it is driven and stepped.
#[derive(Clone, Debug)]
pub struct Scene {
    pub parameters: Parameters,
    pub start: State,
    pub drive: Drive,
    pub step: f64,
}

/// Rigs from feather-light to equal masses; undamped, light, near-critical and over-critical damping; dead to lively; starts that include both
/// walls.
pub fn scene(driven: bool) -> impl Strategy<Value = Scene> {
    let decades = |from: f64, to: f64| (from..to).prop_map(|x| 10f64.powf(x));
    let rig = (
        decades(-6.0, 0.0),
        prop_oneof![
            3 => Just(0.0),
            3 => decades(-12.0, 1.0),
            1 => (decades(-16.0, -2.0), any::<bool>()).prop_map(|(d, above)| if above { 1.0 + d } else { 1.0 - d }),
        ],
        prop_oneof![3 => 1e-3..0.98f64, 1 => Just(0.65)],
    );
    let start = (
        -2.0..2.0f64,
        -2.0..2.0f64,
        prop_oneof![4 => -1.0..1.0f64, 1 => Just(1.0), 1 => Just(-1.0)],
        prop_oneof![3 => -2.0..2.0f64, 1 => Just(0.0)],
    );
    let amplitude = if driven { 1.0 } else { 0.0 };
    let drive = (
        decades(-6.0, 1.0),
        prop_oneof![3 => 0.0..3.0f64, 1 => Just(1.0), 1 => -2.0..0.0f64],
        -1.0..1.0f64,
    );
    (rig, start, drive, decades(-2.0, 2.0)).prop_map(move |(rig, start, drive, step)| {
        let (epsilon, zeta, r) = rig;
        let (q1, dq1, w, dw) = start;
        let (e, omega, held) = drive;
        let mut parameters = Parameters::dimensionless(epsilon, 1.0, r);
        parameters.damping = 2.0 * zeta;
        Scene {
            parameters,
            start: State { q1, dq1, q2: q1 - w, dq2: dq1 - dw },
            drive: Drive {
                signal: [amplitude * held, 0.0, 0.0, 0.0],
                ..Drive::harmonic(amplitude * e, omega)
            },
            step,
        }
    })
}
