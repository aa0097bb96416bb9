//! The frame: 84 bytes, little-endian, one layout for all kinds, and the readings, drives, moves and refusals that it carries.
//! The specification is `docs/network-protocol.md`.

use std::collections::BTreeMap;

use thiserror::Error;
use vines_rig::{Command, ControllerError, Drive, Fault, GroundTruth, LoopState, Move, Sensors};

/// Version of the protocol.
pub const VERSION: u16 = 2;
/// Size of every frame, bytes.
pub const SIZE: usize = 84;
/// First four bytes of every frame in every version.
pub const MAGIC: [u8; 4] = *b"VINE";
/// Number of values in a frame.
pub(crate) const VALUES: usize = 6;

const CHECKSUM_AT: usize = SIZE - 4;

/// Kind of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A client requests a session.
    Hello = 1,
    /// The server accepts it.
    Welcome = 2,
    /// The server refuses it.
    Refusal = 3,
    /// Readings: from a rig server, or to a controller server.
    Sensors = 4,
    /// A drive: to a rig server, or from a controller server.
    Drive = 5,
    /// The client ends the session with a rig in real time.
    Farewell = 6,
    /// The rig in real time confirms the farewell, and reports its timing.
    Report = 7,
    /// A move of the response amplitude, to a controller server.
    Move = 8,
    /// A part of the message of an error that ends the session, before the refusal.
    Text = 9,
}

/// All kinds, in the order of their codes, from 1.
const KINDS: [Kind; 9] = {
    use Kind::{Drive, Farewell, Hello, Move, Refusal, Report, Sensors, Text, Welcome};
    [Hello, Welcome, Refusal, Sensors, Drive, Farewell, Report, Move, Text]
};

/// Booleans of a frame. A bit without a meaning in a kind is 0.
pub mod flag {
    /// Sensors, to a controller: the drive is requested.
    pub(crate) const ACTIVE: u8 = 1;
    /// Drive, from a controller: its lock has settled.
    pub(crate) const SETTLED: u8 = 2;
    /// Sensors: there is a reference channel.
    pub(crate) const REFERENCE: u8 = 4;
    /// Sensors: the rig is a simulation, and its last four values describe the impacts.
    pub(crate) const GROUND_TRUTH: u8 = 8;
    /// Sensors, from a rig in real time: the drive has been shut down for this session.
    pub const SHUT_DOWN: u8 = 16;
    /// Drive: the rig holds the displacement, instead of its oscillator with frequency and amplitude. Move: the control of the response ends.
    pub(crate) const HOLD: u8 = 128;
    /// Drive, from a controller: its phase error cannot be measured.
    pub(crate) const NO_PHASE: u8 = 32;
    /// Hello and Welcome: the server is, or should be, a controller; otherwise a rig.
    pub(crate) const CONTROLLER: u8 = 64;
}

/// One frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// Kind.
    pub kind: Kind,
    /// Bits of [`flag`].
    pub flags: u8,
    /// Number of the session, chosen at random by the client.
    pub session: u64,
    /// Number of the sample.
    pub sequence: u64,
    /// Time of that sample since the start of the session, s.
    pub time: f64,
    /// Values; their meaning depends on the kind.
    pub values: [f64; VALUES],
}

/// Reason why there is no frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum FrameError {
    /// The bytes are not a frame of this protocol, are damaged, or are not authenticated with the key.
    #[error("not a frame of this protocol, or damaged, or of another key")]
    Malformed,
    /// Another version of the protocol.
    #[error("version {0} of the protocol")]
    Version(u16),
    /// The connection is closed.
    #[error("the connection is closed")]
    Closed,
}

impl Frame {
    /// A frame of session `session` without samples.
    pub fn new(kind: Kind, session: u64) -> Self {
        Self {
            kind,
            flags: 0,
            session,
            sequence: 0,
            time: 0.0,
            values: [0.0; VALUES],
        }
    }

    /// Whether a bit of [`flag`] is set.
    pub fn has(&self, flag: u8) -> bool {
        self.flags & flag != 0
    }

    /// The bytes of the frame.
    pub fn encode(&self) -> [u8; SIZE] {
        let mut bytes = [0; SIZE];
        bytes[..4].copy_from_slice(&MAGIC);
        bytes[4..6].copy_from_slice(&VERSION.to_le_bytes());
        (bytes[6], bytes[7]) = (self.kind as u8, self.flags);
        let words = [self.session, self.sequence, self.time.to_bits()];
        let words = words.into_iter().chain(self.values.map(f64::to_bits));
        for (slot, word) in bytes[8..CHECKSUM_AT].chunks_exact_mut(8).zip(words) {
            slot.copy_from_slice(&word.to_le_bytes());
        }
        let checksum = crc32fast::hash(&bytes[..CHECKSUM_AT]);
        bytes[CHECKSUM_AT..].copy_from_slice(&checksum.to_le_bytes());
        bytes
    }

    /// Reads a datagram.
    pub fn decode(bytes: &[u8]) -> Result<Self, FrameError> {
        let version = bytes.strip_prefix(&MAGIC).and_then(|rest| rest.first_chunk());
        let version = u16::from_le_bytes(*version.ok_or(FrameError::Malformed)?);
        if version != VERSION {
            return Err(FrameError::Version(version));
        }
        let is_whole =
            bytes.len() == SIZE && crc32fast::hash(&bytes[..CHECKSUM_AT]).to_le_bytes() == bytes[CHECKSUM_AT..];
        let kind = KINDS.get(usize::from(*bytes.get(6).unwrap_or(&0)).wrapping_sub(1));
        let kind = *kind.filter(|_| is_whole).ok_or(FrameError::Malformed)?;
        let mut words = bytes[8..CHECKSUM_AT]
            .as_chunks()
            .0
            .iter()
            .map(|word| u64::from_le_bytes(*word));
        let mut word = || words.next().expect("nine words");
        Ok(Self {
            kind,
            flags: bytes[7],
            session: word(),
            sequence: word(),
            time: f64::from_bits(word()),
            values: std::array::from_fn(|_| f64::from_bits(word())),
        })
    }
}

/// Readings of a sample.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Reading {
    /// What the sensors read, or its reconstruction.
    pub sensors: Sensors,
    /// The ground truth, if the rig is a simulation.
    pub ground_truth: Option<GroundTruth>,
}

pub(crate) fn write_reading(frame: Frame, reading: &Reading) -> Frame {
    let Sensors { response, reference } = reading.sensors;
    let motion = reading.ground_truth;
    let flags = bit(flag::REFERENCE, reference.is_some()) | bit(flag::GROUND_TRUTH, motion.is_some());
    let [count, time, impact, particle] = motion.map_or([0.0; 4], |motion| {
        let GroundTruth { impacts, impact_time, impact_velocity, particle_velocity, .. } = motion;
        [impacts as f64, impact_time, impact_velocity, particle_velocity]
    });
    let values = [response, reference.unwrap_or(0.0), count, time, impact, particle];
    Frame { kind: Kind::Sensors, flags, values, ..frame }
}

pub(crate) fn read_reading(frame: &Frame) -> Reading {
    let [
        response,
        reference,
        impacts,
        impact_time,
        impact_velocity,
        particle_velocity,
    ] = frame.values;
    let (reference, impacts) = (frame.has(flag::REFERENCE).then_some(reference), impacts as i64);
    let motion = GroundTruth {
        impacts,
        impact_time,
        impact_velocity,
        particle_velocity,
        friction: None,
    };
    let ground_truth = frame.has(flag::GROUND_TRUTH).then_some(motion);
    Reading { sensors: Sensors { response, reference }, ground_truth }
}

pub(crate) fn write_command(frame: Frame, command: &Command) -> Frame {
    let Drive { omega, amplitude, displacement, is_held } = command.drive;
    let flags = bit(flag::SETTLED, command.settled == Some(true))
        | bit(flag::NO_PHASE, command.phase_error.is_none())
        | bit(flag::HOLD, is_held);
    // The state is counted from 1, so that 0 means that it is not reported.
    let state = command.state.map_or(0.0, |state| f64::from(state as u8) + 1.0);
    let fault = command.fault.map_or(0.0, |fault| f64::from(fault as u8));
    let phase_error = command.phase_error.unwrap_or(0.0);
    let values = [omega, amplitude, displacement, phase_error, state, fault];
    Frame { kind: Kind::Drive, flags, values, ..frame }
}

pub(crate) fn read_command(frame: &Frame) -> Command {
    let [omega, amplitude, displacement, phase_error, state, fault] = frame.values;
    let (settled, state) = (frame.has(flag::SETTLED), LoopState::of_number(state as i32 - 1));
    Command {
        drive: Drive { omega, amplitude, displacement, is_held: false },
        phase_error: (!frame.has(flag::NO_PHASE)).then_some(phase_error),
        // A controller that never says so reports no state either.
        settled: (settled || state.is_some()).then_some(settled),
        state,
        fault: Fault::of_number(fault as i32),
    }
}

/// Writes a move of the response and its phase target, rad.
pub(crate) fn write_move(frame: Frame, to: Move, phase_target: f64) -> Frame {
    let Move { response, duration, amplitude, omega, growth } = to;
    let values = [response, duration, amplitude, omega, phase_target, growth];
    Frame { kind: Kind::Move, values, ..frame }
}

/// The move and the phase target in a frame.
pub(crate) fn read_move(frame: &Frame) -> (Move, f64) {
    let [response, duration, amplitude, omega, phase_target, growth] = frame.values;
    (Move { response, duration, amplitude, omega, growth }, phase_target)
}

/// Bytes of a message in a frame, and most bytes of a message.
const PART: usize = 8 * VALUES;
const MESSAGE: usize = 64 * PART;

/// The frames of a message, whose numbers are their places, and the refusal that ends the session with it.
pub(crate) fn write_failure(frame: Frame, message: &str) -> Vec<Frame> {
    let end = (0..=message.len().min(MESSAGE))
        .rev()
        .find(|end| message.is_char_boundary(*end));
    let message = &message.as_bytes()[..end.unwrap_or(0)];
    let part = |(place, part): (usize, &[u8])| {
        let mut bytes = [0; PART];
        bytes[..part.len()].copy_from_slice(part);
        let words = bytes.as_chunks().0;
        let values = std::array::from_fn(|n| f64::from_bits(u64::from_le_bytes(words[n])));
        Frame {
            kind: Kind::Text,
            flags: 0,
            sequence: place as u64,
            values,
            ..frame
        }
    };
    let parts = message.chunks(PART).enumerate().map(part);
    parts
        .chain([Refusal::Failed { bytes: message.len() }.answer(&frame)])
        .collect()
}

/// The parts of a message that have arrived.
#[derive(Debug, Default)]
pub(crate) struct Message(BTreeMap<u64, [f64; VALUES]>);

impl Message {
    /// Takes a part.
    pub fn take(&mut self, frame: &Frame) {
        if frame.sequence < (MESSAGE / PART) as u64 {
            self.0.insert(frame.sequence, frame.values);
        }
    }

    /// The message of this many bytes, or that it has not arrived.
    pub fn text(&self, bytes: usize) -> String {
        let parts = (0..).map_while(|place| self.0.get(&place)).flatten();
        let mut text: Vec<u8> = parts.flat_map(|value| value.to_bits().to_le_bytes()).collect();
        let is_whole = bytes > 0 && text.len() >= bytes;
        text.truncate(bytes);
        String::from_utf8(text)
            .ok()
            .filter(|_| is_whole)
            .unwrap_or_else(|| "its message was lost in the network; the server has printed it".into())
    }
}

/// A bit of the flags, if it is set.
pub(crate) fn bit(flag: u8, set: bool) -> u8 {
    if set { flag } else { 0 }
}

/// Reason of a server to refuse a session, or to end it, with its code.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
#[expect(missing_docs, reason = "the messages explain the variants")]
pub enum Refusal {
    /// 1
    #[error("it has another client; sessions are served one at a time")]
    Busy,
    /// 2: the sample times of server and client, s.
    #[error("its sample time is {server} s, and that of this program {client} s: use the same scene for both")]
    SampleTime { server: f64, client: f64 },
    /// 3
    #[error("it is a rig where a controller is needed, or the reverse")]
    Role,
    /// 4: the version of the server.
    #[error("it has version {0} of the protocol, this program has version {VERSION}: use the same release of both")]
    Version(u16),
    /// 5: a value, rad/s or the unit of the drive, that is not finite or above its limit: frequency, amplitude, displacement.
    #[error(
        "the {} of the drive is {value:e}, allowed is up to {limit:e}: half the sample rate, and the largest amplitude of the rig",
        ["frequency (rad/s)", "amplitude (m, N or V, as it drives)", "present value (m, N or V, as it drives)"].get(*index).unwrap_or(&"value")
    )]
    Drive { index: usize, value: f64, limit: f64 },
    /// 6
    #[error("a frame was damaged, or was not that of the present sample")]
    Unexpected,
    /// 7: what the controller cannot move, and the value that it refuses.
    #[error("its controller {}: {value}", MOVE.get(*index).map_or("refuses a move", |(_, reason)| reason))]
    Move { index: usize, value: f64 },
    /// 8: its rig or controller has failed, with a message of this many bytes.
    #[error("its rig or controller has failed")]
    Failed { bytes: usize },
    #[error("reason {0}")]
    Other(f64),
}

impl Refusal {
    pub(crate) fn answer(self, cause: &Frame) -> Frame {
        let [code, first, value, limit] = match self {
            Self::Busy => [1.0, 0.0, 0.0, 0.0],
            Self::SampleTime { server, .. } => [2.0, server, 0.0, 0.0],
            Self::Role => [3.0, 0.0, 0.0, 0.0],
            Self::Version(version) => [4.0, version.into(), 0.0, 0.0],
            Self::Drive { index, value, limit } => [5.0, index as f64, value, limit],
            Self::Unexpected => [6.0, 0.0, 0.0, 0.0],
            Self::Move { index, value } => [7.0, index as f64, value, 0.0],
            Self::Failed { bytes } => [8.0, bytes as f64, 0.0, 0.0],
            Self::Other(code) => [code, 0.0, 0.0, 0.0],
        };
        let (kind, values) = (Kind::Refusal, [code, first, value, limit, 0.0, 0.0]);
        Frame { flags: 0, kind, values, ..*cause }
    }

    /// Reads a frame; `step`: the sample time of the client, s.
    pub(crate) fn read(frame: &Frame, step: f64) -> Self {
        let [code, first, value, limit, ..] = frame.values;
        match code as u8 {
            1 => Self::Busy,
            2 => Self::SampleTime { server: first, client: step },
            3 => Self::Role,
            4 => Self::Version(first as u16),
            5 => Self::Drive { index: first as usize, value, limit },
            6 => Self::Unexpected,
            7 => Self::Move { index: first as usize, value },
            8 => Self::Failed { bytes: first as usize },
            _ => Self::Other(code),
        }
    }
}

/// What a controller says of a move that it refuses, by the numbers of the protocol, and the value that it refuses.
const MOVE: [(&str, &str); 10] = [
    ("", "cannot control the response amplitude now"),
    (
        "response",
        "refuses a move of the response to this value, m, which is not above 0",
    ),
    (
        "duration",
        "refuses a move of this duration, s, which is not 0 or above",
    ),
    ("amplitude", "refuses a move with this change of the drive amplitude, m"),
    ("omega", "refuses a move with this change of the frequency, rad/s"),
    ("phase_target", "refuses a move with this phase target, rad"),
    ("growth", "refuses a move with this growth at its end, m/s"),
    (
        "amplitude_max",
        "has no limit of the drive, which the control of the response needs: set phase_lock.amplitude_max in its scene",
    ),
    (
        "state",
        "can control the response in a closed loop only, state 2 (acquiring) or 3 (locked), and is in this state",
    ),
    ("", "cannot control the response amplitude"),
];

impl From<ControllerError> for Refusal {
    /// The refusal of a move.
    fn from(error: ControllerError) -> Self {
        let (index, value) = match error {
            ControllerError::Refused(error) => {
                let index = MOVE.iter().position(|(name, _)| *name == error.name);
                (index.unwrap_or_default(), error.value.unwrap_or(f64::NAN))
            }
            ControllerError::NoResponseLoop(_) => (MOVE.len() - 1, 0.0),
            ControllerError::Failed(_) => (0, 0.0),
        };
        Self::Move { index, value }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn every_frame_is_decoded_to_the_same_bits(
            (kind, flags) in (prop::sample::select(&KINDS[..]), any::<u8>()),
            (session, sequence, time, values) in any::<(u64, u64, u64, [u64; VALUES])>(),
        ) {
            let (time, values) = (f64::from_bits(time), values.map(f64::from_bits));
            let bytes = Frame { kind, flags, session, sequence, time, values }.encode();
            // NaN is not equal to itself; its bits are.
            prop_assert_eq!(Frame::decode(&bytes).unwrap().encode(), bytes);
        }

        #[test]
        fn readings_and_drives_survive_the_frame(
            (response, reference) in any::<(f64, Option<f64>)>(),
            motion in any::<Option<(i32, f64, f64, f64)>>(),
            (omega, amplitude, displacement) in (0.0..1e6, 0.0..1e6, -1e6..1e6),
            (phase_error, settled) in (prop::option::of(-3.0..3.0), any::<bool>()),
            (state, fault) in (-1..8, 0..7),
        ) {
            let ground_truth = motion.map(|(impacts, impact_time, impact_velocity, particle_velocity)| {
                GroundTruth { impacts: impacts.into(), impact_time, impact_velocity, particle_velocity, friction: None }
            });
            let reading = Reading { sensors: Sensors { response, reference }, ground_truth };
            let frame = write_reading(Frame::new(Kind::Hello, 1), &reading);
            prop_assert_eq!(read_reading(&Frame::decode(&frame.encode()).unwrap()), reading);
            let drive = Drive { omega, amplitude, displacement, is_held: false };
            let (state, fault) = (LoopState::of_number(state), Fault::of_number(fault));
            let settled = (settled || state.is_some()).then_some(settled);
            let command = Command { drive, phase_error, settled, state, fault };
            let frame = write_command(Frame::new(Kind::Hello, 1), &command);
            prop_assert_eq!(read_command(&Frame::decode(&frame.encode()).unwrap()), command);
        }
    }

    #[test]
    fn a_message_arrives_in_any_order_and_a_part_that_is_lost_is_said() {
        let limit = "the displacement of the armature is 8.801e-3 m, and shaker.stroke_max allows 0.0088 m: µ";
        for message in [limit, &"µ".repeat(MESSAGE), "short"] {
            let frames = write_failure(Frame::new(Kind::Hello, 1), message);
            let (refusal, parts) = frames.split_last().unwrap();
            let Refusal::Failed { bytes } = Refusal::read(refusal, 0.0) else {
                panic!("{refusal:?}");
            };
            let mut arrived = Message::default();
            for (n, part) in parts.iter().rev().enumerate() {
                let is_whole = message.starts_with(&arrived.text(bytes));
                assert!(!is_whole, "{n}");
                arrived.take(&Frame::decode(&part.encode()).unwrap());
            }
            assert_eq!(arrived.text(bytes), message[..message.len().min(bytes)]);
            assert_eq!(bytes, message.len().min(MESSAGE));
        }
    }

    #[test]
    fn another_version_is_recognised_in_a_datagram_of_any_size() {
        let longer = [&b"VINE\x07\x00"[..], &[0; 100]].concat();
        assert_eq!(Frame::decode(&longer), Err(FrameError::Version(7)));
        for short in [&b"VINE"[..], b"VINE\x02\x00", b"VINE\x02\x00 short", b"EVIN\x02\x00"] {
            assert_eq!(Frame::decode(short), Err(FrameError::Malformed));
        }
    }

    /// The checksums of the bytes are from Python's `struct` and `zlib`, by the specification.
    #[test]
    fn frames_of_every_kind_have_the_recorded_bytes() {
        let at = Frame {
            sequence: 7,
            time: 0.25,
            ..Frame::new(Kind::Hello, 0x0102_0304_0506_0708)
        };
        let drive = Drive {
            omega: 55.5,
            amplitude: 9e-5,
            displacement: -1e-5,
            is_held: false,
        };
        let (state, fault) = (LoopState::of_number(3), Fault::of_number(5));
        let command = Command {
            drive,
            phase_error: Some(-1e-3),
            settled: Some(true),
            state,
            fault,
        };
        let [impact_time, impact_velocity, particle_velocity] = [0.2, -0.3, 0.4];
        let motion = GroundTruth {
            impacts: 12,
            impact_time,
            impact_velocity,
            particle_velocity,
            friction: None,
        };
        let reading =
            |reference, ground_truth| Reading { sensors: Sensors { response: 1e-3, reference }, ground_truth };
        let to = Move {
            response: 1e-2,
            duration: 2.0,
            amplitude: -1e-6,
            omega: 0.01,
            growth: 1e-4,
        };
        let mut report = at;
        report.values = [100.0, 3.0, 0.01, 2.0, 1e-4, 2e-3];
        let timing = crate::timing::Timing::read(&report);
        for (frame, checksum) in [
            (write_reading(at, &reading(Some(2e-5), Some(motion))), 0x85c2_255d),
            (write_reading(at, &reading(None, None)), 0xeace_b0e8),
            (write_command(at, &command), 0xaa91_d8c9),
            (write_command(at, &Command { drive, ..Command::default() }), 0x93f5_78a2),
            (write_move(at, to, -1.5), 0xe432_a772),
            (timing.write(at.session), 0x348a_9c27),
            (
                Refusal::Drive { index: 2, value: 1.0, limit: 0.01 }.answer(&at),
                0x02d2_922c,
            ),
            (
                Refusal::SampleTime { server: 1e-3, client: 2e-3 }.answer(&at),
                0x0bb1_66c2,
            ),
        ] {
            let bytes = frame.encode();
            assert_eq!(crc32fast::hash(&bytes[..CHECKSUM_AT]), checksum, "{frame:?}");
            assert_eq!(bytes[CHECKSUM_AT..], checksum.to_le_bytes());
        }
    }
}
