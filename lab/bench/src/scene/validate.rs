//! Range checks that name the value, its unit and what is allowed.

use super::SceneError;

/// One number of a scene, under the name that the file gives it.
#[derive(Clone, Copy)]
pub(super) struct Quantity {
    pub key: &'static str,
    pub value: f64,
    pub unit: &'static str,
}

impl Quantity {
    pub(super) fn new(key: &'static str, value: f64, unit: &'static str) -> Self {
        Self { key, value, unit }
    }

    pub(super) fn positive(self) -> Result<(), SceneError> {
        self.check(self.value > 0.0, "must be positive and finite")
    }

    pub(super) fn not_negative(self) -> Result<(), SceneError> {
        self.check(self.value >= 0.0, "must be zero or positive, and finite")
    }

    /// A value that is not finite is refused whatever `ok` says.
    pub(super) fn check(self, ok: bool, allowed: impl Into<String>) -> Result<(), SceneError> {
        if ok && self.value.is_finite() {
            return Ok(());
        }
        Err(SceneError::Value {
            key: self.key,
            value: self.value,
            unit: self.unit,
            allowed: allowed.into(),
        })
    }
}
