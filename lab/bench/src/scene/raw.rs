//! A scene as written, before it is completed and checked.

use serde::Deserialize;

use super::{
    Backbone, Chain, Controller, Record, Scene, SceneError, Start, excitation::RawExcitation,
    plant::RawPlant,
};

/// The file's sections; those left out count as empty.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Raw {
    #[serde(default)]
    plant: RawPlant,
    #[serde(default)]
    start: Start,
    #[serde(default)]
    excitation: RawExcitation,
    #[serde(default)]
    controller: Controller,
    #[serde(default)]
    record: Record,
    #[serde(default)]
    backbone: Backbone,
    #[serde(default)]
    chain: Chain,
}

impl Raw {
    pub(super) fn from_table(table: toml::Table) -> Result<Self, toml::de::Error> {
        table.try_into()
    }

    pub(super) fn resolve(self, origin: &str) -> Result<Scene, SceneError> {
        let plant = self.plant.resolve(origin)?;
        self.start.check(&plant)?;
        let amplitude = self.excitation.resolve(origin, &plant)?;
        self.controller.check()?;
        self.record.check(&self.controller)?;
        self.backbone.check(&self.controller)?;
        self.chain.check(&self.controller)?;
        Ok(Scene {
            plant,
            start: self.start,
            amplitude,
            controller: self.controller,
            record: self.record,
            backbone: self.backbone,
            chain: self.chain,
        })
    }
}
