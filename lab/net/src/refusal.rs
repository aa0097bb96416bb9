//! Reasons of a server to refuse a session.

use std::fmt::{self, Display, Formatter};

use super::frame::Frame;

/// Reason of a server to refuse a session. In the frame: a code and a number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Refusal {
    /// Code 1: another client has a session.
    Busy,
    /// Code 2: the sample times differ; that of the server, s.
    SampleTime(f64),
    /// Code 3: the server is a rig and the client needs a controller, or the reverse.
    Role,
    /// Code 4: the versions differ; that of the server.
    Version(u16),
    /// An unknown code.
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
                "its sample time is {seconds} s, which differs from that of this program: use the same scene for both"
            ),
            Self::Role => f.write_str("it is a rig where a controller is needed, or the reverse"),
            Self::Version(version) => write!(f, "it has version {version} of the protocol"),
            Self::Other(code) => write!(f, "reason {code}"),
        }
    }
}
