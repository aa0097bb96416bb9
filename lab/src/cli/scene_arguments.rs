//! `--scene` and `--set`, which several commands share.

use std::path::PathBuf;

use clap::Args;
use vines::scene::{Family, Override, Scene, SceneError};

#[derive(Debug, Args)]
pub(super) struct SceneArguments {
    /// Scene file (TOML); without it, the default scene
    #[arg(long, value_name = "FILE")]
    scene: Option<PathBuf>,

    /// Replace one value of the scene, such as plant.r=0.7; may be repeated
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<Override>,
}

impl SceneArguments {
    pub(super) fn load(&self) -> Result<Scene, SceneError> {
        Scene::load(self.scene.as_deref(), &self.set)
    }

    /// The scene, of which numbers may vary.
    pub(super) fn family(&self) -> Result<Family, SceneError> {
        let Some(path) = &self.scene else {
            return Family::parse("", None, &self.set);
        };
        let text = std::fs::read_to_string(path).map_err(|source| SceneError::Read { path: path.clone(), source })?;
        Family::parse(&path.display().to_string(), Some(&text), &self.set)
    }
}
