//! Counters of a session.

use std::fmt::{self, Display, Formatter};

use serde::Serialize;

/// Frames and samples of a session, counted by client or server.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Counters {
    /// Frames sent, including repetitions.
    pub sent: u64,
    /// Valid frames of this session.
    pub received: u64,
    /// Frames sent again because no answer arrived.
    pub resent: u64,
    /// Sequence numbers that were skipped.
    pub lost: u64,
    /// Frames that arrived after a later one, or after their sample.
    pub late: u64,
    /// Frames that were received before.
    pub repeated: u64,
    /// Frames of another sender or another session.
    pub foreign: u64,
    /// Datagrams that are not frames, and frames with invalid values.
    pub malformed: u64,
    /// Samples for which the last valid value was held.
    pub held: u64,
}

impl Counters {
    /// Whether any frame was not delivered once and in time.
    #[must_use]
    pub fn is_troubled(&self) -> bool {
        let Self { resent, lost, late, repeated, foreign, malformed, held, .. } = self;
        [resent, lost, late, repeated, foreign, malformed, held]
            .iter()
            .any(|count| **count > 0)
    }
}

impl Display for Counters {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Self {
            sent,
            received,
            resent,
            lost,
            late,
            repeated,
            foreign,
            malformed,
            held,
        } = self;
        write!(
            f,
            "{received} received, {sent} sent, {resent} sent again, {lost} lost, {late} late, {repeated} repeated, \
             {foreign} foreign, {malformed} malformed, {held} samples held"
        )
    }
}
