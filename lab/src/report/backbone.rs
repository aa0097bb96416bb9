//! The backbone with the decay on it: amplitude over detuning.

use plotters::chart::SeriesLabelPosition;

use super::chart::{
    DECAY_LABEL, THINNED, caption, curve, decay_points, legend, line, locked_point, plane, svg,
};
use super::theme::{EXACT, THEORY, UNSTABLE};
use crate::identification::Identification;
use crate::orbit;
use crate::theory::{BackbonePoint, SlowFlow};

/// Amplitude drawn up to at least this, C.
const TOP: f64 = 0.8;
/// Frequencies at which the exact curve is computed: many, for it turns back sharply, ...
const EXACT_POINTS: usize = 4000;
/// ... of which those are drawn that lie this far apart, as a fraction of the picture.
const APART: f64 = 0.004;

pub(super) fn draw(found: &Identification) -> Result<String, String> {
    let p = &found.parameters;
    let slow_flow = SlowFlow::new(p.lambda, p.r);
    let top = (1.25 * found.lock.c).max(TOP);
    let reach = slow_flow
        .manifold
        .b(top, crate::theory::BranchSide::Right)
        .unwrap_or(1.0);
    let theory = slow_flow.backbone(slow_flow.manifold.b_min(), reach, 400);
    // Below the fold there is no backbone, and the frequency of what is left of the motion goes anywhere.
    let fold = slow_flow.manifold.c_min();
    let above = found.decay.iter().filter(|point| point.c >= fold);
    let (low, high) = theory
        .iter()
        .map(|point| point.sigma)
        .chain(above.map(|point| point.sigma))
        .fold((f64::MAX, f64::MIN), |(low, high), s| {
            (low.min(s), high.max(s))
        });
    let margin = 0.06 * (high - low);
    let (low, high) = (low - margin, high + margin);

    svg(|area| {
        let mut chart = plane(
            area,
            Some((
                "Backbone: phase resonance of the centre of mass",
                &caption(&found.parameters, found.lock.g),
            )),
            ((low, high), "detuning σ = (ω/ω₀ − 1)/ε"),
            ((0.0, top), "amplitude C of v, over b"),
        )?;
        let solid = line(THEORY, 20);
        let label = "first-order theory, stable";
        for (n, run) in runs(&theory, BackbonePoint::stable).into_iter().enumerate() {
            let points = run.iter().map(|point| (point.sigma, point.c)).collect();
            curve(&mut chart, points, solid, false, (n == 0).then_some(label))?;
        }
        let label = "first-order theory, unstable";
        let unstable = runs(&theory, |point| !point.stable());
        for (n, run) in unstable.into_iter().enumerate() {
            let points = run.iter().map(|point| (point.sigma, point.c)).collect();
            let style = line(UNSTABLE, 20);
            curve(&mut chart, points, style, true, (n == 0).then_some(label))?;
        }
        let exact = exact_curve(found, &slow_flow, (low, high), top);
        curve(
            &mut chart,
            exact,
            line(EXACT, 14),
            false,
            Some("exact orbits"),
        )?;
        let decay = found.decay.iter().step_by(THINNED);
        let decay = decay.map(|point| (point.sigma, point.c));
        let inside = decay.filter(|(sigma, _)| (low..=high).contains(sigma));
        decay_points(&mut chart, inside.collect(), DECAY_LABEL)?;
        locked_point(&mut chart, (found.lock.sigma, found.lock.c))?;
        legend(&mut chart, SeriesLabelPosition::UpperRight)
    })
}

/// Consecutive points for which `wanted` holds, each run with the point after it so that the curve has no holes.
fn runs(
    points: &[BackbonePoint],
    wanted: impl Fn(&BackbonePoint) -> bool,
) -> Vec<&[BackbonePoint]> {
    let mut runs = Vec::new();
    let mut start = None;
    for (n, point) in points.iter().enumerate() {
        match (wanted(point), start) {
            (true, None) => start = Some(n),
            (false, Some(from)) => {
                runs.push(&points[from..=n]);
                start = None;
            }
            _ => {}
        }
    }
    if let Some(from) = start {
        runs.push(&points[from..]);
    }
    runs
}

/// The exact backbone beyond the fold, by amplitude.
fn exact_curve(
    found: &Identification,
    slow_flow: &SlowFlow,
    (low, high): (f64, f64),
    top: f64,
) -> Vec<(f64, f64)> {
    let fold = slow_flow.manifold.b_min();
    let mut points: Vec<(f64, f64)> = (0..=EXACT_POINTS)
        .map(|n| low + (high - low) * n as f64 / EXACT_POINTS as f64)
        .flat_map(|sigma| {
            let omega = 1.0 + found.parameters.epsilon * sigma;
            orbit::exact_backbone(&found.parameters, omega)
        })
        .filter(|orbit| orbit.b >= fold && orbit.c <= top)
        .map(|orbit| (orbit.sigma, orbit.c))
        .collect();
    points.sort_by(|a, b| a.1.total_cmp(&b.1));
    let mut drawn: Vec<(f64, f64)> = Vec::new();
    for point in points {
        let far = |last: &(f64, f64)| {
            ((point.0 - last.0) / (high - low)).hypot((point.1 - last.1) / top) >= APART
        };
        if drawn.last().is_none_or(far) {
            drawn.push(point);
        }
    }
    drawn
}
