//! Settings of the page, and the scene that they make.

use lovines::{Parameters, State};
use vines_bench::scene::{
    BackboneSettings, ChainSettings, ControllerSettings, Definition, Dimensionless, Names, PhaseLock, RecordSettings,
    Scene,
};

/// Constants from lab/scene/paper.toml and lab/page/settings.json: the default scene, and an index for each setting.
mod generated {
    #![allow(missing_docs)]
    include!(concat!(env!("OUT_DIR"), "/generated.rs"));
}
pub use generated::{COUNT, index};
use generated::{EXCITATION, PLANT, START};

/// Values of the settings, in the order and the units of lab/page/settings.json.
pub type Settings = [f64; COUNT];

/// The scene in lab/scene/paper.toml.
pub fn default_scene() -> Scene {
    let [primary_mass, stiffness, damping, particle_mass, half_width, restitution] = PLANT;
    let plant = Parameters {
        primary_mass,
        stiffness,
        damping,
        particle_mass,
        half_width,
        restitution,
        cavity: lovines::Cavity::IDEAL,
    };
    let [q1, dq1, q2, dq2] = START;
    let d = Dimensionless::of(&plant, 0.0);
    Scene {
        structure: None,
        plant,
        start: State { q1, dq1, q2, dq2 },
        amplitude: d.amplitude(EXCITATION[0]),
        controller: ControllerSettings::default(),
        record: RecordSettings::default(),
        backbone: BackboneSettings::default(),
        phase_lock: PhaseLock::default(),
        rig_names: Names::default(),
        controller_names: Names::default(),
        chain: ChainSettings::default(),
        resonance: Definition::default(),
        states_sensor: false,
    }
}

/// The settings of a scene, with the loop closed and without noise.
pub fn settings_of(scene: &Scene) -> Settings {
    let d = scene.dimensionless();
    let mut values = [0.0; COUNT];
    values[index::EXCITATION] = d.g;
    values[index::RESTITUTION] = d.r;
    values[index::DAMPING] = d.lambda;
    values[index::MASS_RATIO] = d.epsilon;
    values[index::GAP] = d.b * 1e3;
    let [plus, minus] = scene.plant.gaps();
    values[index::GAP_DIFFERENCE] = 50.0 * (plus - minus) / d.b;
    values[index::FRICTION] = scene.plant.cavity.kinetic_friction;
    values[index::TILT] = scene.plant.cavity.tilt.to_degrees();
    values[index::PHASE_TARGET] = scene.controller.phase_target;
    values[index::BANDWIDTH] = scene.controller.bandwidth;
    values[index::START_SPEED] = d.speed(scene.start.dq2);
    values[index::CLOSED] = 1.0;
    values
}

/// `scene` with the values that differ from its own replaced. The others keep all their bits.
pub fn changed(mut scene: Scene, values: &Settings) -> Scene {
    let before = settings_of(&scene);
    let differs = |one: usize| values[one] != before[one];
    let omega0 = scene.dimensionless().omega0;
    let plant = &mut scene.plant;
    if differs(index::MASS_RATIO) {
        plant.particle_mass = values[index::MASS_RATIO] * plant.primary_mass;
    }
    if differs(index::MASS_RATIO) || differs(index::DAMPING) {
        plant.damping = values[index::DAMPING] * plant.particle_mass * omega0;
    }
    if differs(index::RESTITUTION) {
        plant.restitution = values[index::RESTITUTION];
    }
    if differs(index::GAP) {
        plant.half_width = values[index::GAP] * 1e-3;
    }
    let difference = 0.01 * values[index::GAP_DIFFERENCE];
    let (b, cavity) = (plant.half_width, &mut plant.cavity);
    if differs(index::GAP_DIFFERENCE) || differs(index::GAP) && cavity.b_plus.or(cavity.b_minus).is_some() {
        let gap = |side: f64| (difference != 0.0).then_some(b * (1.0 + side * difference));
        (cavity.b_plus, cavity.b_minus) = (gap(1.0), gap(-1.0));
    }
    if differs(index::FRICTION) {
        (cavity.kinetic_friction, cavity.static_friction) = (values[index::FRICTION], None);
    }
    if differs(index::TILT) {
        cavity.tilt = values[index::TILT].to_radians();
    }
    let d = Dimensionless::of(plant, 0.0);
    if [index::EXCITATION, index::MASS_RATIO, index::GAP]
        .into_iter()
        .any(differs)
    {
        scene.amplitude = d.amplitude(values[index::EXCITATION]);
        scene.backbone = BackboneSettings::default();
    }
    if differs(index::START_SPEED) || differs(index::GAP) {
        scene.start.dq2 = values[index::START_SPEED] * d.b * d.omega0;
    }
    scene.controller.phase_target = values[index::PHASE_TARGET];
    scene.controller.bandwidth = values[index::BANDWIDTH];
    scene
}
