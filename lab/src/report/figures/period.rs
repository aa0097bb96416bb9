//! One period of the motion, with its impacts: exact, and as first-order theory reconstructs it.

use std::f64::consts::{FRAC_PI_2, TAU};

use crate::numerics::range;
use crate::orbit::Periodic;
use crate::report::figure::{Figure, Legend, Panel, Place, line, rig};
use crate::report::theme::{DECAY, EXACT, LOCK, THEORY};
use crate::scene::Dimensionless;
use crate::theory::{BackbonePoint, Waveform};

const SIZE: (u32, u32) = (860, 760);
const UPPER: u32 = 390;
const POINTS: usize = 400;

/// One period of `motion`, and theory's where it has one.
pub fn figure(p: &Dimensionless, motion: &Periodic, theory: Option<&BackbonePoint>) -> Figure {
    let rows = motion.motion(p, POINTS);
    let impacts = impacts(motion);
    Figure::new(
        SIZE,
        vec![
            displacements(p, motion, &rows, &impacts).at([0, 0, SIZE.0, UPPER]),
            coordinates(p, &rows, &impacts, theory).at([0, UPPER, SIZE.0, SIZE.1 - UPPER]),
        ],
    )
}

fn part(n: usize) -> f64 {
    n as f64 / POINTS as f64
}

/// What a function of (tau, q1, q1', q2, q2') says over the period.
fn course(rows: &[[f64; 5]], what: impl Fn(&[f64; 5]) -> f64) -> Vec<Place> {
    let rows = rows.iter().enumerate();
    rows.map(|(n, row)| (part(n), what(row))).collect()
}

/// Primary mass with its walls, and the particle between them.
fn displacements(p: &Dimensionless, motion: &Periodic, rows: &[[f64; 5]], impacts: &[(f64, f64, f64)]) -> Panel {
    let caption = format!(
        "{}, G = {:.3}, exact orbit at σ = {:.4}; lengths over b",
        rig(p),
        motion.g,
        motion.sigma
    );
    let (q1, q2) = (course(rows, |row| row[1]), course(rows, |row| row[3]));
    let farthest = q1.iter().chain(&q2).map(|(_, value)| value.abs() + 1.0);
    let (_, reach) = range((0.0, 1.0), farthest);
    let mut panel = Panel::new(
        ((0.0, 1.0), ""),
        ((-1.05 * reach, 1.7 * reach), "displacements, over b"),
    )
    .heading("One period of the locked motion", &caption)
    .legend(Legend::UpperRight);
    for side in [1.0, -1.0] {
        let wall = course(rows, |row| row[1] + side);
        panel.curve(wall, line(LOCK, 24), "walls, q₁ ± 1");
    }
    panel.curve(q1, line(EXACT, 24), "primary mass q₁");
    panel.dashed(q2, line(DECAY, 24), "particle q₂");
    let marks = impacts.iter().map(|(t, q2, _)| (*t, *q2)).collect();
    panel.circles(marks, 6, line(LOCK, 20), "impacts");
    panel
}

/// Centre of mass and relative displacement.
fn coordinates(
    p: &Dimensionless,
    rows: &[[f64; 5]],
    impacts: &[(f64, f64, f64)],
    theory: Option<&BackbonePoint>,
) -> Panel {
    let w = course(rows, |row| row[1] - row[3]);
    let v = course(rows, |row| row[1] + p.epsilon * row[3]);
    let (_, high) = range((0.0, 1.0), v.iter().map(|(_, value)| value.abs()));
    let mut panel = Panel::new(
        ((0.0, 1.0), "time since the base passed zero upwards, in periods"),
        ((-1.15 * high, 1.9 * high), "v and w, over b"),
    )
    .legend(Legend::UpperRight);
    for side in [-1.0, 1.0] {
        panel.curve(vec![(0.0, side), (1.0, side)], line(LOCK, 10), "");
    }
    panel.curve(w, line(EXACT, 30), "w = q₁ − q₂, exact");
    panel.curve(v, line(DECAY, 30), "v = q₁ + ε q₂, exact");
    if let Some(point) = theory {
        let scene = Dimensionless { omega0: 1.0, b: 1.0, ..*p };
        let wave = Waveform::new(&scene, point.sigma, point.b, -FRAC_PI_2);
        let time = |n: usize| part(n) * TAU / wave.omega;
        let of = |what: fn(&Waveform, f64) -> f64| -> Vec<Place> {
            let all = 0..=POINTS;
            all.map(|n| (part(n), what(&wave, time(n)))).collect()
        };
        panel.dashed(of(Waveform::w), line(THEORY, 12), "first-order theory");
        panel.dashed(of(Waveform::v), line(THEORY, 12), "first-order theory");
    }
    let marks = impacts.iter().map(|(t, _, wall)| (*t, *wall)).collect();
    panel.circles(marks, 6, line(LOCK, 20), "");
    panel
}

/// Impacts of one period of the base: part of the period, displacement of the particle, wall.
fn impacts(motion: &Periodic) -> Vec<(f64, f64, f64)> {
    let part = |phase: f64| (phase / TAU).rem_euclid(1.0);
    let first = motion.bounces.iter();
    let mut found: Vec<(f64, f64, f64)> = first.map(|one| (part(one.phase), one.q2(), one.wall)).collect();
    if motion.pattern.mirrored {
        let half = f64::from(motion.pattern.half_periods) / 2.0;
        let second = motion.bounces.iter();
        found.extend(second.map(|one| (part(one.phase + half * TAU), -one.q2(), -one.wall)));
    }
    found
}
