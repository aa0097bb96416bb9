//! Guards the bits of both FMUs beside the built-in plant and controller, and FMUs with other names and signs.

use std::{
    fs,
    io::{Read, Write},
    path::Path,
};

use vines::experiment::{self, ExperimentError};
use vines::fmu::FmuController;
use vines::fmu_rig;
use vines::identification::identify;
use vines::pack::{Binary, components_of, own_libraries, pack_bench};
use vines::rig::{Controller, Drive, Rig, Simulated};
use vines::scene::{Names, PAPER, Scene};

use crate::endpoints::fmus;
use crate::{built_in, overrides, rig};

#[test]
fn the_fmu_has_the_bits_of_the_plant_in_a_real_cavity() {
    let friction = "plant.mu_k=0.1 plant.mu_s=0.2 plant.theta=0.3 start.dq2=0.5";
    let walls = "plant.b_plus=0.011 plant.r_minus=0.6 plant.r_min=0.2 plant.r_scatter=0.1 plant.seed=5";
    let scene = Scene::load(None, &overrides(&format!("{friction} {walls}"))).unwrap();
    let mut fmu = fmu_rig::load(Path::new(&fmus()[0]), &scene).unwrap();
    let mut own = Simulated::new(scene.plant, scene.start).unwrap();
    let drive = Drive {
        omega: 0.99 * scene.dimensionless().omega0,
        amplitude: 3.0 * scene.amplitude,
        ..Drive::default()
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
fn the_fmu_of_a_structure_has_the_bits_of_the_simulated_one() {
    for (preset, settings) in [
        ("cantilever", "plant.r_scatter=0.1 plant.seed=5"),
        ("frame", "plant.mu_k=0.1 plant.theta=0.3"),
        // Its command is clipped.
        ("shaker-cantilever", "shaker.voltage_max=4.5 shaker.inductance=1e-3"),
        (
            "shaker-cantilever",
            "shaker.voltage_max=4.5 shaker.compensated_mass=0.015 structure.masses={tip=0.005}",
        ),
        ("slip-table", "shaker.cut_off=300"),
    ] {
        let file = format!("{}/../scenes/{preset}.toml", env!("CARGO_MANIFEST_DIR"));
        let scene = Scene::load(Some(Path::new(&file)), &overrides(settings)).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let (name, content) = pack_bench(&scene, &libraries(&scene)).unwrap().swap_remove(0);
        assert_eq!(name, "Structure.fmu");
        let path = folder.path().join(name);
        fs::write(&path, content).unwrap();
        let mut fmu = fmu_rig::load(&path, &scene).unwrap();
        let mut own = Simulated::without_chain(&scene).unwrap();
        let amplitude = scene.knowledge().target.units.command.of_metres(scene.amplitude);
        for n in 0..3000_u32 {
            assert_eq!(fmu.sense().unwrap(), own.sense().unwrap(), "{preset}, sample {n}");
            let [of_fmu, of_own] = [fmu.ground_truth(), own.ground_truth()];
            assert_eq!(of_fmu.unwrap(), of_own.unwrap(), "{preset}, sample {n}");
            let drive = Drive {
                omega: (0.99 + f64::from(n % 5) / 500.0) * scene.dimensionless().omega0,
                amplitude: 3.0 * amplitude,
                displacement: amplitude * f64::from(n % 3),
                // Both ways in which a loop drives a rig.
                is_held: n >= 2500,
            };
            for rig in [&mut fmu as &mut dyn Rig, own.as_mut()] {
                rig.advance(drive, scene.sample_time()).unwrap();
            }
        }
        let truth = own.ground_truth().unwrap().unwrap();
        assert!(truth.impacts > 10, "{preset}: {truth:?}");
    }
}

/// The libraries that were built with this program.
fn libraries(scene: &Scene) -> Vec<Binary> {
    let mut folder = std::env::current_exe().unwrap();
    folder.pop();
    own_libraries(&components_of(scene).unwrap(), &folder).unwrap()
}

/// Writes an FMU whose variables have other names.
fn renamed(fmu: &str, to: &Path, names: &[(&str, &str)]) {
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

/// Detuning at which a run has locked.
fn locked(rig: &mut dyn Rig, controller: &mut dyn Controller, scene: &Scene) -> Result<f64, ExperimentError> {
    let record = experiment::run(&mut Vec::new(), rig, controller, &scene.plan(), |_, _| {})?;
    Ok(identify(&record, &scene.plan()).unwrap().lock.at.sigma)
}

#[test]
fn fmus_with_other_names_and_units_without_an_oscillator_and_without_settled_lock_like_the_built_in_pair() {
    let text = PAPER.to_owned()
        + "\n[rig.names]\nresponse = { name = \"y_sensor\", factor = -1.0 }\ne = { name = \"x_given\", factor = -1.0 }\nc = \"damper\"\n"
        + "\n[controller_names]\nresponse = \"input\"\n";
    let parse = |text: &str, settings: &str| Scene::parse("names.toml", text, &overrides(settings)).unwrap();
    let reported = text.clone() + "phase_error = \"error\"\n";
    let scene = parse(&reported, "chain.reference=false record.decay_periods=150");
    let folder = tempfile::tempdir().unwrap();
    let [rig_file, loop_file] = ["rig.fmu", "loop.fmu"].map(|name| folder.path().join(name));
    let [plant, controller] = fmus();
    let names = [
        [("omega", "w"), ("E", "amplitude"), ("base", "x"), ("impacts", "count")],
        [("v", "y_sensor"), ("e", "x_given"), ("c", "damper"), ("q1", "q1")],
    ];
    renamed(&plant, &rig_file, &names.concat());
    let names = [("response", "input"), ("phase_error", "error"), ("settled", "done")];
    renamed(&controller, &loop_file, &names);
    let own_loop = |scene: &Scene| {
        let config = scene.plan().lock;
        FmuController::load(&loop_file, &config, &scene.controller_names).unwrap()
    };

    // Drive and response both with the opposite sign: the motion is the same.
    let unmapped = Scene { rig_names: Names::default(), ..scene.clone() };
    let missing = fmu_rig::load(&rig_file, &unmapped).err().unwrap().to_string();
    assert!(missing.contains("`e`") && missing.contains("[rig.names]"), "{missing}");
    let mut fmu = fmu_rig::load(&rig_file, &scene).unwrap();
    let found = locked(&mut fmu, &mut own_loop(&scene), &scene).unwrap();
    let expected = locked(&mut *rig(&scene), &mut built_in(&scene), &scene).unwrap();
    println!("sigma = {found} and {expected}");
    assert!((found - expected).abs() < 5e-3, "{found} {expected}");

    // A controller without the output of its phase error is not said to measure none.
    let scene = parse(&text, "phase_lock.acquire_timeout=0.6");
    let error = locked(&mut *rig(&scene), &mut own_loop(&scene), &scene).unwrap_err();
    let words = "the controller does not report its phase error";
    assert!(error.to_string().contains(words), "{error}");
}
