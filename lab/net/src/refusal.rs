//! Why a server does not grant a session.

use std::fmt::{self, Display, Formatter};

use super::frame::Frame;

/// Why a server does not grant a session. On the wire: a code, and a number that goes with it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Refusal {
    /// Code 1: another client has a session.
    Busy,
    /// Code 2: its sample time, s, is not the client's.
    SampleTime(f64),
    /// Code 3: a controller was asked for at a rig, or the reverse.
    Role,
    /// Code 4: its version of the protocol.
    Version(u16),
    /// A code that this version does not know.
    Other(f64),
}

impl Refusal {
    pub(super) fn write(self, mut frame: Frame) -> Frame {
        let (code, number) = match self {
            Self::Busy => (1.0, 0.0),
            Self::SampleTime(seconds) => (2.0, seconds),
            Self::Role => (3.0, 0.0),
            Self::Version(version) => (4.0, version.into()),
            Self::Other(code) => (code, 0.0),
        };
        frame.values[..2].copy_from_slice(&[code, number]);
        frame
    }

    pub(super) fn read(frame: &Frame) -> Self {
        let [code, number, ..] = frame.values;
        if code == 1.0 {
            Self::Busy
        } else if code == 2.0 {
            Self::SampleTime(number)
        } else if code == 3.0 {
            Self::Role
        } else if code == 4.0 {
            Self::Version(number as u16)
        } else {
            Self::Other(code)
        }
    }
}

impl Display for Refusal {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Busy => f.write_str("it has another client; sessions are served one at a time"),
            Self::SampleTime(seconds) => write!(
                f,
                "it samples every {seconds} s, which is not this program's sample time: give both the same scene"
            ),
            Self::Role => f.write_str(
                "it is the other side of the bench: a rig where a controller was wanted, or the reverse",
            ),
            Self::Version(version) => write!(f, "it speaks version {version} of the protocol"),
            Self::Other(code) => write!(f, "reason {code}"),
        }
    }
}
