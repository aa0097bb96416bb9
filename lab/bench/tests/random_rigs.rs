//! Random rigs, locked from rest.

use vines_testbench::random_rigs::{Outcome, locks};

#[test]
fn random_rigs_lock_from_rest_or_say_why_not() {
    let rows = locks(24, 5, &[]).unwrap();
    for row in rows.iter().filter(|row| row.outcome != Outcome::Locked) {
        println!("{row:?}");
        assert!(row.message.as_ref().is_some_and(|message| !message.is_empty()));
    }
    let count = |outcome| rows.iter().filter(|row| row.outcome == outcome).count();
    assert_eq!((count(Outcome::Failed), count(Outcome::Inaccurate)), (0, 0));
    assert!(count(Outcome::Locked) >= 20);
}
