//! Tests of `payload`.

use super::*;
use proptest::prelude::*;

proptest! {
    #[test]
    fn readings_survive_the_frame(response: f64, reference: Option<f64>, ground_truth: Option<(i32, f64, f64, f64)>) {
        let reading = Reading {
            sensors: Sensors { response, reference },
            ground_truth: ground_truth.map(|(impacts, impact_time, impact_velocity, particle_velocity)| GroundTruth {
                impacts: impacts.into(), impact_time, impact_velocity, particle_velocity,
            }),
        };
        let frame = write_reading(Frame::new(Kind::Hello, 1), &reading);
        prop_assert_eq!(read_reading(&Frame::decode(&frame.encode()).unwrap()), reading);
    }

    #[test]
    fn drives_survive_the_frame(omega in 0.0..1e6, amplitude in 0.0..1e6, displacement in -1e6..1e6, phase_error in proptest::option::of(-3.0..3.0), settled: bool, state in -1..8, fault in 0..7) {
        let command = Command {
            drive: Drive { omega, amplitude, displacement },
            phase_error,
            settled,
            state: LoopState::of_number(state),
            fault: Fault::of_number(fault),
        };
        let frame = write_command(Frame::new(Kind::Hello, 1), &command);
        prop_assert_eq!(read_command(&Frame::decode(&frame.encode()).unwrap()), command);
    }
}
