//! The figures: what they show, and with which axes, colours and labels.

mod regimes;

pub use regimes::regimes;

use std::f64::consts::TAU;

use nalgebra::DVector;
use vines_estimate::HarmonicBasis;

use super::figure::{Figure, Marked, Panel, Place, Shape};
use super::theme::{EXACT, INK, MEASURED, PARTICLE, PREDICTED, THEORY};
use crate::comparison::{Comparison, ExactCurve, TrackedComparison};
use crate::fit::{Found, MeasuredPoint};
use crate::numerics::{Estimate, equally_spaced, range};
use crate::orbit::{StructureBranch, StructureOrbit};
use crate::record::Record;
use crate::scene::{Dimensionless, Scene, Sensor};
use crate::survey::{CURVE_POINTS, Survey};
use crate::theory::{self, B_SYMMETRY_BREAKING, BackbonePoint, BranchSide, SlowFlow, reading};

/// Only every fourth point along the decay is drawn, so that the circles do not overlap.
const THINNED: usize = 4;

const DETUNING: &str = "detuning σ = (ω/ω₀ − 1)/ε";
const SPEED: &str = "particle speed B, over b ω₀";
const FIRST_ORDER: &str = "first-order theory";
const FIRST_ORDER_ALONE: &str = "driven mode alone, first-order theory";
const ORBITS: &str = "exact orbits";
const IDENTIFIED: &str = "free decay, identified";
const LOCKED: &str = "locked, measured";
/// Error bars shorter than this fraction of an axis are hidden by the mark at their place.
const VISIBLE: f64 = 0.02;

/// The label of an axis of amplitudes as the scene's sensor reads them.
fn amplitude(p: &Dimensionless) -> &'static str {
    match p.definition.sensor {
        Sensor::V => "amplitude C of v, over b",
        Sensor::Q1 => "amplitude C of q₁, over b",
    }
}

/// The numbers of a scene; `g` is a value of G, or a range.
fn caption(p: &Dimensionless, g: &str) -> String {
    let Dimensionless { epsilon, lambda, r, .. } = p;
    format!("ε = {epsilon:.5}, λ = {lambda:.3}, r = {r}, G {g}; lengths over b, times over 1/ω₀")
}

fn at(g: f64) -> String {
    format!("= {g:.3}")
}

/// A range with a margin on both sides, as a part of its length.
fn widened((low, high): (f64, f64), part: f64) -> (f64, f64) {
    let margin = part * (high - low);
    (low - margin, high + margin)
}

fn circles(panel: &mut Panel, points: impl Iterator<Item = Place>, label: &str) {
    panel.add(Shape::Circle(3.5), points, MEASURED, label);
}

/// Error bars of 95 %: places with their standard uncertainties, vertical or horizontal, on an axis of that range.
fn error_bars(panel: &mut Panel, bars: impl Iterator<Item = (Place, f64)>, vertical: bool, range: f64) {
    let visible = bars.filter(|(_, u)| 2.0 * 1.96 * u > VISIBLE * range);
    let ends = visible.flat_map(|((x, y), u)| {
        let (dx, dy) = if vertical { (0.0, 1.96 * u) } else { (1.96 * u, 0.0) };
        [(x - dx, y - dy), (x + dx, y + dy)]
    });
    panel.add(Shape::Segments(1.2), ends, MEASURED, "95 % of the measurement");
}

/// Two coordinates of the right branch of first-order theory's backbone, from the fold up to an amplitude.
fn theory_backbone(p: &Dimensionless, top: f64, place: impl Fn(&BackbonePoint) -> Place) -> Vec<Marked> {
    let manifold = SlowFlow::new(p.lambda, p.r).manifold;
    let last = manifold.b(top, BranchSide::Right).unwrap_or(1.0);
    let points = theory::backbone(p, manifold.b_min(), last, CURVE_POINTS);
    points.iter().map(|point| (place(point), point.stable())).collect()
}

/// The name of first-order theory, which is of one oscillator, beside exact results.
fn first_order_beside(exact: &ExactCurve) -> &'static str {
    if exact.is_of_structure {
        FIRST_ORDER_ALONE
    } else {
        FIRST_ORDER
    }
}

/// Adds the exact backbone.
fn add_exact(panel: &mut Panel, exact: &ExactCurve, colour: &'static str, label: &str) {
    for curve in &exact.curves {
        let places = curve.iter().map(|orbit| ((orbit.sigma, orbit.c), !orbit.is_unstable()));
        panel.curve(places, 1.6, colour, label);
    }
}

/// The identified backbone beside theory and exact orbits: amplitude over detuning.
pub fn backbone(result: &Comparison) -> Figure {
    let (p, lock) = (&result.parameters, &result.lock.at);
    let top = (1.25 * lock.c).max(0.8);
    let theory = theory_backbone(p, top, |point| (point.sigma, point.c));
    // Below the fold there is no backbone, and the frequency of the remaining motion is arbitrary.
    let fold = SlowFlow::new(p.lambda, p.r).manifold.c_min();
    let decay = || result.decay.iter().map(|compared| compared.point);
    let sigmas = theory.iter().map(|((sigma, _), _)| *sigma);
    let sigmas = sigmas.chain(decay().filter(|point| point.c >= fold).map(|point| point.sigma));
    let x = widened(range((f64::MAX, f64::MIN), sigmas), 0.06);
    let mut panel = Panel::new((x, DETUNING), ((0.0, top), amplitude(p)));
    panel.curve(theory, 2.0, THEORY, first_order_beside(&result.curve));
    add_exact(&mut panel, &result.curve, EXACT, ORBITS);
    let predicted = result.decay.iter();
    let predicted = predicted.filter_map(|compared| Some((compared.sigma_slow_flow?, compared.point.c)));
    let predicted = predicted.filter(|(_, c)| *c > fold);
    panel.add(Shape::Line(1.6), predicted, PREDICTED, "free decay, slow flow");
    let identified = decay().step_by(THINNED).map(|point| (point.sigma, point.c));
    circles(&mut panel, identified, IDENTIFIED);
    let place = (lock.sigma, lock.c);
    for (uncertainty, vertical, range) in [(lock.u_sigma, false, x.1 - x.0), (lock.u_c, true, top)] {
        error_bars(&mut panel, std::iter::once((place, uncertainty)), vertical, range);
    }
    panel.add(Shape::Square, [place], MEASURED, LOCKED);
    let title = format!("Backbone and free decay; resonance: {}", p.definition.name());
    Figure::new(title, caption(p, &at(lock.g)), vec![vec![panel]])
}

/// Range of the particle speed on figures of the manifold: beyond the stable range.
const FASTEST_PARTICLE: f64 = 1.4;

/// A panel with the slow invariant manifold: amplitude over particle speed, the axes of the study.
fn manifold_panel(p: &Dimensionless, top: f64) -> Panel {
    let flow = SlowFlow::new(p.lambda, p.r);
    let place = |b: f64| (b, flow.manifold.c(b) * reading(p, b));
    let speeds = equally_spaced(0.0, FASTEST_PARTICLE, CURVE_POINTS);
    let points = speeds.map(|b| (place(b), theory::impacts_stable(&flow.manifold, b)));
    let mut panel = Panel::new(((0.0, FASTEST_PARTICLE), SPEED), ((0.0, top), amplitude(p)));
    panel.curve(points, 2.0, THEORY, "manifold");
    panel
}

/// The slow invariant manifold with the decay on it.
pub fn manifold(result: &Comparison) -> Figure {
    let (p, lock) = (&result.parameters, &result.lock);
    let mut panel = manifold_panel(p, (1.25 * lock.at.c).max(1.0));
    let decay = result.decay.iter().map(|compared| compared.point).step_by(THINNED);
    let decay = decay.filter_map(|point| Some((point.b?, point.c)));
    circles(&mut panel, decay, IDENTIFIED);
    panel.add(Shape::Square, lock.b.map(|b| (b, lock.at.c)), MEASURED, LOCKED);
    let title = "Slow invariant manifold and the free decay on it";
    Figure::new(title, caption(p, &at(lock.at.g)), vec![vec![panel]])
}

/// The tracked backbone on the exact and the first-order curve, and the drive that holds each level; points that are not settled are
/// crossed.
pub fn tracked(tracked: &TrackedComparison) -> Figure {
    let p = &tracked.parameters;
    let points = || tracked.points.iter().map(|compared| compared.point);
    let top = points().fold(0.5, |most: f64, point| most.max(1.15 * point.at.c));
    let x = widened(range((-1.6, 0.6), points().map(|point| point.at.sigma)), 0.1);
    let [first_order, orbits] = [first_order_beside(&tracked.exact), ORBITS].map(|name| match tracked.u_linear {
        Some([_, u]) => format!("{name}, measured λ = {:.2} ± {u:.2}", p.lambda),
        None => name.into(),
    });
    let mut backbone = Panel::new((x, DETUNING), ((0.0, top), amplitude(p)));
    let theory = theory_backbone(p, top, |point| (point.sigma, point.c));
    backbone.curve(theory, 2.0, THEORY, &first_order);
    add_exact(&mut backbone, &tracked.exact, EXACT, &orbits);
    let places = || points().map(|point| (point.at.sigma, point.at.c));
    circles(&mut backbone, places(), "tracked");
    let bars = places().zip(points().map(|point| point.at.u_sigma));
    error_bars(&mut backbone, bars, false, x.1 - x.0);
    let unsettled = places().zip(points()).filter(|(_, point)| !point.settled);
    let unsettled = unsettled.map(|(place, _)| place);
    backbone.add(Shape::Cross, unsettled, MEASURED, "not settled in time");

    let (least, most) = range((f64::MAX, f64::MIN), points().map(|point| point.at.g));
    let high = 1.3 * most.max(0.1);
    let mut drive = Panel::new(((0.0, top), amplitude(p)), ((0.0, high), "drive G, base over b ε"));
    let theory = theory_backbone(p, top, |point| (point.c, point.g));
    drive.curve(theory, 2.0, THEORY, &first_order);
    let exact = tracked.exact.places().iter().map(|place| (place[0], place[2]));
    drive.add(Shape::Line(1.6), exact, EXACT, &orbits);
    let places = || points().map(|point| (point.at.c, point.at.g));
    circles(&mut drive, places(), "tracked");
    error_bars(&mut drive, places().zip(points().map(|point| point.at.u_g)), true, high);
    let title = "Backbone, tracked with the loop closed, and its drive";
    let caption = caption(p, &format!("from {least:.3} to {most:.3}"));
    Figure::new(title, caption, vec![vec![backbone, drive]])
}

/// What was measured beside the backbones of a scene and of the best hypothesis, and below them the residuals, over amplitude.
pub fn fitted(found: &Found, scene: &Scene) -> Figure {
    let fit = found.hypotheses.best();
    let points = found.data.shown();
    let residuals = found.data.apart(fit);
    let p = scene.dimensionless();
    let used: Vec<(&MeasuredPoint, &[f64; 3])> = points.iter().zip(&residuals).collect();
    let millimetres = |metres: f64| 1e3 * scene.units().response.of_metres(metres);
    let place = |point: &MeasuredPoint| (millimetres(point.response.value), point.omega.value / TAU);
    let at = |measured: Estimate, over_u: f64| measured.value + over_u * measured.uncertainty;
    let model = used.iter().map(|(point, residual)| {
        let amplitude = millimetres(at(point.response, residual[0]));
        (amplitude, at(point.omega, residual[1]) / TAU)
    });
    let mut model: Vec<Place> = model.collect();
    model.sort_by(|place, next| place.0.total_cmp(&next.0));
    let [amplitudes, frequencies] = [|place: Place| place.0, |place: Place| place.1]
        .map(|part| range((f64::MAX, f64::MIN), points.iter().map(|point| part(place(point)))));
    let x = widened(amplitudes, 0.06);
    let exact = ExactCurve::of(&p);
    let expected = exact
        .places()
        .iter()
        .map(|[c, sigma, ..]| (millimetres(c * p.b), (p.omega0 + p.omega_change(*sigma)) / TAU));
    let expected: Vec<Place> = expected
        .filter(|(amplitude, _)| (x.0..x.1).contains(amplitude))
        .collect();
    let y = widened(range(frequencies, expected.iter().map(|place| place.1)), 0.08);
    let amplitude = "amplitude of the response, mm";
    let mut backbone = Panel::new((x, amplitude), (y, "phase resonance, Hz"));
    backbone.add(Shape::Line(1.6), expected, THEORY, "scene");
    backbone.add(Shape::Line(1.6), model, EXACT, "fit");
    circles(&mut backbone, points.iter().map(place), "measured");
    let bars = points.iter().map(|point| (place(point), point.omega.uncertainty / TAU));
    error_bars(&mut backbone, bars, true, y.1 - y.0);

    let sizes = residuals.iter().flatten().map(|residual| residual.abs());
    let most = 1.1 * sizes.fold(3.0, f64::max);
    let mut below = Panel::new((x, amplitude), ((-most, most), "fit less measured, over u"));
    for limit in [-1.96, 1.96] {
        below.add(Shape::Dashed(1.0), [(x.0, limit), (x.1, limit)], INK, "±1.96 u");
    }
    // The smallest marks last: none hides another.
    let quantities = [
        (2, Shape::Square, EXACT, "residual, drive"),
        (1, Shape::Circle(3.5), MEASURED, "residual, frequency"),
        (0, Shape::Dot(2.5), PARTICLE, "residual, amplitude"),
    ];
    for (n, shape, colour, name) in quantities {
        let places = used.iter().map(|(point, residual)| (place(point).0, residual[n]));
        below.add(shape, places, colour, name);
    }
    let is_possible = if fit.excluded.is_some() { "excluded" } else { "possible" };
    let caption = format!(
        "{}: chi-square {:.1} for {} degrees of freedom, {is_possible}",
        fit.hypothesis.names()[0],
        fit.chi_square,
        fit.degrees
    );
    Figure::new(
        "Measured points, scene and fit",
        caption,
        vec![vec![backbone], vec![below]],
    )
}

/// A time (periods), an amplitude and a detuning.
type Triple = [f64; 3];

/// Amplitude and frequency over time: left while the loop seeks and holds phase resonance, right as the motion decays.
pub fn history(record: &Record, scene: &Scene, result: &Comparison) -> Figure {
    let Comparison { parameters: p, lock, .. } = result;
    let flow = SlowFlow::new(p.lambda, p.r);
    let driven = driven(record, scene);
    let end = 1.02 * driven.last().map_or(1.0, |triple| triple[0]);
    let theory = backbone_decay(p, lock.at.c);
    let points = result.decay.iter().map(|compared| compared.point);
    let points = points.filter(|point| point.c >= 0.9 * flow.manifold.c_min());
    let points = points.step_by(THINNED / 2);
    let points: Vec<Triple> = points.map(|point| [point.tau / TAU, point.c, point.sigma]).collect();
    let last = range((0.0, 1.0), points.iter().chain(&theory).map(|triple| triple[0])).1;

    let (_, top) = range((0.0, lock.at.c), driven.iter().map(|triple| triple[1]));
    let detunings = driven.iter().chain(&points).map(|triple| triple[2]);
    let detunings = widened(range((-1.5, 0.5), detunings), 0.1);
    let name = first_order_beside(&result.curve);
    let row = |row: usize, range: (f64, f64), label: &str| {
        let place = |triple: &Triple| (triple[0], triple[row]);
        let mut left = Panel::new(((0.0, end), "time, periods"), (range, label));
        let level = |value: [f64; 2]| [(0.0, value[row - 1]), (end, value[row - 1])];
        let exact = result.exact.iter().flat_map(|exact| level([exact.c, exact.sigma]));
        left.add(Shape::Line(1.6), exact, EXACT, "exact orbit");
        let first_order = result.theory.iter().flat_map(|theory| level([theory.c, theory.sigma]));
        left.add(Shape::Line(1.2), first_order, THEORY, name);
        left.add(Shape::Line(1.2), driven.iter().map(place), MEASURED, "measured");
        let mut right = Panel::new(((0.0, 1.02 * last), "time since the release, periods"), (range, label));
        right.add(Shape::Line(1.2), theory.iter().map(place), THEORY, name);
        circles(&mut right, points.iter().map(place), IDENTIFIED);
        vec![left, right]
    };
    let rows = vec![row(1, (0.0, top * 1.1), amplitude(p)), row(2, detunings, "detuning σ")];
    Figure::new(
        "Seeking and holding resonance; free decay",
        caption(p, &at(lock.at.g)),
        rows,
    )
}

/// The decay along the manifold by first-order theory, from an amplitude.
fn backbone_decay(p: &Dimensionless, from: f64) -> Vec<Triple> {
    let start = theory::backbone_at_level(p, from);
    let decay = start.and_then(|point| SlowFlow::new(p.lambda, p.r).decay(point.b, CURVE_POINTS));
    let samples = decay.unwrap_or_default();
    let samples = samples.iter().map(|(tau1, point)| {
        let c = point.c * reading(p, point.b);
        [tau1 / (p.epsilon * TAU), c, point.sigma]
    });
    samples.collect()
}

/// Amplitude and commanded frequency up to the release, from windows of two periods: least squares of the response by the commanded
/// harmonic and a constant. At most 800 windows: more than there are pixels.
fn driven(record: &Record, scene: &Scene) -> Vec<Triple> {
    let d = scene.dimensionless();
    let dt = record.sample_time;
    let window = 2 * (d.natural_period() / dt).round().max(4.0) as usize;
    let samples = &record.samples[..record.released];
    let step = (samples.len() / 800).max(window / 2);
    (0..samples.len().saturating_sub(window))
        .step_by(step)
        .filter_map(|from| {
            let part = &samples[from..from + window];
            let omega = part[window / 2].command.drive.omega;
            let phases: Vec<f64> = (0..window).map(|n| omega * dt * n as f64).collect();
            let values = part.iter().map(|sample| sample.sensors.response);
            let values = DVector::from_iterator(window, values);
            let fit = HarmonicBasis::new(&phases, [0, 0], 1).fit(&values)?;
            let periods = d.omega0 * part[window / 2].time / TAU;
            Some([periods, fit.harmonic(1).norm() / d.b, d.sigma(omega)])
        })
        .collect()
}

/// Coefficients of restitution of the backbones beside the scene's own, with their colours.
const RESTITUTIONS: [(f64, &str); 4] = [
    (0.3, EXACT),
    (0.5, MEASURED),
    (0.8, "period doubling"),
    (1.0, PREDICTED),
];

/// First-order theory: the slow invariant manifold with the resonant motions at the scene's G, and backbones for several coefficients of
/// restitution, the scene's own emphasised.
pub fn theory(p: &Dimensionless) -> Figure {
    let (x, top) = ((-4.0, 4.0), 1.2);
    let mut manifold = manifold_panel(p, top);
    let resonant = theory::resonant(p);
    let resonant = resonant.iter().map(|point| (point.b, point.c));
    manifold.add(Shape::Square, resonant, INK, "resonance at this G");
    let mut backbones = Panel::new((x, DETUNING), ((0.0, top), amplitude(p)));
    let others = RESTITUTIONS.into_iter().filter(|(r, _)| (r - p.r).abs() > 0.09);
    let mut values: Vec<_> = others.map(|(r, colour)| (r, colour, 1.5)).collect();
    values.push((p.r, THEORY, 3.0));
    values.sort_by(|value, next| value.0.total_cmp(&next.0));
    for (r, colour, width) in values {
        let points: Vec<Marked> = theory::backbone(&Dimensionless { r, ..*p }, 1e-3, 1.5 * B_SYMMETRY_BREAKING, 500)
            .into_iter()
            .filter(|point| point.c <= top && (x.0..=x.1).contains(&point.sigma))
            .map(|point| ((point.sigma, point.c), point.stable()))
            .collect();
        // Without loss at the impacts C vanishes at the fold, and sigma jumps from one side to the other there.
        for piece in points.chunk_by(|place, next| (place.0.0 - next.0.0).abs() < 1.0).rev() {
            backbones.branch(piece.iter().copied(), width, colour, &format!("backbone, r = {r}"));
        }
    }
    let title = format!("Slow invariant manifold; backbones by {}", p.definition.name());
    let caption = format!("{}; dashed: unstable", caption(p, &at(p.g)));
    Figure::new(title, caption, vec![vec![manifold, backbones]])
}

/// The exact backbone of a structure beside that of its driven mode alone; frequencies and responses are those of the sensor.
pub fn structure(scene: &Scene, survey: &Survey) -> Option<Figure> {
    let d = scene.dimensionless();
    let unit = scene.structure.as_ref()?.units().response.of_metres(d.b);
    let place = |orbit: &StructureOrbit| {
        let place = (d.sigma(orbit.omega), orbit.response / unit);
        (place, !orbit.stability.is_unstable())
    };
    let curve = |branch: &StructureBranch| branch.orbits.iter().map(place).collect();
    let [alone, all]: [Vec<Vec<Marked>>; 2] =
        [&survey.facts.alone, &survey.facts.all].map(|branches| branches.iter().map(curve).collect());
    let top = 1.0;
    let places = alone.iter().chain(&all).flatten().map(|point| point.0);
    let sigmas = places.filter(|(_, c)| *c < top).map(|(sigma, _)| sigma);
    let x = widened(range((f64::MAX, f64::MIN), sigmas), 0.06);
    let panel = |curves: &[Vec<Marked>], colour: &'static str, label: &str| {
        let mut panel = Panel::new((x, DETUNING), ((0.0, top), amplitude(&d)));
        for curve in curves {
            panel.curve(curve.iter().copied(), 2.0, colour, label);
        }
        panel
    };
    let panels = vec![
        panel(&alone, THEORY, "driven mode alone"),
        panel(&all, EXACT, "all modes"),
    ];
    let title = "Exact backbone: the driven mode alone, and all modes of the structure";
    let caption = format!("{}; dashed: unstable", caption(&d, &at(d.g)));
    Some(Figure::new(title, caption, vec![panels]))
}

/// The frequency response at the scene's G over a range of sigma, exact and first-order, and the exact backbone. A curve has sigma, C and B of its
/// motions, and whether they are stable.
pub fn responses(
    p: &Dimensionless,
    curves: impl Iterator<Item = Vec<([f64; 3], bool)>>,
    exact: &ExactCurve,
    range: [f64; 2],
) -> Figure {
    let flow = SlowFlow::new(p.lambda, p.r);
    let fold = flow.manifold.b_min();
    let curves: Vec<_> = curves.collect();
    let fast = curves.iter().flatten().filter(|([.., b], _)| *b > fold);
    let top = fast.fold(0.6, |most: f64, ([_, c, _], _)| most.max(1.15 * c));
    let mut panel = Panel::new(((range[0], range[1]), DETUNING), ((0.0, top), amplitude(p)));
    for curve in flow.frequency_responses(p.g, 600) {
        let points = curve.iter().map(|point| {
            let c = point.c * reading(p, point.b);
            ((point.sigma, c), point.is_stable())
        });
        panel.curve(points, 1.0, THEORY, first_order_beside(exact));
    }
    for curve in &curves {
        let points = curve.iter().map(|([sigma, c, _], stable)| ((*sigma, *c), *stable));
        panel.curve(points, 2.2, EXACT, ORBITS);
    }
    add_exact(&mut panel, exact, PREDICTED, "exact backbone");
    let title = format!("Frequency response, and backbone by {}", p.definition.name());
    Figure::new(title, caption(p, &at(p.g)), vec![vec![panel]])
}
