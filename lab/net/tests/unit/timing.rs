//! Lateness of samples, and the texts of a report.

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

#[test]
fn a_session_without_a_sample_reports_numbers_only() {
    let session = Session {
        peer: ([127, 0, 0, 1], 1).into(),
        ended: Ended::Silence,
        samples: 0,
        sample_time: 1e-3,
        seconds: 0.0,
        punctuality: None,
        counters: Some(Counters::default()),
    };
    let text = session.to_string();
    assert!(
        text.contains("0 samples in 0.000 s: 0.0 per second") && !text.contains("NaN"),
        "{text}"
    );
}

#[test]
fn missed_deadlines_and_drives_that_came_too_late_are_told_apart() {
    let timing = |missed, held| Timing { samples: 1000, missed, held, ..Timing::default() };
    assert_eq!(timing(10, 10).doubt(0.01), None);
    let told = |timing: Timing| timing.doubt(0.01).unwrap();
    let (rig, network) = (told(timing(11, 0)), told(timing(0, 999)));
    assert!(rig.starts_with("the rig missed deadlines: its machine"), "{rig}");
    assert!(
        network.starts_with("drives did not reach the rig in time: the network")
            && network.contains("999 had no drive"),
        "{network}"
    );
    assert!(told(timing(11, 11)).starts_with("the rig missed deadlines, and drives"));
}
