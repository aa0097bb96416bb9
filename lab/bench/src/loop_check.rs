//! Check of the loop before the drive rises: an open loop at a hundredth of the drive shows what is connected to what.
//!
//! A linear resonator at rest that is driven at its natural frequency with the amplitude E responds with `-i g E (1 - exp(-d t))/d`
//! (`g`: half the frequency, `d`: damping rate). Response and base are compared with this and with E, by amplitude and phase.

mod linear;
mod open_loop;
mod quantity;
mod verdict;

use std::f64::consts::{PI, TAU};

use num_complex::Complex64;
use serde::Serialize;

use crate::rig::{Rig, RigError};
use crate::scene::Scene;
use vines_model::numerics::{mean, mean_square};

pub use linear::Linear;
pub use quantity::Quantity;
pub use verdict::{Channel, Verdict};

use open_loop::{DECAY, OpenLoop, scatter};
use verdict::{IN_TIME, NOISE, verdict};

/// Drive, as a share of that of the scene.
const SHARE: f64 = 0.01;
/// Periods without a drive, with it, and at their end those that are evaluated.
const PERIODS: [usize; 3] = [2, 24, 4];

/// Result of the check.
#[derive(Debug, Clone, PartialEq, Serialize)]
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
    /// What was measured, beside what the scene says.
    pub quantities: Vec<Quantity>,
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
    let OpenLoop { mut readings, has_base, .. } = rig;
    without_drift(&mut readings[begins..]);
    let mut channels = [0, 1].map(|n| {
        let seen = Seen::of(&readings[begins + driven - window..], n + 1);
        let ratio = seen.phasor / expected[n];
        let floor = scatter(&readings[begins - quiet..begins], n + 1);
        let channel = Channel { noise: seen.noise, floor, ..Channel::default() };
        channel.at(ratio, omega * step)
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
    let waits = moved < 0.5 * expected_move;
    // Without a sensor, the base moves as expected.
    let base = if has_base {
        let seen = Seen::of(&readings[begins + driven - window..], 2);
        (
            seen.phasor,
            seen.noise / seen.phasor.norm() * (2.0 / window as f64).sqrt(),
        )
    } else {
        (expected[1], 0.0)
    };
    let period = samples(1);
    let phasors = |of: usize| -> Vec<Complex64> {
        let periods = readings[begins..].chunks_exact(period);
        periods.map(|readings| Seen::of(readings, of).phasor).collect()
    };
    let linear = Linear::of(&phasors(1), base, omega, period, scene);
    let mut quantities = Vec::new();
    if has_base {
        quantities.extend(quantity::of_base(base, amplitude, &phasors(2), scene));
    }
    if let Some(linear) = &linear {
        // Amplitude and phase of the response for the natural frequency and the damping that the rig has.
        let gain = Complex64::from_polar(linear.response_gain, linear.phase.to_radians());
        let ratio = gain / linear.expected_gain(omega, scene.resonance.reference);
        channels[0] = channels[0].at(ratio * base.0 / expected[1], omega * step);
        quantities.extend(quantity::measured(linear, ratio, scene));
    }
    let verdict = verdict(&channels, &amplitudes, has_base, waits);
    let refused = quantities.iter().find_map(Quantity::refusal);
    let verdict = refused.filter(|refusal| verdict.may_be(*refusal)).unwrap_or(verdict);
    Ok(LoopCheck {
        verdict,
        linear: linear.filter(|_| verdict == Verdict::Healthy),
        amplitude,
        response: channels[0],
        base: has_base.then_some(channels[1]),
        quantities,
    })
}

/// Removes the drift of the response: a particle that flies slowly moves the centre of mass, which looks like a response in every period.
fn without_drift(readings: &mut [[f64; 3]]) {
    let half = readings.len() / 2;
    let [first, second] =
        [&readings[..half], &readings[half..2 * half]].map(|part| mean(part.iter().map(|one| one[1])));
    let slope = (second - first) / half as f64;
    for (n, reading) in readings.iter_mut().enumerate() {
        reading[1] -= slope * n as f64;
    }
}

/// Phasors of response and base, m, at the end of a check of the scene's linear resonator.
fn expected(scene: &Scene) -> [Complex64; 2] {
    let d = scene.dimensionless();
    let omega = scene.controller.omega_start * d.omega0;
    let amplitude = SHARE * scene.amplitude;
    let time = (PERIODS[1] as f64 - 0.5 * PERIODS[2] as f64) * TAU / omega;
    let rate = Complex64::new(scene.linear().damping_rate, omega - d.omega0);
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
