//! A plant without what can be computed again.

use super::{Plant, Totals};
use crate::base_motion::BaseMotion;
use crate::contact::Wall;
use crate::fast::{FastPath, SavedPath};
use crate::moving::{Masses, Moving, Rig};
use crate::parameters::Parameters;

/// A plant without what can be computed again: 0.4 kB instead of 8. The motion continues with the same bits.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Saved {
    parameters: Parameters,
    masses: Masses,
    base: BaseMotion,
    contact: Option<Wall>,
    begun: bool,
    time: f64,
    totals: Totals,
    fast: SavedPath,
}

impl Plant {
    /// The plant without what can be computed again.
    pub fn save(&self) -> Saved {
        let Self {
            moving: Moving { rig, masses, base },
            contact,
            begun,
            time,
            totals,
            fast,
        } = *self;
        let parameters = rig.parameters;
        Saved {
            parameters,
            masses,
            base,
            contact,
            begun,
            time,
            totals,
            fast: fast.save(),
        }
    }

    /// Makes this plant the one that was saved. One plant can take the place of many in turn: what it has computed for the last one is
    /// used again as far as it serves.
    pub fn restore(&mut self, saved: &Saved) {
        let Saved {
            parameters,
            masses,
            base,
            contact,
            begun,
            time,
            totals,
            ref fast,
        } = *saved;
        if self.moving.rig.parameters != parameters {
            let rig = Rig::from(parameters);
            if self.moving.rig.free != rig.free {
                self.fast = FastPath::default();
            }
            self.moving.rig = rig;
        }
        (self.moving.masses, self.moving.base, self.contact) = (masses, base, contact);
        (self.begun, self.time, self.totals) = (begun, time, totals);
        self.fast.restore(fast);
    }
}

impl From<Plant> for Saved {
    fn from(plant: Plant) -> Self {
        plant.save()
    }
}

impl From<&Saved> for Plant {
    fn from(saved: &Saved) -> Self {
        let Saved {
            parameters,
            masses,
            base,
            contact,
            begun,
            time,
            totals,
            ref fast,
        } = *saved;
        let mut path = FastPath::default();
        path.restore(fast);
        let rig = Rig::from(parameters);
        Self {
            moving: Moving { rig, masses, base },
            contact,
            begun,
            time,
            totals,
            fast: path,
        }
    }
}

impl From<Saved> for Plant {
    fn from(saved: Saved) -> Self {
        Self::from(&saved)
    }
}
