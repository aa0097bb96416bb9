//! Regimes, told from a sequence of impacts.

use std::f64::consts::{PI, TAU};

use serde::Serialize;

/// What the response settles into.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub enum Regime {
    /// The particle hits nothing: the linear response.
    #[serde(rename = "no impacts")]
    NoImpacts,
    /// Two impacts per period, half a period apart.
    #[serde(rename = "symmetric 1:1")]
    Symmetric,
    /// Two impacts per period, on alternating walls, at uneven intervals.
    #[serde(rename = "asymmetric 1:1")]
    Asymmetric,
    /// Another pattern that repeats.
    #[serde(rename = "n impacts")]
    Several,
    /// Nothing repeats: the motion is captured into 1:1 resonance and lost again (strongly modulated response), or at least
    /// disturbances do not grow.
    #[serde(rename = "modulated")]
    Modulated,
    /// Nothing repeats, disturbances grow, and there are hardly any captures.
    #[serde(rename = "chaotic")]
    Chaotic,
    /// Impacts accumulate, and the particle rests on a wall for a while.
    #[serde(rename = "sticking")]
    Sticking,
}

impl Regime {
    /// All of them, from the least to the most impacts.
    pub const ALL: [Regime; 7] = [
        Regime::NoImpacts,
        Regime::Symmetric,
        Regime::Asymmetric,
        Regime::Several,
        Regime::Modulated,
        Regime::Chaotic,
        Regime::Sticking,
    ];

    /// Its name.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Regime::NoImpacts => "no impacts",
            Regime::Symmetric => "symmetric 1:1",
            Regime::Asymmetric => "asymmetric 1:1",
            Regime::Several => "n impacts",
            Regime::Modulated => "modulated",
            Regime::Chaotic => "chaotic",
            Regime::Sticking => "sticking",
        }
    }
}

/// One impact of a record.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Hit {
    /// Phase of the base since the record began, rad.
    pub phase: f64,
    /// Sign of the wall.
    pub wall: f64,
    /// Relative velocity just before, over `b omega0`.
    pub velocity: f64,
}

/// A repeating pattern: impacts, and periods of the base.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Pattern {
    pub impacts: usize,
    pub periods: u32,
    pub regime: Regime,
}

/// Longest pattern looked for, impacts.
const LONGEST: usize = 96;
/// Two impacts are the same within this, rad and relative velocity: far above what is left of a transient.
const SAME: f64 = 2e-3;
/// Intervals differ from half a period by less than this, rad, in a symmetric motion.
const EVEN: f64 = 1e-2;

/// The shortest pattern that the whole record repeats at least twice.
pub(super) fn pattern(hits: &[Hit]) -> Option<Pattern> {
    (1..=LONGEST.min(hits.len() / 3)).find_map(|impacts| {
        let periods = ((hits[impacts].phase - hits[0].phase) / TAU).round();
        let repeats = periods > 0.0
            && hits.iter().zip(&hits[impacts..]).all(|(one, other)| {
                one.wall == other.wall
                    && (other.phase - one.phase - periods * TAU).abs() < SAME
                    && (other.velocity - one.velocity).abs() < SAME * (1.0 + one.velocity.abs())
            });
        repeats.then(|| Pattern {
            impacts,
            periods: periods as u32,
            regime: regime(hits, impacts, periods),
        })
    })
}

/// Impacts in a row, on alternating walls, that make a capture into 1:1 resonance.
const CAPTURED: usize = 8;
/// Deviation of an interval from half a period, rad, that still is in step.
const IN_STEP: f64 = 0.15 * PI;

/// Share of the impacts that belong to captures into 1:1 resonance: at least eight in a row, on alternating walls, half a
/// period apart within 15 %.
pub(super) fn synchrony(hits: &[Hit]) -> f64 {
    let in_step = |one: &Hit, other: &Hit| {
        one.wall != other.wall && (other.phase - one.phase - PI).abs() < IN_STEP
    };
    let captured: usize = hits
        .chunk_by(in_step)
        .map(<[Hit]>::len)
        .filter(|length| *length >= CAPTURED)
        .sum();
    captured as f64 / hits.len().max(1) as f64
}

fn regime(hits: &[Hit], impacts: usize, periods: f64) -> Regime {
    if impacts != 2 || periods != 1.0 || hits[0].wall == hits[1].wall {
        return Regime::Several;
    }
    if (hits[1].phase - hits[0].phase - PI).abs() < EVEN {
        Regime::Symmetric
    } else {
        Regime::Asymmetric
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn captures_are_long_runs_in_step() {
        let even = hits(&[(0.3, 1.0), (0.3 + PI, -1.0)], 1, 10);
        assert_eq!(synchrony(&even), 1.0);
        // Of twelve impacts in step and eight on the same wall, the first count.
        let mut mixed = hits(&[(0.3, 1.0), (0.3 + PI, -1.0)], 1, 6);
        mixed.extend((0..8).map(|n| Hit {
            phase: 40.0 + 0.7 * f64::from(n),
            wall: 1.0,
            velocity: 0.2,
        }));
        assert!((synchrony(&mixed) - 0.6).abs() < 1e-12);
        assert_eq!(synchrony(&[]), 0.0);
    }

    fn hits(pattern: &[(f64, f64)], periods: usize, repeats: usize) -> Vec<Hit> {
        (0..repeats)
            .flat_map(|n| {
                pattern.iter().map(move |(phase, wall)| Hit {
                    phase: phase + TAU * (n * periods) as f64,
                    wall: *wall,
                    velocity: 1.5 * wall,
                })
            })
            .collect()
    }

    fn named(hits: &[Hit]) -> Option<(usize, u32, Regime)> {
        pattern(hits).map(|one| (one.impacts, one.periods, one.regime))
    }

    #[test]
    fn even_intervals_are_symmetric_and_uneven_ones_are_not() {
        let even = hits(&[(0.3, 1.0), (0.3 + PI, -1.0)], 1, 20);
        assert_eq!(named(&even), Some((2, 1, Regime::Symmetric)));
        let uneven = hits(&[(0.3, 1.0), (0.5 + PI, -1.0)], 1, 20);
        assert_eq!(named(&uneven), Some((2, 1, Regime::Asymmetric)));
    }

    #[test]
    fn longer_patterns_are_counted() {
        let three = hits(&[(0.3, 1.0), (0.9, 1.0), (3.0, -1.0)], 1, 20);
        assert_eq!(named(&three), Some((3, 1, Regime::Several)));
        let doubled = hits(&[(0.3, 1.0), (3.4, -1.0), (6.7, 1.0), (9.8, -1.0)], 2, 20);
        assert_eq!(named(&doubled), Some((4, 2, Regime::Several)));
    }

    #[test]
    fn a_drifting_sequence_has_no_pattern() {
        let mut drifting = hits(&[(0.3, 1.0), (0.3 + PI, -1.0)], 1, 40);
        for (n, hit) in drifting.iter_mut().enumerate() {
            hit.phase += 0.2 * (0.37 * n as f64).sin();
        }
        assert_eq!(named(&drifting), None);
        assert_eq!(named(&[]), None);
    }
}
