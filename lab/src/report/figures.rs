//! The figures of the report: what they show, and with which axes, colours and labels.

mod regimes;

pub use regimes::regimes;

use std::f64::consts::{FRAC_PI_2, TAU};

use nalgebra::DVector;

use super::figure::{
    AMPLITUDE_OF_V, DETUNING, Figure, Legend, Marked, Panel, Place, SIZE, SPEED, Shape, amplitude, caption, rig,
};
use super::theme::{EXACT, INK, MEASURED, MODULATION, PARTICLE, THEORY};
use crate::comparison::{Comparison, ExactCurve, TrackedComparison};
use crate::fit::{Fit, MeasuredPoint};
use crate::numerics::{Estimate, HarmonicBasis, equally_spaced, range};
use crate::orbit::{self, ContinuationLimits, FrequencyResponse, Periodic};
use crate::record::Record;
use crate::scene::{Definition, Dimensionless, Scene};
use crate::theory::{self, B_SYMMETRY_BREAKING, BackbonePoint, BranchSide, SlowFlow, Waveform, reading};

/// Points of a computed curve: at this figure size, neighbours are at most a few pixels apart.
const POINTS: usize = 400;
/// Only every fourth point along the decay is drawn, so that the circles do not overlap.
const THINNED: usize = 4;

/// Width of figures with panels or a legend beside the axes, px.
const WIDE: f64 = 860.0;
const IDENTIFIED: &str = "free decay, identified";
const FIRST_ORDER: &str = "first-order theory";
/// Error bars shorter than this fraction of an axis are hidden by the mark at their place.
const VISIBLE: f64 = 0.02;

/// A range with a margin on both sides, as a part of its length.
fn widened((low, high): (f64, f64), part: f64) -> (f64, f64) {
    let margin = part * (high - low);
    (low - margin, high + margin)
}

fn marked(point: &BackbonePoint) -> Marked {
    ((point.sigma, point.c), point.stable())
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
    panel.add(Shape::Bars(1.2), ends, MEASURED, "95 % of the measurement");
}

/// The right branch of first-order theory's backbone, from the fold up to an amplitude.
fn theory_backbone(p: &Dimensionless, top: f64) -> Vec<Marked> {
    let manifold = SlowFlow::new(p.lambda, p.r).manifold;
    let last = manifold.b(top, BranchSide::Right).unwrap_or(1.0);
    let points = theory::backbone(p, manifold.b_min(), last, POINTS);
    points.iter().map(marked).collect()
}

/// Adds the right branch of the backbone, by theory and exact, each with its stability.
fn add_backbones(panel: &mut Panel, p: &Dimensionless, theory: Vec<Marked>) {
    let fold = SlowFlow::new(p.lambda, p.r).manifold.b_min();
    let branch = orbit::backbone(p, &ContinuationLimits::default());
    let exact = branch.iter().flat_map(|branch| &branch.points);
    let exact = exact.filter(|motion| motion.b >= fold);
    panel.curve(theory, 2.0, THEORY, FIRST_ORDER);
    let exact = exact.map(|motion| ((motion.sigma, motion.c), motion.stable));
    panel.curve(exact, 1.6, EXACT, "exact orbits");
}

/// The identified backbone beside theory and exact orbits: amplitude over detuning.
pub fn backbone(result: &Comparison) -> Figure {
    let (p, lock) = (&result.parameters, &result.lock.at);
    let top = (1.25 * lock.c).max(0.8);
    let theory = theory_backbone(p, top);
    // Below the fold there is no backbone, and the frequency of the remaining motion is arbitrary.
    let fold = SlowFlow::new(p.lambda, p.r).manifold.c_min();
    let decay = || result.decay.iter().map(|compared| compared.point);
    let sigmas = theory.iter().map(|((sigma, _), _)| *sigma);
    let sigmas = sigmas.chain(decay().filter(|point| point.c >= fold).map(|point| point.sigma));
    let (low, high) = range((f64::MAX, f64::MIN), sigmas);
    let (low, high) = widened((low, high), 0.06);

    let title = match p.definition == Definition::default() {
        true => "Backbone: phase resonance of the centre of mass".into(),
        false => format!("Backbone: {}", p.definition.name()),
    };
    let mut panel = Panel::new(((low, high), DETUNING), ((0.0, top), amplitude(p)))
        .heading(&title, &caption(p, lock.g))
        .legend(Legend::UpperRight);
    add_backbones(&mut panel, p, theory);
    let predicted = result.decay.iter();
    let predicted = predicted.filter_map(|compared| Some((compared.sigma_predicted?, compared.point.c)));
    let label = "free decay, predicted by the exact plant";
    panel.add(Shape::Line(1.0), predicted.filter(|(_, c)| *c > fold), EXACT, label);
    let identified = decay().step_by(THINNED).map(|point| (point.sigma, point.c));
    circles(&mut panel, identified, IDENTIFIED);
    let place = (lock.sigma, lock.c);
    for (uncertainty, vertical, range) in [(lock.u_sigma, false, high - low), (lock.u_c, true, top)] {
        error_bars(&mut panel, std::iter::once((place, uncertainty)), vertical, range);
    }
    panel.add(Shape::Square, [place], MEASURED, "locked, measured");
    Figure(vec![panel])
}

/// Range of the particle speed on figures of the manifold: beyond the stable range.
const FASTEST: f64 = 1.4;

/// The slow invariant manifold from speed 0 on, as a function of the particle speed: amplitude as `read`, and stability.
fn manifold_curve(flow: &SlowFlow, read: impl Fn(f64, f64) -> f64) -> Vec<Marked> {
    let place = |b| (b, read(b, flow.manifold.c(b)));
    let speeds = equally_spaced(0.0, FASTEST, 401);
    let points = speeds.map(|b| (place(b), theory::impacts_stable(&flow.manifold, b)));
    points.collect()
}

/// The slow invariant manifold with the decay on it: amplitude over particle speed, the axes of the study.
pub fn manifold(result: &Comparison) -> Figure {
    let (p, lock) = (&result.parameters, &result.lock);
    let flow = SlowFlow::new(p.lambda, p.r);
    let top = (1.25 * lock.at.c).max(1.0);
    let mut panel = Panel::new(((0.0, FASTEST), SPEED), ((0.0, top), amplitude(p)))
        .heading(
            "Slow invariant manifold and the free decay on it",
            &caption(p, lock.at.g),
        )
        .legend(Legend::LowerRight);
    let curve = manifold_curve(&flow, |b, c| c * reading(p, b, flow.free_detuning(b)));
    panel.curve(curve, 2.0, THEORY, "manifold");
    let decay = result.decay.iter().map(|compared| compared.point).step_by(THINNED);
    let decay = decay.filter_map(|point| Some((point.b?, point.c)));
    circles(&mut panel, decay, IDENTIFIED);
    if let Some(b) = lock.b {
        panel.add(Shape::Square, [(b, lock.at.c)], MEASURED, "locked, measured");
    }
    Figure(vec![panel])
}

/// The tracked backbone on the exact and the first-order curve; points that are not settled are crossed.
pub fn tracked(tracked: &TrackedComparison) -> Figure {
    Figure(vec![tracked_amplitude(tracked)])
}

/// The tracked backbone, and beside it the drive over amplitude.
pub fn tracked_with_drive(tracked: &TrackedComparison) -> Figure {
    let (width, height) = SIZE;
    let drive = tracked_drive(tracked).at([width, 0.0, width, height]);
    Figure(vec![tracked_amplitude(tracked), drive])
}

/// The top of the axis of the tracked amplitudes.
fn top_of(tracked: &TrackedComparison) -> f64 {
    let amplitudes = tracked.points.iter().map(|compared| compared.point.at.c);
    amplitudes.fold(0.5, |most: f64, c| most.max(1.15 * c))
}

fn tracked_amplitude(tracked: &TrackedComparison) -> Panel {
    let (p, top) = (&tracked.parameters, top_of(tracked));
    let points = || tracked.points.iter().map(|compared| compared.point);
    let (low, high) = range((-1.6, 0.6), points().map(|point| point.at.sigma));
    let x = widened((low, high), 0.1);
    let (least, most) = range((f64::MAX, f64::MIN), points().map(|point| point.at.g));
    let text = caption(p, most).replace(&format!("G = {most:.3}"), &format!("G from {least:.3} to {most:.3}"));
    let mut panel = Panel::new((x, DETUNING), ((0.0, top), amplitude(p)))
        .heading("Backbone, tracked with the loop closed", &text)
        .legend(Legend::UpperRight);
    add_backbones(&mut panel, p, theory_backbone(p, top));
    let places = || points().map(|point| (point.at.sigma, point.at.c));
    circles(&mut panel, places(), "tracked");
    let bars = places().zip(points().map(|point| point.at.u_sigma));
    error_bars(&mut panel, bars, false, x.1 - x.0);
    let unsettled = places().zip(points()).filter(|(_, point)| !point.settled);
    let unsettled = unsettled.map(|(place, _)| place);
    panel.add(Shape::Cross, unsettled, MEASURED, "not settled in time");
    panel
}

fn tracked_drive(tracked: &TrackedComparison) -> Panel {
    let (p, top) = (&tracked.parameters, top_of(tracked));
    let points = || tracked.points.iter().map(|compared| compared.point);
    let (_, most) = range((0.0, 0.1), points().map(|point| point.at.g));
    let high = 1.3 * most;
    let mut panel = Panel::new(
        ((0.0, top), amplitude(p)),
        ((0.0, high), "drive G, base amplitude over b ε"),
    )
    .heading("The drive that holds each level", "")
    .legend(Legend::LowerRight);
    let theory = theory::backbone(p, SlowFlow::new(p.lambda, p.r).manifold.b_min(), 1.3, 600);
    let theory = theory.iter().map(|point| ((point.c, point.g), point.stable()));
    panel.curve(theory, 2.0, THEORY, FIRST_ORDER);
    let exact = tracked.exact.places().iter().map(|place| (place[0], place[2]));
    panel.add(Shape::Line(1.6), exact, EXACT, "exact orbits");
    let places = || points().map(|point| (point.at.c, point.at.g));
    circles(&mut panel, places(), "tracked");
    let bars = places().zip(points().map(|point| point.at.u_g));
    error_bars(&mut panel, bars, true, high);
    panel
}

/// Measured points beside the backbones of a scene and of the fitted rig, and below them the residuals, over amplitude.
///
/// The places of the fit are those nearest to the points, with the effects of the cavity that it names.
pub fn fitted(points: &[MeasuredPoint], fit: &Fit, scene: &Scene, verdict: Option<&str>) -> Figure {
    let p = scene.dimensionless();
    let used = (0..points.len()).filter(|n| !fit.left_out.contains(n));
    let used: Vec<(&MeasuredPoint, _)> = used.map(|n| &points[n]).zip(&fit.residuals).collect();
    let place = |point: &MeasuredPoint| (1e3 * point.response.value, point.omega.value / TAU);
    let at = |measured: Estimate, over_u: f64| measured.value + over_u * measured.uncertainty;
    let model = used.iter().map(|(point, residual)| {
        let amplitude = 1e3 * at(point.response, residual[0]);
        (amplitude, at(point.omega, residual[1]) / TAU)
    });
    let mut model: Vec<Place> = model.collect();
    model.sort_by(|place, next| place.0.total_cmp(&next.0));
    let [amplitudes, frequencies] = [|place: Place| place.0, |place: Place| place.1]
        .map(|part| range((f64::MAX, f64::MIN), points.iter().map(|point| part(place(point)))));
    let x = widened(amplitudes, 0.06);
    let exact = ExactCurve::of(&p);
    let expected: Vec<Place> = exact
        .places()
        .iter()
        .map(|[c, sigma, _]| (1e3 * c * p.b, (p.omega0 + p.omega_change(*sigma)) / TAU))
        .filter(|(amplitude, _)| (x.0..x.1).contains(amplitude))
        .collect();
    let (low, high) = range(frequencies, expected.iter().map(|place| place.1));
    // Space for the legend below the right end, the highest.
    let y = (low - 0.3 * (high - low), high + 0.08 * (high - low));
    let (width, height) = SIZE;
    let amplitude = "amplitude of the response, mm";
    let mut backbone = Panel::new((x, amplitude), (y, "frequency of phase resonance, Hz"))
        .heading(
            "Measured points, scene and fit",
            &verdict.unwrap_or_default().replace("; ", ";\n"),
        )
        .legend(Legend::LowerRight);
    backbone.add(Shape::Line(1.6), expected, THEORY, "scene");
    backbone.add(Shape::Line(1.6), model, EXACT, "fit");
    circles(&mut backbone, points.iter().map(place), "measured");
    let bars = points.iter().map(|point| (place(point), point.omega.uncertainty / TAU));
    error_bars(&mut backbone, bars, true, y.1 - y.0);
    let left_out = fit.left_out.iter().map(|n| place(&points[*n]));
    backbone.add(Shape::Cross, left_out, MEASURED, "left out");

    let residuals = fit.residuals.iter().flatten().map(|residual| residual.abs());
    let most = 1.1 * residuals.fold(3.0, f64::max);
    let model = if fit.is_rejected() { "rejected" } else { "not rejected" };
    let text = format!(
        "chi-square {:.1} for {} degrees of freedom: {model}",
        fit.chi_square, fit.degrees
    );
    let mut below = Panel::new((x, amplitude), ((-most, 1.5 * most), "fit less measured, over u"))
        .at([0.0, height, width, height])
        .heading("Residuals over their standard uncertainties", &text)
        .legend(Legend::UpperRight);
    for limit in [-1.96, 1.96] {
        below.add(Shape::Dashed(1.0), [(x.0, limit), (x.1, limit)], INK, "±1.96 u");
    }
    let quantities = [
        (Shape::Dot(3.0), PARTICLE, "amplitude"),
        (Shape::Circle(3.5), MEASURED, "frequency"),
        (Shape::Square, EXACT, "drive"),
    ];
    for (n, (shape, colour, name)) in (0..).zip(quantities) {
        let places = used
            .iter()
            .map(|(point, residual): &(_, &[f64; 3])| (place(point).0, residual[n as usize]));
        below.add(shape, places, colour, name);
    }
    Figure(vec![backbone, below])
}

/// A time (periods), an amplitude and a detuning.
type Triple = [f64; 3];

/// Amplitude and frequency over time: left while the loop seeks and holds phase resonance, right as the motion decays.
pub fn history(record: &Record, scene: &Scene, result: &Comparison) -> Figure {
    let Comparison { parameters: p, lock, .. } = result;
    let flow = SlowFlow::new(p.lambda, p.r);
    let driven = driven(record, scene);
    let theory = backbone_decay(p, lock.at.c);
    let points = result.decay.iter().map(|compared| compared.point);
    let points = points.filter(|point| point.c >= 0.9 * flow.manifold.c_min());
    let points = points
        .step_by(THINNED / 2)
        .map(|point| [point.tau / TAU, point.c, point.sigma]);
    let points: Vec<Triple> = points.collect();

    let (_, top) = range((0.0, lock.at.c), driven.iter().map(|triple| triple[1]));
    let detunings = driven.iter().chain(&points).map(|triple| triple[2]);
    let detunings = widened(range((-1.5, 0.5), detunings), 0.1);
    let (width, upper, lower, left) = (WIDE, 350.0, 290.0, 450.0);
    let rows = [
        (1, (0.0, top * 1.35), amplitude(p), [0.0, upper]),
        (2, detunings, "detuning σ", [upper, lower]),
    ];
    let panels = rows.into_iter().flat_map(|(row, range, label, [y, height])| {
        [
            driven_panel(result, &driven, row, (range, label)).at([0.0, y, left, height]),
            decay_panel(&theory, &points, row, range).at([left, y, width - left, height]),
        ]
    });
    Figure(panels.collect())
}

/// The decay along the manifold by first-order theory, from an amplitude.
fn backbone_decay(p: &Dimensionless, from: f64) -> Vec<Triple> {
    let start = theory::backbone_at_level(p, from);
    let decay = start.and_then(|point| SlowFlow::new(p.lambda, p.r).decay(point.b, POINTS));
    let samples = decay.unwrap_or_default();
    let samples = samples.iter().map(|(tau1, point)| {
        let c = point.c * reading(p, point.b, point.sigma);
        [tau1 / (p.epsilon * TAU), c, point.sigma]
    });
    samples.collect()
}

fn driven_panel(result: &Comparison, driven: &[Triple], row: usize, y: ((f64, f64), &str)) -> Panel {
    let end = 1.02 * driven.last().map_or(1.0, |triple| triple[0]);
    let mut panel = Panel::new(((0.0, end), "time, periods"), y);
    if row == 1 {
        let caption = format!("{}, G = {:.3}", rig(&result.parameters), result.lock.at.g);
        panel = panel.heading("Seeking and holding resonance", &caption);
    }
    let measured = driven.iter().map(|triple| (triple[0], triple[row]));
    panel.add(Shape::Line(1.6), measured, MEASURED, "measured");
    let level = |value: [f64; 2]| [(0.0, value[row - 1]), (end, value[row - 1])];
    if let Some(exact) = &result.exact {
        panel.add(Shape::Line(1.6), level([exact.c, exact.sigma]), EXACT, "exact orbit");
    }
    if let Some(theory) = &result.theory {
        panel.add(Shape::Line(1.2), level([theory.c, theory.sigma]), THEORY, FIRST_ORDER);
    }
    panel.legend(if row == 1 { Legend::LowerRight } else { Legend::None })
}

fn decay_panel(theory: &[Triple], points: &[Triple], row: usize, y: (f64, f64)) -> Panel {
    let last = points.last().map_or(1.0, |triple| triple[0]);
    let end = theory.last().map_or(last, |triple| last.max(triple[0]));
    let mut panel = Panel::new(((0.0, 1.02 * end), "time since the release, periods"), (y, ""));
    if row == 1 {
        panel = panel.heading("Free decay", "the drive is off from 0 on");
    }
    let place = |triple: &Triple| (triple[0], triple[row]);
    panel.add(Shape::Line(1.2), theory.iter().map(place), THEORY, FIRST_ORDER);
    circles(&mut panel, points.iter().map(place), IDENTIFIED);
    panel.legend(if row == 1 { Legend::UpperRight } else { Legend::None })
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
            let fit = HarmonicBasis::new(&phases, 0, &[Some(0)]).fit(&values)?;
            let periods = d.omega0 * part[window / 2].time / TAU;
            Some([periods, fit.harmonic(1).norm() / d.b, d.sigma(omega)])
        })
        .collect()
}

/// The approach to the slow invariant manifold by first-order theory, impact by impact: sequences with the drive on, which end at the
/// locked point, and one without it, from there down to the fold.
pub fn approach(p: &Dimensionless, lock: &BackbonePoint) -> Figure {
    let flow = SlowFlow::new(p.lambda, p.r);
    let lock = &flow.backbone_at(lock.b);
    let gamma = -FRAC_PI_2;
    let top = 2.0 * lock.c;
    let inside = |(b, c): &Place| (0.0..=FASTEST).contains(b) && *c <= top;
    let sequence = |g: f64, (b, c): Place| -> Vec<Place> {
        let phases = (b, flow.psi(lock.b, gamma));
        let impacts = flow.modulation(p.epsilon, (g, lock.sigma), (c, gamma), phases);
        let places = impacts.take(POINTS).map(|impact| (impact.b, impact.c));
        std::iter::once((b, c)).chain(places).take_while(inside).collect()
    };
    let mut panel = Panel::new(((0.0, FASTEST), SPEED), ((0.0, top), AMPLITUDE_OF_V))
        .heading(
            "Approach to the slow invariant manifold, impact by impact",
            &caption(p, lock.g),
        )
        .legend(Legend::LowerRight);
    panel.curve(manifold_curve(&flow, |_, c| c), 2.4, THEORY, "manifold");
    // Starts on all sides of the manifold: B and C in parts of those at the locked point.
    for (b, c) in [(0.93, 1.35), (1.07, 0.65), (0.8, 0.75), (1.14, 1.2)] {
        let places = sequence(lock.g, (b * lock.b, c * lock.c));
        panel.add(Shape::Line(0.6), places.clone(), MODULATION, "");
        panel.add(Shape::Dot(2.2), places, MODULATION, "with drive");
    }
    let free = sequence(0.0, (lock.b, lock.c));
    panel.add(Shape::Circle(3.5), free, MODULATION, "without drive");
    panel.add(Shape::Square, [(lock.b, lock.c)], INK, "phase resonance");
    Figure(vec![panel])
}

/// First-order theory: the slow invariant manifold with the resonant motions at the scene's G, and backbones for several coefficients of
/// restitution.
pub fn theory(p: &Dimensionless) -> Figure {
    let flow = SlowFlow::new(p.lambda, p.r);
    let mut manifold = Panel::new(((0.0, FASTEST), SPEED), ((0.0, 1.2), amplitude(p)))
        .heading("Slow invariant manifold", &caption(p, p.g))
        .legend(Legend::LowerRight);
    let curve = manifold_curve(&flow, |b, c| c * reading(p, b, flow.free_detuning(b)));
    manifold.curve(curve, 2.0, THEORY, "manifold");
    let solutions = theory::resonant(p);
    let solutions = solutions.iter().map(|point| (point.b, point.c));
    manifold.add(Shape::Square, solutions, INK, "resonance at this G");
    let (width, height) = SIZE;
    Figure(vec![manifold, backbones(p).at([width, 0.0, width, height])])
}

/// Backbones of first-order theory for several coefficients of restitution, the scene's own emphasised.
fn backbones(p: &Dimensionless) -> Panel {
    let (x, top) = ((-4.0, 4.0), 1.2);
    let others = [0.3, 0.5, 0.8, 1.0].into_iter();
    let mut values: Vec<f64> = others.filter(|r| (r - p.r).abs() > 0.09).collect();
    values.push(p.r);
    values.sort_by(f64::total_cmp);
    let caption = format!(
        "λ = {:.3}; amplitudes over b; first order in ε; {}",
        p.lambda,
        p.definition.name()
    );
    let mut panel = Panel::new((x, DETUNING), ((0.0, top), amplitude(p)))
        .heading("Backbones for several coefficients of restitution r", &caption)
        .legend(Legend::UpperRight);
    for r in values {
        let (width, size) = if r == p.r { (3.2, 17.0) } else { (1.5, 14.0) };
        let points: Vec<Marked> = theory::backbone(&Dimensionless { r, ..*p }, 1e-3, 1.5 * B_SYMMETRY_BREAKING, 500)
            .into_iter()
            .filter(|point| point.c <= top && (x.0..=x.1).contains(&point.sigma))
            .map(|point| marked(&point))
            .collect();
        // Without loss at the impacts C vanishes at the fold, and sigma jumps from one side to the other there.
        for piece in points.chunk_by(|place, next| (place.0.0 - next.0.0).abs() < 1.0) {
            panel.curve(piece.iter().copied(), width, THEORY, FIRST_ORDER);
        }
        // The label is beside the fold, where the curves are distinct; for a fold near the axis, where its curve enters from the left.
        let flow = SlowFlow::new(p.lambda, r);
        let fold = flow.backbone_at(flow.manifold.b_min());
        let entry = points.iter().map(|(place, _)| *place);
        let entry = entry.filter(|(sigma, _)| *sigma > x.0 + 0.2 && *sigma < 0.0);
        let place = match entry.min_by(|place, next| place.0.total_cmp(&next.0)) {
            _ if fold.c > 0.05 => (fold.sigma.max(0.1) - 0.3, fold.c),
            Some((sigma, c)) => (sigma + 0.4, c),
            None => (0.0, 0.1),
        };
        panel.add(Shape::TextOnCurve(size), [place], INK, &format!("r = {r}"));
    }
    panel
}

/// The frequency response at the scene's G over a range of sigma, exact and first-order, and the exact backbone.
pub fn responses(p: &Dimensionless, response: &FrequencyResponse, range: [f64; 2]) -> Figure {
    let fold = SlowFlow::new(p.lambda, p.r).manifold.b_min();
    let symmetric = response.symmetric().flat_map(|branch| &branch.points);
    let top = symmetric
        .filter(|point| point.b > fold)
        .fold(0.6, |most: f64, point| most.max(1.15 * point.c));
    let mut panel = Panel::new(((range[0], range[1]), DETUNING), ((0.0, top), amplitude(p)))
        .heading("Frequency response and backbone", &caption(p, response.g))
        .at([0.0, 0.0, WIDE, SIZE.1])
        .legend(Legend::Beside(205.0));
    add_response(&mut panel, p, response);
    let branch = orbit::backbone(p, &ContinuationLimits::default());
    let points = branch.iter().flat_map(|branch| &branch.points);
    let points = points.filter(|motion| motion.b >= fold);
    let points = points.map(|motion| ((motion.sigma, motion.c), motion.stable));
    panel.curve(points, 1.2, INK, "exact backbone");
    Figure(vec![panel])
}

/// One frequency response, by theory and exact.
fn add_response(panel: &mut Panel, p: &Dimensionless, response: &FrequencyResponse) {
    for curve in SlowFlow::new(p.lambda, p.r).frequency_responses(response.g, 600) {
        let points = curve.iter().map(|point| {
            let stable = point.impacts_stable && point.slow_flow_stable;
            let c = point.c * reading(p, point.b, point.sigma);
            ((point.sigma, c), stable)
        });
        panel.curve(points, 1.0, THEORY, "theory");
    }
    for component in &response.components {
        let points = component.branch.points.iter();
        let points = points.map(|point| ((point.sigma, point.c), point.stable));
        panel.curve(points, 2.0, EXACT, "exact");
    }
}

/// An impact: part of the period, displacement of the particle, wall.
type Impact = (f64, f64, f64);

/// One period of the motion with its impacts, exact, and as first-order theory reconstructs it.
pub fn period(p: &Dimensionless, motion: &Periodic, theory: Option<&BackbonePoint>) -> Figure {
    let rows = motion.motion(p, POINTS);
    let impacts = impacts(motion);
    let (width, upper, lower) = (SIZE.0, 290.0, 270.0);
    Figure(vec![
        displacements(p, motion, &rows, &impacts).at([0.0, 0.0, width, upper]),
        coordinates(p, &rows, &impacts, theory).at([0.0, upper, width, lower]),
    ])
}

fn part(n: usize) -> f64 {
    n as f64 / POINTS as f64
}

/// A function of (tau, q1, q1', q2, q2') over the period.
fn over_period(rows: &[[f64; 5]], value: impl Fn(&[f64; 5]) -> f64) -> Vec<Place> {
    let rows = rows.iter().enumerate();
    rows.map(|(n, row)| (part(n), value(row))).collect()
}

/// Primary mass with its walls, and the particle between them.
fn displacements(p: &Dimensionless, motion: &Periodic, rows: &[[f64; 5]], impacts: &[Impact]) -> Panel {
    let caption = format!(
        "{}, G = {:.3}, exact orbit at σ = {:.4}; lengths over b",
        rig(p),
        motion.g,
        motion.sigma
    );
    let (q1, q2) = (over_period(rows, |row| row[1]), over_period(rows, |row| row[3]));
    let farthest = q1.iter().chain(&q2).map(|(_, value)| value.abs() + 1.0);
    let (_, most) = range((0.0, 1.0), farthest);
    let mut panel = Panel::new(((0.0, 1.0), ""), ((-1.05 * most, 1.05 * most), "displacements, over b"))
        .heading("One period of the locked motion", &caption)
        .legend(Legend::Beside(182.0));
    for side in [1.0, -1.0] {
        let wall = over_period(rows, |row| row[1] + side);
        panel.add(Shape::Line(2.0), wall, INK, "walls, q₁ ± 1");
    }
    panel.add(Shape::Line(2.4), q1, EXACT, "mass q₁");
    panel.add(Shape::Line(2.0), q2, PARTICLE, "particle q₂");
    let marks = impacts.iter().map(|(t, q2, _)| (*t, *q2));
    panel.add(Shape::Circle(6.0), marks, INK, "impacts");
    panel
}

/// Centre of mass and relative displacement.
fn coordinates(p: &Dimensionless, rows: &[[f64; 5]], impacts: &[Impact], theory: Option<&BackbonePoint>) -> Panel {
    let w = over_period(rows, |row| row[1] - row[3]);
    let v = over_period(rows, |row| row[1] + p.epsilon * row[3]);
    let (_, high) = range((0.0, 1.0), v.iter().map(|(_, value)| value.abs()));
    let mut panel = Panel::new(
        ((0.0, 1.0), "time since the base passed zero upwards, periods"),
        ((-1.15 * high, 1.15 * high), "v and w, over b"),
    )
    .legend(Legend::Beside(182.0));
    panel.add(Shape::Line(1.0), [(0.0, 1.0), (1.0, 1.0)], INK, "walls, w = ± 1");
    panel.add(Shape::Line(1.0), [(0.0, -1.0), (1.0, -1.0)], INK, "");
    panel.add(Shape::Line(2.6), w, PARTICLE, "w = q₁ − q₂");
    panel.add(Shape::Line(2.6), v, EXACT, "v = q₁ + ε q₂");
    if let Some(point) = theory {
        let scene = Dimensionless { omega0: 1.0, b: 1.0, ..*p };
        let wave = Waveform::new(&scene, point.sigma, point.b, -FRAC_PI_2);
        for value in [Waveform::w, Waveform::v] {
            let places = (0..=POINTS).map(|n| (part(n), value(&wave, part(n) * TAU / wave.omega)));
            panel.add(Shape::Line(0.9), places, THEORY, FIRST_ORDER);
        }
    }
    let marks = impacts.iter().map(|(t, _, wall)| (*t, *wall));
    panel.add(Shape::Circle(6.0), marks, INK, "");
    panel
}

/// The impacts of one period of the base.
fn impacts(motion: &Periodic) -> Vec<Impact> {
    let part = |phase: f64| (phase / TAU).rem_euclid(1.0);
    let first = motion.bounces.iter();
    let mut impacts: Vec<Impact> = first
        .map(|impact| (part(impact.phase), impact.q2(), impact.wall))
        .collect();
    if motion.pattern.mirrored {
        let half = f64::from(motion.pattern.half_periods) / 2.0;
        let second = motion.bounces.iter();
        impacts.extend(second.map(|impact| (part(impact.phase + half * TAU), -impact.q2(), -impact.wall)));
    }
    impacts
}
