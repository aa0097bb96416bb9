//! The order of arrival: which frame is new, which came before, which comes too late.

/// What a sequence number is to a receiver.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Arrival {
    /// Newer than all before; `missing` numbers were left out.
    New { missing: u64 },
    /// Left out before, and here after all.
    Late,
    /// Here before.
    Repeated,
}

/// The numbers that have arrived.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Order {
    next: u64,
    /// Bit n: number `next - 1 - n` has arrived.
    seen: u64,
}

impl Order {
    /// Takes note of a number. What is more than 64 numbers old counts as late.
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
    fn numbers_in_order_are_new_and_miss_nothing() {
        let mut order = Order::default();
        for n in 0..1000 {
            assert_eq!(order.arrive(n), Arrival::New { missing: 0 });
        }
    }

    #[test]
    fn the_greatest_number_is_survived() {
        let mut order = Order::default();
        assert!(matches!(order.arrive(u64::MAX - 1), Arrival::New { .. }));
        assert_eq!(order.arrive(u64::MAX - 1), Arrival::Repeated);
        assert_eq!(order.arrive(0), Arrival::Late);
    }

    proptest! {
        #[test]
        fn any_order_is_told_as_a_list_of_all_that_came_would(numbers in prop::collection::vec(0u64..60, 1..200)) {
            let (mut order, mut seen, mut next) = (Order::default(), BTreeSet::new(), 0);
            for n in numbers {
                let fresh = seen.insert(n);
                let expected = match (n >= next, fresh) {
                    (true, _) => Arrival::New { missing: n - next },
                    (false, true) => Arrival::Late,
                    (false, false) => Arrival::Repeated,
                };
                next = next.max(n + 1);
                prop_assert_eq!(order.arrive(n), expected);
            }
        }
    }
}
