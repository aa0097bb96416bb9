//! Guards the device as a rig of the bench, sample by sample and without a clock: the same figures on any machine.

use std::collections::VecDeque;
use std::io;

use vines_helic::codec::Frame;
use vines_helic::{Device, HelicRig, Transport};
use vines_net::Counters;
use vines_testbench::experiment;
use vines_testbench::identification::{Lock, identify};
use vines_testbench::rig::{BuiltIn, Drive, Rig, RigError, Sensors, Simulated};
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

/// Drives the rig for some samples, and returns its readings.
fn shake<T: Transport>(rig: &mut HelicRig<T>, samples: usize, step: f64) -> Result<Vec<Sensors>, RigError> {
    let mut sample = || {
        let sensors = rig.sense()?;
        rig.advance(drive(), step)?;
        Ok(sensors)
    };
    (0..samples).map(|_| sample()).collect()
}

/// How often the n-th datagram arrives.
type Fate = fn(usize) -> usize;

/// The locked point of the default scene, on the plant or on a device with this many samples per sample of the scene.
fn lock(device: Option<(f64, Fate)>) -> (Lock, Counters) {
    let mut scene = Scene::parse("paper.toml", PAPER, &[]).unwrap();
    scene.record.decay_periods = Some(150.0);
    let (mut plant, step) = (Simulated::new(scene.plant, scene.start).unwrap(), scene.sample_time());
    let measure = |rig: &mut dyn Rig| {
        let mut controller = BuiltIn::new(&scene.controller_config()).unwrap();
        let record = experiment::run(rig, &mut controller, &scene, |_, _, _| {}).unwrap();
        identify(&record, &scene).unwrap().lock
    };
    let Some((samples, fate)) = device else {
        return (measure(&mut plant), Counters::default());
    };
    let device = Device::new(Box::new(plant), step / samples, scene.plant.half_width).unwrap();
    let direct = Direct { device, ..Direct::new(fate) };
    let mut rig = HelicRig::new(direct, &Names::default(), step, 100.0).unwrap();
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
    let step = scene().sample_time();
    // Every seventh is lost, every fifth comes twice.
    let mut rig = connect(|n| if n % 7 == 3 { 0 } else { 1 + usize::from(n % 5 == 2) });
    let readings = shake(&mut rig, 4000, step).unwrap();
    println!("{}", rig.counters);
    assert!(rig.counters.held > 400 && rig.counters.late > 100, "{}", rig.counters);
    // The samples keep their times, and those that were lost repeat the period before.
    for (n, sensors) in readings.iter().enumerate().skip(300) {
        let expected = 9e-5 * (55.0 * (n - 1) as f64 * step).sin();
        let error = (sensors.reference.unwrap() - expected).abs();
        assert!(error < 2e-3 * 9e-5, "{n}: {error}");
    }
}

#[test]
fn a_longer_blackout_or_a_device_that_has_tripped_ends_the_run_and_says_so() {
    let step = scene().sample_time();
    let mut rig = connect(|n| usize::from(!(100..140).contains(&n)));
    let message = shake(&mut rig, 1000, step).unwrap_err().to_string();
    let parts = [
        "samples of the helic device did not arrive, 0.1",
        "up to 0.15 s are bridged",
    ];
    assert!(parts.iter().all(|part| message.contains(part)), "{message}");

    let mut rig = connect(|_| 1);
    shake(&mut rig, 50, step).unwrap();
    let mut host = Host::new(device());
    std::mem::swap(&mut host.device, &mut rig.transport().device);
    assert_eq!(host.number("safety"), 1);
    host.set("arm", &[0.0]).unwrap();
    std::mem::swap(&mut host.device, &mut rig.transport().device);
    let message = shake(&mut rig, 1000, step).unwrap_err().to_string();
    assert!(message.contains("output of the helic device is off"), "{message}");
}

#[test]
fn names_and_rates_that_do_not_fit_are_explained_and_a_slower_scene_uses_every_second_sample() {
    let step = scene().sample_time();
    let names = |text: &str| {
        let text = format!("{PAPER}\n[rig.names]\n{text}");
        Scene::parse("mapped.toml", &text, &[]).unwrap().rig_names
    };
    let refused = |names: Names, step: f64| {
        let rig = HelicRig::new(Direct::new(|_| 1), &names, step, 70.0);
        rig.err().unwrap().to_string()
    };
    let missing = refused(names("response = { name = \"laser\", unit = \"mm\" }"), step);
    assert!(
        missing.contains("no source \"laser\"") && missing.contains("response [mm]"),
        "{missing}"
    );
    assert!(refused(names("force = \"F\""), step).contains("maps `force`"));
    let rate = refused(Names::default(), 0.7 * step);
    assert!(rate.contains("controller.samples_per_period"), "{rate}");
    let mut rig = HelicRig::new(Direct::new(|_| 1), &Names::default(), 2.0 * step, 50.0).unwrap();
    shake(&mut rig, 100, 2.0 * step).unwrap();
    assert!(!rig.counters.is_troubled());
}

#[test]
fn the_drive_has_the_phase_of_the_host_however_late_its_commands_are() {
    let step = scene().sample_time();
    for under_way in [0, 10, 30] {
        let mut direct = Direct { under_way, ..Direct::new(|_| 1) };
        let mut host = Host::new(direct.device);
        host.set("freq", &[37.0]).unwrap();
        (0..777).for_each(|_| drop(host.device.tick().unwrap()));
        direct.device = host.device;
        let mut rig = HelicRig::new(direct, &Names::default(), step, 100.0).unwrap();
        let mut driven = 0;
        for (n, sensors) in (-1..).zip(shake(&mut rig, 600, step).unwrap()) {
            // The base is held from the sample before.
            let (base, expected) = (sensors.reference.unwrap(), 9e-5 * (55.0 * step * f64::from(n)).sin());
            driven += u32::from(base != 0.0);
            assert!(
                base == 0.0 || (base - expected).abs() < 1e-9,
                "{under_way}, {n}: {base} {expected}"
            );
        }
        assert!(driven > 300, "{under_way}: {driven}");
    }
}
