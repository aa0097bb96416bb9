//! One period of the motion, with its impacts: exact, and as first-order theory reconstructs it.

use std::f64::consts::TAU;

use plotters::chart::SeriesLabelPosition;
use plotters::prelude::*;

use super::chart::{at, curve, legend, line, plane, px, svg_of};
use super::theme::{DECAY, EXACT, LOCK, THEORY};
use crate::orbit::Periodic;
use crate::scene::Dimensionless;
use crate::theory::{BackbonePoint, Waveform};

const SIZE: (u32, u32) = (860, 760);
const UPPER: u32 = 390;
const POINTS: usize = 400;

/// Draws one period of `motion`, and theory's where it has one.
pub fn draw(
    p: &Dimensionless,
    motion: &Periodic,
    theory: Option<&BackbonePoint>,
) -> Result<String, String> {
    let caption = format!(
        "ε = {:.5}, λ = {:.3}, r = {}, G = {:.3}, exact orbit at σ = {:.4}; lengths over b",
        p.epsilon, p.lambda, p.r, motion.g, motion.sigma
    );
    let rows = motion.motion(p, POINTS);
    let part = |n: usize| n as f64 / POINTS as f64;
    let of = |what: &dyn Fn(&[f64; 5]) -> f64| -> Vec<(f64, f64)> {
        rows.iter()
            .enumerate()
            .map(|(n, row)| (part(n), what(row)))
            .collect()
    };
    let (q1, q2) = (of(&|row| row[1]), of(&|row| row[3]));
    let w = of(&|row| row[1] - row[3]);
    let v = of(&|row| row[1] + p.epsilon * row[3]);
    let reach = q1
        .iter()
        .chain(&q2)
        .fold(1.0, |most: f64, (_, value)| most.max(value.abs() + 1.0));
    let impacts = impacts(motion);
    svg_of(SIZE, |area| {
        let (upper, lower) = area.split_vertically(px(UPPER));
        let mut chart = plane(
            &upper,
            Some(("One period of the locked motion", &caption)),
            ((0.0, 1.0), ""),
            ((-1.05 * reach, 1.7 * reach), "displacements, over b"),
        )?;
        let wall = |side: f64| q1.iter().map(|(t, q)| (*t, q + side)).collect::<Vec<_>>();
        let walls = line(LOCK, 24);
        curve(&mut chart, wall(1.0), walls, false, Some("walls, q₁ ± 1"))?;
        curve(&mut chart, wall(-1.0), walls, false, None)?;
        curve(
            &mut chart,
            q1.clone(),
            line(EXACT, 24),
            false,
            Some("primary mass q₁"),
        )?;
        curve(
            &mut chart,
            q2.clone(),
            line(DECAY, 24),
            true,
            Some("particle q₂"),
        )?;
        let marks = impacts.iter().map(|(t, q2, _)| (*t, *q2));
        chart
            .draw_series(marks.map(|place| Circle::new(place, px(6), line(LOCK, 20))))?
            .label("impacts")
            .legend(|(x, y)| Circle::new((x + at(15), y), px(5), line(LOCK, 20)));
        legend(&mut chart, SeriesLabelPosition::UpperRight)?;

        let high = v
            .iter()
            .fold(1.0, |most: f64, (_, value)| most.max(value.abs()));
        let mut chart = plane(
            &lower,
            None,
            (
                (0.0, 1.0),
                "time since the base passed zero upwards, in periods",
            ),
            ((-1.15 * high, 1.9 * high), "v and w, over b"),
        )?;
        for side in [-1.0, 1.0] {
            curve(
                &mut chart,
                vec![(0.0, side), (1.0, side)],
                line(LOCK, 10),
                false,
                None,
            )?;
        }
        curve(
            &mut chart,
            w,
            line(EXACT, 30),
            false,
            Some("w = q₁ − q₂, exact"),
        )?;
        curve(
            &mut chart,
            v,
            line(DECAY, 30),
            false,
            Some("v = q₁ + ε q₂, exact"),
        )?;
        if let Some(point) = theory {
            let scene = Dimensionless {
                omega0: 1.0,
                b: 1.0,
                ..*p
            };
            let wave = Waveform::new(&scene, point.sigma, point.b, -std::f64::consts::FRAC_PI_2);
            let time = |n: usize| part(n) * TAU / wave.omega;
            let curve_of = |what: &dyn Fn(f64) -> f64| -> Vec<(f64, f64)> {
                (0..=POINTS).map(|n| (part(n), what(time(n)))).collect()
            };
            let style = line(THEORY, 12);
            let label = Some("first-order theory");
            curve(&mut chart, curve_of(&|t| wave.w(t)), style, true, label)?;
            curve(&mut chart, curve_of(&|t| wave.v(t)), style, true, None)?;
        }
        let marks = impacts.iter().map(|(t, _, wall)| (*t, *wall));
        chart.draw_series(marks.map(|place| Circle::new(place, px(6), line(LOCK, 20))))?;
        legend(&mut chart, SeriesLabelPosition::UpperRight)
    })
}

/// Impacts of one period of the base: part of the period, displacement of the particle, wall.
fn impacts(motion: &Periodic) -> Vec<(f64, f64, f64)> {
    let part = |phase: f64| (phase / TAU).rem_euclid(1.0);
    let mut found: Vec<(f64, f64, f64)> = motion
        .bounces
        .iter()
        .map(|one| (part(one.phase), one.q2(), one.wall))
        .collect();
    if motion.shape.mirrored {
        let half = f64::from(motion.shape.half_periods) / 2.0;
        let mirrored = motion
            .bounces
            .iter()
            .map(|one| (part(one.phase + half * TAU), -one.q2(), -one.wall));
        found.extend(mirrored);
    }
    found
}
