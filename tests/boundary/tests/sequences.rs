//! Random sequences of calls; `scripts/stress` makes many more of them.

use fmi2_boundary::{Fmu, fuzz};

#[test]
fn calls_in_any_order_are_answered_and_every_error_has_a_reason() {
    for fmu in [Fmu::plant(), Fmu::controller()] {
        let tally = (0..400)
            .map(|seed| fuzz::sequence(&fmu, seed))
            .fold(fuzz::Tally::default(), |sum, one| sum.and(&one));
        let [ok, _, _, error, fatal, _] = tally.statuses;
        assert_eq!(fatal, 0);
        assert!(ok > tally.calls() / 10 && error > tally.calls() / 10);
        assert!(tally.harmless > 100);
    }
}
