//! Readings in place of lost ones.

use std::collections::VecDeque;

use vines_testbench::rig::Sensors;

/// Largest number of readings that are kept: more than two periods of the finest sampling of a scene.
const MOST: usize = 1 << 18;

/// The readings of the last period of the drive, from which lost ones are reconstructed: a lost reading repeats the one a period before
/// it; for the response plus a straight line that meets the readings on both sides of the gap. Before the end of the first period, or with a
/// drive without a frequency, only the line is left.
#[derive(Debug, Clone, Default)]
pub struct Bridge {
    /// Phase of the drive, turns, and the reading, in order.
    past: VecDeque<(f64, Sensors)>,
}

impl Bridge {
    /// Keeps the reading at `phase` (turns).
    pub fn keep(&mut self, phase: f64, reading: Sensors) {
        if self.past.back().is_some_and(|(last, _)| *last >= phase) || self.past.len() >= MOST {
            // The drive has no frequency, or its period exceeds what is kept.
            self.past.clear();
        }
        self.past.push_back((phase, reading));
        // One reading beyond the period: between it and the next one, the period begins.
        while self.past.get(1).is_some_and(|(second, _)| *second < phase - 1.0) {
            self.past.pop_front();
        }
    }

    /// The lost reading at `phase`, `ahead` samples of `turn` (turns) before the reading `next`.
    pub fn fill(&self, phase: f64, next: &Sensors, ahead: u64, turn: f64) -> Sensors {
        let Some((last_phase, last)) = self.past.back() else {
            return *next;
        };
        let end = phase + ahead as f64 * turn;
        let before = [*last_phase, phase, end].map(|phase| self.period_before(phase));
        let [at_last, at_phase, at_end] = match before {
            [Some(a), Some(b), Some(c)] => [a, b, c],
            _ => [Sensors::default(); 3],
        };
        let share = 1.0 / (ahead + 1) as f64;
        let value = |of: fn(&Sensors) -> f64| {
            let [start, end] = [of(last) - of(&at_last), of(next) - of(&at_end)];
            of(&at_phase) + start + share * (end - start)
        };
        let reference = |sensors: &Sensors| sensors.reference.unwrap_or_default();
        // A rig may stop its base where no sample of the drive arrives: after the gap it is elsewhere for one sample.
        let at_base = before[1].map_or_else(|| value(reference), |before| reference(&before));
        Sensors {
            response: value(|sensors| sensors.response),
            reference: next.reference.map(|_| at_base),
        }
    }

    /// The reading a period before `phase`, or as many periods as lie after the last reading.
    fn period_before(&self, phase: f64) -> Option<Sensors> {
        let (last, _) = self.past.back()?;
        let phase = phase - (phase - last).ceil().max(1.0);
        let after = self
            .past
            .partition_point(|(at, _)| *at <= phase)
            .min(self.past.len() - 1);
        let (first, second) = (self.past.get(after.checked_sub(1)?)?, self.past.get(after)?);
        let share = (phase - first.0) / (second.0 - first.0);
        let between = |a: f64, b: f64| a + share * (b - a);
        Some(Sensors {
            response: between(first.1.response, second.1.response),
            reference: first.1.reference.zip(second.1.reference).map(|(a, b)| between(a, b)),
        })
    }
}

#[cfg(test)]
#[path = "../tests/unit/bridge.rs"]
mod tests;
