//! Guards the drive of a served rig after a loss of frames and after a shutdown.

use super::*;

use vines_testbench::rig::Sensors;

/// A rig that shows the base displacement.
#[derive(Default)]
struct Base(f64);

impl Rig for Base {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        Ok(Sensors { response: self.0, reference: None })
    }

    fn advance(&mut self, _: Drive, _: f64) -> Result<(), RigError> {
        unreachable!()
    }

    fn hold(&mut self, drive: Drive, _: f64) -> Result<(), RigError> {
        self.0 = drive.displacement;
        Ok(())
    }
}

#[test]
fn a_base_of_held_samples_follows_its_sine_where_no_sample_arrives() {
    let (mut ramp, mut base) = (Ramp::default(), Base::default());
    for n in 0..140 {
        let displacement = 1e-4 * (0.06 * f64::from(n)).sin();
        if !(50..77).contains(&n) {
            ramp.set(Drive { omega: 60.0, amplitude: 1e-4, displacement }, true);
        }
        ramp.apply(&mut base, 1e-3).unwrap();
        assert!((base.0 - displacement).abs() < 1e-12, "{n}");
    }
    // Samples that are not those of a sine: no displacement beyond the amplitude. Samples of an unknown motion are held.
    for displacement in [-1e-4, 1e-4] {
        ramp.set(Drive { omega: 60.0, amplitude: 1e-4, displacement }, true);
    }
    for _ in 0..500 {
        ramp.apply(&mut base, 1e-3).unwrap();
        assert!(base.0.abs() <= 1e-4);
    }
    ramp.set(Drive { displacement: 5e-5, ..Drive::default() }, true);
    (0..3).for_each(|_| ramp.apply(&mut base, 1e-3).unwrap());
    assert_eq!(base.0, 5e-5);
}

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
