//! The clock of a rig in real time, and the reports on a session: of the server to its user, and of a rig in real time to its client.

use std::fmt::{self, Display, Formatter};
use std::net::SocketAddr;
use std::time::{Duration, Instant};

use hdrhistogram::Histogram;
use serde::Serialize;
use thiserror::Error;

use crate::frame::{Frame, Kind};

/// Largest lateness that the histogram resolves, ns: a minute. A later sample counts as that late.
const LARGEST_LATENESS: u64 = 60_000_000_000;
/// Significant digits of a lateness in the histogram.
const DIGITS: u8 = 3;

/// The clock of a rig in real time, and the lateness of its samples.
#[derive(Debug, Clone)]
pub struct RealTimeClock {
    start: Instant,
    /// s
    period: f64,
    /// Lateness, ns.
    lateness: Histogram<u64>,
    /// Number of samples that were late by a whole period or more.
    missed: u64,
    /// Largest lateness.
    worst: Duration,
    /// Time from the start to the last sample.
    served: Duration,
}

impl RealTimeClock {
    /// A clock that starts now; `period` in s.
    pub fn start(period: f64) -> Self {
        let lateness = Histogram::new_with_bounds(1, LARGEST_LATENESS, DIGITS).expect("the bounds are valid");
        Self {
            start: Instant::now(),
            period,
            lateness,
            missed: 0,
            worst: Duration::ZERO,
            served: Duration::ZERO,
        }
    }

    /// Time at which sample `n` is due. Computed from the start, so that rounding errors do not accumulate.
    pub fn due(&self, n: u64) -> Instant {
        self.start + Duration::from_secs_f64(n as f64 * self.period)
    }

    /// Counts sample `n`, which is served now.
    pub fn serve(&mut self, n: u64) {
        self.served = self.start.elapsed();
        self.record(self.served.saturating_sub(self.due(n) - self.start));
    }

    /// Time from the start to the last sample, s.
    pub fn seconds(&self) -> f64 {
        self.served.as_secs_f64()
    }

    fn record(&mut self, lateness: Duration) {
        self.lateness.saturating_record(lateness.as_nanos() as u64);
        self.missed += u64::from(lateness.as_secs_f64() >= self.period);
        self.worst = self.worst.max(lateness);
    }

    /// The figures of all samples since the start or [`RealTimeClock::forget`]; of them, `held` had no drive in time.
    pub fn timing(&self, held: u64) -> Timing {
        // The upper limit of a class may be above the largest value in it.
        let quantile = |share| self.lateness.value_at_quantile(share);
        let quantile = |share| Duration::from_nanos(quantile(share)).min(self.worst).as_secs_f64();
        Timing {
            samples: self.lateness.len(),
            missed: self.missed,
            worst: self.worst.as_secs_f64(),
            held,
            p99: quantile(0.99),
            p99_99: quantile(0.9999),
        }
    }

    /// The classes of lateness with samples: upper limit, s, and number of samples.
    pub fn classes(&self) -> Vec<(f64, u64)> {
        let classes = self.lateness.iter_recorded();
        classes
            .map(|class| {
                (
                    Duration::from_nanos(class.value_iterated_to()).as_secs_f64(),
                    class.count_at_value(),
                )
            })
            .collect()
    }

    /// Forgets the lateness of the samples until now.
    pub fn forget(&mut self) {
        self.lateness.reset();
        (self.missed, self.worst) = (0, Duration::ZERO);
    }
}

/// The report of a rig in real time did not arrive.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("the rig's report was lost in the network: whether it got its drives in time is not known")]
pub struct ReportLost;

/// What a rig in real time reports to its client at the end.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Timing {
    /// Samples served.
    pub samples: u64,
    /// Samples that were late by a whole period or more.
    pub missed: u64,
    /// Largest lateness, s.
    pub worst: f64,
    /// Samples without a drive in time.
    pub held: u64,
    /// Lateness that 99 % of the samples do not exceed, s.
    pub p99: f64,
    /// Lateness that 99.99 % of the samples do not exceed, s.
    pub p99_99: f64,
}

impl Timing {
    /// What makes results doubtful: more than this share of the samples came too late, or had no drive in time.
    pub fn doubt(&self, tolerated: f64) -> Option<String> {
        let most = tolerated * self.samples.max(1) as f64;
        (self.missed.max(self.held) as f64 > most)
            .then(|| format!("a machine is too slow or too busy, or the network lost or delayed frames: {self}"))
    }

    pub(crate) fn write(&self, session: u64) -> Frame {
        let Self { samples, missed, worst, held, p99, p99_99 } = *self;
        let values = [samples as f64, missed as f64, worst, held as f64, p99, p99_99];
        Frame { values, ..Frame::new(Kind::Report, session) }
    }

    pub(crate) fn read(frame: &Frame) -> Self {
        let [samples, missed, worst, held, p99, p99_99] = frame.values;
        let [samples, missed, held] = [samples, missed, held].map(|count| count as u64);
        Self { samples, missed, worst, held, p99, p99_99 }
    }
}

impl Display for Timing {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Self { samples, missed, held, .. } = self;
        let [p99, p99_99, worst] = [self.p99, self.p99_99, self.worst].map(|lateness| 1e3 * lateness);
        write!(
            f,
            "of {samples} samples, {missed} missed their deadline (99 % were at most {p99:.3} ms late, 99.99 % {p99_99:.3} ms, the worst \
             {worst:.3} ms), and {held} had no drive in time"
        )
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
    /// The rig or the controller has failed; the drive was shut down, and the server ends.
    Failed,
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
    pub timing: Option<Timing>,
    /// Classes of the lateness with samples, for a rig in real time: upper limit, s, and number of samples.
    pub histogram: Vec<(f64, u64)>,
    /// Counters, for a rig in real time.
    pub counters: Option<Counters>,
}

impl Display for Session {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Self { peer, samples, seconds, .. } = self;
        let ended = match self.ended {
            Ended::Farewell => "ended by the client",
            Ended::Silence => "SHUT DOWN: the client was silent, or behind, for too long",
            Ended::Refused => "SHUT DOWN: the client sent a drive or a frame that is not allowed",
            Ended::Stopped => "stopped by the server",
            Ended::Failed => "SHUT DOWN: the rig or controller has failed",
        };
        let rate = if *seconds > 0.0 { *samples as f64 / seconds } else { 0.0 };
        let nominal = 1.0 / self.sample_time;
        writeln!(f, "session of {peer}: {ended}")?;
        writeln!(
            f,
            "  {samples} samples in {seconds:.3} s: {rate:.1} per second, nominal {nominal:.1}"
        )?;
        if let Some(timing) = &self.timing {
            writeln!(f, "  {timing}")?;
        }
        self.counters.map_or(Ok(()), |counters| writeln!(f, "  {counters}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_and_missed_deadlines_are_those_of_the_samples() {
        let mut clock = RealTimeClock::start(9.9995e-3);
        for n in 1..=10_000 {
            clock.record(Duration::from_micros(n));
        }
        let timing = clock.timing(3);
        for (quantile, expected) in [(timing.p99, 9.9e-3), (timing.p99_99, 9.999e-3)] {
            assert!((quantile / expected - 1.0).abs() < 1e-3, "{timing}");
        }
        let Timing { samples, missed, worst, held, .. } = timing;
        assert_eq!((samples, missed, worst, held), (10_000, 1, 1e-2, 3));
        assert_eq!(clock.classes().iter().map(|(_, count)| count).sum::<u64>(), 10_000);
        clock.forget();
        assert_eq!(clock.timing(0), Timing::default());
    }

    #[test]
    fn missed_deadlines_and_drives_that_came_too_late_are_doubtful() {
        for (missed, held, is_doubtful) in [(10, 10, false), (11, 0, true), (0, 11, true)] {
            let timing = Timing { samples: 1000, missed, held, ..Timing::default() };
            assert_eq!(timing.doubt(0.01).is_some(), is_doubtful, "{timing}");
        }
    }
}
