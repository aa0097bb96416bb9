//! Tests of `ramp`.

use super::*;

#[test]
fn after_a_shutdown_the_drive_ramps_to_zero_and_stays_there() {
    let drive = Drive { omega: 2.0, amplitude: 1.0, displacement: 0.5 };
    let mut ramp = Ramp::default();
    ramp.set(drive, false);
    assert_eq!(ramp.next(), drive);
    ramp.shut_down();
    let mut before = drive.amplitude;
    while !ramp.is_down() {
        let now = ramp.next().amplitude;
        assert!(now < before && before - now < 0.011);
        before = now;
        ramp.set(drive, false);
    }
    let down = Drive { amplitude: 0.0, displacement: 0.0, ..drive };
    assert_eq!(ramp.next(), down);
}
