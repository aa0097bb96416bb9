//! The response from period to period: amplitude and phase without the influence of their own drift.

use nalgebra::Complex;

use super::Cycle;

/// The response of a period.
pub struct Motion {
    /// m
    pub amplitude: f64,
    /// rad
    pub phase: f64,
    /// Phase less that of the fit, rad.
    pub correction: f64,
}

/// Amplitudes and phases of the response, continuous from period to period, without the influence of their own drift.
///
/// Over one period from the phase 0 on, a drift z' of the complex amplitude per radian changes the fitted amplitude by
/// -i conj(z')/2.
pub fn motion(cycles: &[Cycle]) -> Vec<Motion> {
    let mut before = cycles[0].response[0];
    let mut turned = before.arg();
    let phases: Vec<f64> = cycles
        .iter()
        .map(|cycle| {
            turned += (cycle.response[0] * before.conj()).arg();
            before = cycle.response[0];
            cycle.drive_phase + turned
        })
        .collect();
    let last = cycles.len() - 1;
    (0..=last)
        .map(|n| {
            let (from, to) = (n.saturating_sub(1), (n + 1).min(last));
            let time = (cycles[to].time - cycles[from].time) * cycles[n].omega;
            let growth = (cycles[to].amplitude() - cycles[from].amplitude()) / time;
            let amplitude = cycles[n].amplitude();
            // The frequency of the drive may jump from period to period; that of the response does not.
            let turning = amplitude * ((phases[to] - phases[from]) / time - 1.0);
            let z = cycles[n].response[0];
            let drift = Complex::new(growth, turning) * z / amplitude;
            let correction = Complex::new(0.0, 0.5) * drift.conj() / z;
            Motion {
                amplitude: amplitude * (1.0 + correction.re),
                phase: phases[n] + correction.im,
                correction: correction.im,
            }
        })
        .collect()
}
