//! The check behind a shaker, whose command is not the force: sines at several frequencies, each until it is steady.
//!
//! With reference R and response D, `R/D = (omega0² - omega² + 2 i delta omega)/(2 g omega0)` is a straight line over `omega²`, whatever the shaker
//! does, and a parabola with other modes: its root gives natural frequency and damping, and its slope there the gain. `R` over the command shows
//! the drop-out, and gives the numbers of [`ShakerPath`].

use std::f64::consts::TAU;

use nalgebra::{Matrix3, RowVector3, Vector3};
use num_complex::Complex64;
use vines_model::numerics::{SIGNIFICANT, complex_fit};

use super::{
    CheckedChannel, CheckedQuantity, DEAD, FACTOR, Fitted, Linear, LoopCheck, NOTED, OpenLoop, PHASE, Sine, Verdict,
    first_of, noise_of, of_response, quantity,
};
use crate::rig::{Rig, RigError};
use vines_scene::linear::{LinearResponse, POINT_RESOLUTION, ParticleState};
use vines_scene::plan::Plan;
use vines_scene::scene::{PLACES, frequencies};
use vines_scene::shaker_path::ShakerPath;

/// Periods of a window, and most periods at a frequency.
const STEADY_WINDOW: usize = 16;
const MOST_PERIODS: f64 = 800.0;

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
    let (linear, amplitude) = (plan.knowledge.linear, share * plan.amplitude);
    let mut rig = OpenLoop::new(rig, plan);
    let frequencies = frequencies(linear.omega0, linear.damping_rate);
    let mut all = Vec::new();
    for omega in frequencies {
        all.push(Steady::of(&mut rig, omega, amplitude)?);
    }
    let samples = window(linear.omega0, plan.knowledge.sample_time);
    rig.end(samples / STEADY_WINDOW)?;
    let near = &all[..PLACES.len()];
    let Steady { both: at, noise, .. } = near[PLACES.len() / 2];
    let curve = Curve::of(near, &linear);
    // By the noise of both phasors alone.
    let of_noise = [0, 1].map(|n| noise[n] * (2.0 / samples as f64).sqrt() / at[n].norm());
    let u_noise = curve.u_gain / curve.scatter * of_noise[0].hypot(of_noise[1]) * (at[1] / at[0]).norm();
    let values: Vec<(f64, Complex64)> = frequencies
        .into_iter()
        .zip(&all)
        // The control takes what readings are late from their phase.
        .map(|(omega, one)| (omega, one.both[1] / amplitude * Complex64::cis(omega * plan.lock.delay)))
        .collect();
    let path = stated.fitted(curve.natural, curve.damping, &values);
    let response = curve.response(path);
    // At the root the other pole is twice the frequency away.
    let reference = plan.knowledge.numbers.definition.reference;
    let expected = response.oscillator_gain(curve.natural, reference) * response.rate(-curve.natural).conj();
    let ratio = response.gain * Complex64::new(0.0, 2.0 * curve.natural) / expected;
    let mut quantities = of_response(&response, ratio, plan).to_vec();
    let error = path.error(curve.natural, &values);
    quantities.extend(of_reference(&path, stated, at[1].norm() / amplitude, error));
    let expected = amplitude * (0.5 * linear.omega0 / linear.damping_rate.max(f64::MIN_POSITIVE));
    let dead = [at[0].norm() < DEAD * expected, at[1].norm() < DEAD * amplitude];
    let is_number = |one: &Steady| one.ratio().is_finite();
    let refusal = quantities.iter().find_map(CheckedQuantity::refusal);
    let verdict = first_of(&[
        (Verdict::NotANumber, !(at[0] + at[1]).is_finite()),
        (Verdict::ShakerOff, dead[0] && dead[1]),
        (Verdict::ResponseDead, dead[0]),
        (Verdict::BaseDead, dead[1]),
        (Verdict::ResponseReversed, ratio.re < 0.0),
        (Verdict::NotANumber, !near.iter().all(is_number)),
        (refusal.unwrap_or(Verdict::Healthy), refusal.is_some()),
    ]);
    let channel = |n: usize, ratio: Complex64| {
        let channel = CheckedChannel { noise: noise[n], ..CheckedChannel::default() };
        channel.at(ratio, linear.omega0 * plan.knowledge.sample_time)
    };
    Ok(LoopCheck {
        verdict,
        amplitude,
        share,
        periods: all.iter().map(|one| one.periods).sum(),
        u_noise,
        response: channel(0, ratio),
        base: Some(channel(1, at[1] / amplitude)),
        linear: Some(Linear::new(response, plan)).filter(|_| verdict == Verdict::Healthy),
        quantities,
    })
}

/// Samples of a window at a frequency, rad/s.
fn window(omega: f64, sample_time: f64) -> usize {
    (STEADY_WINDOW as f64 * TAU / (omega * sample_time)).round() as usize
}

/// What response and reference read at a frequency when they are steady.
#[derive(Clone, Copy)]
struct Steady {
    /// The frequency, rad/s, which is complex while the response still changes.
    omega: Complex64,
    /// The phasors.
    both: [Complex64; 2],
    /// RMS of everything else.
    noise: [f64; 2],
    /// Duration, periods.
    periods: f64,
}

impl Steady {
    /// Drives with the frequency `omega`, rad/s, and this amplitude, m.
    fn of(rig: &mut OpenLoop<impl Rig + ?Sized>, omega: f64, amplitude: f64) -> Result<Self, RigError> {
        let sine = Sine { target: rig.target, omega, step: rig.step };
        let samples = window(omega, rig.step);
        let duration = samples as f64 * rig.step;
        let mut periods = 0.0;
        loop {
            rig.readings.clear();
            rig.drive(samples, omega, amplitude)?;
            periods += STEADY_WINDOW as f64;
            // A heavy table on the suspension of a light armature floats for hundreds of periods: a parabola in a window.
            let both =
                [1, 2].map(|channel| sine.fitted(&rig.readings, channel, 0.5 * samples as f64, 2, &[sine.pole()]));
            // A steady motion changes from window to window by no more than a point resolves; what noise makes of it is no change.
            let changes = |one: &Fitted| {
                let noise = noise_of(&rig.readings, one.channel, &rig.target, rig.step);
                let u = noise * one.found.u(&[Complex64::ZERO, Complex64::ONE]);
                (one.found.pole - sine.pole()).norm() * duration > POINT_RESOLUTION + SIGNIFICANT * u * duration
            };
            if !both.iter().any(changes) || periods >= MOST_PERIODS {
                return Ok(Self {
                    omega: -Complex64::I * both[0].found.pole,
                    both: both.each_ref().map(|one| one.phasor(0)),
                    noise: both.map(|one| one.noise()),
                    periods,
                });
            }
        }
    }

    /// Reference over response.
    fn ratio(&self) -> Complex64 {
        self.both[1] / self.both[0]
    }
}

/// The curve of reference over response, at its root.
struct Curve {
    /// Natural frequency, rad/s.
    natural: f64,
    /// Damping rate, rad/s.
    damping: f64,
    /// Standard uncertainty of both, rad/s.
    u_rate: f64,
    slope: Complex64,
    /// Relative standard uncertainty of the slope.
    u_gain: f64,
    /// Standard deviation of each component of the ratios.
    scatter: f64,
}

impl Curve {
    /// The parabola through the ratios at these frequencies. `linear`: the response that the scene states.
    fn of(near: &[Steady], linear: &LinearResponse) -> Self {
        let abscissas: Vec<Complex64> = near
            .iter()
            .map(|one| one.omega * one.omega / (2.0 * linear.omega0))
            .collect();
        let ratios: Vec<Complex64> = near.iter().map(Steady::ratio).collect();
        // In half-power bandwidths from the middle.
        let x = abscissas.iter().sum::<Complex64>() / abscissas.len() as f64;
        let unit = 2.0 * linear.damping_rate;
        let row = |at: Complex64| RowVector3::new(Complex64::ONE, at, at * at);
        let rows: Vec<_> = abscissas.iter().map(|one| row((one - x) / unit)).collect();
        let nothing = Complex64::new(f64::NAN, 0.0);
        let (found, inverse) = complex_fit(rows.iter().copied().zip(ratios.iter().copied()))
            .unwrap_or_else(|| (Vector3::from_element(nothing), Matrix3::from_element(nothing)));
        let slope_at = |at: Complex64| RowVector3::new(Complex64::ZERO, Complex64::ONE, 2.0 * at);
        // The root that a straight line has, too.
        let bent = (1.0 - 4.0 * found[0] * found[2] / (found[1] * found[1])).sqrt();
        let root = -2.0 * found[0] / (found[1] * (1.0 + bent));
        let rest: f64 = rows
            .iter()
            .zip(&ratios)
            .map(|(row, ratio)| (ratio - (row * found)[0]).norm_sqr())
            .sum();
        let scatter = (rest / (2.0 * ratios.len() as f64 - 6.0)).sqrt();
        let u = |row: RowVector3<Complex64>| scatter * (row * inverse * row.adjoint())[0].re.sqrt();
        let slope = (slope_at(root) * found)[0] / unit;
        let u_gain = u(slope_at(root)) / (slope.norm() * unit);
        let u_rate = u(row(root)) / slope.norm();
        // The root is `omega0²/(2 w) (omega0 + i delta)/(omega0 - i delta)` with `w` of the scene, and the slope is proportional to `omega0 - i delta`.
        let root = x + unit * root;
        let natural = (2.0 * linear.omega0 * root.norm()).sqrt();
        let damping = natural * (0.5 * root.arg()).tan();
        Self { natural, damping, u_rate, slope, u_gain, scatter }
    }

    /// The frequency response, behind this shaker.
    fn response(&self, path: ShakerPath) -> LinearResponse {
        LinearResponse {
            omega0: self.natural,
            damping_rate: self.damping,
            uncertainty: self.u_rate.max(NOTED[0] * POINT_RESOLUTION * self.natural),
            gain: Complex64::new(self.damping / self.natural, 1.0) / self.slope,
            u_gain: self.u_gain,
            particle: ParticleState::Unknown,
            shaker: Some(path),
        }
        .stated()
    }
}

/// What the shaker makes of its command: `gain`, reference over command at the natural frequency, and the largest relative error of the model of it.
fn of_reference(path: &ShakerPath, stated: &ShakerPath, gain: f64, error: f64) -> [CheckedQuantity; 4] {
    let u = |measured: f64| POINT_RESOLUTION * measured.abs();
    let [drop_out, dropped] = [path, stated].map(ShakerPath::drop_out);
    let [turn, turned] = [path, stated].map(|one| one.turn().to_degrees());
    let names = [
        "reference over command at the natural frequency",
        "drop-out: this over the reference of a structure that does not move",
        "turn of the reference within the half-power bandwidth",
        "reference over command, largest relative error of its model",
    ];
    let refused = Some(Verdict::ShakerResonance);
    // All but the last are told, not refused.
    [
        quantity(names[0], "", [gain, u(gain), 1.0], FACTOR, None),
        quantity(names[1], "", [drop_out, u(drop_out), dropped], FACTOR * dropped, None),
        quantity(names[2], "degrees", [turn, u(turn), turned], PHASE, None),
        quantity(names[3], "", [error, POINT_RESOLUTION, 0.0], ROBUST, refused),
    ]
}
