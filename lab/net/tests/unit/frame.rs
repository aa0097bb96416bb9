//! Guards the format: frames and the readings and commands in them survive encoding; damaged, foreign and random bytes are refused.

use super::*;
use proptest::prelude::*;

fn frames() -> impl Strategy<Value = Frame> {
    let numbers = prop::array::uniform6(any::<u64>());
    (1u8..=8, any::<u8>(), any::<u64>(), any::<u64>(), any::<u64>(), numbers).prop_map(
        |(kind, flags, session, sequence, time, values)| Frame {
            kind: KINDS[usize::from(kind) - 1],
            flags,
            session,
            sequence,
            time: f64::from_bits(time),
            values: values.map(f64::from_bits),
        },
    )
}

proptest! {
    #[test]
    fn every_frame_is_decoded_to_the_same_bits(frame in frames()) {
        let bytes = frame.encode();
        let back = Frame::decode(&bytes).unwrap();
        // NaN is not equal to itself; its bits are.
        prop_assert_eq!(back.encode(), bytes);
    }

    #[test]
    fn a_frame_with_up_to_three_inverted_bits_is_refused(frame in frames(), turned in prop::collection::btree_set(0..SIZE * 8, 1..=3)) {
        let mut bytes = frame.encode();
        for bit in turned {
            bytes[bit / 8] ^= 1 << (bit % 8);
        }
        prop_assert!(Frame::decode(&bytes).is_err());
    }

    #[test]
    fn no_datagram_makes_the_decoder_panic(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        prop_assert!(Frame::decode(&bytes).is_err());
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
        let command = Command { drive, phase_error, settled, state, fault };
        let frame = write_command(Frame::new(Kind::Hello, 1), &command);
        prop_assert_eq!(read_command(&Frame::decode(&frame.encode()).unwrap()), command);
    }
}

#[test]
fn the_layout_is_the_documented_one() {
    let frame = Frame {
        kind: Kind::Drive,
        flags: flag::SETTLED,
        session: 0x0102_0304_0506_0708,
        sequence: 9,
        time: 0.5,
        values: [1.0, 2.0, 0.0, 0.0, 0.0, -1.0],
    };
    let bytes = frame.encode();
    assert_eq!(&bytes[..8], b"VINE\x02\x00\x05\x02");
    assert_eq!(bytes[8..16], [8, 7, 6, 5, 4, 3, 2, 1]);
    assert_eq!(bytes[16..24], [9, 0, 0, 0, 0, 0, 0, 0]);
    assert_eq!(bytes[24..32], 0.5f64.to_le_bytes());
    assert_eq!(bytes[72..80], (-1.0f64).to_le_bytes());
    // The value of zlib.crc32 in Python.
    assert_eq!(bytes[80..], 0xe40e_f90du32.to_le_bytes());
}

#[test]
fn another_version_is_recognised_in_a_datagram_of_any_size() {
    let longer = [&b"VINE\x07\x00"[..], &[0; 100]].concat();
    assert_eq!(Frame::decode(&longer), Err(FrameError::Version(7)));
    assert_eq!(Frame::decode(b"VINE"), Err(FrameError::Magic));
    assert_eq!(Frame::decode(b"VINE\x02\x00 short"), Err(FrameError::Size(12)));
}

#[test]
fn frames_of_every_kind_have_the_recorded_bytes() {
    let at = Frame {
        sequence: 7,
        time: 0.25,
        ..Frame::new(Kind::Hello, 0x0102_0304_0506_0708)
    };
    let drive = Drive { omega: 55.5, amplitude: 9e-5, displacement: -1e-5 };
    let (state, fault) = (LoopState::of_number(3), Fault::of_number(5));
    let command = Command { drive, phase_error: Some(-1e-3), settled: true, state, fault };
    let sensors = Sensors { response: 1e-3, reference: Some(2e-5) };
    let motion = GroundTruth {
        impacts: 12,
        impact_time: 0.2,
        impact_velocity: -0.3,
        particle_velocity: 0.4,
        friction: None,
    };
    let to = Move {
        response: 1e-2,
        duration: 2.0,
        amplitude: -1e-6,
        omega: 0.01,
        growth: 1e-4,
    };
    let timing = crate::timing::Timing {
        samples: 100,
        missed: 3,
        worst: 0.01,
        held: 2,
        p99: 1e-4,
        p99_99: 2e-3,
    };
    let bare = Reading {
        sensors: Sensors { reference: None, ..sensors },
        ground_truth: None,
    };
    let frames = [
        write_reading(at, &Reading { sensors, ground_truth: Some(motion) }),
        write_reading(at, &bare),
        write_command(at, &command),
        write_command(at, &Command { drive, ..Command::default() }),
        write_move(at, to, -1.5),
        timing.write(at.session),
        Refusal::Drive { index: 2, value: 1.0, limit: 0.01 }.answer(&at),
        Refusal::SampleTime(1e-3).answer(&at),
    ];
    let checksums = frames.map(|frame| crc32fast::hash(&frame.encode()[..CHECKSUM_AT]));
    // From Python's `struct` and `zlib`, by the specification.
    let recorded = [
        0x85c2_255d,
        0xeace_b0e8,
        0xaa91_d8c9,
        0x93f5_78a2,
        0xe432_a772,
        0x348a_9c27,
        0x02d2_922c,
        0x0bb1_66c2,
    ];
    assert_eq!(checksums, recorded);
}
