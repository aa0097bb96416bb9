//! Guards the codec: the vectors of the protocol, version 3 (`docs/protocol.md` of helic-daq, "Known-answer vectors").

use std::io::ErrorKind;

use vines_helic::codec::{Frame, Packet, checksum, message, take_text};

use super::host::{device, scene};

fn bytes(hex: &str) -> Vec<u8> {
    let byte = |byte| u8::from_str_radix(byte, 16).unwrap();
    hex.split_whitespace().map(byte).collect()
}

#[test]
fn every_frame_of_the_published_vectors_is_encoded_and_decoded() {
    for (text, expected) in [(&b"123456789"[..], 0x29b1), (b"", 0xffff), (&[0], 0xe1f0)] {
        assert_eq!(checksum(text), expected);
    }
    for vector in [
        "48 4C 01 01 02 00 00 00 89 0C",
        "48 4C 02 01 00 00 98 5E",
        "48 4C 05 02 08 00 0C 00 04 03 02 01 AA BB 39 A7",
        "48 4C 06 03 06 00 0C 00 04 03 02 01 08 D1",
        "48 4C 0A 01 0C 00 03 11 00 0D 00 00 FA 45 10 A4 00 00 76 0A",
    ] {
        let whole = bytes(vector);
        let (kind, sequence, payload) = (whole[2], whole[3], whole[6..whole.len() - 2].to_vec());
        let frame = Frame { kind, sequence, payload };
        assert_eq!(frame.encode(), whole, "{vector}");
        let (followed, mut rest) = ([&whole[..], b"HL"].concat(), Vec::new());
        assert_eq!(Frame::read(&mut &followed[..], &mut rest).unwrap(), frame);
        assert_eq!(rest, b"HL");
        for cut in 0..whole.len() {
            let kind = Frame::read(&mut &whole[..cut], &mut Vec::new()).unwrap_err().kind();
            assert_eq!(kind, ErrorKind::UnexpectedEof, "{cut} bytes of {vector}");
        }
    }
}

#[test]
fn status_definitions_and_sources_have_the_published_form() {
    let mut device = device();
    // Version, parameters, sources, sample rate, time since the start: the layout of the last vector.
    let answer = device.handle(&Frame::new(message::STATUS, []), 42_000).payload;
    let published = bytes("03 11 00 0D 00 00 FA 45 10 A4 00 00");
    assert_eq!((answer.len(), answer[0]), (published.len(), published[0]));
    assert_eq!(answer[8..], published[8..]);
    assert_eq!(published[4..8], 8000f32.to_le_bytes());
    assert_eq!(answer[4..8], ((1.0 / scene().sample_time()) as f32).to_le_bytes());
    let page = device.handle(&Frame::new(message::GET_PARAMS, [0, 0]), 0);
    let published = bytes("66 72 65 71 00 66 01 00 01");
    assert!(page.payload.windows(published.len()).any(|part| part == published));
    let entries = bytes("61 64 63 30 00 56 00 6C 61 73 65 72 00 6D 6D 00");
    let mut rest = &entries[..];
    assert_eq!(
        [(); 4].map(|()| take_text(&mut rest).unwrap()),
        ["adc0", "V", "laser", "mm"]
    );
    assert!(rest.is_empty());
}

#[test]
fn a_packet_of_the_stream_has_the_published_layout() {
    let expected = bytes(
        "48 4C 03 02 04 03 02 01 05 00 00 00 06 00 00 00 07 00 02 00 00 00 80 3F 00 00 00 C0 00 00 00 3F 00 00 00 00",
    );
    let packet = Packet {
        sequence: 0x0102_0304,
        first: 5,
        decimation: 7,
        width: 2,
        values: vec![1.0, -2.0, 0.5, 0.0],
    };
    // A packet of this device has lost no record before.
    let encoded = [&expected[..12], &[0; 4], &expected[16..]].concat();
    assert_eq!(packet.encode(), encoded);
    assert_eq!(Packet::decode(&expected), Ok(packet));
    assert!(Packet::decode(&expected[..30]).is_err());
}
