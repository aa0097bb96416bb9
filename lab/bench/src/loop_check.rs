//! Check of the loop before the drive rises: an open loop at a hundredth of the drive shows what is connected to what.
//!
//! A linear resonator at rest that is driven at its natural frequency with the amplitude E responds with `-i g E (1 - exp(-d t))/d`
//! (`g`: half the frequency, `d`: damping rate). Response and base are compared with this and with E, by amplitude and phase.

mod linear;
mod lock_times;
mod open_loop;
mod trials;
mod verdict;

use std::f64::consts::{PI, TAU};

use num_complex::Complex64;
use serde::Serialize;

use crate::rig::{Rig, RigError};
use crate::scene::Scene;
use vines_model::numerics::{mean, mean_square};

pub use linear::Linear;
pub use lock_times::{LockTime, lock_times};
pub use trials::{Trials, trials};
pub use verdict::{Channel, Verdict};

use open_loop::{DECAY, OpenLoop, scatter};
use verdict::{IN_TIME, NOISE, verdict};

/// Drive, as a share of that of the scene.
const SHARE: f64 = 0.01;
/// Periods without a drive, with it, and at their end those that are evaluated.
const PERIODS: [usize; 3] = [2, 24, 4];

/// Result of the check.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LoopCheck {
    /// The verdict.
    pub verdict: Verdict,
    /// Amplitude of the drive, m.
    pub amplitude: f64,
    /// The response.
    pub response: Channel,
    /// The base, if a sensor measures it.
    pub base: Option<Channel>,
    /// The linear response and the gains for it, if the loop is healthy.
    pub linear: Option<Linear>,
}

/// Checks a rig at a hundredth of the drive, after a response that is still falling has come to rest. The phase of the rig's oscillator is
/// a multiple of 2 pi before and after.
pub fn check(rig: &mut (impl Rig + ?Sized), scene: &Scene) -> Result<LoopCheck, RigError> {
    let (d, step) = (scene.dimensionless(), scene.sample_time());
    let omega = scene.controller.omega_start * d.omega0;
    let amplitude = SHARE * scene.amplitude;
    let samples = |periods: usize| (periods as f64 * TAU / (omega * step)).round() as usize;
    let [quiet, driven, window] = PERIODS.map(samples);
    let mut rig = OpenLoop {
        rig,
        omega,
        step,
        phase: 0.0,
        readings: Vec::new(),
        has_base: false,
    };
    let expected = expected(scene);
    rig.rest(quiet, samples(DECAY), NOISE * expected[0].norm())?;
    let begins = rig.readings.len();
    rig.drive(driven, amplitude)?;
    rig.end(samples(1))?;
    let OpenLoop { readings, has_base, .. } = rig;
    let channels = [0, 1].map(|n| {
        let seen = Seen::of(&readings[begins + driven - window..], n + 1);
        let ratio = seen.phasor / expected[n];
        let floor = scatter(&readings[begins - quiet..begins], n + 1);
        Channel {
            gain: ratio.norm(),
            phase: ratio.arg().to_degrees(),
            delay: -ratio.arg() / (omega * step),
            noise: seen.noise,
            floor,
        }
    });
    let amplitudes = expected.map(|one| one.norm());
    // A delay that looks like the opposite sign is at least this long. Until then, the base rests; one of the opposite sign moves.
    let first = (samples(1) as f64 * (PI - IN_TIME) / TAU) as usize;
    let begin = &readings[begins..begins + first];
    let rest = mean(readings[begins - quiet..begins].iter().map(|reading| reading[2]));
    let moved = mean_square(begin.iter().map(|reading| reading[2] - rest));
    let expected_move = mean_square(
        begin
            .iter()
            .map(|reading| channels[1].gain * amplitude * reading[0].sin()),
    );
    let verdict = verdict(&channels, &amplitudes, has_base, moved < 0.5 * expected_move);
    // Without a sensor, the base moves as expected.
    let base = if has_base {
        Seen::of(&readings[begins + driven - window..], 2).phasor
    } else {
        expected[1]
    };
    let period = samples(1);
    let phasors: Vec<_> = readings[begins..]
        .chunks_exact(period)
        .map(|readings| Seen::of(readings, 1).phasor)
        .collect();
    let linear = Linear::of(&phasors, base, omega, period as f64 * step, scene);
    Ok(LoopCheck {
        verdict,
        linear: linear.filter(|_| verdict == Verdict::Healthy),
        amplitude,
        response: channels[0],
        base: has_base.then_some(channels[1]),
    })
}

/// Phasors of response and base, m, at the end of a check of the scene's linear resonator.
fn expected(scene: &Scene) -> [Complex64; 2] {
    let d = scene.dimensionless();
    let omega = scene.controller.omega_start * d.omega0;
    let amplitude = SHARE * scene.amplitude;
    let time = (PERIODS[1] as f64 - 0.5 * PERIODS[2] as f64) * TAU / omega;
    let damping = 0.5 * d.epsilon * d.lambda * d.omega0;
    let rate = Complex64::new(damping, omega - d.omega0);
    let growth = Complex64::new(0.0, -0.5 * d.omega0) * (1.0 - (-rate * time).exp()) / rate;
    // A delay that the chain states is expected.
    let stated = Complex64::from_polar(1.0, -scene.controller_config().delay * omega);
    [growth * amplitude * stated, stated * amplitude]
}

/// A signal at the frequency of the drive, m, and the rest of it, RMS.
struct Seen {
    phasor: Complex64,
    noise: f64,
}

impl Seen {
    fn of(readings: &[[f64; 3]], channel: usize) -> Self {
        let n = readings.len() as f64;
        let mean = mean(readings.iter().map(|reading| reading[channel]));
        let phasor: Complex64 = readings
            .iter()
            .map(|reading| (reading[channel] - mean) * Complex64::new(reading[0].sin(), reading[0].cos()) * 2.0 / n)
            .sum();
        let rest = |reading: &[f64; 3]| reading[channel] - mean - (phasor * Complex64::cis(reading[0])).im;
        Self { phasor, noise: mean_square(readings.iter().map(rest)).sqrt() }
    }
}
