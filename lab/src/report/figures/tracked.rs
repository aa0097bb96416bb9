//! The tracked backbone: the points held with the loop closed, on the exact curve and that of theory.

use super::{backbone::add_backbones, decay_points, error_bars};
use crate::backbone::Point;
use crate::comparison::TrackedComparison;
use crate::numerics::range;
use crate::report::figure::{DETUNING, Figure, Legend, Panel, SIZE, amplitude, caption, line};
use crate::report::theme::{DECAY, EXACT, THEORY};
use crate::theory::{self, SlowFlow};

/// The points, and the top of the axis of their amplitudes.
fn points(tracked: &TrackedComparison) -> (impl Iterator<Item = Point> + Clone, f64) {
    let all = tracked.points.iter().map(|one| one.point);
    let top = all.clone().fold(0.5, |most: f64, one| most.max(1.15 * one.at.c));
    (all, top)
}

/// The points in the plane of amplitude and detuning; points that are not settled are crossed.
pub fn figure(tracked: &TrackedComparison) -> Figure {
    Figure::single(amplitude_panel(tracked))
}

/// The same beside the drive over amplitude.
pub fn figure_with_drive(tracked: &TrackedComparison) -> Figure {
    let (width, height) = SIZE;
    let drive = drive_panel(tracked).at([width, 0, width, height]);
    Figure::new((2 * width, height), vec![amplitude_panel(tracked), drive])
}

fn amplitude_panel(tracked: &TrackedComparison) -> Panel {
    let p = &tracked.parameters;
    let (all, top) = points(tracked);
    let (low, high) = range((-1.6, 0.6), all.clone().map(|one| one.at.sigma));
    let x = (low - 0.1 * (high - low), high + 0.1 * (high - low));
    let (least, most) = range((f64::MAX, f64::MIN), all.clone().map(|one| one.at.g));
    let text = caption(p, most).replace(&format!("G = {most:.3}"), &format!("G from {least:.3} to {most:.3}"));
    let mut panel = Panel::new((x, DETUNING), ((0.0, top), amplitude(p)))
        .heading("Backbone, tracked with the loop closed", &text)
        .legend(Legend::UpperRight);
    add_backbones(&mut panel, p, x, (0.0, top));
    let place = |one: Point| (one.at.sigma, one.at.c);
    decay_points(&mut panel, all.clone().map(place), "tracked");
    let bars = all.clone().map(|one| (place(one), 1.96 * one.at.u_sigma));
    error_bars(&mut panel, bars, false);
    let unsettled = all.filter(|one| !one.settled).map(place).collect();
    panel.crosses(unsettled, line(DECAY, 20), "not settled in time");
    panel
}

fn drive_panel(tracked: &TrackedComparison) -> Panel {
    let p = &tracked.parameters;
    let (all, top) = points(tracked);
    let flow = SlowFlow::new(p.lambda, p.r);
    let theory = theory::backbone(p, flow.manifold.b_min(), 1.3, 600);
    let theory = theory.iter().map(|one| (one.c, one.g));
    let exact = tracked.exact.places().iter().map(|one| (one[0], one[2]));
    let (_, most) = range((0.0, 0.1), all.clone().map(|one| one.at.g));
    let high = 1.3 * most;
    let inside = |place: &(f64, f64)| place.0 <= top && place.1 <= high;
    let mut panel = Panel::new(
        ((0.0, top), amplitude(p)),
        ((0.0, high), "drive G, base amplitude over b ε"),
    )
    .heading("The drive that holds each level", "")
    .legend(Legend::LowerRight);
    let theory = theory.filter(inside).collect();
    panel.dashed(theory, line(THEORY, 20), "first-order theory");
    let exact = exact.filter(inside).collect();
    panel.curve(exact, line(EXACT, 16), "exact orbits");
    decay_points(&mut panel, all.clone().map(|one| (one.at.c, one.at.g)), "tracked");
    error_bars(
        &mut panel,
        all.map(|one| ((one.at.c, one.at.g), 1.96 * one.at.u_g)),
        true,
    );
    panel
}
