//! A foreign tone on the response sensor.

use std::f64::consts::TAU;

use vines_testbench::backbone::track;
use vines_testbench::experiment::{self, Plan};
use vines_testbench::identification::{Regime, foreign_tone, identify, regime_by_response};
use vines_testbench::record::Sample;
use vines_testbench::rig::{BuiltIn, Chain, Command, Drive, Rig, RigError, Sensors, Simulated};
use vines_testbench::scene::{LinearResponse, PAPER, Scene};

/// A rig without ground truth, whose response sensor reads tones, too: hertz and metres.
struct Humming<'a> {
    rig: Box<dyn Rig>,
    tones: &'a [(f64, f64)],
    time: f64,
}

impl Rig for Humming<'_> {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        let sensors = self.rig.sense()?;
        let tones = self
            .tones
            .iter()
            .map(|(hertz, size)| size * (TAU * hertz * self.time + 1.0).sin());
        Ok(Sensors { response: sensors.response + tones.sum::<f64>(), ..sensors })
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        self.time += step;
        self.rig.advance(drive, step)
    }
}

fn scene(settings: &[&str]) -> Scene {
    let overrides: Vec<_> = settings.iter().map(|one| one.parse().unwrap()).collect();
    let mut scene = Scene::parse("paper.toml", PAPER, &overrides).unwrap();
    scene.measured = Some(LinearResponse::of(&scene));
    scene
}

fn rig<'a>(scene: &Scene, tones: &'a [(f64, f64)]) -> Humming<'a> {
    let plant = Simulated::new(scene.plant, scene.start)
        .unwrap()
        .with_sensors(scene.resonance);
    Humming { rig: Chain::around(Box::new(plant), scene), tones, time: 0.0 }
}

/// Mains hum and a ripple with harmonics: hertz, and share of a response of C = 0.55.
const TONES: [&[(f64, f64)]; 4] = [
    &[(50.0, 0.1)],
    &[(60.0, 0.1)],
    &[(50.0, 0.02)],
    &[(50.0, 0.1), (100.0, 0.05), (150.0, 0.03)],
];

fn in_metres(tones: &[(f64, f64)], scene: &Scene) -> Vec<(f64, f64)> {
    let response = 0.55 * scene.plant.half_width;
    tones.iter().map(|(hertz, share)| (*hertz, share * response)).collect()
}

/// Settings of rigs: noise of two seeds, another particle, and rest at the start.
const RIGS: [&[&str]; 4] = [
    &["chain.snr=60"],
    &["chain.snr=60", "chain.seed=2"],
    &["plant.r=0.6", "plant.m=0.03"],
    &["start.dq2=0"],
];

#[test]
fn a_backbone_is_tracked_through_mains_hum_and_ripple_and_its_points_say_so() {
    for (tones, settings) in TONES.into_iter().zip(RIGS) {
        let levels = ["backbone.points=2", "backbone.C_to=0.55"];
        let scene = scene(&[settings, &levels].concat());
        let tracked = |tones: &[(f64, f64)]| {
            let mut controller = BuiltIn::new(&scene.backbone_config()).unwrap();
            let rig = &mut rig(&scene, tones);
            track(rig, &mut controller, &scene, |_, _| {}).unwrap().points
        };
        for (clean, point) in tracked(&[]).iter().zip(tracked(&in_metres(tones, &scene))) {
            println!("{tones:?}, {settings:?}: {point:?}");
            assert!(
                point.settled
                    && [point, *clean]
                        .iter()
                        .all(|one| matches!(one.regime, Regime::Symmetric | Regime::Unresolved))
            );
            let tone = point.tone.unwrap();
            assert!((tone.hertz - tones[0].0).abs() < 0.01);
            assert!((tone.share / (tones[0].1 * 0.55 / point.at.c) - 1.0).abs() < 0.02);
            assert!((point.at.sigma - clean.at.sigma).abs() < 3.0 * clean.at.u_sigma.hypot(point.at.u_sigma));
            assert!(clean.tone.is_none());
        }
    }
}

#[test]
fn a_lock_is_identified_through_mains_hum_and_ripple() {
    for (tones, settings) in TONES.into_iter().zip(RIGS) {
        let scene = scene(&[settings, &["record.decay_periods=20"]].concat());
        let lock = |tones: &[(f64, f64)]| {
            let mut controller = BuiltIn::new(&scene.controller_config()).unwrap();
            let plan = Plan::of(&scene);
            let record = experiment::run(&mut rig(&scene, tones), &mut controller, &plan, |_, _, _| {});
            identify(&record.unwrap(), &scene).unwrap().lock
        };
        let (clean, found) = (lock(&[]), lock(&in_metres(tones, &scene)));
        println!("{tones:?}, {settings:?}: {found:?}");
        let said = found.tone.unwrap().to_string();
        assert!(
            said.starts_with(&format!("a foreign tone of {:.1} Hz, ", tones[0].0)),
            "{said}"
        );
        assert!((found.at.sigma - clean.at.sigma).abs() < 3.0 * clean.at.u_sigma.hypot(found.at.u_sigma));
        assert!(clean.tone.is_none());
    }
}

#[test]
fn no_motion_of_a_particle_is_a_foreign_tone() {
    let mut irregular = 0;
    // Values that fill their intervals evenly.
    for n in 0..60 {
        let share = |k: u32| (0.5 + f64::from(n) * 0.754_877_666_246_692_7_f64.powi(k as i32)).fract();
        let between = |k: u32, low: f64, high: f64| low * (high / low).powf(share(k));
        let settings = [
            format!("plant.m={}", 3.807 * between(1, 0.001, 0.05)),
            format!("plant.r={}", 0.3 + 0.65 * share(2)),
            format!("excitation.G={}", between(3, 0.1, 4.0)),
            format!("resonance.sensor={}", ["v", "q1", "acceleration"][n as usize % 3]),
        ];
        let scene = scene(&settings.each_ref().map(String::as_str));
        let d = scene.dimensionless();
        let drive = Drive {
            omega: d.omega(6.0 * share(4) - 3.0),
            amplitude: scene.amplitude,
            displacement: 0.0,
        };
        let step = scene.sample_time();
        let mut rig = rig(&scene, &[]);
        let mut samples = Vec::new();
        for sample in 0..6000 {
            let sensors = rig.sense().unwrap();
            let command = Command { drive, ..Command::default() };
            samples.push(Sample {
                time: step * f64::from(sample),
                sensors,
                command,
                ground_truth: None,
            });
            rig.advance(drive, step).unwrap();
        }
        // The first of these windows contains the transient.
        for window in [&samples[1000..3000], &samples[4000..]] {
            assert_eq!(foreign_tone(window, &scene, drive.omega), None, "{settings:?}");
            let phase = scene.controller.phase_target_radians();
            let regime = regime_by_response(window, &scene, drive.amplitude, phase, drive.omega);
            irregular += usize::from(regime == Regime::Other);
        }
    }
    println!("{irregular} of 120 windows are irregular");
    assert!(irregular >= 30);
}
