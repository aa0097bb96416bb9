//! Scenes read from files and texts.

use std::path::Path;

use super::{Override, PAPER, Scene, SceneError, overrides};

impl Scene {
    /// Reads the scene file at `path`, or the default scene without one, with the overrides applied in order.
    pub fn load(path: Option<&Path>, overrides: &[Override]) -> Result<Self, SceneError> {
        let Some(path) = path else {
            return Self::parse("paper.toml (the default scene)", PAPER, overrides);
        };
        let text = std::fs::read_to_string(path).map_err(|source| SceneError::Read { path: path.into(), source })?;
        Self::parse(&path.display().to_string(), &text, overrides)
    }

    /// Reads a scene from `text`; `origin` names it in messages.
    pub fn parse(origin: &str, text: &str, overrides: &[Override]) -> Result<Self, SceneError> {
        let scene = overrides::read(origin, text, overrides)?.0.resolve(origin)?;
        scene.controller_config().build()?;
        Ok(scene)
    }
}
