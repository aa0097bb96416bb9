//! The record of an experiment: its samples.

use std::fmt::Write;

use crate::rig::{Command, Drive, GroundTruth, Sensors};
use vines_scene::knowledge::Target;

/// One sample of the record.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Sample {
    /// Time, s.
    pub time: f64,
    /// What the sensors read: in the units of their channels in a recording, otherwise in m, as [`Target::scaled`] says.
    pub sensors: Sensors,
    /// Output of the controller: the drive from this sample to the next; in a recording, the command of the rig.
    pub command: Command,
    /// The ground truth of a simulated rig.
    pub ground_truth: Option<GroundTruth>,
    /// Amplitude of the command of a shaker from this sample to the next, V; 0 without a shaker.
    pub shaker_command: f64,
}

/// First line of a recording (CSV) of a rig with the channels of `target`, with the units that are not m.
pub fn headings(target: &Target) -> String {
    let units = [target.unit(0), target.unit(1), target.units.command.symbol];
    let [response, reference, command] = units.map(|unit| match unit {
        "m" => String::new(),
        other => format!(" [{other}]"),
    });
    format!("time,response{response},reference{reference},omega,E{command},phase_error,state,fault\n")
}

/// Appends a sample to a recording, as a line.
pub fn write_row(text: &mut String, sample: &Sample) {
    let Sample { time, sensors, command, .. } = sample;
    let Drive { omega, amplitude, .. } = command.drive;
    let reference = sensors.reference.map_or_else(String::new, |value| value.to_string());
    let state = command
        .state
        .map_or_else(String::new, |state| (state as u8).to_string());
    let fault = command.fault.map_or(0, |fault| fault as u8);
    let response = sensors.response;
    let phase_error = command.phase_error.map_or_else(String::new, |error| error.to_string());
    // Writing to a string cannot fail.
    let _ = writeln!(
        text,
        "{time},{response},{reference},{omega},{amplitude},{phase_error},{state},{fault}"
    );
}

/// The samples of an experiment as a recording, in the units of the channels.
pub fn table(samples: &[Sample], target: &Target) -> String {
    let mut text = headings(target);
    for sample in samples {
        let sensors = target.unscaled(sample.sensors);
        // Behind a shaker the command is not the drive that the controller asks for.
        let mut command = sample.command;
        command.drive = match sample.shaker_command {
            0.0 => target.command(command.drive),
            amplitude => Drive { amplitude, ..command.drive },
        };
        write_row(&mut text, &Sample { sensors, command, ..*sample });
    }
    text
}

/// Phases of the drive at the samples, rad, from `start` at the first.
pub(crate) fn drive_phases(samples: &[Sample], sample_time: f64, start: f64) -> Vec<f64> {
    let advance = |phase: &mut f64, sample: &Sample| {
        let now = *phase;
        *phase += sample.command.drive.omega * sample_time;
        Some(now)
    };
    samples.iter().scan(start, advance).collect()
}

/// Everything that was measured.
#[derive(Debug, Clone, PartialEq)]
pub struct Record {
    /// Time from sample to sample, s.
    pub sample_time: f64,
    /// The samples, from the start on.
    pub samples: Vec<Sample>,
    /// Index of the sample at which the lock had settled.
    pub settled: usize,
    /// Whether the response is held by control; if not, by the requested drive, because the controller does not control the response.
    pub held: bool,
    /// Index of the sample at which the controller was asked to release the drive.
    pub hold_end: usize,
    /// Index of the first sample with the drive off, after the controller's ramp.
    pub released: usize,
    /// Share of the samples before it with the command at the limit of a shaker's amplifier, per cent; `None` without a shaker.
    pub clipped_percent: Option<f64>,
}

impl Record {
    /// The samples between the settled lock and the release.
    pub fn hold(&self) -> &[Sample] {
        &self.samples[self.settled..self.hold_end]
    }

    /// The samples with the drive off.
    pub fn decay(&self) -> &[Sample] {
        &self.samples[self.released..]
    }
}
