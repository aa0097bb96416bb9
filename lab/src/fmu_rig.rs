//! The FMU of a scene's plant as its rig.

use std::path::Path;

use vines_bench::rig::{Measured, has_friction};
use vines_bench::scene::{Measurand, Reference, Scene, Sensor, Structure};
use vines_fmu::{Asked, FmuError, FmuRig};

/// The amplitude of a drive, its signal, and the reference, with their unit.
fn drive_names(structure: Option<&Structure>) -> [(&'static str, &'static str); 3] {
    match structure.map(|structure| (structure.excitation, structure.shaker.is_some())) {
        Some((Reference::Force, true)) => [("u_amplitude", "V"), ("u", "V"), ("force", "N")],
        Some((Reference::Force, false)) => [("F_amplitude", "N"), ("F", "N"), ("force", "N")],
        Some((Reference::Base, true)) => [("u_amplitude", "V"), ("u", "V"), ("q[table]", "m")],
        Some((Reference::Base, false)) | None => [("E", "m"), ("e", "m"), ("base", "m")],
    }
}

/// The displacement of a structure's force cell whose mass is compensated.
fn at_cell(structure: &Structure) -> Option<String> {
    let drive = structure.drive.filter(|_| structure.compensated_mass() > 0.0)?;
    Some(format!("q[{}]", structure.points[drive]))
}

/// Loads the plant at `path` with parameters and start of the scene, and gives it the sensors of the scene.
pub fn load(path: &Path, scene: &Scene) -> Result<Measured<FmuRig>, FmuError> {
    let (names, definition) = (&scene.rig_names, scene.resonance);
    let structure = scene.structure.as_ref();
    let response = match (structure, definition.sensor) {
        _ if names.mapped("response").is_some() => "response".to_owned(),
        (Some(structure), _) => format!("q[{}]", structure.points[structure.sensor]),
        (None, Sensor::V) => "v".to_owned(),
        (None, Sensor::Q1) => "q1".to_owned(),
    };
    let mut starts = scene.start_values();
    // A structure starts at rest.
    starts.retain(|(name, _)| structure.is_none() || !["q1", "der(q1)"].contains(name));
    let rig = FmuRig::load(
        path,
        &Asked {
            names,
            definition,
            sample_time: scene.sample_time(),
            drive: drive_names(structure),
            response,
            cell: structure.and_then(at_cell),
            starts,
            has_friction: has_friction(&scene.plant),
            direction: structure.map_or(1.0, Structure::direction),
        },
    )?;
    // A variable that the scene names is what it is measured as; velocities and accelerations of our own variables are differences.
    let mut differences = definition;
    if names.mapped("response").is_some() {
        differences.sensor_quantity = Measurand::Displacement;
    }
    if names.mapped("base").is_some() {
        differences.reference_quantity = Measurand::Displacement;
    }
    let compensated = structure.map_or(0.0, Structure::compensated_mass);
    Ok(Measured::new(rig, differences, &scene.plant, compensated))
}
