//! The check behind a shaker, whose command is not the force: sines at several frequencies, each until it is steady.
//!
//! With reference R and response D, `R/D = (omega0² - omega² + 2 i delta omega)/(2 g omega0)` is a straight line over `omega²`, whatever the shaker
//! does: its root gives natural frequency and damping, and its slope the gain. `R` over the command shows the drop-out.

use std::f64::consts::{FRAC_PI_2, TAU};

use num_complex::Complex64;
use phase_lock::Gains;
use vines_model::numerics::mean;

use super::{
    CheckedChannel, CheckedQuantity, DEAD, FACTOR, Linear, LoopCheck, NOTED, OpenLoop, PHASE, SHARES, Verdict, fitted,
    of_response, quantity,
};
use crate::experiment::FOLLOWED;
use crate::linear::{MeasuredLinear, ParticleState};
use crate::plan::{Plan, ShakerPath};
use crate::rig::{Rig, RigError, Scaled};

/// Places of the frequencies about the natural one, half-power bandwidths.
const PLACES: [f64; 7] = [-1.0, -0.5, -0.25, 0.0, 0.25, 0.5, 1.0];
/// Periods of a window, and most windows at a frequency.
const WINDOW: [usize; 2] = [8, 60];
/// Largest relative change from window to window of a steady motion.
const STEADY: f64 = 1e-4;

/// Checks a rig with a shaker at a hundredth of the drive.
pub(super) fn check(rig: &mut (impl Rig + ?Sized), plan: &Plan, stated: &ShakerPath) -> Result<LoopCheck, RigError> {
    let (target, linear) = (plan.knowledge.target, plan.knowledge.linear);
    let amplitude = SHARES[0] * plan.amplitude;
    let mut scaled = Scaled::new(rig, target);
    let mut rig = OpenLoop {
        rig: &mut scaled,
        step: plan.knowledge.sample_time,
        phase: 0.0,
        readings: Vec::new(),
        has_base: false,
    };
    let window = |omega: f64| (WINDOW[0] as f64 * TAU / (omega * plan.knowledge.sample_time)).round() as usize;
    let mut steady = |omega: f64| -> Result<[Complex64; 4], RigError> {
        let mut last = [Complex64::ZERO; 2];
        let (mut noise, mut change) = ([0.0; 2], f64::INFINITY);
        for _ in 0..WINDOW[1] {
            rig.readings.clear();
            rig.drive(window(omega), omega, amplitude)?;
            let both = [1, 2].map(|channel| fitted(&rig.readings, channel, &target, omega));
            change = (0..2)
                .map(|n| (both[n].0 - last[n]).norm() / both[n].0.norm())
                .fold(0.0, f64::max);
            (last, noise) = (both.map(|(phasor, _)| phasor), both.map(|(_, rest)| rest));
            // A reading that is no number never settles.
            if change < STEADY || change.is_nan() {
                break;
            }
        }
        let noises = noise.map(|noise| Complex64::new(noise, change));
        Ok([last[0], last[1], noises[0], noises[1]])
    };
    let places = PLACES.map(|place| linear.omega0 + 2.0 * place * linear.damping_rate);
    let mut near = Vec::new();
    for omega in places {
        near.push(steady(omega)?);
    }
    let ends = [steady(plan.lock.omega_min)?[1], steady(plan.lock.omega_max)?[1]];
    let at = near[PLACES.len() / 2];
    // The line of R/D.
    let abscissas = places.map(|omega| omega * omega / (2.0 * linear.omega0));
    let ratios: Vec<Complex64> = near.iter().map(|phasors| phasors[1] / phasors[0]).collect();
    let (x, y) = (
        mean(abscissas.iter().copied()),
        ratios.iter().sum::<Complex64>() / ratios.len() as f64,
    );
    let spread: f64 = abscissas.iter().map(|one| (one - x).powi(2)).sum();
    let slope = abscissas
        .iter()
        .zip(&ratios)
        .map(|(one, ratio)| (one - x) * (ratio - y))
        .sum::<Complex64>()
        / spread;
    let rest: f64 = abscissas
        .iter()
        .zip(&ratios)
        .map(|(one, ratio)| (ratio - y - slope * (one - x)).norm_sqr())
        .sum();
    let scatter = (rest / (2.0 * ratios.len() as f64 - 4.0)).sqrt();
    let root = x - y / slope;
    // The root is `omega0²/(2 w) (omega0 + i delta)/(omega0 - i delta)` with `w` of the scene, and the slope is proportional to `omega0 - i delta`.
    let natural = (2.0 * linear.omega0 * root.norm()).sqrt();
    let damping = natural * (0.5 * root.arg()).tan();
    let u_rate = scatter / (slope.norm() * (ratios.len() as f64).sqrt());
    let u_gain = scatter / (slope.norm() * spread.sqrt());
    let gain = Complex64::new(damping / natural, 1.0) / slope;
    let measured = measured(plan, [natural, damping, u_rate], gain, u_gain);
    // A table also moves the structure through its damper.
    let damper = if stated.by_force { 0.0 } else { 2.0 * damping / natural };
    let ratio = gain / (Complex64::new(damper, -1.0) * (0.5 * natural));
    let mut quantities = of_response(&measured, ratio, plan).to_vec();
    let [low, high] = ends.map(|end| end.norm());
    let drop_out = at[1].norm() / low.max(high);
    let turn = (near[5][1] * near[1][1].conj()).arg();
    quantities.extend([
        noted(
            "reference over command at the natural frequency",
            "",
            at[1].norm() / amplitude,
            1.0,
            FACTOR,
        ),
        noted(
            "drop-out: this over the largest at the ends of the range",
            "",
            drop_out,
            stated.drop_out,
            FACTOR * stated.drop_out,
        ),
        noted(
            "turn of the reference within the half-power bandwidth",
            "degrees",
            turn.to_degrees(),
            stated.turn.to_degrees(),
            PHASE,
        ),
    ]);
    let expected = amplitude * (0.5 * linear.omega0 / linear.damping_rate.max(f64::MIN_POSITIVE));
    // Three equal roots at a third of the bandwidth, within the time in which the bench expects the loops to follow.
    let slowest = 3.0 * linear.omega0 / (FOLLOWED as f64 * TAU);
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
            .unwrap_or(if plan.lock.bandwidth < slowest {
                Verdict::DropOut
            } else {
                Verdict::Healthy
            }),
    };
    let channel = |n: usize, ratio: Complex64| {
        let channel = CheckedChannel { noise: at[2 + n].re, ..CheckedChannel::default() };
        channel.at(ratio, linear.omega0 * plan.knowledge.sample_time)
    };
    Ok(LoopCheck {
        verdict,
        amplitude,
        response: channel(0, ratio),
        base: Some(channel(1, at[1] / amplitude)),
        linear: Some(measured).filter(|_| verdict == Verdict::Healthy),
        quantities,
    })
}

/// A quantity that is told, not refused.
fn noted(name: &'static str, unit: &'static str, measured: f64, expected: f64, tolerance: f64) -> CheckedQuantity {
    quantity(
        name,
        unit,
        [measured, STEADY * measured.abs(), expected],
        tolerance,
        None,
    )
}

/// The linear response from natural frequency, damping rate and their uncertainty, rad/s, and the gain with its relative uncertainty.
fn measured(plan: &Plan, [omega_0, damping_rate, u_rate]: [f64; 3], gain: Complex64, u_gain: f64) -> Linear {
    let (bandwidth, rate) = (plan.lock.bandwidth, damping_rate.max(0.0));
    let gains = Gains::from_bandwidth(bandwidth, rate);
    let u_rate = u_rate.max(NOTED[0] * STEADY * omega_0);
    Linear {
        data: MeasuredLinear {
            f0: omega_0 / TAU,
            u_f0: u_rate / TAU,
            zeta: damping_rate / omega_0,
            u_zeta: u_rate / omega_0,
            correlation: 0.0,
            particle: ParticleState::Unknown,
        },
        omega_0,
        damping_rate,
        u_damping_rate: u_rate,
        response_gain: gain.norm(),
        u_gain,
        phase: gain.arg().to_degrees(),
        bandwidth,
        gains: [gains.proportional, gains.integral],
        phase_margin: gains
            .phase_margin(bandwidth, rate, plan.knowledge.sample_time)
            .to_degrees(),
    }
}
