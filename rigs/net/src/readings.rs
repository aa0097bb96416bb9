//! The readings of a rig in real time: one per sample, also where some of them are lost.

use std::collections::VecDeque;

use vines_rig::Sensors;

use crate::frame::Reading;
use crate::timing::Counters;

/// Largest number of readings that are kept: more than two periods of the finest sampling of a scene.
const MOST_READINGS: usize = 1 << 18;

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
        if past.back().is_some_and(|(last, _)| *last >= phase) || past.len() >= MOST_READINGS {
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
mod tests {
    use std::f64::consts::TAU;
    use std::ops::Range;

    use vines_bench::experiment;
    use vines_bench::rig::{BuiltIn, Chain, Drive, GroundTruth, Rig, RigError, Simulated};
    use vines_bench::scene::{Override, PAPER, Scene};

    use super::*;

    /// A periodic motion with harmonics, whose amplitude and mean drift.
    fn motion(n: u64) -> Sensors {
        let (turns, drift) = (0.0103 * n as f64, n as f64 / 1e5);
        let response = (1.0 + drift) * (TAU * turns).sin() + 0.2 * (3.0 * TAU * turns).cos() + drift;
        Sensors { response, reference: Some(0.1 * (TAU * turns).cos()) }
    }

    /// A reading that has arrived.
    fn measured(sensors: Sensors) -> Reading {
        Reading { sensors, ground_truth: Some(GroundTruth::default()) }
    }

    /// The readings after a gap of `lost` ones after `known` ones, by their numbers; the drive turns by `turn`.
    fn bridged(known: u64, lost: u64, turn: f64, motion: fn(u64) -> Sensors) -> Vec<(u64, Sensors)> {
        let (mut readings, mut counters) = (Readings::default(), Counters::default());
        let sample = |n| {
            if n < known {
                assert_eq!(readings.arrive(n, measured(motion(n)), &mut counters), 0);
            } else if n == known {
                let later = known + lost;
                assert_eq!(readings.arrive(later, measured(motion(later)), &mut counters), lost);
                assert_eq!(readings.arrive(known, measured(motion(known)), &mut counters), 0);
                assert_eq!(counters.late, 1, "a reading after a later one");
            }
            let taken = readings.take(&mut counters).unwrap();
            assert_eq!(counters.longest, if n < known { 0 } else { lost });
            assert_eq!(taken.ground_truth.is_none(), (known..known + lost).contains(&n));
            readings.advance(turn);
            (n, taken.sensors)
        };
        (0..=known + lost).map(sample).skip(known as usize).collect()
    }

    #[test]
    fn a_gap_of_any_length_in_a_periodic_motion_is_bridged_with_its_harmonics_and_without_a_period_by_a_line() {
        for (known, lost, allowed) in [
            (600, 1, [0.01, 1e-4]),
            (600, 4, [0.01, 1e-4]),
            (600, 27, [0.01, 1e-4]),
            (600, 90, [0.01, 1e-4]),
            (600, 250, [0.01, 1e-4]),
            (10, 4, [0.03, 1e-3]),
        ] {
            for (n, filled) in bridged(known, lost, 0.0103, motion) {
                let expected = motion(n);
                let response = (filled.response - expected.response).abs();
                let reference = (filled.reference.unwrap() - expected.reference.unwrap()).abs();
                assert!(
                    response < allowed[0] && reference < allowed[1],
                    "{lost}: {response} {reference}"
                );
            }
        }
        // Nothing at all before the gap, and no frequency.
        assert_eq!(bridged(0, 3, 0.0, motion)[0].1, motion(3));
        let line = |n: u64| Sensors {
            response: 1.0 + 2.0 * n.saturating_sub(5) as f64,
            reference: None,
        };
        assert_eq!(bridged(6, 1, 0.0, line)[0].1.response, 3.0);
    }

    /// A rig whose readings and drives are lost in a gap. Until its end the rig has the last drive; a base of held samples stands still.
    struct Interrupted {
        rig: Box<dyn Rig>,
        readings: Readings,
        gap: Range<u64>,
        at: u64,
        drive: (Drive, f64),
    }

    impl Interrupted {
        fn apply(&mut self) -> Result<(), RigError> {
            let (drive, step) = self.drive;
            self.rig.advance(drive, step)
        }
    }

    impl Rig for Interrupted {
        fn sense(&mut self) -> Result<Sensors, RigError> {
            let mut counters = Counters::default();
            let Range { start, end } = self.gap;
            if self.at == start {
                for _ in start..end {
                    self.rig.sense()?;
                    self.apply()?;
                }
            }
            if self.at <= start || self.at > end {
                let number = if self.at == start { end } else { self.at };
                self.readings.arrive(number, measured(self.rig.sense()?), &mut counters);
            }
            Ok(self.readings.take(&mut counters).expect("there is a reading").sensors)
        }

        fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
            self.drive = (drive, step);
            self.readings.advance(drive.omega * step / TAU);
            self.at += 1;
            let is_lost = self.gap.contains(&(self.at - 1));
            if is_lost { Ok(()) } else { self.apply() }
        }
    }

    #[test]
    fn a_run_rides_through_a_gap_of_30_ms_at_any_phase_whoever_makes_the_sine_of_the_base() {
        for settings in [
            &[][..],
            &["chain.hold=true", "chain.dac_bits=16", "chain.snr=40"],
            &[
                "resonance.sensor=q1",
                "resonance.sensor_quantity=acceleration",
                "record.hold_periods=5",
            ],
        ] {
            let overrides: Vec<Override> = settings.iter().map(|setting| setting.parse().unwrap()).collect();
            let scene = Scene::parse("paper.toml", PAPER, &overrides).unwrap();
            let lost = (0.03 / scene.sample_time()).ceil() as u64;
            let run = |from: u64| {
                let plant = Simulated::new(scene.plant, scene.start).unwrap();
                let rig = Interrupted {
                    rig: Box::new(plant.with_sensors(scene.resonance)),
                    readings: Readings::default(),
                    gap: from..from + lost,
                    at: 0,
                    drive: (Drive::default(), scene.sample_time()),
                };
                let mut controller = BuiltIn::new(&scene.plan().lock).unwrap();
                let mut rig = Chain::around(Box::new(rig), &scene);
                experiment::run(&mut Vec::new(), &mut *rig, &mut controller, &scene.plan(), |_, _| {})
                    .unwrap_or_else(|error| panic!("{settings:?}, {lost} samples from {from} on: {error}"))
            };
            let whole = run(u64::MAX / 2);
            for [from, to] in [[0, whole.settled], [whole.settled, whole.released]] {
                // Phases that fill the period evenly.
                (0..8).for_each(|n| drop(run((from + (to - from) * n / 8 + 37 * n % 100) as u64)));
            }
        }
    }
}
