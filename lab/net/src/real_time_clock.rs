//! The clock of a rig in real time, and the lateness of its samples.

use std::fmt::{self, Display, Formatter};
use std::time::{Duration, Instant};

use hdrhistogram::Histogram;
use serde::ser::SerializeStruct;
use serde::{Serialize, Serializer};

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

#[cfg(test)]
#[path = "../tests/unit/real_time_clock.rs"]
mod tests;
