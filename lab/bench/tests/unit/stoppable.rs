//! Tests of `stoppable`.

use std::sync::Mutex;

use super::*;

struct Log(Arc<Mutex<Vec<Drive>>>);

impl Rig for Log {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        Ok(Sensors { response: 1.0, reference: None })
    }

    fn advance(&mut self, drive: Drive, _: f64) -> Result<(), RigError> {
        self.0.lock().unwrap().push(drive);
        Ok(())
    }
}

#[test]
fn a_rig_that_is_stopped_gets_a_zero_drive_and_fails() {
    let (drives, stop) = (Arc::default(), Arc::default());
    let mut rig = Stoppable::around(Box::new(Log(Arc::clone(&drives))), 0.1, &stop);
    let drive = Drive { omega: 1.0, amplitude: 2.0, displacement: 0.0 };
    assert_eq!(rig.sense().unwrap().response, 1.0);
    rig.advance(drive, 0.1).unwrap();
    stop.store(true, Ordering::Relaxed);
    assert!(rig.sense().unwrap_err().cause::<Interrupted>().is_some());
    assert_eq!(*drives.lock().unwrap(), [drive, Drive::default()]);
}
