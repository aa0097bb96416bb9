//! The `[excitation]` section: the base amplitude, as G or as E.

use serde::Deserialize;

use super::{Plant, SceneError, validate::Quantity};

/// The section as written; exactly one of the two keys is given.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawExcitation {
    #[serde(rename = "G")]
    g: Option<f64>,
    #[serde(rename = "E")]
    e: Option<f64>,
}

impl RawExcitation {
    /// Amplitude E of the base displacement, m.
    pub(super) fn resolve(&self, origin: &str, plant: &Plant) -> Result<f64, SceneError> {
        match (self.g, self.e) {
            (Some(g), None) => {
                Quantity::new("excitation.G", g, "(dimensionless)").not_negative()?;
                Ok(g * plant.half_width * plant.epsilon())
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
