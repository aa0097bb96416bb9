//! An experiment inside each FMU, so that a new program can be tried before a rig is: parameters, the inputs sample by sample, and outputs to compare
//! with. For oscillator and controller it is a lock of the default scene, for a structure a sine. The files are those of the draft FMI-LS-REF
//! 1.0.0-alpha.1: a manifest, which names the experiment in `resources/`.

use std::fmt::Write;

use lovines::{Drive, InvalidValue, Plant, Refused, StructureState};
use phase_lock::{Config, Input, Output, PhaseLock};
use vines_rig::unit::rounded;

use super::{File, controller_values, parameter_set, plant_values};
use crate::scene::{PAPER, Scene, Structure};

/// Samples per second, 23 in a natural period: fewer than those of the scene, to keep the files small, and times of few digits.
const RATE: u32 = 200;
/// Length of the experiment, s; the loop has locked by then.
const STOP: u32 = 40;

/// Where a program that knows the layered standard looks.
const MANIFEST: &str = "extra/org.fmi-standard.fmi-ls-ref/fmi-ls-manifest.xml";

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

    /// The files of an experiment of this name, meaning, stop time and step, s.
    fn files(self, [name, meaning]: [&str; 2], [stop, step]: [f64; 2], parameters: Vec<u8>) -> Vec<File> {
        let manifest = format!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<fmiReferences xmlns:fmi-ls=\"http://fmi-standard.org/fmi-ls-manifest\" \
             fmi-ls:fmi-ls-name=\"org.fmi-standard.fmi-ls-ref\"\n  fmi-ls:fmi-ls-version=\"1.0.0-alpha.1\"\n  \
             fmi-ls:fmi-ls-description=\"Layered Standard providing information on related files included in an FMU.\">\n  \
             <Related type=\"application/x-ma-hs-experiments\" source=\"../../resources/{name}.exp\" role=\"experiment/smoke-test\"\n    \
             description=\"{meaning}\"/>\n</fmiReferences>\n"
        );
        let experiment = format!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<Experiments name=\"vines\">\n  <Experiment name=\"{name}\" startTime=\"0\" \
             stopTime=\"{stop}\" stepSize=\"{step}\"\n    description=\"{meaning}\">\n    \
             <Parameters type=\"application/x-ssp-parameter-set\" source=\"{name}.ssv\"/>\n    <Stimuli type=\"text/csv\" \
             source=\"{name}-stimuli.csv\"/>\n    <References type=\"text/csv\" source=\"{name}-references.csv\"/>\n  </Experiment>\n</Experiments>\n"
        );
        [
            (MANIFEST.into(), manifest.into_bytes()),
            (format!("resources/{name}.exp"), experiment.into_bytes()),
            (format!("resources/{name}.ssv"), parameters),
            (format!("resources/{name}-stimuli.csv"), self.stimuli.into_bytes()),
            (format!("resources/{name}-references.csv"), self.references.into_bytes()),
        ]
        .into()
    }
}

/// The files of plant and controller.
pub(super) fn resources() -> [Vec<File>; 2] {
    let scene = Scene::parse("paper.toml", PAPER, &[]).expect("the default scene is correct");
    let config = Config { sample_time: 1.0 / f64::from(RATE), ..scene.plan().lock };
    let lock = config
        .build()
        .expect("the controller of the default scene allows this sample time");
    let [plant, controller] = couple(&scene, &lock).expect("the values of a correct scene are allowed");
    let experiment = [
        "lock",
        "The coupled pair locks; each FMU gets what the other one has put out",
    ];
    let times = [f64::from(STOP), config.sample_time];
    [
        plant.files(experiment, times, parameter_set("plant", plant_values(&scene))),
        controller.files(
            experiment,
            times,
            parameter_set("controller", controller_values(&config)),
        ),
    ]
}

/// Length of the experiment of a structure, periods of the driven mode: irregular motions of longer ones show rounding.
const SINE_PERIODS: u32 = 20;

/// The files of a structure under a sine of its driven mode's frequency: the inputs of signal and amplitude, and the amplitude that it has. `parameters`: the set of its
/// parameters; `step`: the time from sample to sample, s.
pub(super) fn sine(
    (structure, scene): (&Structure, &Scene),
    ([signal, input], amplitude): ([&str; 2], f64),
    step: f64,
    parameters: Vec<u8>,
) -> Result<Vec<File>, Refused> {
    let start = StructureState {
        q2: scene.start.q2,
        dq2: scene.start.dq2,
        ..StructureState::default()
    };
    let mut plant = Plant::with_host(structure.host.clone(), scene.plant, &start)?;
    // Seven digits, as in the files.
    let [amplitude, omega] = [amplitude, structure.mode().omega].map(|value| rounded(value, 6));
    let in_period = (std::f64::consts::TAU / (omega * step)).round() as u32;
    let samples = SINE_PERIODS * in_period;
    let mut half = Half::new(&format!("{signal},{input},omega"), "q1,q2,impacts");
    for n in 0..=samples {
        let time = f64::from(n) * step;
        if n == 0 || n == samples {
            let _ = writeln!(half.stimuli, "{time},0,{amplitude:e},{omega:e}");
        }
        if n > 0 && n % in_period == 0 {
            let (masses, impacts) = (plant.state(), plant.totals().impacts);
            let _ = writeln!(half.references, "{time},{:e},{:e},{impacts}", masses.q1, masses.q2);
        }
        plant.advance(Drive::harmonic(amplitude, omega), step)?;
    }
    let experiment = ["sine", "A sine of the driven mode's frequency"];
    Ok(half.files(experiment, [f64::from(samples) * step, step], parameters))
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
        // Seven digits, as in the files.
        let [response, reference, amplitude, omega] = [v, base, amplitude, omega].map(|value| rounded(value, 6));
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
