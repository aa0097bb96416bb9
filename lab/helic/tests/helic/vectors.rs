//! Guards the codec: the vectors of the protocol, version 3 (`docs/protocol.md` of helic-daq, "Known-answer vectors").

use vines_helic::codec::{Frame, Packet, crc16, message, take_text};

use super::host::{device, scene};

fn bytes(hex: &str) -> Vec<u8> {
    hex.split_whitespace()
        .map(|byte| u8::from_str_radix(byte, 16).unwrap())
        .collect()
}

#[test]
fn the_checksum_has_the_published_values() {
    assert_eq!(crc16(b"123456789"), 0x29b1);
    assert_eq!(crc16(b""), 0xffff);
    assert_eq!(crc16(&[0]), 0xe1f0);
}

#[test]
fn every_frame_of_the_published_vectors_is_encoded_and_decoded() {
    let vectors = [
        (message::GET_PARAMS, 1, "00 00", "48 4C 01 01 02 00 00 00 89 0C"),
        (message::GET_SOURCES, 1, "", "48 4C 02 01 00 00 98 5E"),
        (
            message::SET_BLOCK,
            2,
            "0C 00 04 03 02 01 AA BB",
            "48 4C 05 02 08 00 0C 00 04 03 02 01 AA BB 39 A7",
        ),
        (
            message::COMMIT,
            3,
            "0C 00 04 03 02 01",
            "48 4C 06 03 06 00 0C 00 04 03 02 01 08 D1",
        ),
        (
            message::STATUS,
            1,
            "03 11 00 0D 00 00 FA 45 10 A4 00 00",
            "48 4C 0A 01 0C 00 03 11 00 0D 00 00 FA 45 10 A4 00 00 76 0A",
        ),
    ];
    for (kind, sequence, payload, expected) in vectors {
        let frame = Frame { kind, sequence, payload: bytes(payload) };
        assert_eq!(frame.encode(), bytes(expected), "{expected}");
        let whole = bytes(expected);
        let mut followed = [&whole[..], b"HL"].concat();
        assert_eq!(Frame::take(&mut followed), Ok(Some(frame)));
        assert_eq!(followed, b"HL");
        for cut in 0..whole.len() {
            let taken = Frame::take(&mut whole[..cut].to_vec());
            assert_eq!(taken, Ok(None), "{cut} bytes of {expected}");
        }
    }
    // Version, parameters, sources, sample rate, time since the start: the layout of the last payload.
    let mut device = device();
    let status = Frame { kind: message::STATUS, sequence: 1, payload: vec![] };
    let answer = device.handle(&status, 42_000).payload;
    let published = bytes(vectors[4].2);
    assert_eq!((answer.len(), answer[0]), (published.len(), published[0]));
    assert_eq!(answer[8..], published[8..]);
    let rate = |payload: &[u8]| f32::from_le_bytes(payload[4..8].try_into().unwrap());
    let expected = (1.0 / scene().sample_time()) as f32;
    assert_eq!([rate(&published), rate(&answer)], [8000.0, expected]);
}

#[test]
fn definitions_and_sources_have_the_published_form() {
    let mut device = device();
    let page = device.handle(
        &Frame { kind: message::GET_PARAMS, sequence: 0, payload: vec![0, 0] },
        0,
    );
    let published = bytes("66 72 65 71 00 66 01 00 01");
    assert!(page.payload.windows(published.len()).any(|part| part == published));
    let entries = bytes("61 64 63 30 00 56 00 6C 61 73 65 72 00 6D 6D 00");
    let mut rest = &entries[..];
    for expected in ["adc0", "V", "laser", "mm"] {
        assert_eq!(take_text(&mut rest).unwrap(), expected);
    }
    assert!(rest.is_empty());
}

#[test]
fn a_packet_of_the_stream_has_the_published_layout() {
    let packet = Packet {
        sequence: 0x0102_0304,
        first: 5,
        dropped: 6,
        decimation: 7,
        width: 2,
        values: vec![1.0, -2.0, 0.5, 0.0],
    };
    let expected =
        "48 4C 03 02 04 03 02 01 05 00 00 00 06 00 00 00 07 00 02 00 00 00 80 3F 00 00 00 C0 00 00 00 3F 00 00 00 00";
    assert_eq!(packet.encode(), bytes(expected));
    assert_eq!(Packet::decode(&bytes(expected)), Ok(packet));
    assert!(Packet::decode(&bytes(expected)[..30]).is_err());
}
