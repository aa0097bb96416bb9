//! A structure before it is driven: its modes, and what the exact orbits say of its 1:1 motion at phase resonance.

use serde::Serialize;
use vines_model::orbit::{ModeFacts, Particle, StructureBranch, StructureOrbit, StructureOrbits, StructureRange};

use crate::scene::{Scene, Structure};

/// Largest particle speed of the curves, over b omega0: beyond symmetry breaking.
const SPEED_MAX: f64 = 1.35;
/// Orbits on a curve.
const POINTS: usize = 400;

/// What is known of a structure without driving it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Survey {
    /// The sections of the host: its modes, with the damping that couples them where there is any.
    pub modes: Vec<ModeFacts>,
    /// The section of the driven mode.
    pub driven: usize,
    /// Orbits at phase resonance under the scene's drive.
    pub orbits: Vec<StructureOrbit>,
    /// The backbone with all modes.
    pub backbone: Vec<StructureBranch>,
    /// The backbone of the driven mode alone.
    pub alone: Vec<StructureBranch>,
}

/// Where the backbone loses its stability, though the driven mode alone is stable there.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Taken {
    /// Amplitudes of the response, m, from and to.
    pub response: [f64; 2],
    /// The mode that has most of the growing disturbance beside the driven mode and the particle, by its place.
    pub mode: usize,
    /// The orbit with the largest growth.
    pub worst: StructureOrbit,
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
        let range = StructureRange {
            omega: scene.frequencies(),
            speed: SPEED_MAX * scene.plant.half_width * scene.plant.natural_frequency(),
            points: POINTS,
        };
        Some(Self {
            modes: orbits.modes(driven)?,
            driven,
            orbits: orbits.resonant(scene.structure_drive()?, range.omega),
            backbone: orbits.backbone(&range),
            alone: orbits.with_sections(|n| n == driven).backbone(&range),
        })
    }

    /// Where the driven mode alone is stable, and the structure is not: by the orbit of the same frequency, on the same side of the fold.
    pub fn taken(&self, scene: &Scene) -> Vec<Taken> {
        let Some(orbits) = scene.structure_orbits() else {
            return Vec::new();
        };
        let alone = orbits.with_sections(|n| n == self.driven);
        let mut taken: Vec<Taken> = Vec::new();
        for branch in &self.backbone {
            let mut run: Vec<&StructureOrbit> = Vec::new();
            for orbit in branch.orbits.iter().map(Some).chain([None]) {
                let is_taken = |orbit: &StructureOrbit| {
                    !orbit.stable && alone.at_phase_resonance(orbit.omega).iter().any(|other| other.stable)
                };
                match orbit.filter(|orbit| is_taken(orbit)) {
                    Some(orbit) => run.push(orbit),
                    None => taken.extend(self.run(&orbits, &std::mem::take(&mut run))),
                }
            }
        }
        taken
    }

    /// A run of unstable orbits.
    fn run(&self, orbits: &StructureOrbits, run: &[&StructureOrbit]) -> Option<Taken> {
        let worst = run
            .iter()
            .max_by(|one, other| one.growth().total_cmp(&other.growth()))?;
        let shares = orbits.shares(worst)?;
        let others = (0..self.modes.len()).filter(|n| *n != self.driven);
        let mode = others.max_by(|one, other| shares[*one].total_cmp(&shares[*other]))?;
        let low = run.iter().map(|orbit| orbit.response).fold(f64::INFINITY, f64::min);
        let high = run.iter().map(|orbit| orbit.response).fold(0.0, f64::max);
        Some(Taken { response: [low, high], mode, worst: (*worst).clone() })
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
