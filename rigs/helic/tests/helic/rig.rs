//! Guards the device as a rig of the bench, sample by sample and without a clock: the same figures on any machine.

use std::collections::VecDeque;
use std::io;
use std::mem::swap;

use vines_bench::experiment;
use vines_bench::identification::{Lock, identify};
use vines_bench::rig::{BuiltIn, Drive, Rig, RigError, Sensors, Simulated};
use vines_bench::scene::{Names, PAPER, Scene};
use vines_helic::codec::Frame;
use vines_helic::{Device, HelicRig, Transport};
use vines_net::Counters;

use super::host::{Host, device, scene};

/// How often the n-th datagram arrives.
type Fate = fn(usize) -> usize;

/// A device that takes its samples when a datagram is asked for. The last `under_way` datagrams have not arrived yet.
struct Direct {
    device: Device,
    fate: Fate,
    number: usize,
    waiting: VecDeque<Vec<u8>>,
    under_way: usize,
}

impl Direct {
    fn new(device: Device, fate: Fate, under_way: usize) -> Self {
        Self { device, fate, number: 0, waiting: VecDeque::new(), under_way }
    }

    /// As a rig, with this many samples per sample of a device with the rate of the scene.
    fn rig(self, names: &Names, ratio: f64) -> Result<HelicRig<Self>, RigError> {
        HelicRig::new(self, names, ratio * scene().sample_time(), 100.0 / ratio)
    }
}

impl Transport for Direct {
    fn request(&mut self, request: &Frame) -> io::Result<Frame> {
        Ok(self.device.handle(request, 0))
    }

    fn datagram(&mut self) -> io::Result<Vec<u8>> {
        for _ in 0..2000 {
            if self.waiting.len() > self.under_way {
                return Ok(self.waiting.pop_front().unwrap());
            }
            if let Some((_, bytes)) = self.device.tick().unwrap() {
                let copies = (self.fate)(self.number);
                self.waiting.extend(std::iter::repeat_n(bytes, copies));
                self.number += 1;
            }
        }
        Err(io::ErrorKind::TimedOut.into())
    }
}

fn connect(fate: Fate) -> HelicRig<Direct> {
    Direct::new(device(), fate, 0).rig(&Names::default(), 1.0).unwrap()
}

/// Drives the rig for some samples, and returns its readings.
fn shake(rig: &mut HelicRig<Direct>, samples: usize) -> Result<Vec<Sensors>, RigError> {
    let drive = Drive { omega: 55.0, amplitude: 9e-5, ..Drive::default() };
    let mut sample = || {
        let sensors = rig.sense()?;
        rig.advance(drive, scene().sample_time())?;
        Ok(sensors)
    };
    (0..samples).map(|_| sample()).collect()
}

/// The locked point of the default scene, on the plant or on a device with this many samples per sample of the scene.
fn lock(device: Option<(f64, Fate)>) -> (Lock, Counters) {
    let mut scene = Scene::parse("paper.toml", PAPER, &[]).unwrap();
    scene.record.decay_periods = Some(150.0);
    let (mut plant, step) = (Simulated::new(scene.plant, scene.start).unwrap(), scene.sample_time());
    let measure = |rig: &mut dyn Rig| {
        let mut controller = BuiltIn::new(&scene.plan().lock).unwrap();
        let record = experiment::run(&mut Vec::new(), rig, &mut controller, &scene.plan(), |_, _| {}).unwrap();
        identify(&record, &scene.plan()).unwrap().lock
    };
    let Some((samples, fate)) = device else {
        return (measure(&mut plant), Counters::default());
    };
    let device = Device::new(Box::new(plant), step / samples, scene.plant.half_width).unwrap();
    let mut rig = HelicRig::new(Direct::new(device, fate, 0), &Names::default(), step, 100.0).unwrap();
    (measure(&mut rig), rig.counters)
}

#[test]
fn the_experiment_on_a_device_gives_the_backbone_of_the_plant_also_through_lost_datagrams() {
    let expected = lock(None).0.at;
    let [coarse, fine] = [8.0, 16.0].map(|samples| {
        let (found, counters) = lock(Some((samples, |_| 1)));
        assert!(!counters.is_troubled(), "{counters}");
        assert!((found.at.c - expected.c).abs() < 1e-3);
        found.at
    });
    // The device holds its output for a sample, which is half a sample late: the difference is proportional to its sample time.
    let late = [coarse, fine].map(|found| found.sigma - expected.sigma);
    println!(
        "sigma = {}, with 8 and 16 samples of the device {late:?} more",
        expected.sigma
    );
    assert!(
        (late[0] / late[1] - 2.0).abs() < 0.2 && late[1].abs() < 0.003,
        "{late:?}"
    );
    // The first one; one in fifty, and now and then six in a row, 30 ms.
    let lost = |n| usize::from(n != 0 && n * 7919 % 50 != 13 && n % 997 <= 990);
    let (found, counters) = lock(Some((8.0, lost)));
    assert!(counters.held > 300, "{counters}");
    let distance = (found.at.sigma - coarse.sigma).abs().max((found.at.c - coarse.c).abs());
    assert!(distance < 1e-3, "{distance}");
}

#[test]
fn lost_and_repeated_datagrams_are_counted_and_bridged() {
    // Every seventh is lost, every fifth comes twice.
    let mut rig = connect(|n| if n % 7 == 3 { 0 } else { 1 + usize::from(n % 5 == 2) });
    let readings = shake(&mut rig, 4000).unwrap();
    println!("{}", rig.counters);
    assert!(rig.counters.held > 400 && rig.counters.late > 100, "{}", rig.counters);
    // The samples keep their times, and those that were lost repeat the period before.
    for (n, sensors) in readings.iter().enumerate().skip(300) {
        let expected = 9e-5 * (55.0 * (n - 1) as f64 * scene().sample_time()).sin();
        let error = (sensors.reference.unwrap() - expected).abs();
        assert!(error < 2e-3 * 9e-5, "{n}: {error}");
    }
}

#[test]
fn a_longer_blackout_or_a_device_that_has_tripped_ends_the_run_and_says_so() {
    let mut rig = connect(|n| usize::from(!(100..140).contains(&n)));
    let message = shake(&mut rig, 1000).unwrap_err().to_string();
    for part in [
        "samples of the helic device did not arrive, 0.1",
        "up to 0.15 s are bridged",
    ] {
        assert!(message.contains(part), "{message}");
    }
    let mut rig = connect(|_| 1);
    shake(&mut rig, 50).unwrap();
    let mut host = Host::new(device());
    swap(&mut host.device, &mut rig.transport.device);
    assert_eq!(host.get("safety"), 1);
    host.set("arm", &[0.0]).unwrap();
    swap(&mut host.device, &mut rig.transport.device);
    let message = shake(&mut rig, 1000).unwrap_err().to_string();
    assert!(message.contains("output of the helic device is off"), "{message}");
}

#[test]
fn names_and_rates_that_do_not_fit_are_explained_and_a_slower_scene_uses_every_second_sample() {
    let direct = || Direct::new(device(), |_| 1, 0);
    for (name, ratio, parts) in [
        (
            "response = { name = \"laser\", unit = \"mm\" }",
            1.0,
            ["no source \"laser\"", "response [mm]"],
        ),
        ("force = \"F\"", 1.0, ["maps `force`", "there are response, base and E"]),
        (
            "",
            0.7,
            ["set controller.samples_per_period", "(or that over an integer)"],
        ),
    ] {
        let text = format!("{PAPER}\n[rig.names]\n{name}");
        let names = Scene::parse("mapped.toml", &text, &[]).unwrap().rig_names;
        let refused = direct().rig(&names, ratio).err().unwrap().to_string();
        assert!(parts.iter().all(|part| refused.contains(part)), "{refused}");
    }
    let mut rig = direct().rig(&Names::default(), 2.0).unwrap();
    shake(&mut rig, 100).unwrap();
    assert!(!rig.counters.is_troubled());
}

#[test]
fn the_drive_has_the_phase_of_the_host_however_late_its_commands_are() {
    for under_way in [0, 10, 30] {
        let mut host = Host::new(device());
        host.set("freq", &[37.0]).unwrap();
        host.tick(777);
        let mut rig = Direct::new(host.device, |_| 1, under_way)
            .rig(&Names::default(), 1.0)
            .unwrap();
        let mut driven = 0;
        for (n, sensors) in (-1..).zip(shake(&mut rig, 600).unwrap()) {
            // The base is held from the sample before.
            let expected = 9e-5 * (55.0 * scene().sample_time() * f64::from(n)).sin();
            let base = sensors.reference.unwrap();
            driven += u32::from(base != 0.0);
            assert!(
                base == 0.0 || (base - expected).abs() < 1e-9,
                "{under_way}, {n}: {base} {expected}"
            );
        }
        assert!(driven > 300, "{under_way}: {driven}");
    }
}
