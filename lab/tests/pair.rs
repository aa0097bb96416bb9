//! Guards both FMUs as the `fmi` crate couples them in co-simulation, with its delay of one sample, and FMUs with other names and signs.

use std::{
    fs,
    io::{Read, Write},
    path::{Path, PathBuf},
};

use fmi::fmi2::import::Fmi2Import;
use fmi::fmi2::instance::{CoSimulation, Common, InstanceCS};
use fmi::traits::FmiImport;
use vines::experiment::{self, Plan};
use vines::fmu::{FmuController, FmuRig};
use vines::identification::identify;
use vines::pack::pack_bench;
use vines::rig::{BuiltIn, Controller, Drive, GroundTruth, Move, Rig, RigError, Sensors, Simulated};
use vines::scene::{Names, PAPER, Scene};

/// The periods that are driven: the default scene locks after about 110.
const PERIODS: f64 = 1000.0;
const HOLD_PERIODS: f64 = 20.0;

/// The folder of the libraries of this build: cargo makes them because this package depends on them.
fn libraries() -> PathBuf {
    Path::new(env!("CARGO_BIN_EXE_vines")).with_file_name("deps")
}

/// One FMU of the pair.
struct Part {
    instance: InstanceCS,
    import: Fmi2Import,
}

impl Part {
    /// Loads the FMU and starts it with the values that the system file binds to it.
    fn start(out: &Path, file: &str, bound: &str) -> Self {
        let import: Fmi2Import = fmi::import::from_path(out.join(file)).unwrap();
        let mut part = Self {
            instance: import.instantiate_cs(file, false, true).unwrap(),
            import,
        };
        for (name, kind, value) in values(&out.join("bench.ssp"), bound) {
            let reference = [part.find(&name)];
            let instance = &mut part.instance;
            match kind.as_str() {
                "Real" => instance.set_real(&reference, &[value.parse().unwrap()]),
                "Integer" => instance.set_integer(&reference, &[value.parse().unwrap()]),
                _ => instance.set_boolean(&reference, &[i32::from(value == "true")]),
            }
            .unwrap();
        }
        let instance = &mut part.instance;
        instance.setup_experiment(None, 0.0, None).unwrap();
        instance.enter_initialization_mode().unwrap();
        instance.exit_initialization_mode().unwrap();
        part
    }

    fn find(&self, name: &str) -> u32 {
        let variables = &self.import.model_description().model_variables.variables;
        let variable = variables.iter().find(|variable| variable.name == name);
        variable.expect("the FMU has the variable").value_reference
    }

    fn find_two(&self, names: [&str; 2]) -> [u32; 2] {
        names.map(|name| self.find(name))
    }

    fn read(&mut self, references: [u32; 2]) -> [f64; 2] {
        let mut values = [0.0; 2];
        self.instance.get_real(&references, &mut values).unwrap();
        values
    }

    fn advance(&mut self, inputs: [u32; 2], values: [f64; 2], time: f64, step: f64) {
        self.instance.set_real(&inputs, &values).unwrap();
        self.instance.do_step(time, step, true).unwrap();
    }
}

/// Name, type and value of what a parameter set of the system file binds.
fn values(system: &Path, name: &str) -> Vec<(String, String, String)> {
    let mut archive = zip::ZipArchive::new(fs::File::open(system).unwrap()).unwrap();
    let mut text = String::new();
    let mut entry = archive.by_name(name).unwrap();
    entry.read_to_string(&mut text).unwrap();
    let parameters = text.lines().filter(|line| line.contains("<ssv:Parameter "));
    let values = parameters.map(|line| {
        let words: Vec<&str> = line.split('"').collect();
        let kind = words[2].trim_start_matches("><ssv:");
        let kind = kind.trim_end_matches(" value=");
        (words[1].into(), kind.into(), words[3].into())
    });
    values.collect()
}

#[test]
fn the_pair_in_co_simulation_locks_where_the_built_in_loop_does() {
    let scene = Scene::load(None, &[]).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path();
    pack_bench(&scene, &libraries().as_path().into(), out).unwrap();
    let mut plant = Part::start(out, "LoViNes.fmu", "resources/plant.ssv");
    let mut controller = Part::start(out, "PhaseLock.fmu", "resources/controller.ssv");

    let sensed = plant.find_two(["v", "base"]);
    let driven = plant.find_two(["omega", "E"]);
    let sensors = controller.find_two(["response", "reference"]);
    let drive = controller.find_two(["omega", "E"]);
    let impacts = [plant.find("impacts")];

    let step = scene.sample_time();
    let samples = |periods: f64| (periods * scene.controller.samples_per_period) as usize;
    let (mut omega, mut before, mut after) = (0.0, [0], [0]);
    let hold = samples(HOLD_PERIODS);
    for n in 0..samples(PERIODS) {
        let (readings, command) = (plant.read(sensed), controller.read(drive));
        if n + hold == samples(PERIODS) {
            plant.instance.get_integer(&impacts, &mut before).unwrap();
        }
        if n + hold >= samples(PERIODS) {
            omega += command[0] / hold as f64;
        }
        let time = n as f64 * step;
        controller.advance(sensors, readings, time, step);
        plant.advance(driven, command, time, step);
    }
    plant.instance.get_integer(&impacts, &mut after).unwrap();

    let mut flag = [0];
    let reference = [controller.find("locked")];
    controller.instance.get_boolean(&reference, &mut flag).unwrap();
    assert_eq!(flag, [1]);

    let sigma = scene.dimensionless().sigma(omega);
    let mut own = (Simulated::new(scene.plant, scene.start).unwrap(), built_in(&scene));
    let off = sigma - locked(&mut own.0, &mut own.1, &scene);
    println!("sigma = {sigma:.6}, off the own loop by {off:.1e}");
    assert!(off.abs() < 1e-4);
    let hits = after[0] - before[0];
    assert!((39..=41).contains(&hits), "{hits} impacts in 20 periods");
}

#[test]
fn the_fmu_moves_the_response_with_the_bits_of_the_built_in_controller() {
    let overrides = ["phase_lock.harmonics=4", "phase_lock.base_bandwidth=0.5"].map(|one| one.parse().unwrap());
    let scene = Scene::load(None, &overrides).unwrap();
    let folder = tempfile::tempdir().unwrap();
    pack_bench(&scene, &libraries().as_path().into(), folder.path()).unwrap();
    let config = scene.backbone_config();
    let mut fmu = FmuController::load(&folder.path().join("PhaseLock.fmu"), &config, &Default::default()).unwrap();
    let mut own = BuiltIn::new(&config).unwrap();
    let mut rig = Simulated::new(scene.plant, scene.start).unwrap();
    let mut moved = 0.0;
    for n in 0..6000 {
        if n == 2000 || n == 4000 {
            let to = Move {
                response: (0.8 - 1e-4 * n as f64) * scene.plant.half_width,
                duration: 2.0,
                amplitude: -1e-6,
                omega: 0.01,
                growth: 0.0,
            };
            fmu.hold_response(to, -1.5).unwrap();
            own.hold_response(to, -1.5).unwrap();
        }
        let sensors = rig.sense().unwrap();
        let command = own.sample(sensors, true).unwrap();
        assert_eq!(fmu.sample(sensors, true).unwrap(), command, "sample {n}");
        rig.advance(command.drive, scene.sample_time()).unwrap();
        moved = command.drive.amplitude;
    }
    assert!(moved != config.amplitude);
}

/// Writes an FMU whose variables have other names.
fn renamed(fmu: &Path, to: &Path, names: &[(&str, &str)]) {
    let mut archive = zip::ZipArchive::new(fs::File::open(fmu).unwrap()).unwrap();
    let mut copy = zip::ZipWriter::new(fs::File::create(to).unwrap());
    for n in 0..archive.len() {
        let mut entry = archive.by_index(n).unwrap();
        let (name, mut content) = (entry.name().unwrap().into_owned(), Vec::new());
        entry.read_to_end(&mut content).unwrap();
        if name == "modelDescription.xml" {
            let mut text = String::from_utf8(content).unwrap();
            for (from, to) in names {
                let [from, to] = [from, to].map(|name| format!("<ScalarVariable name=\"{name}\""));
                assert!(text.contains(&from), "{from}");
                text = text.replace(&from, &to);
            }
            content = text.into();
        }
        copy.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
        copy.write_all(&content).unwrap();
    }
    copy.finish().unwrap();
}

/// The plant without its base sensor.
struct NoBase(Simulated);

impl Rig for NoBase {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        Ok(Sensors { reference: None, ..self.0.sense()? })
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        self.0.advance(drive, step)
    }

    fn ground_truth(&mut self) -> Result<Option<GroundTruth>, RigError> {
        self.0.ground_truth()
    }
}

fn built_in(scene: &Scene) -> BuiltIn {
    BuiltIn::new(&scene.controller_config()).unwrap()
}

/// Detuning at which a run has locked.
fn locked(rig: &mut impl Rig, controller: &mut impl Controller, scene: &Scene) -> f64 {
    let record = experiment::run(rig, controller, &Plan::of(scene), |_, _, _| {}).unwrap();
    identify(&record, scene).unwrap().lock.at.sigma
}

#[test]
fn fmus_with_other_names_and_units_without_an_oscillator_and_without_settled_lock_like_the_built_in_pair() {
    let text = PAPER.to_owned()
        + "\n[rig.names]\nresponse = { name = \"y_sensor\", factor = -1.0 }\ne = { name = \"x_given\", factor = -1.0 }\nc = \"damper\"\n"
        + "\n[controller_names]\nresponse = \"input\"\nphase_error = \"error\"\n";
    let set = ["chain.reference=false", "record.decay_periods=150"].map(|one| one.parse().unwrap());
    let scene = Scene::parse("names.toml", &text, &set).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = |name| folder.path().join(name);
    pack_bench(&scene, &libraries().as_path().into(), folder.path()).unwrap();
    let hidden = [("omega", "w"), ("E", "amplitude"), ("base", "x"), ("impacts", "count")];
    let own = [("v", "y_sensor"), ("e", "x_given"), ("c", "damper")];
    renamed(
        &path("LoViNes.fmu"),
        &path("rig.fmu"),
        &[&hidden[..], &own[..]].concat(),
    );
    let own = [("response", "input"), ("phase_error", "error"), ("settled", "done")];
    renamed(&path("PhaseLock.fmu"), &path("loop.fmu"), &own);

    // Drive and response both with the opposite sign: the motion is the same.
    let rig = |names| {
        FmuRig::load(
            &path("rig.fmu"),
            &scene.start_values(),
            scene.resonance,
            &scene.plant,
            names,
        )
    };
    let none = Names::default();
    let missing = rig(&none).err().unwrap().to_string();
    assert!(missing.contains("`e`") && missing.contains("[rig.names]"), "{missing}");
    let mut rig = rig(&scene.rig_names).unwrap();
    let config = scene.controller_config();
    let mut controller = FmuController::load(&path("loop.fmu"), &config, &scene.controller_names).unwrap();
    let found = locked(&mut rig, &mut controller, &scene);
    let plant = Simulated::new(scene.plant, scene.start).unwrap();
    let expected = locked(&mut NoBase(plant), &mut BuiltIn::new(&config).unwrap(), &scene);
    println!("sigma = {found} and {expected}");
    assert!((found - expected).abs() < 5e-3, "{found} {expected}");
}

#[test]
fn a_controller_without_the_output_of_its_phase_error_is_not_said_to_measure_none() {
    let set = ["record.lock_periods=5"].map(|one| one.parse().unwrap());
    let scene = Scene::load(None, &set).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = |name| folder.path().join(name);
    pack_bench(&scene, &libraries().as_path().into(), folder.path()).unwrap();
    renamed(&path("PhaseLock.fmu"), &path("loop.fmu"), &[("phase_error", "error")]);
    let mut rig = Simulated::new(scene.plant, scene.start).unwrap();
    let mut controller = FmuController::load(&path("loop.fmu"), &scene.controller_config(), &Names::default()).unwrap();
    let error = experiment::run(&mut rig, &mut controller, &Plan::of(&scene), |_, _, _| {}).unwrap_err();
    let message = error.to_string();
    assert!(
        message.contains("the controller does not report its phase error"),
        "{message}"
    );
}
