//! A lock of the default scene inside both FMUs, so that a new program can be tried before a rig is: parameters, the inputs sample by sample, and
//! outputs to compare with. The files are those of an experiment of the draft FMI-LS-REF 1.0.0-alpha.1, in `resources/`.

use std::fmt::Write;

use lovines::{Drive, InvalidValue, Plant};
use phase_lock::{Config, Input, Output, PhaseLock};

use super::{File, controller_values, parameter_set, plant_values};
use crate::scene::{PAPER, Scene};

/// Samples per second, 23 in a natural period: fewer than those of the scene, to keep the files small, and times of few digits.
const RATE: u32 = 200;
/// Length of the experiment, s; the loop has locked by then.
const STOP: u32 = 40;

/// The columns of one FMU.
struct Half {
    stimuli: String,
    references: String,
}

impl Half {
    fn new(inputs: &str, outputs: &str) -> Self {
        Self {
            stimuli: format!("time,{inputs}\n"),
            references: format!("time,{outputs}\n"),
        }
    }

    /// The files in `resources/`.
    fn files(self, parameters: Vec<u8>) -> Vec<File> {
        let step = 1.0 / f64::from(RATE);
        let experiment = format!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<Experiments name=\"vines\">\n  <Experiment name=\"lock\" startTime=\"0\" \
             stopTime=\"{STOP}\" stepSize=\"{step}\"\n    description=\"The coupled pair locks; each FMU gets what the other one has put out\">\n    \
             <Parameters type=\"application/x-ssp-parameter-set\" source=\"lock.ssv\"/>\n    <Stimuli type=\"text/csv\" \
             source=\"lock-stimuli.csv\"/>\n    <References type=\"text/csv\" source=\"lock-references.csv\"/>\n  </Experiment>\n</Experiments>\n"
        );
        let files = [
            ("experiments.xml", experiment.into_bytes()),
            ("lock.ssv", parameters),
            ("lock-stimuli.csv", self.stimuli.into_bytes()),
            ("lock-references.csv", self.references.into_bytes()),
        ];
        files.map(|(name, content)| (name.to_owned(), content)).into()
    }
}

/// A reading or a drive as its file has it: with seven digits.
fn rounded(value: f64) -> f64 {
    format!("{value:.6e}").parse().unwrap_or(value)
}

/// The files of plant and controller.
pub(super) fn resources() -> [Vec<File>; 2] {
    let scene = Scene::parse("paper.toml", PAPER, &[]).expect("the default scene is correct");
    let config = Config {
        sample_time: 1.0 / f64::from(RATE),
        ..scene.controller_config()
    };
    let lock = config
        .build()
        .expect("the controller of the default scene allows this sample time");
    let [plant, controller] = couple(&scene, &lock).expect("the values of a correct scene are allowed");
    [
        plant.files(parameter_set("plant", plant_values(&scene))),
        controller.files(parameter_set("controller", controller_values(&config))),
    ]
}

/// Couples the cores as a master couples their FMUs: at each sample both are read, fed, and stepped.
fn couple(scene: &Scene, lock: &PhaseLock) -> Result<[Half; 2], InvalidValue> {
    let (mut state, mut output) = (lock.start(), lock.idle());
    let mut plant = Plant::new(scene.plant, scene.start)?;
    let mut of_plant = Half::new("E,omega", "v,base,impacts");
    let mut of_controller = Half::new("response,reference,active", "omega,E,response_amplitude,locked");
    for n in 0..=STOP * RATE {
        let time = f64::from(n) / f64::from(RATE);
        let (base, masses, impacts) = (plant.base_displacement(), plant.state(), plant.totals().impacts);
        let v = masses.q1 + scene.plant.mass_ratio() * masses.q2;
        let Output { omega, amplitude, response_amplitude, locked, .. } = output;
        if n > 0 && n % RATE == 0 {
            let locked = u8::from(locked);
            let _ = writeln!(of_plant.references, "{time},{v:e},{base:e},{impacts}");
            let _ = writeln!(
                of_controller.references,
                "{time},{omega:e},{amplitude:e},{response_amplitude:e},{locked}"
            );
        }
        let [response, reference, amplitude, omega] = [v, base, amplitude, omega].map(rounded);
        let _ = writeln!(of_plant.stimuli, "{time},{amplitude:e},{omega:e}");
        let _ = writeln!(of_controller.stimuli, "{time},{response:e},{reference:e},1");
        plant.advance(
            Drive { amplitude, omega, ..Drive::default() },
            lock.config().sample_time,
        )?;
        output = lock.process(&mut state, Input { response, reference: Some(reference), active: true });
    }
    Ok([of_plant, of_controller])
}
