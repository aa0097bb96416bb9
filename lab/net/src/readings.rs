//! The readings of a rig in real time: one per sample, also where some of them are lost.

use std::collections::VecDeque;

use vines_testbench::rig::Sensors;

use crate::frame::Reading;
use crate::timing::Counters;

/// Largest number of readings that are kept: more than two periods of the finest sampling of a scene.
const MOST: usize = 1 << 18;

/// The readings that arrive by their numbers, in order: a lost one is reconstructed. It repeats the reading a period of the drive before it;
/// for the response plus a straight line that meets the readings on both sides of the gap. Before the end of the first period, or with a
/// drive without a frequency, only the line is left. The ground truth of a lost reading is not known.
#[derive(Debug, Clone, Default)]
pub struct Readings {
    /// Number of the present sample, and its reading if it has been taken.
    at: u64,
    now: Option<Reading>,
    /// Readings of the present and of later samples, in order, and the number after them.
    arrived: VecDeque<(u64, Reading)>,
    next: u64,
    /// Phase of the drive at the present sample, and its last step, turns.
    phase: f64,
    turn: f64,
    /// Phases, turns, and readings of the last period, in order.
    past: VecDeque<(f64, Sensors)>,
}

impl Readings {
    /// A reading has arrived; one that came twice, or after a later one, is not used. Returns the number of readings lost before it.
    pub fn arrive(&mut self, number: u64, reading: Reading, counters: &mut Counters) -> u64 {
        let Some(lost) = number.checked_sub(self.next) else {
            counters.late += 1;
            return 0;
        };
        self.next = number.saturating_add(1);
        self.arrived.push_back((number, reading));
        lost
    }

    /// The reading of the present sample; None if neither it nor a later one has arrived.
    pub fn take(&mut self, counters: &mut Counters) -> Option<Reading> {
        if self.now.is_none() {
            let (number, mut reading) = *self.arrived.front()?;
            let ahead = number - self.at;
            if ahead == 0 {
                self.arrived.pop_front();
            } else {
                counters.hold(ahead);
                reading = Reading {
                    sensors: self.fill(&reading.sensors, ahead),
                    ground_truth: None,
                };
            }
            self.keep(reading.sensors);
            self.now = Some(reading);
        }
        self.now
    }

    /// The next sample begins; the drive turns by `turn` turns until then.
    pub fn advance(&mut self, turn: f64) {
        self.at += 1;
        self.now = None;
        self.turn = turn;
        self.phase += turn;
    }

    /// Number of the reading after those that have arrived.
    pub fn next(&self) -> u64 {
        self.next
    }

    /// Phase of the drive at the present sample, turns.
    pub fn phase(&self) -> f64 {
        self.phase
    }

    /// Keeps the reading of the present sample.
    fn keep(&mut self, reading: Sensors) {
        let (phase, past) = (self.phase, &mut self.past);
        if past.back().is_some_and(|(last, _)| *last >= phase) || past.len() >= MOST {
            // The drive has no frequency, or its period exceeds what is kept.
            past.clear();
        }
        past.push_back((phase, reading));
        // One reading beyond the period: between it and the next one, the period begins.
        while past.get(1).is_some_and(|(second, _)| *second < phase - 1.0) {
            past.pop_front();
        }
    }

    /// The lost reading of the present sample, `ahead` samples before the reading `next`.
    fn fill(&self, next: &Sensors, ahead: u64) -> Sensors {
        let Some((last_phase, last)) = self.past.back() else {
            return *next;
        };
        let end = self.phase + ahead as f64 * self.turn;
        let before = [*last_phase, self.phase, end].map(|phase| self.period_before(phase));
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
        let after = self.past.partition_point(|(at, _)| *at <= phase);
        let after = after.min(self.past.len() - 1);
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
#[path = "../tests/unit/readings.rs"]
mod tests;
