//! Guards lost readings: gaps in a periodic motion, and an experiment that rides through them.

use std::f64::consts::TAU;
use std::ops::Range;

use vines_testbench::experiment;
use vines_testbench::rig::{BuiltIn, Chain, Drive, GroundTruth, Rig, RigError, Simulated};
use vines_testbench::scene::{Override, PAPER, Scene};

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
    drive: (Drive, bool, f64),
}

impl Interrupted {
    fn apply(&mut self) -> Result<(), RigError> {
        let (drive, holds, step) = self.drive;
        match holds {
            true => self.rig.hold(drive, step),
            false => self.rig.advance(drive, step),
        }
    }

    fn step(&mut self, drive: Drive, holds: bool, step: f64) -> Result<(), RigError> {
        self.drive = (drive, holds, step);
        self.readings.advance(drive.omega * step / TAU);
        self.at += 1;
        let is_lost = self.gap.contains(&(self.at - 1));
        if is_lost { Ok(()) } else { self.apply() }
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
        self.step(drive, false, step)
    }

    fn hold(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        self.step(drive, true, step)
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
                drive: (Drive::default(), false, scene.sample_time()),
            };
            let mut controller = BuiltIn::new(&scene.controller_config()).unwrap();
            let mut rig = Chain::around(Box::new(rig), &scene);
            experiment::run(&mut *rig, &mut controller, &scene.plan(), |_, _, _| {})
                .unwrap_or_else(|error| panic!("{settings:?}, {lost} samples from {from} on: {error}"))
        };
        let whole = run(u64::MAX / 2);
        for [from, to] in [[0, whole.settled], [whole.settled, whole.released]] {
            // Phases that fill the period evenly.
            (0..8).for_each(|n| drop(run((from + (to - from) * n / 8 + 37 * n % 100) as u64)));
        }
    }
}
