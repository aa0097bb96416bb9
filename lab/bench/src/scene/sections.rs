//! The sections of a scene as written, before they are completed and checked.

use lovines::Parameters;
use serde::Deserialize;

use super::{
    Backbone, Chain, Controller, Definition, Dimensionless, Names, PhaseLock, Record, Reference, Scene, SceneError,
    backbone::both,
    plant::{PlantSection, StartSection},
    validate::Quantity,
};

/// The file; sections left out count as empty.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Sections {
    plant: PlantSection,
    start: StartSection,
    excitation: Excitation,
    controller: Controller,
    phase_lock: PhaseLock,
    record: Record,
    backbone: Backbone,
    chain: Chain,
    resonance: Definition,
    rig: RigSection,
    controller_names: Names,
}

/// A rig other than the simulated one.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RigSection {
    names: Names,
}

/// The base amplitude; exactly one of the two keys is given.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct Excitation {
    #[serde(rename = "G")]
    g: Option<f64>,
    #[serde(rename = "E")]
    e: Option<f64>,
}

impl Excitation {
    /// Amplitude E of the base displacement, m.
    fn resolve(&self, origin: &str, plant: &Parameters) -> Result<f64, SceneError> {
        match (self.g, self.e) {
            (Some(g), None) => {
                Quantity::new("excitation.G", g, "(dimensionless)").not_negative()?;
                Ok(Dimensionless::of(plant, 0.0).amplitude(g))
            }
            (None, Some(e)) => {
                Quantity::new("excitation.E", e, "m").not_negative()?;
                Ok(e)
            }
            (given, _) => Err(SceneError::Keys {
                origin: origin.into(),
                message: format!(
                    "[excitation] has {} of G (dimensionless) and E (m): give exactly one, with G = E/(b epsilon)",
                    if given.is_some() { "both" } else { "neither" }
                ),
            }),
        }
    }
}

impl Sections {
    /// Replaces a section.
    pub(super) fn replace(&mut self, name: &str, table: toml::Table) -> Result<(), toml::de::Error> {
        match name {
            "plant" => self.plant = PlantSection::deserialize(table)?,
            "start" => self.start = StartSection::deserialize(table)?,
            "excitation" => self.excitation = Excitation::deserialize(table)?,
            "controller" => self.controller = Controller::deserialize(table)?,
            "phase_lock" => self.phase_lock = PhaseLock::deserialize(table)?,
            "record" => self.record = Record::deserialize(table)?,
            "backbone" => self.backbone = Backbone::deserialize(table)?,
            "chain" => self.chain = Chain::deserialize(table)?,
            _ => self.resonance = Definition::deserialize(table)?,
        }
        Ok(())
    }

    pub(super) fn resolve(mut self, origin: &str) -> Result<Scene, SceneError> {
        self.backbone.complete(origin)?;
        if self.controller.g_max.and(self.controller.e_max).is_some() {
            return Err(both(origin, "controller", "G_max", "E_max"));
        }
        let plant = self.plant.resolve(origin)?;
        let scene = Scene {
            start: self.start.resolve(&plant)?,
            amplitude: self.excitation.resolve(origin, &plant)?,
            plant,
            controller: self.controller,
            phase_lock: self.phase_lock,
            record: self.record,
            backbone: self.backbone,
            chain: self.chain,
            resonance: self.resonance,
            rig_names: self.rig.names,
            controller_names: self.controller_names,
            measured: None,
        };
        scene.controller.check()?;
        scene.record.check(&scene.controller, scene.lock_periods())?;
        scene.backbone.check()?;
        scene.chain.check(&scene.controller)?;
        if scene.resonance.reference == Reference::Force && !scene.chain.reference {
            let message = "resonance.reference = \"force\" with chain.reference = false: the force k e + c e' follows from the base \
                           sensor; switch it on, or take the reference \"base\"";
            return Err(SceneError::Keys { origin: origin.into(), message: message.into() });
        }
        let fastest = scene.controller.omega_max * scene.dimensionless().omega0;
        lovines::Drive::harmonic(scene.amplitude, fastest)
            .validate()
            .map_err(SceneError::Drive)?;
        Ok(scene)
    }
}
