//! The approach to the slow invariant manifold, and the way along it: the modulation of first-order theory, impact by impact.

use plotters::chart::SeriesLabelPosition;
use plotters::prelude::*;

use super::chart::{at, caption, curve, legend, line, plane, px, svg};
use super::lines::{Marked, pieces};
use super::theme::{DECAY, EXACT, LOCK, THEORY, UNSTABLE};
use crate::scene::Dimensionless;
use crate::theory::{BackbonePoint, SlowFlow, impacts_stable};

/// Starts off the manifold: C and B in parts of those at the locked point.
const STARTS: [(f64, f64); 4] = [(1.35, 0.93), (0.65, 1.07), (0.75, 0.8), (1.2, 1.14)];
/// Most impacts followed.
const IMPACTS: usize = 400;
const POINTS: usize = 300;

/// Draws walks with the drive on, which end at the locked point, and one without it, from there down to the fold.
pub fn draw(p: &Dimensionless, lock: &BackbonePoint) -> Result<String, String> {
    let flow = SlowFlow::new(p.lambda, p.r);
    let gamma = -std::f64::consts::FRAC_PI_2;
    let walk = |g: f64, sigma: f64, (c, b): (f64, f64)| -> Vec<(f64, f64)> {
        let phases = (b, flow.psi(lock.b, gamma));
        let impacts = flow.modulation(p.epsilon, (g, sigma), (c, gamma), phases);
        let places = impacts.take(IMPACTS).map(|one| (one.c, one.b));
        std::iter::once((c, b)).chain(places).collect()
    };
    let x = (0.0, 1.6 * lock.c);
    let y = (0.0, 1.35 * lock.b);
    let inside = |place: &(f64, f64)| place.0 <= x.1 && (y.0..=y.1).contains(&place.1);
    svg(|area| {
        let mut chart = plane(
            area,
            Some((
                "Approach to the slow invariant manifold, impact by impact",
                &caption(p, lock.g),
            )),
            (x, "amplitude C of v, over b"),
            (y, "particle speed B, over b ω₀"),
        )?;
        let manifold: Vec<Marked> = (0..=POINTS)
            .map(|n| y.1 * n as f64 / POINTS as f64)
            .map(|b| ((flow.manifold.c(b), b), impacts_stable(&flow.manifold, b)))
            .filter(|(place, _)| inside(place))
            .collect();
        let mut labels = [
            Some("manifold, 1:1 impacts stable"),
            Some("manifold, unstable"),
        ];
        pieces(
            &mut chart,
            &manifold,
            [line(THEORY, 30), line(UNSTABLE, 20)],
            &mut labels,
        )?;
        let mut label = Some("driven at phase resonance, from off the manifold");
        for (c, b) in STARTS {
            let places = walk(lock.g, lock.sigma, (c * lock.c, b * lock.b));
            let places: Vec<_> = places.into_iter().take_while(inside).collect();
            curve(&mut chart, places.clone(), line(EXACT, 6), false, None)?;
            let dots = places
                .into_iter()
                .map(|place| Circle::new(place, px(3), EXACT.filled()));
            let drawn = chart.draw_series(dots)?;
            if let Some(label) = label.take() {
                drawn
                    .label(label)
                    .legend(|(x, y)| Circle::new((x + at(15), y), px(3), EXACT.filled()));
            }
        }
        let falling = walk(0.0, lock.sigma, (lock.c, lock.b));
        let falling: Vec<_> = falling.into_iter().take_while(inside).collect();
        chart
            .draw_series(
                falling
                    .into_iter()
                    .map(|place| Circle::new(place, px(4), line(DECAY, 16))),
            )?
            .label("without drive, until synchrony is lost")
            .legend(|(x, y)| Circle::new((x + at(15), y), px(4), line(DECAY, 16)));
        let square = |(x, y): (i32, i32)| {
            Rectangle::new(
                [(x - at(5), y - at(5)), (x + at(5), y + at(5))],
                LOCK.filled(),
            )
        };
        chart
            .draw_series(std::iter::once(
                EmptyElement::at((lock.c, lock.b)) + square((0, 0)),
            ))?
            .label("phase resonance")
            .legend(move |(x, y)| square((x + at(15), y)));
        legend(&mut chart, SeriesLabelPosition::LowerRight)
    })
}
