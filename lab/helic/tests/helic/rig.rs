//! Guards the device as a rig of the bench, sample by sample and without a clock: the same figures on any machine.

use std::collections::VecDeque;
use std::io;

use vines_helic::codec::Frame;
use vines_helic::{Device, HelicRig, Transport};
use vines_testbench::experiment::{self, Plan};
use vines_testbench::identification::identify;
use vines_testbench::rig::{BuiltIn, Drive, Rig, Simulated};
use vines_testbench::scene::{Names, PAPER, Scene};

use super::host::{Host, device, scene};

/// A device that takes its samples when a datagram is asked for; `fate` says how often a datagram arrives. The last `under_way` datagrams
/// have not arrived yet.
struct Direct<F> {
    device: Device,
    fate: F,
    number: usize,
    waiting: VecDeque<Vec<u8>>,
    under_way: usize,
}

impl<F: FnMut(usize) -> usize> Direct<F> {
    fn new(fate: F) -> Self {
        Self {
            device: device(),
            fate,
            number: 0,
            waiting: VecDeque::new(),
            under_way: 0,
        }
    }
}

impl<F: FnMut(usize) -> usize> Transport for Direct<F> {
    fn request(&mut self, request: &Frame) -> io::Result<Frame> {
        Ok(self.device.handle(request, 0))
    }

    fn datagram(&mut self) -> io::Result<Vec<u8>> {
        for _ in 0..2000 {
            if self.waiting.len() > self.under_way
                && let Some(bytes) = self.waiting.pop_front()
            {
                return Ok(bytes);
            }
            if let Some((_, bytes)) = self.device.tick().unwrap() {
                let copies = (self.fate)(self.number);
                self.waiting.extend(std::iter::repeat_n(bytes, copies));
                self.number += 1;
            }
        }
        Err(io::ErrorKind::TimedOut.into())
    }

    fn port(&self) -> io::Result<u16> {
        Ok(1)
    }
}

fn connect<F: FnMut(usize) -> usize>(fate: F) -> HelicRig<Direct<F>> {
    let scene = scene();
    let samples = scene.controller.samples_per_period;
    HelicRig::new(Direct::new(fate), &Names::default(), scene.sample_time(), samples).unwrap()
}

fn drive() -> Drive {
    Drive { omega: 55.0, amplitude: 9e-5, displacement: 0.0 }
}

#[test]
fn the_experiment_on_a_device_gives_the_backbone_of_the_plant() {
    let mut scene = scene();
    scene.record.decay_periods = Some(150.0);
    let plant = || Simulated::new(scene.plant, scene.start).unwrap();
    let step = scene.sample_time();
    let run = |rig: &mut dyn Rig| {
        let mut controller = BuiltIn::new(&scene.controller_config()).unwrap();
        let record = experiment::run(rig, &mut controller, &Plan::of(&scene), |_, _, _| {}).unwrap();
        identify(&record, &scene).unwrap().lock
    };
    let expected = run(&mut plant());
    // The device holds its output for a sample, which is half a sample late: the difference is proportional to its sample time.
    let [coarse, fine] = [8.0, 16.0].map(|samples| {
        let device = Device::new(Box::new(plant()), step / samples, scene.plant.half_width).unwrap();
        let direct = Direct { device, ..Direct::new(|_| 1) };
        let mut rig = HelicRig::new(direct, &Names::default(), step, 100.0).unwrap();
        let found = run(&mut rig);
        assert!(!rig.counters.is_troubled(), "{}", rig.counters);
        assert!((found.at.c - expected.at.c).abs() < 1e-3);
        found.at.sigma - expected.at.sigma
    });
    println!(
        "sigma = {}, {coarse} more with 8 and {fine} more with 16 samples of the device",
        expected.at.sigma
    );
    assert!(
        (coarse / fine - 2.0).abs() < 0.2 && fine.abs() < 0.003,
        "{coarse} {fine}"
    );
}

#[test]
fn lost_and_repeated_datagrams_are_counted_and_bridged() {
    let scene = scene();
    // Every seventh is lost, every fifth comes twice.
    let mut rig = connect(|n| if n % 7 == 3 { 0 } else { 1 + usize::from(n % 5 == 2) });
    let mut readings = Vec::new();
    for _ in 0..4000 {
        readings.push(rig.sense().unwrap());
        rig.advance(drive(), scene.sample_time()).unwrap();
    }
    println!("{}", rig.counters);
    assert!(rig.counters.held > 400 && rig.counters.late > 100, "{}", rig.counters);
    // The samples keep their times, and those that were lost repeat the period before.
    for (n, sensors) in readings.iter().enumerate().skip(300) {
        let expected = 9e-5 * (55.0 * (n - 1) as f64 * scene.sample_time()).sin();
        let error = (sensors.reference.unwrap() - expected).abs();
        assert!(error < 2e-3 * 9e-5, "{n}: {error}");
    }
}

#[test]
fn an_experiment_rides_through_lost_datagrams_and_gives_the_same_backbone() {
    let mut scene = scene();
    scene.start = Scene::parse("paper.toml", PAPER, &[]).unwrap().start;
    let run = |fate: fn(usize) -> usize| {
        let plant = Simulated::new(scene.plant, scene.start).unwrap();
        let device = Device::new(Box::new(plant), scene.sample_time() / 8.0, scene.plant.half_width).unwrap();
        let direct = Direct { device, ..Direct::new(fate) };
        let mut rig = HelicRig::new(direct, &Names::default(), scene.sample_time(), 100.0).unwrap();
        let mut controller = BuiltIn::new(&scene.controller_config()).unwrap();
        let record = experiment::run(&mut rig, &mut controller, &Plan::of(&scene), |_, _, _| {}).unwrap();
        println!("{}", rig.counters);
        (identify(&record, &scene).unwrap().lock, rig.counters)
    };
    let (expected, _) = run(|_| 1);
    // The first one; one in fifty, and now and then six in a row, 30 ms.
    let (found, counters) = run(|n| usize::from(n != 0 && n * 7919 % 50 != 13 && n % 997 <= 990));
    assert!(counters.held > 300, "{counters}");
    let distance = (found.at.sigma - expected.at.sigma)
        .abs()
        .max((found.at.c - expected.at.c).abs());
    assert!(distance < 1e-3, "{distance}");
}

#[test]
fn a_longer_blackout_ends_the_run_and_says_how_long_it_was() {
    let scene = scene();
    let mut rig = connect(|n| usize::from(!(100..140).contains(&n)));
    let error = (0..1000).find_map(|_| {
        let sensed = rig.sense();
        sensed.and_then(|_| rig.advance(drive(), scene.sample_time())).err()
    });
    let message = error.unwrap().to_string();
    assert!(
        message.contains("samples of the helic device did not arrive, 0.1"),
        "{message}"
    );
    assert!(message.contains("up to 0.15 s are bridged"), "{message}");
}

#[test]
fn a_device_that_has_tripped_ends_the_run() {
    let scene = scene();
    let mut rig = connect(|_| 1);
    for _ in 0..50 {
        rig.sense().unwrap();
        rig.advance(drive(), scene.sample_time()).unwrap();
    }
    let mut host = Host::new(device());
    std::mem::swap(&mut host.device, &mut rig.transport().device);
    assert_eq!(host.number("safety"), 1);
    host.set("arm", &[0.0]).unwrap();
    std::mem::swap(&mut host.device, &mut rig.transport().device);
    let error = (0..1000).find_map(|_| {
        rig.sense()
            .and_then(|_| rig.advance(drive(), scene.sample_time()))
            .err()
    });
    assert!(error.unwrap().to_string().contains("output of the helic device is off"));
}

#[test]
fn names_and_rates_that_do_not_fit_are_explained() {
    let scene = scene();
    let step = scene.sample_time();
    let mapped = format!("{PAPER}\n[rig.names]\nresponse = {{ name = \"laser\", unit = \"mm\" }}\n");
    let names = Scene::parse("mapped.toml", &mapped, &[]).unwrap().rig_names;
    let refused = HelicRig::new(Direct::new(|_| 1), &names, step, 100.0)
        .err()
        .unwrap()
        .to_string();
    assert!(
        refused.contains("no source \"laser\"") && refused.contains("response [mm]"),
        "{refused}"
    );
    let refused = HelicRig::new(Direct::new(|_| 1), &Names::default(), 0.7 * step, 70.0)
        .err()
        .unwrap();
    assert!(
        refused.to_string().contains("controller.samples_per_period"),
        "{refused}"
    );
}

#[test]
fn a_slower_scene_uses_every_second_sample_of_the_device() {
    let scene = scene();
    let mut rig = HelicRig::new(Direct::new(|_| 1), &Names::default(), 2.0 * scene.sample_time(), 50.0).unwrap();
    for _ in 0..100 {
        rig.sense().unwrap();
        rig.advance(Drive::default(), 2.0 * scene.sample_time()).unwrap();
    }
    assert!(!rig.counters.is_troubled());
}

#[test]
fn the_drive_has_the_phase_of_the_host_however_late_its_commands_are() {
    let scene = scene();
    for under_way in [0, 10, 30] {
        let mut direct = Direct { under_way, ..Direct::new(|_| 1) };
        let mut host = Host::new(direct.device);
        host.set("freq", &[37.0]).unwrap();
        (0..777).for_each(|_| drop(host.device.tick().unwrap()));
        direct.device = host.device;
        let mut rig = HelicRig::new(direct, &Names::default(), scene.sample_time(), 100.0).unwrap();
        let turn = 55.0 * scene.sample_time();
        let mut driven = 0;
        for n in 0..600 {
            let base = rig.sense().unwrap().reference.unwrap();
            // The base is held from the sample before.
            let expected = 9e-5 * (turn * f64::from(n - 1)).sin();
            driven += u32::from(base != 0.0);
            assert!(
                base == 0.0 || (base - expected).abs() < 1e-9,
                "{under_way}, {n}: {base} {expected}"
            );
            rig.advance(drive(), scene.sample_time()).unwrap();
        }
        assert!(driven > 300, "{under_way}: {driven}");
    }
}
