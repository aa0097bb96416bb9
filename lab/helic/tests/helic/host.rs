//! A host that knows the protocol and nothing of the client of this project.

use std::collections::HashMap;

use vines_helic::Device;
use vines_helic::codec::{ErrorCode, Frame, Packet, message, take_text};
use vines_testbench::rig::Simulated;
use vines_testbench::scene::{PAPER, Scene};

pub fn scene() -> Scene {
    let mut scene = Scene::parse("paper.toml", PAPER, &[]).unwrap();
    scene.start = Default::default();
    scene
}

/// The plant of the default scene at rest.
pub fn device() -> Device {
    let scene = scene();
    let rig = Simulated::new(scene.plant, scene.start).unwrap();
    Device::new(Box::new(rig), scene.sample_time(), scene.plant.half_width).unwrap()
}

/// Asks a device, as a host would over TCP.
pub struct Host {
    pub device: Device,
    pub parameters: HashMap<String, (u16, u8)>,
}

impl Host {
    pub fn new(mut device: Device) -> Self {
        let mut parameters = HashMap::new();
        loop {
            let start = parameters.len() as u16;
            let request = Frame {
                kind: message::GET_PARAMS,
                sequence: 7,
                payload: start.to_le_bytes().into(),
            };
            let answer = device.handle(&request, 0);
            assert_eq!((answer.kind, answer.sequence), (message::GET_PARAMS, 7));
            assert_eq!(answer.payload[..2], start.to_le_bytes());
            assert!(answer.payload.len() <= 1024);
            let mut rest = &answer.payload[4..];
            while !rest.is_empty() {
                let name = take_text(&mut rest).unwrap();
                assert!(name.len() <= 23, "{name}");
                parameters.insert(name, (parameters.len() as u16, rest[0]));
                rest = &rest[4..];
            }
            let next = u16::from_le_bytes([answer.payload[2], answer.payload[3]]);
            assert_eq!(usize::from(next), parameters.len());
            if next == start {
                break;
            }
        }
        Self { device, parameters }
    }

    pub fn ask(&mut self, kind: u8, payload: &[u8]) -> Result<Vec<u8>, ErrorCode> {
        let answer = self
            .device
            .handle(&Frame { kind, sequence: 1, payload: payload.into() }, 0);
        match answer.kind {
            message::ERROR => {
                assert_eq!(answer.payload[1], kind);
                Err(ErrorCode::of_number(answer.payload[0]).unwrap())
            }
            same => {
                assert_eq!(same, kind);
                Ok(answer.payload)
            }
        }
    }

    pub fn set(&mut self, name: &str, values: &[f32]) -> Result<(), ErrorCode> {
        let (index, code) = self.parameters[name];
        let mut payload = index.to_le_bytes().to_vec();
        payload.extend(values.iter().flat_map(|value| match code {
            b'f' => value.to_le_bytes(),
            _ => (*value as u32).to_le_bytes(),
        }));
        self.ask(message::SET_PAR, &payload).map(drop)
    }

    pub fn get(&mut self, name: &str) -> Vec<u8> {
        let index = self.parameters[name].0;
        self.ask(message::GET_PAR, &index.to_le_bytes()).unwrap()
    }

    pub fn number(&mut self, name: &str) -> u32 {
        u32::from_le_bytes(self.get(name).try_into().unwrap())
    }

    pub fn sources(&mut self) -> Vec<String> {
        let answer = self.ask(message::GET_SOURCES, &[]).unwrap();
        let (mut names, mut rest) = (Vec::new(), &answer[..]);
        while !rest.is_empty() {
            names.push(take_text(&mut rest).unwrap());
            assert!(names.iter().all(|name| name.len() <= 15));
            take_text(&mut rest).unwrap();
        }
        names
    }

    pub fn set_up(&mut self, names: &[&str], decimation: u16, count: u32) -> Result<(), ErrorCode> {
        let all = self.sources();
        let mut payload = [
            &decimation.to_le_bytes()[..],
            &count.to_le_bytes(),
            &[names.len() as u8],
        ]
        .concat();
        payload.extend(
            names
                .iter()
                .map(|name| all.iter().position(|one| one == name).unwrap() as u8),
        );
        self.ask(message::STREAM_SETUP, &payload).map(drop)
    }

    /// A finite capture: all records, and their samples.
    pub fn capture(&mut self, names: &[&str], decimation: u16, count: u32) -> (Vec<u32>, Vec<Vec<f32>>) {
        self.set_up(names, decimation, count).unwrap();
        self.ask(message::STREAM_START, &5000u16.to_le_bytes()).unwrap();
        let (mut at, mut records, mut sequence) = (Vec::new(), Vec::new(), 0);
        for _ in 0..=count * u32::from(decimation) + 100 {
            if let Some((port, bytes)) = self.device.tick().unwrap() {
                let packet = Packet::decode(&bytes).unwrap();
                assert_eq!((port, packet.sequence, packet.decimation), (5000, sequence, decimation));
                assert!(bytes.len() <= 1472);
                sequence += 1;
                for (n, record) in packet.values.chunks_exact(names.len()).enumerate() {
                    at.push(packet.first + n as u32 * u32::from(decimation));
                    records.push(record.to_vec());
                }
            }
        }
        assert_eq!(records.len(), count as usize);
        (at, records)
    }
}
