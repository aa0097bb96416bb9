//! Coverage of the uncertainties: the share of the intervals that contain the exact value, over their nominal level.

use crate::calibration::{Calibration, Kind, Outcome};
use crate::report::figure::{Figure, Legend, Panel, line};
use crate::report::theme::{DECAY, EXACT, LOCK, UNSTABLE};

/// Nominal levels, and the half widths of their intervals in standard uncertainties.
const LEVELS: [(f64, f64); 11] = [
    (0.1, 0.1257),
    (0.2, 0.2533),
    (0.3, 0.3853),
    (0.4, 0.5244),
    (0.5, 0.6745),
    (0.6, 0.8416),
    (0.7, 1.0364),
    (0.8, 1.2816),
    (0.9, 1.6449),
    (0.95, 1.96),
    (0.99, 2.5758),
];

pub fn figure(found: &Calibration) -> Figure {
    let axis = |label| ((0.0, 1.0), label);
    let mut panel = Panel::new(
        axis("nominal level of the interval"),
        axis("share that contains the exact value"),
    )
    .heading(
        "Coverage of the uncertainties",
        &format!("{} runs at 40, 30 and 20 dB, three rigs", found.runs),
    )
    .legend(Legend::LowerRight);
    panel.dashed(vec![(0.0, 0.0), (1.0, 1.0)], line(UNSTABLE, 12), "exact coverage");
    for (kind, colour, label) in [
        (Kind::Lock, LOCK, "lock"),
        (Kind::Tracked, EXACT, "tracked, settled"),
        (Kind::Decay, DECAY, "decay, corrected"),
    ] {
        let of_kind: Vec<&Outcome> = found.outcomes.iter().filter(|one| one.kind == kind).collect();
        let share = |half: f64| {
            let inside = of_kind
                .iter()
                .filter(|one| one.error.abs() <= half * one.uncertainty)
                .count();
            inside as f64 / of_kind.len().max(1) as f64
        };
        panel.curve(
            LEVELS.map(|(level, half)| (level, share(half))).to_vec(),
            line(colour, 20),
            label,
        );
    }
    Figure::single(panel)
}
