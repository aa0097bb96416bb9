//! Guards device and host against random and mutated frames: a device that gets mutated frames beside genuine ones does what one does that gets the genuine ones only.

#[path = "../../net/tests/fuzz/noise.rs"]
mod noise;

use std::io;
use std::sync::{Arc, Mutex};

use vines_helic::codec::{Frame, Packet, message};
use vines_helic::{Device, HelicRig, Transport};
use vines_testbench::rig::{Drive, Rig, RigError, Sensors};
use vines_testbench::scene::Names;

use noise::{Noise, size};

/// m
const LARGEST: f64 = 5e-3;

type Log = Arc<Mutex<f64>>;

/// A rig that says how it is driven.
struct Spy(Log);

impl Rig for Spy {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        Ok(Sensors { response: 1e-3, reference: Some(0.0) })
    }

    fn advance(&mut self, _: Drive, _: f64) -> Result<(), RigError> {
        unreachable!()
    }

    fn hold(&mut self, drive: Drive, _: f64) -> Result<(), RigError> {
        *self.0.lock().unwrap() = drive.displacement;
        Ok(())
    }
}

fn device() -> (Device, Log) {
    let log = Log::default();
    (
        Device::new(Box::new(Spy(Arc::clone(&log))), 1e-3, LARGEST).unwrap(),
        log,
    )
}

/// A request that makes sense, or one of the right form with random content.
fn request(noise: &mut Noise) -> Frame {
    let index = |noise: &mut Noise, first, count| ((first + noise.below(count)) as u16).to_le_bytes().to_vec();
    let mut payload = match noise.below(4) {
        0 => {
            let length = noise.below(40);
            noise.bytes(length)
        }
        // A small integer, a float, and the series of forcing or target.
        1 => [index(noise, 0, 50), (noise.below(3) as u32).to_le_bytes().into()].concat(),
        2 => [index(noise, 0, 50), (noise.below(9) as f32 / 8.0).to_le_bytes().into()].concat(),
        _ => {
            let mut series = index(noise, 11, 2);
            (0..33).for_each(|_| series.extend((noise.below(100) as f32 / 1000.0).to_le_bytes()));
            series
        }
    };
    let kind = match noise.below(3) {
        0 => noise.below(13) as u8,
        _ => message::SET_PAR,
    };
    if kind == message::GET_PARAMS {
        payload.truncate(2);
    }
    Frame { kind, sequence: noise.next() as u8, payload }
}

#[test]
fn mutated_frames_never_drive_a_helic_device() {
    let (frames, seed) = size();
    let mut noise = Noise(seed ^ 4);
    let ((mut attacked, moved), (mut clean, expected)) = (device(), device());
    let (mut collisions, mut driven) = (0u64, 0u64);
    for n in 0..frames {
        let genuine = request(&mut noise);
        let mut bytes = genuine.encode();
        noise.mutate(&mut bytes);
        if bytes != genuine.encode()
            && let Ok(Some(frame)) = Frame::take(&mut bytes)
        {
            // The checksum has 16 bits: such a frame is as good as sent.
            collisions += 1;
            assert_eq!(attacked.handle(&frame, 0), clean.handle(&frame, 0));
        }
        if n % 8 == 0 {
            assert_eq!(attacked.handle(&genuine, 0), clean.handle(&genuine, 0));
            let (mine, theirs) = (attacked.tick().unwrap(), clean.tick().unwrap());
            assert_eq!(mine, theirs);
            let out = *moved.lock().unwrap();
            assert_eq!(out, *expected.lock().unwrap());
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
        for _ in 0..100 {
            if let Some((_, mut bytes)) = self.0.tick().unwrap() {
                if self.1.below(2) == 0 {
                    self.1.mutate(&mut bytes);
                    let length = self.1.below(2 * bytes.len());
                    bytes.resize(length, 0);
                }
                return Ok(bytes);
            }
        }
        Err(io::ErrorKind::TimedOut.into())
    }

    fn port(&self) -> io::Result<u16> {
        Ok(1)
    }
}

#[test]
fn damaged_answers_and_packets_never_make_the_host_panic() {
    let (frames, seed) = size();
    let mut noise = Noise(seed ^ 5);
    let (mut packets, mut runs) = (0, 0);
    while packets < frames / 10 {
        runs += 1;
        let transport = Damaged(device().0, Noise(noise.next()));
        packets += 1;
        let Ok(mut rig) = HelicRig::new(transport, &Names::default(), 1e-3, 100.0) else {
            continue;
        };
        for n in 0..1000 {
            let drive = Drive {
                omega: 50.0 + f64::from(n),
                amplitude: 1e-4,
                displacement: 0.0,
            };
            if rig.sense().and_then(|_| rig.advance(drive, 1e-3)).is_err() {
                break;
            }
        }
        packets += rig.counters.received + rig.counters.malformed;
    }
    for _ in 0..frames {
        let length = noise.below(200);
        let mut bytes = noise.bytes(length);
        if length > 3 {
            bytes[..3].copy_from_slice(b"HL\x03");
        }
        let _ = (Packet::decode(&bytes), Frame::take(&mut bytes));
    }
    println!("helic host: {packets} packets, half of them damaged, in {runs} runs; {frames} random datagrams decoded");
}
