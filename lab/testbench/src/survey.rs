//! Exact orbits of a scene, whose host is one oscillator or a structure: at phase resonance, along the backbone, and what a structure's other
//! modes do to both.

use std::f64::consts::FRAC_PI_2;

use serde::Serialize;
use vines_model::Dimensionless;
use vines_model::orbit::{
    self, AfterImpact, Orbit, Particle, StabilityChange, StructureBranch, StructureFacts, StructureOrbit,
    StructureOrbits,
};

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
            facts: orbits.facts(driven, scene.frequencies(), POINTS)?,
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

/// The exact phase-resonant orbits of a scene under its drive, by rising C; `numbers` are those of its oscillator or driven mode.
pub fn phase_resonant(scene: &Scene, numbers: &Dimensionless) -> Vec<Orbit> {
    let of_structure = || {
        let (orbits, drive) = (scene.structure_orbits()?, scene.structure_drive()?);
        let found = orbits.resonant(drive, scene.frequencies());
        Some(
            found
                .iter()
                .filter_map(|orbit| dimensionless(orbit, scene, numbers))
                .collect(),
        )
    };
    of_structure().unwrap_or_else(|| orbit::phase_resonant(numbers))
}

/// The exact backbone of a scene's structure, curve by curve; `None` for one oscillator.
pub fn structure_backbone(scene: &Scene, numbers: &Dimensionless) -> Option<Vec<Vec<Orbit>>> {
    let orbits = scene.structure_orbits()?;
    // Other modes may have the motion that the loop finds.
    let range = orbits
        .range(section_of(scene.structure.as_ref()?), POINTS)?
        .with(scene.frequencies());
    let curve = |branch: &StructureBranch| {
        branch
            .orbits
            .iter()
            .filter_map(|orbit| dimensionless(orbit, scene, numbers))
            .collect()
    };
    Some(orbits.backbone(&range).iter().map(curve).collect())
}

/// An orbit of a structure in the numbers of its driven mode: C is the response over that of the mode with the amplitude b at the cavity. Of
/// the multipliers the four largest.
fn dimensionless(orbit: &StructureOrbit, scene: &Scene, d: &Dimensionless) -> Option<Orbit> {
    let structure = scene.structure.as_ref()?;
    let length = |value: f64| value / d.b;
    // Half a period later the particle is at the opposite point.
    let [q2, dq2] = [-length(FRAC_PI_2 * orbit.speed / orbit.omega), d.speed(orbit.speed)];
    let impact_velocity = d.speed(orbit.impact_velocity);
    let moduli: Vec<f64> = orbit.multipliers.iter().map(|[re, im]| re.hypot(*im)).collect();
    Some(Orbit {
        g: d.excitation(orbit.drive * structure.base_per_drive()),
        sigma: d.sigma(orbit.omega),
        omega: orbit.omega / d.omega0,
        c: length(orbit.response / structure.reading_per_response().abs()),
        gamma: orbit.phase,
        b: d.speed(orbit.speed),
        impact_velocity,
        start: AfterImpact {
            phase: orbit.impact_phase,
            q1: q2 + 1.0,
            dq1: dq2 - d.r * impact_velocity,
            q2,
            dq2,
        },
        multipliers: *moduli.last_chunk()?,
        stable: orbit.stable,
    })
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
