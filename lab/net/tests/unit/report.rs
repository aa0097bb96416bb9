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
