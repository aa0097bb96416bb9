//! Sequence numbers: whether a frame is new, repeated, or late.

/// Class of a sequence number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Arrival {
    /// Larger than all before; `missing` numbers were skipped.
    New { missing: u64 },
    /// Skipped before, received now.
    Late,
    /// Received before.
    Repeated,
}

/// The sequence numbers received: the largest one, and a window of 64 before it.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct SequenceWindow {
    next: u64,
    /// Bit n: number `next - 1 - n` was received.
    seen: u64,
}

impl SequenceWindow {
    /// Classifies and stores a number. A number older than the window counts as late.
    pub fn arrive(&mut self, sequence: u64) -> Arrival {
        if sequence >= self.next {
            let missing = sequence - self.next;
            let kept = u32::try_from(missing + 1).ok();
            self.seen = kept.and_then(|n| self.seen.checked_shl(n)).unwrap_or(0) | 1;
            self.next = sequence.saturating_add(1);
            return Arrival::New { missing };
        }
        let age = u32::try_from(self.next - 1 - sequence).unwrap_or(u32::MAX);
        let Some(bit) = 1u64.checked_shl(age) else {
            return Arrival::Late;
        };
        if self.seen & bit != 0 {
            return Arrival::Repeated;
        }
        self.seen |= bit;
        Arrival::Late
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    #[test]
    fn numbers_in_order_are_new_without_gaps() {
        let mut window = SequenceWindow::default();
        for n in 0..1000 {
            assert_eq!(window.arrive(n), Arrival::New { missing: 0 });
        }
    }

    #[test]
    fn the_largest_number_does_not_overflow() {
        let mut window = SequenceWindow::default();
        assert!(matches!(window.arrive(u64::MAX - 1), Arrival::New { .. }));
        assert_eq!(window.arrive(u64::MAX - 1), Arrival::Repeated);
        assert_eq!(window.arrive(0), Arrival::Late);
    }

    proptest! {
        #[test]
        fn every_order_is_classified_like_a_list_of_all_numbers(numbers in prop::collection::vec(0u64..60, 1..200)) {
            let (mut window, mut seen, mut next) = (SequenceWindow::default(), BTreeSet::new(), 0);
            for n in numbers {
                let fresh = seen.insert(n);
                let expected = match (n >= next, fresh) {
                    (true, _) => Arrival::New { missing: n - next },
                    (false, true) => Arrival::Late,
                    (false, false) => Arrival::Repeated,
                };
                next = next.max(n + 1);
                prop_assert_eq!(window.arrive(n), expected);
            }
        }
    }
}
