//! Report of a server on a session.

use std::fmt::{self, Display, Formatter};
use std::net::SocketAddr;

use serde::Serialize;

use super::counters::Counters;
use super::real_time_clock::Punctuality;

/// End of a session.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Ended {
    /// The client ended the session.
    Farewell,
    /// The client was silent for too long; the drive was shut down.
    Silence,
    /// The server was stopped.
    Stopped,
}

/// One session of a server.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Session {
    /// Address of the client.
    pub peer: SocketAddr,
    /// How the session ended.
    pub ended: Ended,
    /// Samples served.
    pub samples: u64,
    /// Sample time, s.
    pub sample_time: f64,
    /// Duration from the first drive or reading to the end, s.
    pub seconds: f64,
    /// Lateness of the samples, for a rig in real time.
    pub punctuality: Option<Punctuality>,
    /// Counters.
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
            Ended::Farewell => "ended by the client's farewell",
            Ended::Silence => "SHUT DOWN: the client was silent for too long",
            Ended::Stopped => "stopped by the server",
        };
        writeln!(f, "session of udp://{}: {ended}", self.peer)?;
        writeln!(
            f,
            "  {} samples in {:.3} s: {:.1} per second, nominal {:.1}",
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
