//! What has happened on a link.

use std::fmt::{self, Display, Formatter};

use serde::Serialize;

/// Frames and samples of one session at one end.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Counters {
    /// Frames sent, those sent again included.
    pub sent: u64,
    /// Frames of this session that arrived whole.
    pub received: u64,
    /// Frames sent again because no answer had come.
    pub resent: u64,
    /// Numbers that had not arrived when a later one did.
    pub lost: u64,
    /// Frames that arrived after a later one, or after their sample had passed.
    pub late: u64,
    /// Frames that had arrived before.
    pub repeated: u64,
    /// Frames from another sender or of another session.
    pub foreign: u64,
    /// Datagrams that are no frames, and frames with numbers that cannot be used.
    pub malformed: u64,
    /// Samples for which the last good value was taken again.
    pub held: u64,
}

impl Counters {
    /// Whether anything went other than it should.
    #[must_use]
    pub fn is_troubled(&self) -> bool {
        let Self {
            resent,
            lost,
            late,
            repeated,
            foreign,
            malformed,
            held,
            ..
        } = self;
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
