//! What a server tells about a session.

use std::fmt::{self, Display, Formatter};
use std::net::SocketAddr;

use serde::Serialize;

use super::counters::Counters;
use super::pace::Punctuality;

/// How a session ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Ended {
    /// The client said farewell.
    Farewell,
    /// The client was silent for too long: the drive was shut down.
    Silence,
    /// This program was asked to stop.
    Stopped,
}

/// One session of a server.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Session {
    /// Who the client was.
    pub peer: SocketAddr,
    /// How it ended.
    pub ended: Ended,
    /// Samples served.
    pub samples: u64,
    /// Time from sample to sample, s.
    pub sample_time: f64,
    /// From the first drive or reading to the end, s.
    pub seconds: f64,
    /// Of a rig in real time.
    pub punctuality: Option<Punctuality>,
    /// What happened on the link.
    pub counters: Counters,
}

impl Session {
    /// Samples per second of the wall clock.
    #[must_use]
    pub fn rate(&self) -> f64 {
        self.samples as f64 / self.seconds
    }
}

impl Display for Session {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let ended = match self.ended {
            Ended::Farewell => "its client said farewell",
            Ended::Silence => "SHUT DOWN: its client was silent for too long",
            Ended::Stopped => "stopped here",
        };
        writeln!(f, "session of udp://{}: {ended}", self.peer)?;
        writeln!(
            f,
            "  {} samples in {:.3} s: {:.1} a second, nominal {:.1}",
            self.samples,
            self.seconds,
            self.rate(),
            1.0 / self.sample_time
        )?;
        if let Some(punctuality) = &self.punctuality {
            write!(f, "{punctuality}")?;
        }
        writeln!(f, "  {}", self.counters)
    }
}
