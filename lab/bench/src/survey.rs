//! Exact orbits of a scene, whose host is one oscillator or a structure: at phase resonance, along the backbone, and what a structure's other
//! modes do to both.

use serde::Serialize;
use vines_model::Dimensionless;
use vines_model::orbit::{
    Orbit, OrbitCurve, SEARCHED, StabilityChange, StructureBranch, StructureFacts, StructureOrbit, StructureOrbits,
    StructureRange, at_amplitude,
};

use crate::fit::{self, Contradiction, MeasuredPoint};
use vines_scene::scene::{Scene, Structure};

/// Points of a computed curve: at the size of a figure, neighbours are at most a few pixels apart.
pub const CURVE_POINTS: usize = 400;
/// Detunings of one oscillator's backbone.
pub const DETUNINGS: [f64; 2] = [-6.0, 6.0];

/// What is known of a structure without driving it. The response is the displacement at the sensor, m.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Survey {
    /// The sections of the host, which are its modes, and the backbone with the driven one alone and with all.
    pub facts: StructureFacts,
    /// The section of the driven mode.
    pub driven: usize,
    /// Orbits at phase resonance under the scene's drive, from 0.2 to 3 times the frequency of the driven mode, and where the controller may set the
    /// frequency.
    pub orbits: Vec<StructureOrbit>,
    /// Stable orbits of the backbone behind a shaker, by rising response, beside those under a pure sine.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub behind_shaker: Vec<BehindShaker>,
}

/// An orbit of the backbone of structure and shaker under a sine of the command, and the orbit of the structure alone with the same response under a
/// sine of the reference, which is the force, N, or the displacement of the table, m. They differ by the harmonics of the reference.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BehindShaker {
    /// Amplitude of the response, m.
    pub response: f64,
    /// Frequency, rad/s, and amplitude of the reference.
    pub at: [f64; 2],
    /// Harmonics 3, 5 and 7 of the reference over its first; a symmetric motion has no even ones.
    pub harmonics: [f64; 3],
    /// The same under a sine of the reference, if there is such an orbit.
    pub by_sine: Option<[f64; 2]>,
}

impl Survey {
    /// Number of orbits that are tried where the backbone is one curve.
    pub const ORBITS: usize = 2 * CURVE_POINTS;

    /// The survey of a scene's structure; `None` without one. `progress` is called for every orbit of the backbone that is tried, about
    /// [`Self::ORBITS`] times.
    pub fn of(scene: &Scene, progress: &dyn Fn()) -> Option<Self> {
        let structure = scene.structure.as_ref()?;
        let orbits = scene.orbits_of(structure);
        let driven = section_of(structure);
        let facts = orbits.facts(driven, scene.frequencies(), CURVE_POINTS, progress)?;
        let [low, high] = scene.frequencies();
        let [least, most] = SEARCHED.map(|share| share * scene.plant.natural_frequency());
        Some(Self {
            behind_shaker: behind_shaker(scene, &facts.all).unwrap_or_default(),
            facts,
            driven,
            orbits: orbits.resonant(scene.drive(), [low.min(least), high.max(most)]),
        })
    }

    /// Where another mode takes the stability of the backbone.
    pub fn taken(&self) -> impl Iterator<Item = (usize, &StabilityChange)> {
        let stretches = self.facts.all.iter().flat_map(StructureBranch::stable);
        stretches
            .flat_map(|(_, ends)| ends)
            .flatten()
            .filter_map(|change| Some((change.section().filter(|mode| *mode != self.driven)?, change)))
    }
}

/// Nine orbits, at most, of the longest stable stretch of this backbone behind the scene's shaker, and under a pure sine; `None` without a shaker.
fn behind_shaker(scene: &Scene, backbone: &[StructureBranch]) -> Option<Vec<BehindShaker>> {
    let (structure, shaker) = scene.shaken()?;
    let alone = scene.orbits_of(&shaker.alone);
    let stretches = backbone.iter().flat_map(StructureBranch::stable).map(|(run, _)| run);
    let run = stretches.max_by_key(|run| run.len())?;
    let mut orbits: Vec<&StructureOrbit> = run.iter().step_by(run.len().div_ceil(9)).collect();
    orbits.sort_by(|one, other| one.response.total_cmp(&other.response));
    let compared = |orbit: &StructureOrbit| {
        // The impulses of two impacts per period, as a force.
        let impulses = 4.0 * scene.plant.particle_mass * orbit.speed * orbit.omega / std::f64::consts::PI;
        let harmonic = |order: f64| {
            let omega = order * orbit.omega;
            let reference = shaker.reference(structure.excitation, omega);
            let per_force = structure.host.frequency_response_to_cavity(&reference, omega);
            impulses * per_force.norm() / orbit.reference
        };
        BehindShaker {
            response: orbit.response,
            at: [orbit.omega, orbit.reference],
            harmonics: [3.0, 5.0, 7.0].map(harmonic),
            by_sine: with_response(&alone, orbit.response, orbit.omega).map(|sine| [sine.omega, sine.reference]),
        }
    };
    Some(orbits.into_iter().map(compared).collect())
}

/// The orbit at phase resonance with this response, m, near a frequency, rad/s.
fn with_response(orbits: &StructureOrbits, response: f64, omega: f64) -> Option<StructureOrbit> {
    let distance = |orbit: &StructureOrbit| (orbit.response - response).abs();
    let found = orbits.at_phase_resonance(omega).into_iter();
    let near = found.min_by(|one, other| distance(one).total_cmp(&distance(other)))?;
    orbits.at_response(response, [omega, near.speed])
}

/// The exact orbits of a scene, one by one, in the numbers of its oscillator or driven mode. An oscillator is a structure of one section, with units of
/// its own.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ExactOrbits {
    orbits: StructureOrbits,
    numbers: Dimensionless,
    /// Amplitude of the drive.
    drive: f64,
    /// Base of the oscillator per reference, and displacement at the sensor per response of the oscillator.
    per_unit: [f64; 2],
}

impl ExactOrbits {
    /// Those of the oscillator or the structure of a scene.
    pub(crate) fn of(scene: &Scene, numbers: &Dimensionless) -> Self {
        let Some(structure) = &scene.structure else {
            return Self::of_oscillator(numbers);
        };
        let units = structure.units();
        Self {
            orbits: scene.orbits_of(structure),
            numbers: *numbers,
            drive: scene.drive(),
            per_unit: [units.reference.in_metres(1.0), units.response.of_metres(1.0)],
        }
    }

    /// Those of an oscillator.
    pub(crate) fn of_oscillator(numbers: &Dimensionless) -> Self {
        Self {
            orbits: StructureOrbits::of(numbers),
            numbers: Dimensionless { omega0: 1.0, b: 1.0, ..*numbers },
            drive: numbers.epsilon * numbers.g,
            per_unit: [1.0; 2],
        }
    }

    /// An orbit in these numbers: C is the response over that of the mode with the amplitude b at the cavity.
    fn told(&self, orbit: &StructureOrbit) -> Orbit {
        let [per_drive, per_response] = self.per_unit;
        orbit.in_numbers(&self.numbers, per_drive, per_response)
    }

    /// The orbit at phase resonance with the response C, near a detuning and a speed of the particle.
    pub(crate) fn with_amplitude(&self, c: f64, [sigma, speed]: [f64; 2]) -> Option<Orbit> {
        let d = &self.numbers;
        let near = [d.omega(sigma), speed * d.b * d.omega0];
        let found = self.orbits.at_response(c * d.b * self.per_unit[1], near)?;
        Some(self.told(&found))
    }

    /// The exact backbone of the scene, over the detunings of its structure or of one oscillator.
    fn backbone(&self, scene: &Scene) -> Vec<StructureBranch> {
        let range = match &scene.structure {
            // Other modes may have the motion that the loop finds.
            Some(structure) => {
                let range = self.orbits.range(section_of(structure), CURVE_POINTS);
                range.map(|range| range.with(scene.frequencies()))
            }
            None => Some(StructureRange::at_any_speed(&self.numbers, DETUNINGS, CURVE_POINTS)),
        };
        range.map_or(Vec::new(), |range| self.orbits.backbone(&range))
    }
}

/// The exact phase-resonant orbits of a scene under its drive, by rising C; `numbers` are those of its oscillator or driven mode.
pub fn phase_resonant(scene: &Scene, numbers: &Dimensionless) -> Vec<Orbit> {
    let exact = ExactOrbits::of(scene, numbers);
    let searched = scene.structure.as_ref().map_or(SEARCHED, |_| scene.frequencies());
    let found = exact.orbits.resonant(exact.drive, searched);
    found.iter().map(|orbit| exact.told(orbit)).collect()
}

/// The exact backbone of a scene's structure, curve by curve; `None` for one oscillator.
pub fn structure_backbone(scene: &Scene, numbers: &Dimensionless) -> Option<Vec<Vec<Orbit>>> {
    scene.structure.as_ref()?;
    let exact = ExactOrbits::of(scene, numbers);
    let branches = exact.backbone(scene).into_iter();
    let curve = |branch: StructureBranch| branch.orbits.iter().map(|orbit| exact.told(orbit)).collect();
    Some(branches.map(curve).collect())
}

/// The stable orbits of a scene's exact backbone, with those where its stable stretches begin and end.
pub fn stable_backbone(scene: &Scene, numbers: &Dimensionless) -> Vec<Orbit> {
    let exact = ExactOrbits::of(scene, numbers);
    let branches = exact.backbone(scene);
    let stable = branches.iter().flat_map(StructureBranch::stable_to_their_ends);
    stable.flatten().map(|orbit| exact.told(orbit)).collect()
}

/// Curves of the exact symmetric 1:1 orbits of a scene at these detunings: at phase resonance, or the frequency response under the scene's drive.
pub fn orbit_curves(scene: &Scene, numbers: &Dimensionless, sigma: [f64; 2], is_response: bool) -> Vec<OrbitCurve> {
    let ExactOrbits { orbits, numbers, drive, per_unit } = ExactOrbits::of(scene, numbers);
    let range = StructureRange::at_any_speed(&numbers, sigma, CURVE_POINTS);
    let branches = match is_response {
        true => orbits.frequency_response(drive, &range),
        false => orbits.backbone(&range),
    };
    let told = |branch: &StructureBranch| branch.in_numbers(&numbers, per_unit[0], per_unit[1]);
    branches.iter().map(told).collect()
}

/// Detunings of a structure's backbone and of the frequencies that the controller may set.
pub fn detunings(scene: &Scene, numbers: &Dimensionless) -> Option<[f64; 2]> {
    let structure = scene.structure.as_ref()?;
    let range = scene.orbits_of(structure).range(section_of(structure), CURVE_POINTS)?;
    Some(range.with(scene.frequencies()).omega.map(|omega| numbers.sigma(omega)))
}

/// Measured points of a structure as its driven mode alone would have them.
///
/// A point is moved by the difference, in frequency and drive, between the exact orbits with its response at the scene's parameters: of the driven mode
/// alone, and of all modes near the frequency of the point. Points where one of them does not exist are left out. Those of one mode without a shaker stay.
pub fn without_other_modes(scene: &Scene, points: Vec<MeasuredPoint>) -> Vec<MeasuredPoint> {
    let is_more = |structure: &&Structure| structure.modes.len() > 1 || structure.shaker.is_some();
    let Some(structure) = scene.structure.as_ref().filter(is_more) else {
        return points;
    };
    let exact = ExactOrbits::of(scene, &scene.dimensionless());
    let moved = |mut point: MeasuredPoint| {
        let definition = scene.definition().at_phase(point.phase);
        let numbers = Dimensionless { definition, ..scene.dimensionless() };
        let response = structure.units().response.of_metres(point.response.value);
        let orbits = exact.orbits.clone().with_target(point.phase);
        let all = exact.told(&with_response(&orbits, response, point.omega.value)?);
        let alone = at_amplitude(&numbers, point.response.value / numbers.b)?;
        point.omega.value += numbers.omega0 * (alone.omega - all.omega);
        point.drive.value += numbers.amplitude(alone.g - all.g);
        Some(point)
    };
    points.into_iter().filter_map(moved).collect()
}

/// How measured points contradict their scene; `None` where they do not, or cannot tell, or where the cavity of the scene is not ideal. The points of a
/// structure are compared as its driven mode alone would have them.
pub fn contradiction(scene: &Scene, points: Vec<MeasuredPoint>) -> Option<Contradiction> {
    if scene.left_out_of_cavity().is_some() {
        return None;
    }
    let points = without_other_modes(scene, points);
    fit::contradiction(&points, scene.definition(), &scene.plant)
}

/// The section of the driven mode: the nearest in frequency.
fn section_of(structure: &Structure) -> usize {
    let distance = |n: &usize| {
        let oscillator = &structure.host.sections()[*n].oscillator;
        // A coil has no frequency.
        if oscillator.delta < oscillator.omega0 {
            (oscillator.omega0 - structure.mode().omega).abs()
        } else {
            f64::INFINITY
        }
    };
    let all = 0..structure.host.sections().len();
    all.min_by(|one, other| distance(one).total_cmp(&distance(other)))
        .unwrap_or(0)
}
