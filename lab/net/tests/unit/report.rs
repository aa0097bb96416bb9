//! Tests of `report`.

use super::*;

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
