//! Amplitude and frequency over time: while the loop seeks and holds phase resonance, and as the motion decays.

use std::f64::consts::TAU;

use nalgebra::{Matrix3, Vector3};
use plotters::chart::SeriesLabelPosition;

use super::chart::{
    DECAY_LABEL, THINNED, caption, curve, decay_points, legend, line, plane, px, svg_of,
};
use super::theme::{DECAY, EXACT, THEORY};
use crate::comparison::Comparison;
use crate::experiment::Record;
use crate::scene::Scene;
use crate::theory::{BranchSide, SlowFlow};

const SIZE: (u32, u32) = (980, 760);
const UPPER: u32 = 400;
const LEFT: u32 = 520;
/// Most points of a curve.
const MOST: usize = 800;

/// One period of the driven part of a record; dimensionless.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Passage {
    /// Periods since the start.
    period: f64,
    c: f64,
    sigma: f64,
}

/// Draws the four panels.
pub fn draw(record: &Record, scene: &Scene, found: &Comparison) -> Result<String, String> {
    let driven = driven(record, scene);
    let flow = SlowFlow::new(found.parameters.lambda, found.parameters.r);
    let decay = flow
        .manifold
        .b(found.lock.c, BranchSide::Right)
        .and_then(|b| flow.decay(b))
        .map(|decay| decay.samples(400))
        .unwrap_or_default();
    let per_period = found.parameters.epsilon * TAU;
    let fold = flow.manifold.c_min();
    let points: Vec<_> = found
        .decay
        .iter()
        .map(|one| one.point)
        .filter(|one| one.c >= 0.9 * fold)
        .step_by(THINNED / 2)
        .collect();
    let last = driven.last().map_or(1.0, |one| one.period);
    let ends = points.last().map_or(1.0, |one| one.tau / TAU);
    let ends = decay
        .last()
        .map_or(ends, |one| ends.max(one.tau1 / per_period));
    let top = driven
        .iter()
        .fold(found.lock.c, |most: f64, one| most.max(one.c))
        * 1.35;
    let sigmas = driven.iter().map(|one| one.sigma);
    let sigmas = sigmas.chain(points.iter().map(|one| one.sigma));
    let (low, high) = sigmas.fold((-1.5f64, 0.5f64), |(low, high), s| {
        (low.min(s), high.max(s))
    });
    let margin = 0.1 * (high - low);
    let sigma_range = (low - margin, high + margin);
    let theory = |value: Option<f64>| value.map(|value| vec![(0.0, value), (1.02 * last, value)]);

    svg_of(SIZE, |area| {
        let (upper, lower) = area.split_vertically(px(UPPER));
        for (row, range, label) in [
            (&upper, (0.0, top), "amplitude C of v, over b"),
            (&lower, sigma_range, "detuning σ"),
        ] {
            let amplitude = range.0 == 0.0;
            let (left, right) = row.split_horizontally(px(LEFT));
            let text = caption(&found.parameters, found.lock.g);
            let heading =
                amplitude.then_some(("Seeking and holding phase resonance", text.as_str()));
            let time = "time, in periods of the oscillator alone";
            let mut chart = plane(&left, heading, ((0.0, 1.02 * last), time), (range, label))?;
            let of = |one: &Passage| if amplitude { one.c } else { one.sigma };
            let measured = driven.iter().map(|one| (one.period, of(one))).collect();
            curve(
                &mut chart,
                measured,
                line(DECAY, 16),
                false,
                Some("measured"),
            )?;
            let exact = found
                .exact
                .map(|one| if amplitude { one.c } else { one.sigma });
            if let Some(level) = theory(exact) {
                curve(
                    &mut chart,
                    level,
                    line(EXACT, 14),
                    false,
                    Some("exact orbit"),
                )?;
            }
            let first = found
                .theory
                .map(|one| if amplitude { one.c } else { one.sigma });
            if let Some(level) = theory(first) {
                curve(
                    &mut chart,
                    level,
                    line(THEORY, 14),
                    true,
                    Some("first-order theory"),
                )?;
            }
            let corner = if amplitude {
                SeriesLabelPosition::LowerRight
            } else {
                SeriesLabelPosition::UpperRight
            };
            legend(&mut chart, corner)?;

            let heading = amplitude.then_some(("Free decay", "the drive is off from 0 on"));
            let time = "time since the release, likewise";
            let mut chart = plane(&right, heading, ((0.0, 1.02 * ends), time), (range, ""))?;
            let model = decay.iter().map(|one| {
                let value = if amplitude { one.c } else { one.sigma };
                (one.tau1 / per_period, value)
            });
            let model = model
                .filter(|(_, value)| (range.0..=range.1).contains(value))
                .collect();
            curve(
                &mut chart,
                model,
                line(THEORY, 16),
                true,
                Some("first-order theory"),
            )?;
            let marks = points.iter().map(|one| {
                let value = if amplitude { one.c } else { one.sigma };
                (one.tau / TAU, value)
            });
            decay_points(&mut chart, marks.collect(), DECAY_LABEL)?;
            legend(&mut chart, SeriesLabelPosition::UpperRight)?;
        }
        Ok(())
    })
}

/// Amplitude and commanded frequency, period by period, up to the release: least squares of v by the commanded harmonic and a
/// constant, over two periods.
fn driven(record: &Record, scene: &Scene) -> Vec<Passage> {
    let d = scene.dimensionless();
    let dt = record.sample_time;
    let window = 2 * (d.natural_period() / dt).round().max(4.0) as usize;
    let samples = &record.samples[..record.released];
    let step = (samples.len() / MOST).max(window / 2);
    (0..samples.len().saturating_sub(window))
        .step_by(step)
        .filter_map(|from| {
            let part = &samples[from..from + window];
            let omega = part[window / 2].command.drive.omega;
            let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
            for (n, sample) in part.iter().enumerate() {
                let (sine, cosine) = (omega * dt * n as f64).sin_cos();
                let row = Vector3::new(sine, cosine, 1.0);
                normal += row * row.transpose();
                right += row * sample.sensors.response;
            }
            let fit = normal.cholesky()?.solve(&right);
            Some(Passage {
                period: d.omega0 * part[window / 2].time / TAU,
                c: fit[0].hypot(fit[1]) / d.b,
                sigma: d.sigma(omega),
            })
        })
        .collect()
}
