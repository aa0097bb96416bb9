//! `--scene` and `--set`, which several commands share.

use std::path::PathBuf;

use clap::Args;
#[cfg(feature = "sweep")]
use vines::scene::Family;
use vines::scene::{Override, Scene, SceneError};

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
        self.load_with(&[])
    }

    /// The scene, of which numbers may vary.
    #[cfg(feature = "sweep")]
    pub(super) fn family(&self) -> Result<Family, SceneError> {
        let Some(path) = &self.scene else {
            return Family::parse("", None, &self.set);
        };
        let text = std::fs::read_to_string(path).map_err(|source| SceneError::Read { path: path.clone(), source })?;
        Family::parse(&path.display().to_string(), Some(&text), &self.set)
    }

    /// The first replaced value among these sections and keys.
    pub(super) fn one_of(&self, keys: &[&str]) -> Option<&Override> {
        self.set.iter().find(|one| one.is_one_of(keys))
    }

    /// The scene with further values replaced.
    pub(super) fn load_with(&self, further: &[Override]) -> Result<Scene, SceneError> {
        let set = [&self.set, further].concat();
        Scene::load(self.scene.as_deref(), &set)
    }
}
