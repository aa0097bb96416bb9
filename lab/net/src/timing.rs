//! The clock of a rig in real time, and the reports on a session: of the server to its user, and of a rig in real time to its client.

use std::fmt::{self, Display, Formatter};
use std::net::SocketAddr;
use std::time::{Duration, Instant};

use hdrhistogram::Histogram;
use serde::ser::SerializeStruct;
use serde::{Serialize, Serializer};
use thiserror::Error;

use super::frame::{Frame, Kind};

/// Largest lateness that the histogram resolves, ns.
const LONGEST: u64 = 60_000_000_000;
/// Digits of a lateness.
const DIGITS: u8 = 3;
/// s per ns.
const NANO: f64 = 1e-9;
/// The quantiles that are reported, and their names.
const QUANTILES: [(&str, f64); 3] = [("p50", 0.5), ("p99", 0.99), ("p99_99", 0.9999)];

/// Statistics of the lateness of the samples.
#[derive(Debug, Clone, PartialEq)]
pub struct Punctuality {
    /// Lateness, ns.
    histogram: Histogram<u64>,
    /// Number of samples that were late by a whole period or more.
    pub missed: u64,
    /// Largest lateness, s.
    pub worst: f64,
}

impl Default for Punctuality {
    fn default() -> Self {
        let histogram = Histogram::new_with_bounds(1, LONGEST, DIGITS).expect("the bounds are valid");
        Self { histogram, missed: 0, worst: 0.0 }
    }
}

impl Punctuality {
    /// Counts a sample that was late by `lateness`, s, of a sample period, s.
    pub fn record(&mut self, lateness: f64, period: f64) {
        self.histogram.saturating_record((lateness / NANO) as u64);
        self.missed += u64::from(lateness >= period);
        self.worst = self.worst.max(lateness);
    }

    /// Number of samples.
    pub fn samples(&self) -> u64 {
        self.histogram.len()
    }

    /// Lateness, s, that this share of the samples does not exceed.
    pub fn quantile(&self, share: f64) -> f64 {
        // The upper limit of a class may be above the largest value in it.
        (self.histogram.value_at_quantile(share) as f64 * NANO).min(self.worst)
    }

    /// The classes that samples are in: upper limit of the lateness, s, and number of samples.
    pub fn classes(&self) -> Vec<(f64, u64)> {
        self.histogram
            .iter_recorded()
            .map(|one| (one.value_iterated_to() as f64 * NANO, one.count_at_value()))
            .collect()
    }
}

impl Serialize for Punctuality {
    /// Seconds.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut all = serializer.serialize_struct("Punctuality", QUANTILES.len() + 4)?;
        all.serialize_field("samples", &self.samples())?;
        for (name, share) in QUANTILES {
            all.serialize_field(name, &self.quantile(share))?;
        }
        all.serialize_field("worst", &self.worst)?;
        all.serialize_field("missed", &self.missed)?;
        all.serialize_field("histogram", &self.classes())?;
        all.end()
    }
}

impl Display for Punctuality {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "  lateness of {} samples:", self.samples())?;
        for (name, share) in QUANTILES {
            write!(f, " {} {:.1} us,", name.replace('_', "."), 1e6 * self.quantile(share))?;
        }
        writeln!(
            f,
            " maximum {:.1} us; {} deadlines missed",
            1e6 * self.worst,
            self.missed
        )
    }
}

/// The clock of a rig in real time.
#[derive(Debug, Clone)]
pub struct RealTimeClock {
    start: Instant,
    /// s
    period: f64,
    /// Lateness of the samples.
    pub punctuality: Punctuality,
}

impl RealTimeClock {
    /// A clock that starts now; `period` in s.
    pub fn start(period: f64) -> Self {
        Self {
            start: Instant::now(),
            period,
            punctuality: Punctuality::default(),
        }
    }

    /// Time at which sample `n` is due. Computed from the start, so that rounding errors do not accumulate.
    pub fn due(&self, n: u64) -> Instant {
        self.start + Duration::from_secs_f64(n as f64 * self.period)
    }

    /// Counts sample `n`, which is served now.
    pub fn serve(&mut self, n: u64) {
        let lateness = self.due(n).elapsed().as_secs_f64();
        self.punctuality.record(lateness, self.period);
    }
}

/// End of a session.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Ended {
    /// The client ended the session.
    Farewell,
    /// The client was silent, or behind, for too long; the drive was shut down.
    Silence,
    /// The client sent a drive or a frame that is not allowed; the drive was shut down.
    Refused,
    /// The server was stopped.
    Stopped,
}

/// Frames and samples of a session in real time, counted by client or server.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Counters {
    /// Valid frames of this session.
    pub received: u64,
    /// Frames that arrived after their sample, after a later frame, or twice.
    pub late: u64,
    /// Frames of another sender or another session.
    pub foreign: u64,
    /// Datagrams that are not frames, and frames with invalid values.
    pub malformed: u64,
    /// Samples for which the last valid value was held.
    pub held: u64,
    /// Most of them in a row.
    pub longest: u64,
}

impl Counters {
    /// Counts a sample for which the last valid value was held, one of at least `row` in a row.
    pub fn hold(&mut self, row: u64) {
        self.held += 1;
        self.longest = self.longest.max(row);
    }

    /// Whether any frame was not delivered once and in time.
    pub fn is_troubled(&self) -> bool {
        *self != Self { received: self.received, ..Self::default() }
    }
}

impl Display for Counters {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Self { received, late, foreign, malformed, held, longest } = self;
        write!(
            f,
            "{received} frames received, {late} late, {foreign} foreign, {malformed} malformed; {held} samples held, at most {longest} in a row"
        )
    }
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
    /// Counters, for a rig in real time.
    pub counters: Option<Counters>,
}

impl Session {
    /// Samples per second of the wall clock.
    pub fn rate(&self) -> f64 {
        if self.seconds > 0.0 {
            self.samples as f64 / self.seconds
        } else {
            0.0
        }
    }
}

impl Display for Session {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let ended = match self.ended {
            Ended::Farewell => "ended by the client",
            Ended::Silence => "SHUT DOWN: the client was silent, or behind, for too long",
            Ended::Refused => "SHUT DOWN: the client sent a drive or a frame that is not allowed",
            Ended::Stopped => "stopped by the server",
        };
        writeln!(f, "session of {}: {ended}", self.peer)?;
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
        self.counters.map_or(Ok(()), |counters| writeln!(f, "  {counters}"))
    }
}

/// The report of a rig in real time did not arrive.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("the rig's report was lost in the network: whether it got its drives in time is not known")]
pub struct ReportLost;

/// What a rig in real time reports to its client at the end.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Timing {
    /// Samples served.
    pub samples: u64,
    /// Samples that were late by a whole period or more.
    pub missed: u64,
    /// Largest lateness, s.
    pub worst: f64,
    /// Samples without a drive in time.
    pub held: u64,
    /// Lateness that 99 % and 99.99 % of the samples do not exceed, s.
    pub quantiles: [f64; 2],
}

impl Timing {
    /// What makes results doubtful: more than this share of the samples came too late, or had no drive in time.
    pub fn doubt(&self, tolerated: f64) -> Option<String> {
        let exceeds = |count: u64| count as f64 > tolerated * self.samples.max(1) as f64;
        let reason = match (exceeds(self.missed), exceeds(self.held)) {
            (false, false) => return None,
            (true, false) => "the rig missed deadlines: its machine is too slow or too busy",
            (false, true) => {
                "drives did not reach the rig in time: the network lost or delayed frames, or the controller or this machine is too slow"
            }
            (true, true) => {
                "the rig missed deadlines, and drives did not reach it in time: a machine is too busy, or the network too slow"
            }
        };
        Some(format!("{reason}; {self}"))
    }

    pub(crate) fn write(&self, session: u64) -> Frame {
        let Self { samples, missed, worst, held, quantiles: [p99, p9999] } = *self;
        Frame {
            values: [samples as f64, missed as f64, worst, held as f64, p99, p9999],
            ..Frame::new(Kind::Report, session)
        }
    }

    pub(crate) fn read(frame: &Frame) -> Self {
        let [samples, missed, worst, held, p99, p9999] = frame.values;
        Self {
            samples: samples as u64,
            missed: missed as u64,
            worst,
            held: held as u64,
            quantiles: [p99, p9999],
        }
    }
}

impl Display for Timing {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Self { samples, missed, worst, held, quantiles } = self;
        let [p99, p9999] = quantiles.map(|lateness| 1e3 * lateness);
        write!(
            f,
            "of {samples} samples, {missed} missed their deadline (99 % were at most {p99:.3} ms late, 99.99 % {p9999:.3} ms, the worst \
             {:.3} ms), and {held} had no drive in time",
            1e3 * worst
        )
    }
}

#[cfg(test)]
#[path = "../tests/unit/timing.rs"]
mod tests;
