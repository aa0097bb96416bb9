//! The start of a session: Hello, and Welcome or Refusal.

use thiserror::Error;

use super::frame::{Frame, Kind, VERSION, flag};
use super::payload::read_command;
use vines_testbench::rig::{ControllerError, Drive};
use vines_testbench::scene::Definition;

/// Largest relative difference of two sample times that count as equal.
pub(super) const SAME_TIME: f64 = 1e-9;

/// What a server offers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Role {
    /// A controller.
    Controller,
    /// A rig.
    Rig {
        /// Largest drive amplitude, m. A drive above it is refused.
        max_amplitude: f64,
        /// What its sensors read.
        sensors: Definition,
    },
}

/// Settings of a server.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Service {
    /// What it offers.
    pub role: Role,
    /// Sample time, s.
    pub sample_time: f64,
    /// Longest silence of a client before its session is shut down, s.
    pub silence: f64,
}

impl Service {
    /// The answer to Hello.
    pub(super) fn welcome(&self, hello: &Frame) -> Result<Frame, Refusal> {
        let (flags, channels) = match self.role {
            Role::Rig { sensors, .. } => (0, sensors.channels()),
            Role::Controller => (flag::CONTROLLER, 0),
        };
        if hello.flags & flag::CONTROLLER != flags {
            return Err(Refusal::Role);
        }
        // Not a number is not the same, either.
        let same = (hello.values[0] / self.sample_time - 1.0).abs() <= SAME_TIME;
        if !same {
            return Err(Refusal::SampleTime(self.sample_time));
        }
        let mut welcome = Frame { flags, ..Frame::new(Kind::Welcome, hello.session) };
        welcome.values[..3].copy_from_slice(&[self.sample_time, self.silence, channels.into()]);
        Ok(welcome)
    }

    /// The drive in a frame. What is not finite or above a limit must not reach a shaker.
    pub(super) fn drive(&self, frame: &Frame) -> Result<Drive, Refusal> {
        let largest = match self.role {
            Role::Rig { max_amplitude, .. } => max_amplitude,
            Role::Controller => 0.0,
        };
        let limits = [std::f64::consts::PI / self.sample_time, largest, largest];
        for (index, limit) in limits.into_iter().enumerate() {
            let value = frame.values[index];
            // The displacement has a sign.
            let size = if index == 2 { value.abs() } else { value };
            if !(0.0..=limit).contains(&size) {
                return Err(Refusal::Drive { index, value, limit });
            }
        }
        Ok(read_command(frame).drive)
    }
}

/// Reason of a server to refuse a session, or to end it, with its code.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
#[expect(missing_docs, reason = "the messages explain the variants")]
pub enum Refusal {
    /// 1
    #[error("it has another client; sessions are served one at a time")]
    Busy,
    /// 2: the sample time of the server, s.
    #[error("its sample time is {0} s, which differs from that of this program: use the same scene for both")]
    SampleTime(f64),
    /// 3
    #[error("it is a rig where a controller is needed, or the reverse")]
    Role,
    /// 4: the version of the server.
    #[error("it has version {0} of the protocol, this program has {VERSION}")]
    Version(u16),
    /// 5: a value, rad/s or m, that is not finite or above its limit: frequency, amplitude, displacement.
    #[error("{}", excess(*index, *value, *limit))]
    Drive { index: usize, value: f64, limit: f64 },
    /// 6
    #[error("a frame was damaged, or was not that of the present sample")]
    Unexpected,
    /// 7: what the controller cannot move, and the value that it refuses.
    #[error("its controller {}", immovable(*index, *value))]
    Move { index: usize, value: f64 },
    #[error("reason {0}")]
    Other(f64),
}

impl Refusal {
    pub(super) fn answer(self, cause: &Frame) -> Frame {
        let values = match self {
            Self::Busy => [1.0, 0.0, 0.0, 0.0],
            Self::SampleTime(seconds) => [2.0, seconds, 0.0, 0.0],
            Self::Role => [3.0, 0.0, 0.0, 0.0],
            Self::Version(version) => [4.0, version.into(), 0.0, 0.0],
            Self::Drive { index, value, limit } => [5.0, index as f64, value, limit],
            Self::Unexpected => [6.0, 0.0, 0.0, 0.0],
            Self::Move { index, value } => [7.0, index as f64, value, 0.0],
            Self::Other(code) => [code, 0.0, 0.0, 0.0],
        };
        let mut frame = Frame { flags: 0, kind: Kind::Refusal, ..*cause };
        frame.values = [0.0; 6];
        frame.values[..4].copy_from_slice(&values);
        frame
    }

    pub(super) fn read(frame: &Frame) -> Self {
        let [code, first, value, limit, ..] = frame.values;
        match code as u8 {
            1 => Self::Busy,
            2 => Self::SampleTime(first),
            3 => Self::Role,
            4 => Self::Version(first as u16),
            5 => Self::Drive { index: first as usize, value, limit },
            6 => Self::Unexpected,
            7 => Self::Move { index: first as usize, value },
            _ => Self::Other(code),
        }
    }
}

/// Values of a refused move, by their numbers from 1: those of the frame, then what the controller itself lacks.
const MOVE: [(&str, &str); 8] = [
    ("response", "m"),
    ("duration", "s"),
    ("amplitude", "m"),
    ("omega", "rad/s"),
    ("phase_target", "rad"),
    ("growth", "m/s"),
    ("amplitude_max", "m"),
    ("state", ""),
];

impl From<ControllerError> for Refusal {
    /// The refusal of a move.
    fn from(error: ControllerError) -> Self {
        let (index, value) = match error {
            ControllerError::Refused(error) => {
                let index = MOVE.iter().position(|(name, _)| *name == error.name);
                (index.map_or(0, |index| index + 1), error.value.unwrap_or(f64::NAN))
            }
            ControllerError::NoResponseLoop => (MOVE.len() + 1, 0.0),
            ControllerError::Failed(_) => (0, 0.0),
        };
        Self::Move { index, value }
    }
}

/// The message for a move that is refused.
fn immovable(index: usize, value: f64) -> String {
    match index {
        1..=6 => {
            let (name, unit) = MOVE[index - 1];
            let allowed = match index {
                1 => "above 0",
                2 => "0 or above",
                _ => "a finite number that the configuration of the controller allows",
            };
            format!("refuses a move with {name} = {value} {unit}: allowed is {allowed}")
        }
        7 => "has no limit of the drive, which the control of the response amplitude needs: set phase_lock.amplitude_max in its scene".into(),
        8 => format!(
            "is in state {value}: the response amplitude can be controlled in a closed loop only, in state 2 (acquiring) or 3 (locked)"
        ),
        9 => "cannot control the response amplitude".into(),
        _ => "cannot control the response amplitude now".into(),
    }
}

/// The message for a drive that is not allowed.
fn excess(index: usize, value: f64, limit: f64) -> String {
    let (name, unit, advice) = match index {
        0 => ("frequency", "rad/s", "the limit is half its sample rate"),
        1 => ("amplitude", "m", "`vines rig --max-amplitude` sets the limit"),
        _ => ("displacement", "m", "`vines rig --max-amplitude` sets the limit"),
    };
    format!("the {name} of the drive is {value:e} {unit}, allowed is up to {limit:e} {unit}; {advice}")
}
