//! Guards the format: frames and the readings and commands in them survive encoding; other versions and sizes are named.
//! Damaged and random bytes: `tests/fuzz`.

use super::*;
use proptest::prelude::*;

proptest! {
    #[test]
    fn every_frame_is_decoded_to_the_same_bits(
        (kind, flags) in (prop::sample::select(&KINDS[..]), any::<u8>()),
        (session, sequence, time, values) in any::<(u64, u64, u64, [u64; VALUES])>(),
    ) {
        let (time, values) = (f64::from_bits(time), values.map(f64::from_bits));
        let bytes = Frame { kind, flags, session, sequence, time, values }.encode();
        // NaN is not equal to itself; its bits are.
        prop_assert_eq!(Frame::decode(&bytes).unwrap().encode(), bytes);
    }

    #[test]
    fn readings_and_drives_survive_the_frame(
        (response, reference) in any::<(f64, Option<f64>)>(),
        motion in any::<Option<(i32, f64, f64, f64)>>(),
        (omega, amplitude, displacement) in (0.0..1e6, 0.0..1e6, -1e6..1e6),
        (phase_error, settled) in (prop::option::of(-3.0..3.0), any::<bool>()),
        (state, fault) in (-1..8, 0..7),
    ) {
        let ground_truth = motion.map(|(impacts, impact_time, impact_velocity, particle_velocity)| {
            GroundTruth { impacts: impacts.into(), impact_time, impact_velocity, particle_velocity, friction: None }
        });
        let reading = Reading { sensors: Sensors { response, reference }, ground_truth };
        let frame = write_reading(Frame::new(Kind::Hello, 1), &reading);
        prop_assert_eq!(read_reading(&Frame::decode(&frame.encode()).unwrap()), reading);
        let drive = Drive { omega, amplitude, displacement };
        let (state, fault) = (LoopState::of_number(state), Fault::of_number(fault));
        let settled = (settled || state.is_some()).then_some(settled);
        let command = Command { drive, phase_error, settled, state, fault };
        let frame = write_command(Frame::new(Kind::Hello, 1), &command);
        prop_assert_eq!(read_command(&Frame::decode(&frame.encode()).unwrap()), command);
    }
}

#[test]
fn another_version_is_recognised_in_a_datagram_of_any_size() {
    let longer = [&b"VINE\x07\x00"[..], &[0; 100]].concat();
    assert_eq!(Frame::decode(&longer), Err(FrameError::Version(7)));
    for short in [&b"VINE"[..], b"VINE\x02\x00", b"VINE\x02\x00 short", b"EVIN\x02\x00"] {
        assert_eq!(Frame::decode(short), Err(FrameError::Malformed));
    }
}

/// The checksums of the bytes are from Python's `struct` and `zlib`, by the specification.
#[test]
fn frames_of_every_kind_have_the_recorded_bytes() {
    let at = Frame {
        sequence: 7,
        time: 0.25,
        ..Frame::new(Kind::Hello, 0x0102_0304_0506_0708)
    };
    let drive = Drive { omega: 55.5, amplitude: 9e-5, displacement: -1e-5 };
    let (state, fault) = (LoopState::of_number(3), Fault::of_number(5));
    let command = Command {
        drive,
        phase_error: Some(-1e-3),
        settled: Some(true),
        state,
        fault,
    };
    let [impact_time, impact_velocity, particle_velocity] = [0.2, -0.3, 0.4];
    let motion = GroundTruth {
        impacts: 12,
        impact_time,
        impact_velocity,
        particle_velocity,
        friction: None,
    };
    let reading = |reference, ground_truth| Reading { sensors: Sensors { response: 1e-3, reference }, ground_truth };
    let to = Move {
        response: 1e-2,
        duration: 2.0,
        amplitude: -1e-6,
        omega: 0.01,
        growth: 1e-4,
    };
    let mut report = at;
    report.values = [100.0, 3.0, 0.01, 2.0, 1e-4, 2e-3];
    let timing = crate::timing::Timing::read(&report);
    for (frame, checksum) in [
        (write_reading(at, &reading(Some(2e-5), Some(motion))), 0x85c2_255d),
        (write_reading(at, &reading(None, None)), 0xeace_b0e8),
        (write_command(at, &command), 0xaa91_d8c9),
        (write_command(at, &Command { drive, ..Command::default() }), 0x93f5_78a2),
        (write_move(at, to, -1.5), 0xe432_a772),
        (timing.write(at.session), 0x348a_9c27),
        (
            Refusal::Drive { index: 2, value: 1.0, limit: 0.01 }.answer(&at),
            0x02d2_922c,
        ),
        (Refusal::SampleTime(1e-3).answer(&at), 0x0bb1_66c2),
    ] {
        let bytes = frame.encode();
        assert_eq!(crc32fast::hash(&bytes[..CHECKSUM_AT]), checksum, "{frame:?}");
        assert_eq!(bytes[CHECKSUM_AT..], checksum.to_le_bytes());
    }
}
