//! The clock of a rig in real time, and the lateness of its samples.

use std::fmt::{self, Display, Formatter};
use std::time::{Duration, Instant};

use serde::Serialize;

/// Upper limits of the classes of lateness, in sample periods; the last class has none. A sample that is late by a whole
/// period has missed its deadline, because the next one is due then.
pub const CLASSES: [f64; 6] = [0.0625, 0.125, 0.25, 0.5, 1.0, 2.0];

/// Statistics of the lateness.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Punctuality {
    /// Number of samples per class; [`CLASSES`] has the upper limits.
    pub histogram: [u64; CLASSES.len() + 1],
    /// Number of samples that were late by a whole period or more.
    pub missed: u64,
    /// Largest lateness, s.
    pub worst: f64,
}

impl Punctuality {
    /// Counts a sample that was late by `lateness`, s, of a sample period, s.
    pub fn record(&mut self, lateness: f64, period: f64) {
        let share = lateness / period;
        let class = CLASSES.iter().take_while(|end| share >= **end).count();
        self.histogram[class] += 1;
        self.missed += u64::from(share >= 1.0);
        self.worst = self.worst.max(lateness);
    }
}

impl Display for Punctuality {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "  {} deadlines missed, at worst {:.3} ms late; lateness in sample periods:",
            self.missed,
            1e3 * self.worst
        )?;
        for (n, count) in self.histogram.iter().enumerate() {
            let class = CLASSES.get(n).map_or("longer".into(), |end| format!("below {end}"));
            writeln!(f, "    {class:<13}{count:>10}")?;
        }
        Ok(())
    }
}

/// The clock of a rig in real time.
#[derive(Debug, Clone, Copy)]
pub(super) struct RealTimeClock {
    start: Instant,
    /// s
    period: f64,
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
mod tests {
    use super::*;

    #[test]
    fn lateness_is_counted_in_its_class_and_a_whole_period_is_a_missed_deadline() {
        let mut all = Punctuality::default();
        for share in [0.0, 0.0625, 0.3, 0.999, 1.0, 5.0] {
            all.record(share * 0.25, 0.25);
        }
        assert_eq!(all.histogram, [1, 1, 0, 1, 1, 1, 1]);
        assert_eq!((all.missed, all.worst), (2, 1.25));
    }
}
