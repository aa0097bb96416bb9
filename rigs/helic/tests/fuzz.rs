//! Guards device and host against random and mutated frames: a device that gets mutated frames beside genuine ones does what one does that gets the genuine ones only.

#[expect(dead_code, reason = "the other tests use it, too")]
#[path = "helic/host.rs"]
mod host;
#[path = "../../net/tests/fuzz/noise.rs"]
mod noise;

use std::io;

use vines_bench::rig::{Drive, Rig};
use vines_bench::scene::Names;
use vines_helic::codec::{Frame, Packet, message};
use vines_helic::{Device, HelicRig, Transport};

use host::{Base, scene};
use noise::{Noise, size};

/// m
const LARGEST: f64 = 5e-3;

/// A request that makes sense, or one of the right form with random content.
fn request(noise: &mut Noise) -> Frame {
    let mut payload = (noise.below(50) as u16).to_le_bytes().to_vec();
    match noise.below(4) {
        0 => {
            let length = noise.below(40);
            payload = noise.bytes(length);
        }
        // A small integer, a float, and the series of forcing or target.
        1 => payload.extend((noise.below(3) as u32).to_le_bytes()),
        2 => payload.extend((noise.below(9) as f32 / 8.0).to_le_bytes()),
        _ => {
            payload = vec![11 + noise.below(2) as u8, 0];
            payload.extend((0..33).flat_map(|_| (noise.below(100) as f32 / 1000.0).to_le_bytes()));
        }
    }
    let kind = match noise.below(3) {
        0 => noise.below(13) as u8,
        _ => message::SET_PAR,
    };
    if kind == message::GET_PARAMS {
        payload.truncate(2);
    }
    Frame { sequence: noise.next() as u8, ..Frame::new(kind, payload) }
}

#[test]
fn mutated_frames_never_drive_a_helic_device() {
    let (frames, seed) = size();
    let mut noise = Noise::new(seed ^ 4);
    let [moved, expected] = [(); 2].map(|()| Base::default());
    let (mut attacked, mut clean) = (moved.device(LARGEST), expected.device(LARGEST));
    let (mut collisions, mut driven) = (0u64, 0u64);
    for n in 0..frames {
        let genuine = request(&mut noise);
        let mut bytes = genuine.encode();
        noise.mutate(&mut bytes);
        if bytes != genuine.encode()
            && let Ok(frame) = Frame::read(&mut &bytes[..], &mut Vec::new())
        {
            // The checksum has 16 bits: such a frame is as good as sent.
            collisions += 1;
            assert_eq!(attacked.handle(&frame, 0), clean.handle(&frame, 0));
        }
        if n % 8 == 0 {
            assert_eq!(attacked.handle(&genuine, 0), clean.handle(&genuine, 0));
            assert_eq!(attacked.tick().unwrap(), clean.tick().unwrap());
            let out = moved.get();
            assert_eq!(out, expected.get());
            assert!(out.abs() <= LARGEST && (out == 0.0 || attacked.is_driven()));
            driven += u64::from(out != 0.0);
        }
    }
    println!(
        "helic device: {frames} frames, {collisions} with a correct checksum by chance; driven at {driven} samples"
    );
    assert!(driven > 0);
}

/// A device whose answers and packets are damaged.
struct Damaged(Device, Noise);

impl Transport for Damaged {
    fn request(&mut self, request: &Frame) -> io::Result<Frame> {
        let mut answer = self.0.handle(request, 0);
        if self.1.below(200) == 0 && !answer.payload.is_empty() {
            self.1.mutate(&mut answer.payload);
        }
        Ok(answer)
    }

    fn datagram(&mut self) -> io::Result<Vec<u8>> {
        let packet = (0..100).find_map(|_| self.0.tick().unwrap());
        let (_, mut bytes) = packet.ok_or(io::ErrorKind::TimedOut)?;
        if self.1.below(2) == 0 {
            self.1.mutate(&mut bytes);
            let length = self.1.below(2 * bytes.len());
            bytes.resize(length, 0);
        }
        Ok(bytes)
    }
}

#[test]
fn damaged_answers_and_packets_never_make_the_host_panic() {
    let (frames, seed) = size();
    let (mut noise, step) = (Noise::new(seed ^ 5), scene().sample_time());
    let (mut packets, mut runs) = (0, 0);
    while packets < frames / 10 {
        (runs, packets) = (runs + 1, packets + 1);
        let transport = Damaged(Base::default().device(LARGEST), Noise::new(noise.next()));
        let Ok(mut rig) = HelicRig::new(transport, &Names::default(), step, 100.0) else {
            continue;
        };
        let _ = (0..1000).try_for_each(|n| {
            rig.sense()?;
            rig.advance(
                Drive {
                    omega: 50.0 + f64::from(n),
                    amplitude: 1e-4,
                    ..Drive::default()
                },
                step,
            )
        });
        packets += rig.counters.received + rig.counters.malformed;
    }
    for _ in 0..frames {
        let length = noise.below(200);
        let mut bytes = noise.bytes(length);
        if length > 3 {
            bytes[..3].copy_from_slice(b"HL\x03");
        }
        let _ = (Packet::decode(&bytes), Frame::read(&mut &bytes[..], &mut Vec::new()));
    }
    println!("helic host: {packets} packets, half of them damaged, in {runs} runs; {frames} random datagrams decoded");
}
