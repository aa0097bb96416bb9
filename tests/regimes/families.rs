//! What is scanned.

use crate::scan::Case;
use lovines::Drive;

pub struct Family {
    pub name: &'static str,
    pub cases: Vec<Case>,
}

const AT_REST: (f64, f64) = (0.0, 0.0);
const MOVING: (f64, f64) = (0.7, -0.4);

/// Damping ratios: none, hardly any, light, across critical damping, far above it.
pub fn damping_ratios() -> Vec<f64> {
    let near = [1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-14, 2.3e-16];
    let below = near.iter().map(|d| 1.0 - d);
    let above = near.iter().rev().map(|d| 1.0 + d);
    let light = [0.0, 1e-300, 1e-30, 1e-16, 1e-12, 1e-8, 1e-6, 1e-4, 5e-4, 1e-2, 0.1];
    let around_half = [0.4999, 0.5, 0.5001, 0.8];
    let heavy = [1.005, 1.0051, 1.1, 2.0, 30.0, 1e3];
    (light.into_iter())
        .chain(around_half)
        .chain(below)
        .chain([1.0])
        .chain(above)
        .chain(heavy)
        .collect()
}

fn near_zero() -> impl Iterator<Item = f64> {
    [
        1e-16, 2.3e-16, 1e-15, 1e-14, 1e-13, 1e-12, 1e-11, 1e-10, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1,
    ]
    .into_iter()
    .flat_map(|d| [-d, d])
    .chain([0.0])
}

/// The oscillator of unit mass and stiffness.
pub fn unit(zeta: f64, drive: Drive, start: (f64, f64)) -> Case {
    Case { mass: 1.0, stiffness: 1.0, damping: 2.0 * zeta, start, drive }
}

/// The rig of the default scene with another damping ratio, and as much of the natural frequency as driving frequency.
fn rig(zeta: f64, amplitude: f64, ratio: f64, mass: f64, start: (f64, f64)) -> Case {
    let stiffness: f64 = 11.68e3;
    let omega0 = (stiffness / mass).sqrt();
    Case {
        mass,
        stiffness,
        damping: 2.0 * zeta * mass * omega0,
        start: (0.01 * start.0, 0.01 * omega0 * start.1),
        drive: Drive::harmonic(amplitude, ratio * omega0),
    }
}

fn family(name: &'static str, cases: impl Iterator<Item = Case>) -> Family {
    Family { name, cases: cases.collect() }
}

pub fn all() -> Vec<Family> {
    let ratios = damping_ratios();
    let every = |step: usize| ratios.iter().copied().step_by(step);
    let tiny = [0.0, 1e-300, 1e-16, 1e-14, 1e-12, 1e-10, 1e-8, 1e-6, 1e-4];
    let mut families = vec![
        family(
            "free, damping ratio 0 to 1000",
            every(1).flat_map(|z| [MOVING, (1.0, 0.0), (0.0, 1.0)].map(|s| unit(z, Drive::default(), s))),
        ),
        family(
            "harmonic, damping ratio 0 to 1000",
            every(1).flat_map(|z| [0.3, 1.7, 40.0].map(|omega| unit(z, Drive::harmonic(0.3, omega), MOVING))),
        ),
        family(
            "omega across the resonance, 1e-16 to 0.1 off, damping ratio 0 to 1e-4",
            tiny.into_iter().flat_map(|z| {
                near_zero().flat_map(move |d| {
                    let at = |e, s| unit(z, Drive::harmonic(e, 1.0 + d), s);
                    [at(0.3, MOVING), at(1e-9, AT_REST)]
                })
            }),
        ),
        family(
            "the same, default rig",
            tiny.into_iter()
                .flat_map(|z| near_zero().map(move |d| rig(z, 1e-4, 1.0 + d, 3.807, AT_REST))),
        ),
        family(
            "the same, particle stuck",
            tiny.into_iter()
                .flat_map(|z| near_zero().map(move |d| rig(z, 1e-4, 1.0 + d, 3.807 + 0.032, MOVING))),
        ),
        family(
            "omega 0 to 1e-2, both signs",
            every(4).flat_map(|z| {
                [0.0, 1e-300, -1e-300, 1e-100, -1e-30, 1e-16, -1e-12, 1e-8, -1e-4, 1e-2]
                    .map(move |omega| unit(z, Drive::harmonic(0.3, omega), AT_REST))
            }),
        ),
        family(
            "omega negative",
            every(2).flat_map(|z| {
                [-1.0, -0.7, -1.0 - 1e-12].map(move |omega| unit(z, Drive::harmonic(0.3, omega), MOVING))
            }),
        ),
        family(
            "E = 0 with omega at the resonance, 0, and not",
            every(4).flat_map(|z| [1.0, 0.0, 0.7].map(move |omega| unit(z, Drive::harmonic(0.0, omega), MOVING))),
        ),
    ];
    let names = [
        "signal of order 0, alone and with the oscillator",
        "signal of order 1, alone and with the oscillator",
        "signal of order 2, alone and with the oscillator",
        "signal of order 3, alone and with the oscillator",
    ];
    for (order, name) in names.into_iter().enumerate() {
        let mut alone = Drive::default();
        alone.signal[order] = [0.4, -0.3, 0.2, 0.1][order];
        let mut full = Drive::harmonic(0.3, 0.7);
        full.signal[..=order].copy_from_slice(&[0.4, -0.3, 0.2, 0.1][..=order]);
        let resonant = Drive { omega: 1.0 + 1e-12, ..full };
        families.push(family(
            name,
            every(1).flat_map(move |z| {
                let last = if z < 0.2 { resonant } else { full };
                [unit(z, alone, AT_REST), unit(z, full, AT_REST), unit(z, last, MOVING)]
            }),
        ));
    }
    families
}
