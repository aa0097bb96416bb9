//! A host that knows the protocol and nothing of the client of this project; and the rigs that are served.

use std::collections::HashMap;
use std::sync::{Arc, Mutex};

use vines_bench::rig::{Drive, Rig, RigError, Sensors, Simulated};
use vines_bench::scene::{PAPER, Scene};
use vines_helic::Device;
use vines_helic::codec::{ErrorCode, Frame, Packet, message, take_text};

pub fn scene() -> Scene {
    let mut scene = Scene::parse("paper.toml", PAPER, &[]).unwrap();
    scene.start = Default::default();
    scene
}

/// The plant of the default scene at rest, as a device.
pub fn device() -> Device {
    let scene = scene();
    let rig = Simulated::new(scene.plant, scene.start).unwrap();
    Device::new(Box::new(rig), scene.sample_time(), scene.plant.half_width).unwrap()
}

/// A rig that shows the displacement of its base.
#[derive(Clone, Default)]
pub struct Base(pub Arc<Mutex<f64>>);

impl Base {
    pub fn get(&self) -> f64 {
        *self.0.lock().unwrap()
    }

    /// This rig as a device, with a limit of the output, m.
    pub fn device(&self, largest: f64) -> Device {
        Device::new(Box::new(self.clone()), scene().sample_time(), largest).unwrap()
    }
}

impl Rig for Base {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        Ok(Sensors { response: 1e-3, reference: Some(self.get()) })
    }

    fn advance(&mut self, drive: Drive, _: f64) -> Result<(), RigError> {
        assert!(drive.is_held);
        *self.0.lock().unwrap() = drive.displacement;
        Ok(())
    }
}

/// Asks a device, as a host would over TCP.
pub struct Host {
    pub device: Device,
    /// Indices and types.
    pub parameters: HashMap<String, (u16, u8)>,
    pub sources: Vec<String>,
}

impl Host {
    pub fn new(device: Device) -> Self {
        let (parameters, sources) = (HashMap::new(), Vec::new());
        let mut host = Self { device, parameters, sources };
        loop {
            let start = host.parameters.len() as u16;
            let page = host.ask(message::GET_PARAMS, &start.to_le_bytes()).unwrap();
            assert!(page[..2] == start.to_le_bytes() && page.len() <= 1024);
            let mut rest = &page[4..];
            while !rest.is_empty() {
                let name = take_text(&mut rest).unwrap();
                assert!(name.len() <= 23, "{name}");
                host.parameters.insert(name, (host.parameters.len() as u16, rest[0]));
                rest = &rest[4..];
            }
            let next = u16::from_le_bytes([page[2], page[3]]);
            assert_eq!(usize::from(next), host.parameters.len());
            if next == start {
                break;
            }
        }
        let answer = host.ask(message::GET_SOURCES, &[]).unwrap();
        let mut rest = &answer[..];
        while !rest.is_empty() {
            host.sources.push(take_text(&mut rest).unwrap());
            take_text(&mut rest).unwrap();
        }
        assert!(host.sources.iter().all(|name| name.len() <= 15));
        host
    }

    pub fn ask(&mut self, kind: u8, payload: &[u8]) -> Result<Vec<u8>, ErrorCode> {
        let request = Frame { sequence: 7, ..Frame::new(kind, payload) };
        let answer = self.device.handle(&request, 0);
        assert_eq!(answer.sequence, 7);
        if answer.kind == message::ERROR {
            assert_eq!(answer.payload[1], kind);
            return Err(ErrorCode::of_number(answer.payload[0]).unwrap());
        }
        assert_eq!(answer.kind, kind);
        Ok(answer.payload)
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

    pub fn get(&mut self, name: &str) -> u32 {
        let index = self.parameters[name].0.to_le_bytes();
        u32::from_le_bytes(self.ask(message::GET_PAR, &index).unwrap().try_into().unwrap())
    }

    pub fn tick(&mut self, samples: u32) {
        (0..samples).for_each(|_| drop(self.device.tick().unwrap()));
    }

    pub fn set_up(&mut self, names: &[&str], decimation: u16, count: u32) -> Result<(), ErrorCode> {
        let head = [
            &decimation.to_le_bytes()[..],
            &count.to_le_bytes(),
            &[names.len() as u8],
        ]
        .concat();
        let position = |name: &&str| self.sources.iter().position(|own| own == name).unwrap() as u8;
        let sources: Vec<u8> = names.iter().map(position).collect();
        self.ask(message::STREAM_SETUP, &[head, sources].concat()).map(drop)
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
                let samples = (packet.first..).step_by(decimation.into());
                for (sample, record) in samples.zip(packet.values.chunks_exact(names.len())) {
                    at.push(sample);
                    records.push(record.to_vec());
                }
            }
        }
        assert_eq!(records.len(), count as usize);
        (at, records)
    }
}
