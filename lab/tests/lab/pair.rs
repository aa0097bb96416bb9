//! Guards the bits of both FMUs beside the built-in plant and controller, and FMUs with other names and signs.

use std::{
    fs,
    io::{Read, Write},
    path::Path,
};

use tempfile::TempDir;
use vines::experiment;
use vines::fmu::{FmuController, FmuRig};
use vines::identification::identify;
use vines::pack::{Binary, components, own_libraries, pack_bench};
use vines::rig::{BuiltIn, Controller, Drive, GroundTruth, Move, Rig, RigError, Sensors, Simulated};
use vines::scene::{Names, PAPER, Scene};

use crate::PROGRAM;

/// The libraries of this build: cargo makes them because this package depends on them.
fn libraries() -> Vec<Binary> {
    own_libraries(&components(), &Path::new(PROGRAM).with_file_name("deps")).unwrap()
}

/// Plant and controller with the parameters of a scene, packed into a folder.
fn packed(scene: &Scene) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    pack_bench(scene, &libraries(), folder.path()).unwrap();
    folder
}

#[test]
fn the_fmu_has_the_bits_of_the_plant_in_a_real_cavity() {
    let effects = [
        "plant.mu_k=0.1",
        "plant.mu_s=0.2",
        "plant.theta=0.3",
        "plant.b_plus=0.011",
        "plant.r_minus=0.6",
        "plant.r_min=0.2",
        "plant.r_scatter=0.1",
        "plant.seed=5",
        "start.dq2=0.5",
    ];
    let scene = Scene::load(None, &effects.map(|one| one.parse().unwrap())).unwrap();
    let folder = packed(&scene);
    let mut fmu = FmuRig::load(&folder.path().join("LoViNes.fmu"), &scene).unwrap();
    let mut own = Simulated::new(scene.plant, scene.start).unwrap();
    let drive = Drive {
        omega: 0.99 * scene.dimensionless().omega0,
        amplitude: 3.0 * scene.amplitude,
        displacement: 0.0,
    };
    for n in 0..3000 {
        assert_eq!(fmu.sense().unwrap(), own.sense().unwrap(), "sample {n}");
        assert_eq!(fmu.ground_truth().unwrap(), own.ground_truth().unwrap(), "sample {n}");
        for rig in [&mut fmu as &mut dyn Rig, &mut own] {
            rig.advance(drive, scene.sample_time()).unwrap();
        }
    }
    let truth = own.ground_truth().unwrap().unwrap();
    assert!(truth.impacts > 10, "{truth:?}");
}

#[test]
fn the_fmu_moves_the_response_with_the_bits_of_the_built_in_controller() {
    let overrides = ["phase_lock.harmonics=4", "phase_lock.base_bandwidth=0.5"].map(|one| one.parse().unwrap());
    let scene = Scene::load(None, &overrides).unwrap();
    let folder = packed(&scene);
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

/// Detuning at which a run has locked.
fn locked(rig: &mut impl Rig, controller: &mut impl Controller, scene: &Scene) -> f64 {
    let record = experiment::run(rig, controller, scene, |_, _, _| {}).unwrap();
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
    pack_bench(&scene, &libraries(), folder.path()).unwrap();
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
    let rig = |scene| FmuRig::load(&path("rig.fmu"), scene);
    let unmapped = Scene { rig_names: Names::default(), ..scene.clone() };
    let missing = rig(&unmapped).err().unwrap().to_string();
    assert!(missing.contains("`e`") && missing.contains("[rig.names]"), "{missing}");
    let mut rig = rig(&scene).unwrap();
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
    let set = ["phase_lock.acquire_timeout=0.6"].map(|one| one.parse().unwrap());
    let scene = Scene::load(None, &set).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = |name| folder.path().join(name);
    pack_bench(&scene, &libraries(), folder.path()).unwrap();
    renamed(&path("PhaseLock.fmu"), &path("loop.fmu"), &[("phase_error", "error")]);
    let mut rig = Simulated::new(scene.plant, scene.start).unwrap();
    let mut controller = FmuController::load(&path("loop.fmu"), &scene.controller_config(), &Names::default()).unwrap();
    let error = experiment::run(&mut rig, &mut controller, &scene, |_, _, _| {}).unwrap_err();
    let message = error.to_string();
    assert!(
        message.contains("the controller does not report its phase error"),
        "{message}"
    );
}
