//! The plant as it is saved: what follows from something else is left out, and computed again.

use super::{Masses, Plant, Rig, Totals};
use crate::base_motion::BaseMotion;
use crate::contact::Contact;
use crate::fast::Keys;
use crate::parameters::Parameters;
use serde::{Deserialize, Serialize};

/// Everything that does not follow from something else.
#[derive(Serialize, Deserialize)]
pub(super) struct Snapshot {
    parameters: Parameters,
    contact: Contact,
    masses: Masses,
    base: BaseMotion,
    begun: bool,
    time: f64,
    totals: Totals,
    evaluations: u64,
    fast: Keys,
}

impl From<Plant> for Snapshot {
    fn from(plant: Plant) -> Self {
        Self {
            parameters: plant.rig.parameters,
            contact: plant.contact,
            masses: plant.masses,
            base: plant.base,
            begun: plant.begun,
            time: plant.time,
            totals: plant.totals,
            evaluations: plant.evaluations,
            fast: Keys::of(&plant.fast),
        }
    }
}

impl From<Snapshot> for Plant {
    fn from(saved: Snapshot) -> Self {
        let rig = Rig::new(&saved.parameters);
        Self {
            fast: saved.fast.restore(&rig.alone),
            rig,
            contact: saved.contact,
            masses: saved.masses,
            base: saved.base,
            begun: saved.begun,
            time: saved.time,
            totals: saved.totals,
            evaluations: saved.evaluations,
        }
    }
}

#[cfg(test)]
#[path = "../../tests/unit/plant_snapshot.rs"]
mod tests;
