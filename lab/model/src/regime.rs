//! Classification of regimes from a sequence of impacts.

use std::f64::consts::PI;
use std::fmt::{self, Display, Formatter};

use serde::Serializer;

use crate::numerics::{mean, standard_deviation};

words! {
    /// Regime of a response.
    Regime::word {
        /// The particle hits nothing: the linear mode.
        NoImpacts = "no impacts",
        /// Two impacts per period, on alternating walls, half a period apart.
        Symmetric = "symmetric 1:1",
        /// Two impacts per period, on alternating walls, at uneven intervals.
        Asymmetric = "asymmetric 1:1",
        /// Another pattern that repeats.
        Several = "n impacts",
        /// Nothing repeats, and disturbances neither grow nor shrink: the largest Lyapunov exponent is zero within its uncertainty.
        QuasiPeriodic = "quasi-periodic",
        /// The largest Lyapunov exponent is positive, and at least a fifth of the impacts belong to captures into 1:1 resonance, which
        /// are lost again: a chaotic strongly modulated response.
        Modulated = "modulated",
        /// The largest Lyapunov exponent is positive, and fewer impacts belong to captures.
        Chaotic = "chaotic",
        /// None of these was shown within the periods that were simulated.
        Undecided = "undecided",
        /// Not 1:1; a record too short, or without impact data, cannot say more.
        Other = "other",
        /// Steady and off the linear mode; no harmonic shows whether it is symmetric.
        Unresolved = "steady, symmetry unresolved",
        /// The response alone shows neither impacts nor the linear mode.
        NotEstablished = "not established",
        /// No data to determine it from.
        Unknown = "unknown",
    }
}

impl Regime {
    /// Those of the map, the first ones; they exclude each other.
    pub const SIMULATED: [Regime; 8] = match Self::ALL.first_chunk() {
        Some(simulated) => *simulated,
        None => unreachable!(),
    };

    /// What the response alone shows of it: words for a rig that may contain no particle.
    pub fn motion(&self) -> &'static str {
        match self {
            Regime::NoImpacts => "near the linear response",
            Regime::Symmetric => "nonlinear, symmetric",
            Regime::Asymmetric => "nonlinear, asymmetric",
            Regime::Unresolved => "nonlinear, symmetry unresolved",
            Regime::NotEstablished => "not established",
            Regime::Unknown => "unknown",
            _ => "irregular",
        }
    }

    /// [`Self::motion`] as a field of a file.
    pub fn serialize_motion<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.motion())
    }

    /// Its short name, as in a table.
    pub fn name(&self) -> &'static str {
        match self {
            Regime::Other => "irregular",
            Regime::Unresolved => "steady and nonlinear (symmetry unresolved)",
            Regime::NotEstablished => "not established (no evidence of impacts)",
            Regime::Unknown => "unknown (the rig does not report impacts)",
            other => other.word(),
        }
    }
}

impl Display for Regime {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Regime::NoImpacts => "without impacts (the linear mode)",
            other => other.name(),
        })
    }
}

/// One impact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Impact {
    /// When: s, or phase of the base in rad.
    pub time: f64,
    /// Relative velocity just before; its sign identifies the wall.
    pub velocity: f64,
}

impl Impact {
    fn on_other_wall(&self, other: &Impact) -> bool {
        self.velocity * other.velocity < 0.0
    }
}

/// Largest standard deviation of the intervals, relative to their mean, in a symmetric regime of a measured motion, which
/// noise disturbs.
pub const MEASURED: f64 = 0.01;
/// Deviation of the impacts per period from two that still counts as two.
const COUNT: f64 = 0.05;

/// The regime of impacts that come `per_period` times a period: symmetric 1:1 where the intervals differ by no more than
/// `tolerance` ([`MEASURED`]), asymmetric 1:1, or another one.
pub fn one_to_one(impacts: &[Impact], per_period: f64, tolerance: f64) -> Regime {
    let alternate = impacts.windows(2).all(|pair| pair[0].on_other_wall(&pair[1]));
    if (per_period - 2.0).abs() > COUNT || !alternate {
        return Regime::Other;
    }
    let intervals: Vec<f64> = impacts.windows(2).map(|pair| pair[1].time - pair[0].time).collect();
    let spread = standard_deviation(&intervals) / mean(intervals.iter().copied());
    if spread <= tolerance {
        Regime::Symmetric
    } else {
        Regime::Asymmetric
    }
}

/// Smallest number of consecutive impacts, on alternating walls, of a capture into 1:1 resonance.
const CAPTURED: usize = 8;
/// Deviation of an interval from half a period, rad, in a capture.
const IN_STEP: f64 = 0.15 * PI;

/// Share of the impacts that belong to captures into 1:1 resonance: at least eight in a row, on alternating walls, half a
/// period apart within 15 %. Times are phases of the base, rad.
pub fn synchrony(impacts: &[Impact]) -> f64 {
    let in_step =
        |impact: &Impact, next: &Impact| impact.on_other_wall(next) && (next.time - impact.time - PI).abs() < IN_STEP;
    let captured: usize = impacts
        .chunk_by(in_step)
        .map(<[Impact]>::len)
        .filter(|length| *length >= CAPTURED)
        .sum();
    captured as f64 / impacts.len().max(1) as f64
}

/// Relative deviation of an interval from the one before at which the impacts have lost synchrony.
const SYNCHRONY_LOST: f64 = 0.25;

/// Time of the last impact in synchrony with a motion whose half period starts as `half_period` and changes slowly: on the
/// other wall than the impact before, and after an interval about as long as the last one.
pub fn end_of_synchrony(impacts: &[Impact], half_period: f64) -> Option<f64> {
    let mut expected = half_period;
    let mut end = impacts.first()?.time;
    for pair in impacts.windows(2) {
        let interval = pair[1].time - pair[0].time;
        if (interval / expected - 1.0).abs() > SYNCHRONY_LOST || !pair[0].on_other_wall(&pair[1]) {
            break;
        }
        expected = interval;
        end = pair[1].time;
    }
    Some(end)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

    /// Impacts at phases of a period, rad, on walls, repeated.
    fn impacts(pattern: [(f64, f64); 2], repeats: usize) -> Vec<Impact> {
        let period =
            |n: usize| pattern.map(|(phase, wall)| Impact { time: phase + TAU * n as f64, velocity: 1.5 * wall });
        (0..repeats).flat_map(period).collect()
    }

    #[test]
    fn captures_are_long_runs_in_step() {
        let even = [(0.3, 1.0), (0.3 + PI, -1.0)];
        assert_eq!(synchrony(&impacts(even, 10)), 1.0);
        // Of twelve impacts in step and eight on the same wall, the first count.
        let mut mixed = impacts(even, 6);
        mixed.extend((0..8).map(|n| Impact { time: 40.0 + 0.7 * f64::from(n), velocity: 0.2 }));
        assert!((synchrony(&mixed) - 0.6).abs() < 1e-12);
        assert_eq!(synchrony(&[]), 0.0);
    }

    #[test]
    fn one_to_one_is_two_impacts_per_period_on_both_walls_and_symmetric_at_even_intervals() {
        for (second, wall, per_period, regime) in [
            (0.3, -1.0, 2.0, Regime::Symmetric),
            (0.5, -1.0, 2.0, Regime::Asymmetric),
            (0.3, -1.0, 3.0, Regime::Other),
            (0.3, 1.0, 2.0, Regime::Other),
        ] {
            let impacts = impacts([(0.3, 1.0), (second + PI, wall)], 20);
            assert_eq!(one_to_one(&impacts, per_period, MEASURED), regime);
        }
    }

    #[test]
    fn synchrony_ends_at_the_first_interval_that_jumps() {
        let mut sequence = impacts([(0.0, 1.0), (PI, -1.0)], 5);
        assert_eq!(end_of_synchrony(&sequence, PI), Some(9.0 * PI));
        sequence[6].time += 1.0;
        assert_eq!(end_of_synchrony(&sequence, PI), Some(5.0 * PI));
        assert_eq!(end_of_synchrony(&[], PI), None);
    }
}
