//! The six values of a frame: readings or a drive.

use super::frame::{Frame, Kind, flag};
use vines_testbench::rig::{Command, Drive, Fault, GroundTruth, LoopState, Move, Sensors};

/// Readings of a sample.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Reading {
    pub sensors: Sensors,
    pub ground_truth: Option<GroundTruth>,
}

pub(super) fn write_reading(mut frame: Frame, reading: &Reading) -> Frame {
    let Reading { sensors, ground_truth } = reading;
    frame.kind = Kind::Sensors;
    if sensors.reference.is_some() {
        frame.flags |= flag::REFERENCE;
    }
    if ground_truth.is_some() {
        frame.flags |= flag::GROUND_TRUTH;
    }
    let inside = ground_truth.unwrap_or_default();
    frame.values = [
        sensors.response,
        sensors.reference.unwrap_or(0.0),
        inside.impacts as f64,
        inside.impact_time,
        inside.impact_velocity,
        inside.particle_velocity,
    ];
    frame
}

pub(super) fn read_reading(frame: &Frame) -> Reading {
    let [
        response,
        reference,
        impacts,
        impact_time,
        impact_velocity,
        particle_velocity,
    ] = frame.values;
    Reading {
        sensors: Sensors {
            response,
            reference: frame.has(flag::REFERENCE).then_some(reference),
        },
        ground_truth: frame.has(flag::GROUND_TRUTH).then_some(GroundTruth {
            impacts: impacts as i64,
            impact_time,
            impact_velocity,
            particle_velocity,
        }),
    }
}

pub(super) fn write_command(mut frame: Frame, command: &Command) -> Frame {
    frame.kind = Kind::Drive;
    if command.settled {
        frame.flags |= flag::SETTLED;
    }
    if command.phase_error.is_none() {
        frame.flags |= flag::NO_PHASE;
    }
    let Drive { omega, amplitude, displacement } = command.drive;
    // The state is counted from 1, so that 0 means that it is not reported.
    let state = command.state.map_or(0.0, |state| f64::from(state as u8) + 1.0);
    let fault = command.fault.map_or(0.0, |fault| f64::from(fault as u8));
    let phase_error = command.phase_error.unwrap_or(0.0);
    frame.values = [omega, amplitude, displacement, phase_error, state, fault];
    frame
}

pub(super) fn read_command(frame: &Frame) -> Command {
    let [omega, amplitude, displacement, phase_error, state, fault] = frame.values;
    Command {
        drive: Drive { omega, amplitude, displacement },
        phase_error: (!frame.has(flag::NO_PHASE)).then_some(phase_error),
        settled: frame.has(flag::SETTLED),
        state: LoopState::of_number(state as i32 - 1),
        fault: Fault::of_number(fault as i32),
    }
}

/// Writes a move of the response and its phase target, rad, into a frame. A response of 0 ends the control of the response.
pub(super) fn write_move(mut frame: Frame, to: Move, phase_target: f64) -> Frame {
    frame.kind = Kind::Move;
    frame.values = [
        to.response,
        to.duration,
        to.amplitude,
        to.omega,
        phase_target,
        to.growth,
    ];
    frame
}

/// The move and the phase target in a frame.
pub(super) fn read_move(frame: &Frame) -> (Move, f64) {
    let [response, duration, amplitude, omega, phase_target, growth] = frame.values;
    let to = Move { response, duration, amplitude, omega, growth };
    (to, phase_target)
}

#[cfg(test)]
#[path = "../tests/unit/payload.rs"]
mod tests;
