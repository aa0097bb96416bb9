//! A structure before it is driven: its modes, and what the exact orbits say of its 1:1 motion at phase resonance.

use serde::Serialize;
use vines_model::orbit::{Particle, StabilityChange, StructureFacts, StructureOrbit, StructureOrbits};

use crate::scene::{Scene, Structure};

/// Orbits on a curve.
const POINTS: usize = 400;

/// What is known of a structure without driving it. The response is the displacement at the sensor, m.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Survey {
    /// The sections of the host, which are its modes, and the backbone with the driven one alone and with all.
    pub facts: StructureFacts,
    /// The section of the driven mode.
    pub driven: usize,
    /// Orbits at phase resonance under the scene's drive, at frequencies that the controller may set.
    pub orbits: Vec<StructureOrbit>,
}

impl Scene {
    /// The exact orbits of the scene's structure; `None` without one. The response is the displacement at the sensor.
    pub fn structure_orbits(&self) -> Option<StructureOrbits> {
        let structure = self.structure.as_ref()?;
        let particle = Particle {
            mass: self.plant.particle_mass,
            half_width: self.plant.half_width,
            restitution: self.plant.restitution,
        };
        let target = self.controller.phase_target.to_radians();
        let orbits = StructureOrbits::new(&structure.host, particle);
        Some(orbits.with_response(&structure.response()).with_target(target))
    }

    /// Amplitude of the drive of the scene's structure: m for a base, N for a force.
    pub fn structure_drive(&self) -> Option<f64> {
        self.structure
            .as_ref()
            .map(|structure| self.amplitude / structure.base_per_drive())
    }

    /// The frequencies that the controller may set, rad/s.
    pub(crate) fn frequencies(&self) -> [f64; 2] {
        [self.controller.omega_min, self.controller.omega_max].map(|share| share * self.plant.natural_frequency())
    }
}

impl Survey {
    /// The survey of a scene's structure; `None` without one.
    pub fn of(scene: &Scene) -> Option<Self> {
        let (structure, orbits) = (scene.structure.as_ref()?, scene.structure_orbits()?);
        let driven = section_of(structure);
        Some(Self {
            facts: orbits.facts(driven, POINTS)?,
            driven,
            orbits: orbits.resonant(scene.structure_drive()?, scene.frequencies()),
        })
    }

    /// Where another mode takes the stability of the backbone, or gives it back.
    pub fn taken(&self) -> impl Iterator<Item = (usize, &StabilityChange)> {
        let changes = self.facts.all.iter().flat_map(|branch| &branch.changes);
        changes.filter_map(|change| Some((change.section().filter(|mode| *mode != self.driven)?, change)))
    }
}

/// The section of the driven mode: the nearest in frequency.
fn section_of(structure: &Structure) -> usize {
    let distance = |n: &usize| {
        let section = &structure.host.sections()[*n];
        (section.oscillator.omega0 - structure.mode().omega).abs()
    };
    let all = 0..structure.host.sections().len();
    all.min_by(|one, other| distance(one).total_cmp(&distance(other)))
        .unwrap_or(0)
}
