//! Tests of `real_time_clock`.

use super::*;

#[test]
fn quantiles_and_missed_deadlines_are_those_of_the_samples() {
    let mut all = Punctuality::default();
    for n in 1..=10_000 {
        all.record(f64::from(n) * 1e-6, 9.9995e-3);
    }
    for (share, expected) in [(0.5, 5e-3), (0.99, 9.9e-3), (0.9999, 9.999e-3)] {
        assert!(
            (all.quantile(share) / expected - 1.0).abs() < 1e-3,
            "{share}: {}",
            all.quantile(share)
        );
    }
    assert_eq!((all.samples(), all.missed, all.worst), (10_000, 1, 1e-2));
    assert_eq!(all.classes().iter().map(|(_, count)| count).sum::<u64>(), 10_000);
    assert!(
        all.to_string().contains("p99.99 10000.0 us, maximum 10000.0 us"),
        "{all}"
    );
}
