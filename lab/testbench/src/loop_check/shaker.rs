//! The check behind a shaker, whose command is not the force: sines at several frequencies, each until it is steady.
//!
//! With reference R and response D, `R/D = (omega0² - omega² + 2 i delta omega)/(2 g omega0)` is a straight line over `omega²`, whatever the shaker
//! does, and a parabola with other modes: its root gives natural frequency and damping, and its slope there the gain. `R` over the command shows
//! the drop-out, and gives the numbers of [`ShakerPath`].

use std::f64::consts::{FRAC_PI_2, TAU};

use nalgebra::{Matrix3, RowVector3, Vector3};
use num_complex::Complex64;
use vines_model::numerics::complex_fit;

use super::{
    CheckedChannel, CheckedQuantity, DEAD, FACTOR, Linear, LoopCheck, NEWTON_STEPS, NOTED, OpenLoop, PHASE, Verdict,
    fitted, of_response, quantity,
};
use crate::linear::LinearResponse;
use crate::linear::ParticleState;
use crate::plan::Plan;
use crate::rig::{Rig, RigError, Scaled};
use crate::scene::{PLACES, frequencies};
use crate::shaker_path::ShakerPath;

/// Periods of a window, and most windows at a frequency.
const STEADY_WINDOW: [usize; 2] = [8, 100];
/// Largest relative change from window to window of a steady motion.
const STEADY_CHANGE: f64 = 1e-4;

/// Largest relative error of the model of reference over command. The control is stable below 1 (small gain: its closed loop is at most 1); half of
/// it is a gain margin of 2.
const ROBUST: f64 = 0.5;

/// Checks a rig with a shaker at this share of the drive.
pub(super) fn check(
    rig: &mut (impl Rig + ?Sized),
    plan: &Plan,
    stated: &ShakerPath,
    share: f64,
) -> Result<LoopCheck, RigError> {
    let (target, linear) = (plan.knowledge.target, plan.knowledge.linear);
    let amplitude = share * plan.amplitude;
    let mut periods = 0.0;
    let mut scaled = Scaled::new(rig, target);
    let mut rig = OpenLoop::new(&mut scaled, target, plan.knowledge.sample_time);
    let window = |omega: f64| (STEADY_WINDOW[0] as f64 * TAU / (omega * plan.knowledge.sample_time)).round() as usize;
    // Response and reference at the end of two windows, their noise, and the frequency, which is complex while the response still changes.
    let mut steady = |omega: f64| -> Result<(Complex64, [Complex64; 2], [f64; 2]), RigError> {
        let (mut last, mut before) = ([Complex64::ZERO; 2], [Complex64::ZERO; 2]);
        let mut noise = [0.0; 2];
        for _ in 0..STEADY_WINDOW[1] {
            rig.readings.clear();
            rig.drive(window(omega), omega, amplitude)?;
            periods += STEADY_WINDOW[0] as f64;
            // A heavy table on the suspension of a light armature floats for hundreds of periods: a parabola in a window.
            let both = [1, 2].map(|channel| fitted(&rig.readings, channel, 2, &target, omega));
            let change = (0..2)
                .map(|n| (both[n].0 - last[n]).norm() / both[n].0.norm())
                .fold(0.0, f64::max);
            (before, last, noise) = (last, both.map(|(phasor, _)| phasor), both.map(|(_, rest)| rest));
            // A reading that is no number never settles.
            if change < STEADY_CHANGE || change.is_nan() {
                break;
            }
        }
        let middle = [0, 1].map(|n| 0.5 * (before[n] + last[n]));
        let duration = window(omega) as f64 * plan.knowledge.sample_time;
        let growth = (last[0] - before[0]) / (duration * middle[0]);
        Ok((omega - Complex64::I * growth, middle, noise))
    };
    let frequencies = frequencies(linear.omega0, linear.damping_rate);
    let mut all = Vec::new();
    for omega in frequencies {
        all.push(steady(omega)?);
    }
    rig.end(window(linear.omega0) / STEADY_WINDOW[0])?;
    let near = &all[..PLACES.len()];
    let (_, at, noise) = near[PLACES.len() / 2];
    // The curve of R/D.
    let abscissas: Vec<Complex64> = near
        .iter()
        .map(|(omega, ..)| omega * omega / (2.0 * linear.omega0))
        .collect();
    let ratios: Vec<Complex64> = near.iter().map(|(_, both, _)| both[1] / both[0]).collect();
    // In half-power bandwidths from the middle.
    let x = abscissas.iter().sum::<Complex64>() / abscissas.len() as f64;
    let unit = 2.0 * linear.damping_rate;
    let row = |at: Complex64| RowVector3::new(Complex64::ONE, at, at * at);
    let rows: Vec<_> = abscissas.iter().map(|one| row((one - x) / unit)).collect();
    let nothing = Complex64::new(f64::NAN, 0.0);
    let (found, inverse) = complex_fit(rows.iter().copied().zip(ratios.iter().copied()))
        .unwrap_or_else(|| (Vector3::from_element(nothing), Matrix3::from_element(nothing)));
    let slope_at = |at: Complex64| RowVector3::new(Complex64::ZERO, Complex64::ONE, 2.0 * at);
    let mut root = -found[0] / found[1];
    for _ in 0..NEWTON_STEPS {
        root -= (row(root) * found)[0] / (slope_at(root) * found)[0];
    }
    let rest: f64 = rows
        .iter()
        .zip(&ratios)
        .map(|(row, ratio)| (ratio - (row * found)[0]).norm_sqr())
        .sum();
    let scatter = (rest / (2.0 * ratios.len() as f64 - 6.0)).sqrt();
    let u = |row: RowVector3<Complex64>| scatter * (row * inverse * row.adjoint())[0].re.sqrt();
    let slope = (slope_at(root) * found)[0] / unit;
    let u_gain = u(slope_at(root)) / (slope.norm() * unit);
    // By the noise of both phasors alone.
    let of_noise = [0, 1].map(|n| noise[n] * (2.0 / window(linear.omega0) as f64).sqrt() / at[n].norm());
    let u_noise = u_gain / scatter * of_noise[0].hypot(of_noise[1]) * (at[1] / at[0]).norm();
    let u_rate = u(row(root)) / slope.norm();
    // The root is `omega0²/(2 w) (omega0 + i delta)/(omega0 - i delta)` with `w` of the scene, and the slope is proportional to `omega0 - i delta`.
    let root = x + unit * root;
    let natural = (2.0 * linear.omega0 * root.norm()).sqrt();
    let damping = natural * (0.5 * root.arg()).tan();
    let values: Vec<(f64, Complex64)> = frequencies
        .into_iter()
        .zip(&all)
        // The control takes what readings are late from their phase.
        .map(|(omega, (_, both, _))| (omega, both[1] / amplitude * Complex64::cis(omega * plan.lock.delay)))
        .collect();
    let path = stated.fitted(natural, damping, &values);
    let response = LinearResponse {
        omega0: natural,
        damping_rate: damping,
        uncertainty: u_rate.max(NOTED[0] * STEADY_CHANGE * natural),
        gain: Complex64::new(damping / natural, 1.0) / slope,
        u_gain,
        particle: ParticleState::Unknown,
        shaker: Some(path),
    };
    // At the root the other pole is twice the frequency away.
    let reference = plan.knowledge.numbers.definition.reference;
    let expected = response.oscillator_gain(natural, reference) * response.rate(-natural).conj();
    let ratio = response.gain * Complex64::new(0.0, 2.0 * natural) / expected;
    let mut quantities = of_response(&response, ratio, plan).to_vec();
    quantities.extend([
        noted(
            "reference over command at the natural frequency",
            "",
            at[1].norm() / amplitude,
            1.0,
            FACTOR,
        ),
        noted(
            "drop-out: this over the reference of a structure that does not move",
            "",
            path.drop_out(),
            stated.drop_out(),
            FACTOR * stated.drop_out(),
        ),
        noted(
            "turn of the reference within the half-power bandwidth",
            "degrees",
            path.turn().to_degrees(),
            stated.turn().to_degrees(),
            PHASE,
        ),
        quantity(
            "reference over command, largest relative error of its model",
            "",
            [path.error(natural, &values), STEADY_CHANGE, 0.0],
            ROBUST,
            Some(Verdict::ShakerResonance),
        ),
    ]);
    let expected = amplitude * (0.5 * linear.omega0 / linear.damping_rate.max(f64::MIN_POSITIVE));
    let verdict = match () {
        () if !(at[0] + at[1]).is_finite() => Verdict::NotANumber,
        () if at[0].norm() < DEAD * expected && at[1].norm() < DEAD * amplitude => Verdict::ShakerOff,
        () if at[0].norm() < DEAD * expected => Verdict::ResponseDead,
        () if at[1].norm() < DEAD * amplitude => Verdict::BaseDead,
        () if ratio.re < 0.0 && ratio.arg().abs() > FRAC_PI_2 => Verdict::ResponseReversed,
        () if ratios.iter().any(|ratio| !ratio.is_finite()) => Verdict::NotANumber,
        () => quantities
            .iter()
            .find_map(CheckedQuantity::refusal)
            .unwrap_or(Verdict::Healthy),
    };
    let channel = |n: usize, ratio: Complex64| {
        let channel = CheckedChannel { noise: noise[n], ..CheckedChannel::default() };
        channel.at(ratio, linear.omega0 * plan.knowledge.sample_time)
    };
    Ok(LoopCheck {
        verdict,
        amplitude,
        share,
        periods,
        u_noise,
        response: channel(0, ratio),
        base: Some(channel(1, at[1] / amplitude)),
        linear: Some(Linear::new(response, plan)).filter(|_| verdict == Verdict::Healthy),
        quantities,
    })
}

/// A quantity that is told, not refused.
fn noted(name: &'static str, unit: &'static str, measured: f64, expected: f64, tolerance: f64) -> CheckedQuantity {
    quantity(
        name,
        unit,
        [measured, STEADY_CHANGE * measured.abs(), expected],
        tolerance,
        None,
    )
}
