//! Exact symmetric 1:1 orbits of a structure with several modes, in SI units: under a given drive, at phase resonance, and along the backbone.
//!
//! The closed form is the one of the study's oscillator, with sums over the sections. Motions of other patterns are searched on one
//! oscillator only.
//!
//! At one frequency, phase resonance or the drive leave two speeds. Over an interval of frequencies both form a loop, which is closed where
//! the two are equal: a turning point in frequency. An angle along the loop passes it without a step that would have to adapt.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use lovines::oscillator::Oscillator;
use lovines::{Excitation, Host, Section};
use nalgebra::{Complex, Matrix2, Vector2};
use serde::Serialize;

use super::half_period::HalfPeriod;
use super::periodic::wrapped;
use super::return_map::{Bifurcation, Stability};
use super::symmetric::{Interval, Particle, Reading, SymmetricMotion, SymmetricMotions, harmonic, intervals, search};
use super::{AfterImpact, Orbit};
use crate::numerics::{self, Equations, equally_spaced, newton, try_bisection};
use crate::oscillator::section;
use crate::theory::SlowFlow;
use crate::{Definition, Dimensionless, Reference, Sensor};

/// An exact symmetric 1:1 orbit of a structure.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StructureOrbit {
    /// Angular frequency, rad/s.
    pub omega: f64,
    /// Amplitude of the drive: m for a base, N for a force, V for the command of a shaker.
    pub drive: f64,
    /// Amplitude of the reference, which is the drive itself unless [`StructureOrbits::with_reference`] says otherwise.
    pub reference: f64,
    /// Amplitude of the first harmonic of the response, m.
    pub response: f64,
    /// Phase of this harmonic relative to the drive, rad.
    pub phase: f64,
    /// Speed of the particle, m/s.
    pub speed: f64,
    /// Relative velocity before an impact, m/s.
    pub impact_velocity: f64,
    /// Phase of the drive at the impact on the wall w = +b, rad, in (-pi, pi]; the other impact is half a period later.
    pub impact_phase: f64,
    /// Where the orbit can be started.
    pub start: StructureStart,
    /// By the half-period map, which has two multipliers of every section, and two of the particle.
    #[serde(flatten)]
    pub stability: Stability,
}

/// The state where the phase of the drive is 0, so that the drive is `sin(omega t)` times its amplitude from there on.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StructureStart {
    /// (x, v) of every section, as in [`lovines::host`].
    pub sections: Vec<[f64; 2]>,
    /// Displacement of the particle, m.
    pub q2: f64,
    /// Velocity of the particle, m/s.
    pub dq2: f64,
}

impl StructureOrbit {
    /// This orbit in the numbers of an oscillator, which a base of the amplitude `base_per_drive`, m, drives as a unit drive does the host, and
    /// whose response is this one over `reading_per_response`. Of the multipliers the four largest.
    pub fn in_numbers(&self, d: &Dimensionless, base_per_drive: f64, reading_per_response: f64) -> Orbit {
        // Half a period later the particle is at the opposite point.
        let [q2, dq2] = [-FRAC_PI_2 * self.speed / self.omega / d.b, d.speed(self.speed)];
        let impact_velocity = d.speed(self.impact_velocity);
        let [q1, dq1] = [q2 + 1.0, dq2 - d.r * impact_velocity];
        Orbit {
            g: d.excitation(self.reference * base_per_drive),
            sigma: d.sigma(self.omega),
            omega: self.omega / d.omega0,
            c: self.response / (d.b * reading_per_response),
            gamma: self.phase,
            b: dq2,
            impact_velocity,
            start: AfterImpact { phase: self.impact_phase, q1, dq1, q2, dq2 },
            multipliers: self.stability.largest_four(),
            stable: self.stability.stable,
            neutral: self.stability.neutral,
        }
    }
}

/// A curve of symmetric 1:1 orbits of a structure, in order.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StructureBranch {
    /// Its orbits.
    pub orbits: Vec<StructureOrbit>,
    /// Where multipliers leave or enter the unit circle, in order. Two opposite changes between neighbouring orbits are missed.
    pub changes: Vec<StabilityChange>,
    /// It leads back to its first orbit.
    pub closed: bool,
}

/// A curve of symmetric 1:1 orbits in the numbers of an oscillator.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OrbitCurve {
    /// Its orbits, in order.
    pub points: Vec<Orbit>,
    /// Where multipliers leave or enter the unit circle.
    pub special: Vec<(Bifurcation, Orbit)>,
    /// It leads back to its first orbit.
    pub closed: bool,
}

impl StructureBranch {
    /// The stretches of stable orbits, and of neutral ones, each with the changes at its ends; `None` where the curve ends.
    pub fn stretches(&self) -> impl Iterator<Item = (&[StructureOrbit], [Option<&StabilityChange>; 2])> {
        let mut from = 0;
        let kind = |orbit: &StructureOrbit| [orbit.stability.stable, orbit.stability.neutral];
        let runs = self.orbits.chunk_by(move |one, other| kind(one) == kind(other));
        let with_ends = runs.map(move |run| {
            let ends = [from, from + run.len()].map(|n| self.changes.iter().find(|change| change.after + 1 == n));
            from += run.len();
            (run, ends)
        });
        with_ends.filter(|(run, _)| !run[0].stability.is_unstable())
    }

    /// The stretches of stable orbits.
    pub fn stable(&self) -> impl Iterator<Item = (&[StructureOrbit], [Option<&StabilityChange>; 2])> {
        self.stretches().filter(|(run, _)| run[0].stability.stable)
    }

    /// The stretches of stable orbits, with the orbits where they begin and end.
    pub fn stable_to_their_ends(&self) -> impl Iterator<Item = Vec<&StructureOrbit>> {
        self.stable().map(|(run, [first, last])| {
            let [first, last] = [first, last].map(|end| end.map(|change| &change.orbit));
            first.into_iter().chain(run).chain(last).collect()
        })
    }

    /// This curve in the numbers of an oscillator, as [`StructureOrbit::in_numbers`].
    pub fn in_numbers(&self, d: &Dimensionless, base_per_drive: f64, reading_per_response: f64) -> OrbitCurve {
        let told = |orbit: &StructureOrbit| orbit.in_numbers(d, base_per_drive, reading_per_response);
        OrbitCurve {
            points: self.orbits.iter().map(told).collect(),
            special: self
                .changes
                .iter()
                .map(|change| (change.kind, told(&change.orbit)))
                .collect(),
            closed: self.closed,
        }
    }
}

/// An orbit with a multiplier on the unit circle.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StabilityChange {
    /// What happens.
    pub kind: Bifurcation,
    /// The orbit there.
    pub orbit: StructureOrbit,
    /// What each section and, last, the particle contribute to the disturbance that neither grows nor decays there: shares of its energy.
    pub shares: Vec<f64>,
    /// Number of the last orbit of the curve before it, from 0.
    pub after: usize,
}

impl StabilityChange {
    /// The section that contributes most to the disturbance; `None` for the particle.
    pub fn section(&self) -> Option<usize> {
        let largest = self
            .shares
            .iter()
            .enumerate()
            .max_by(|one, other| one.1.total_cmp(other.1));
        largest.map(|(n, _)| n).filter(|n| n + 1 < self.shares.len())
    }
}

/// Where curves are followed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StructureRange {
    /// Angular frequencies, rad/s.
    pub omega: [f64; 2],
    /// Largest speed of the particle, m/s.
    pub speed: f64,
    /// Number of orbits over each interval of frequencies in which there are orbits.
    pub points: usize,
}

impl StructureRange {
    /// All speeds at these detunings of an oscillator.
    pub fn at_any_speed(d: &Dimensionless, sigma: [f64; 2], points: usize) -> Self {
        let [low, high] = SEARCHED.map(|omega| omega * d.omega0);
        Self {
            omega: sigma.map(|sigma| d.omega(sigma).clamp(low, high)),
            speed: f64::INFINITY,
            points,
        }
    }

    /// This range, extended to the frequencies from `low` to `high`, rad/s.
    #[must_use]
    pub fn with(mut self, [low, high]: [f64; 2]) -> Self {
        self.omega = [self.omega[0].min(low), self.omega[1].max(high)];
        self
    }
}

/// A mode beside the driven one, and what it does to the orbits.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ModeFacts {
    /// Natural frequency, rad/s.
    pub omega0: f64,
    /// Damping ratio.
    pub zeta: f64,
    /// Mass ratio `epsilon = m phi²`: mass of the particle over the modal mass at the cavity.
    pub mass_ratio: f64,
    /// Natural frequency over the driven mode's.
    pub ratio: f64,
    /// The harmonic of the driven mode, 3, 5 or 7, that is nearest to this mode, and the distance over the driven mode's frequency.
    pub harmonic: (u32, f64),
    /// What this mode adds to the conditions of impact, alpha and beta, over what they are with the driven mode alone, at the driven mode's
    /// frequency. Far below 1, the mode leaves the orbits where they are; its effect on their stability is another question.
    pub influence: f64,
}

/// What the other modes of a structure do to the backbone of the driven one.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StructureFacts {
    /// The modes, in the order of the sections.
    pub modes: Vec<ModeFacts>,
    /// The backbone of the driven mode alone.
    pub alone: Vec<StructureBranch>,
    /// The backbone with all modes.
    pub all: Vec<StructureBranch>,
}

/// The symmetric 1:1 orbits of a structure with a particle in a cavity.
///
/// By default the response is the displacement of the cavity, and lags the drive by a quarter of a period at resonance.
#[derive(Debug, Clone, PartialEq)]
pub struct StructureOrbits {
    excitation: Excitation,
    sections: Vec<Section>,
    particle: Particle,
    response: Option<Vec<[f64; 2]>>,
    /// Reference, and inertia in it.
    reference: Option<[Vec<[f64; 2]>; 2]>,
    /// Weight of m q2 in the response.
    of_particle: f64,
    /// The phase refers to the force of the drive on the first section, not to the drive.
    by_force: bool,
    target: f64,
}

/// Frequencies searched, over the natural frequency of the oscillator or the driven mode.
pub const SEARCHED: [f64; 2] = [0.2, 3.0];
/// Least number of frequencies at which orbits are searched over a range.
const FEWEST_FREQUENCIES: usize = 4000;
/// Difference of neighbouring frequencies over the distance from the nearest mode, which counts at least as its mass ratio: the detunings where it is of
/// order one.
const SPACING: f64 = 0.002;
/// Widths, in the angle along a loop, to which a change of stability and the end of a branch are located.
const LOCATION_WIDTH: f64 = 1e-11;
/// Amplitudes over b that are rounding: of a response that is zero, and of the harmonic part of an orbit that needs no drive.
const AMPLITUDE_ROUNDING: f64 = 1e-12;

impl StructureOrbits {
    /// The orbits of a host.
    pub fn new(host: &Host, particle: Particle) -> Self {
        Self {
            excitation: host.excitation(),
            sections: host.sections().to_vec(),
            particle,
            response: None,
            reference: None,
            of_particle: 0.0,
            by_force: false,
            target: -FRAC_PI_2,
        }
    }

    /// The orbits of the study's oscillator, dimensionless.
    pub fn of(scene: &Dimensionless) -> Self {
        let Definition { reference, sensor, phase, .. } = scene.definition;
        Self {
            excitation: Excitation::Base,
            sections: vec![section(scene.epsilon * scene.lambda)],
            particle: Particle { mass: scene.epsilon, half_width: 1.0, restitution: scene.r },
            response: None,
            reference: None,
            of_particle: f64::from(u8::from(sensor == Sensor::V)),
            by_force: reference == Reference::Force,
            target: phase,
        }
    }

    /// With the displacement of another point as the response, which [`Host::row`] gives.
    pub fn with_response(mut self, point: &[[f64; 2]]) -> Self {
        self.response = Some(point.to_vec());
        self
    }

    /// With a sum over the sections as the reference, instead of the drive, less the acceleration of another sum.
    pub fn with_reference(mut self, reference_and_inertia: [Vec<[f64; 2]>; 2]) -> Self {
        self.reference = Some(reference_and_inertia);
        self
    }

    /// With another phase, rad, of the response (a displacement) relative to the reference at resonance.
    pub fn with_target(mut self, phase: f64) -> Self {
        self.target = phase;
        self
    }

    /// The orbits of a host that has only the sections for which `keep` is true of their number.
    pub fn with_sections(&self, keep: impl Fn(usize) -> bool) -> Self {
        fn kept<T: Copy>(all: &[T], keep: &impl Fn(usize) -> bool) -> Vec<T> {
            let numbered = all.iter().enumerate();
            numbered.filter(|(n, _)| keep(*n)).map(|(_, one)| *one).collect()
        }
        Self {
            sections: kept(&self.sections, &keep),
            response: self.response.as_ref().map(|rows| kept(rows, &keep)),
            reference: self
                .reference
                .as_ref()
                .map(|both| both.each_ref().map(|rows| kept(rows, &keep))),
            ..*self
        }
    }

    /// All orbits at the frequency `omega`, rad/s, with a reference of the amplitude `reference`, at any phase: none or up to two.
    pub fn at(&self, omega: f64, reference: f64) -> Vec<StructureOrbit> {
        let both = self.both(omega, |motions| motions.driven(reference));
        both.iter()
            .flatten()
            .filter_map(|motion| self.accept(motion, true))
            .collect()
    }

    /// All orbits at phase resonance at the frequency `omega`, rad/s, under any drive: none or up to two.
    pub fn at_phase_resonance(&self, omega: f64) -> Vec<StructureOrbit> {
        let both = self.both(omega, SymmetricMotions::phase_resonant);
        both.iter()
            .flatten()
            .filter_map(|motion| self.accept_resonant(motion, true))
            .collect()
    }

    /// The orbit at phase resonance whose response has the amplitude `response`, near a frequency, rad/s, and a speed of the particle.
    ///
    /// Along a backbone the frequency has extrema, also where it is stable: both are unknowns.
    pub fn at_response(&self, response: f64, [omega, speed]: [f64; 2]) -> Option<StructureOrbit> {
        let mut equations = AtResponse { orbits: self, response, near: [omega, speed] };
        let found = newton(&mut equations, Vector2::repeat(1.0))?;
        self.accept_resonant(&self.motions(found[0] * omega)?.at(found[1] * speed), true)
    }

    /// All orbits at phase resonance with a reference of the amplitude `reference` and frequencies in a range, rad/s, by rising response.
    pub fn resonant(&self, reference: f64, range: [f64; 2]) -> Vec<StructureOrbit> {
        let found = search(self.grid(range), reference, |omega| self.motions(omega));
        let mut orbits: Vec<_> = found
            .iter()
            .filter_map(|motion| self.accept_resonant(motion, true))
            .collect();
        orbits.sort_unstable_by(|first, second| first.response.total_cmp(&second.response));
        let same = |first: f64, second: f64| (first - second).abs() < 1e-9 * first.abs();
        orbits.dedup_by(|first, second| same(first.omega, second.omega) && same(first.speed, second.speed));
        orbits
    }

    /// Frequencies from `low` to `high`, equally spaced far from the modes, and ever closer towards each: the orbits of a mode with a small mass ratio
    /// epsilon are within some epsilon of its frequency.
    fn grid(&self, [low, high]: [f64; 2]) -> impl Iterator<Item = f64> {
        let modes = (0..self.sections.len()).filter_map(|n| self.numbers(n));
        let modes: Vec<_> = modes.map(|mode| (mode.omega0, mode.epsilon)).collect();
        let next = move |omega: f64| {
            let distances = modes
                .iter()
                .map(|(omega0, epsilon)| (omega - omega0).hypot(epsilon * omega0));
            let spacing = distances.fold(f64::INFINITY, f64::min) * SPACING;
            omega + spacing.min((high - low) / FEWEST_FREQUENCIES as f64)
        };
        std::iter::successors(Some(low), move |omega| Some(next(*omega)))
            .take_while(move |omega| *omega < high)
            .chain([high])
    }

    /// The exact backbone: the orbits at phase resonance within `range`, as curves.
    pub fn backbone(&self, range: &StructureRange) -> Vec<StructureBranch> {
        self.backbone_with(range, &|| ())
    }

    /// The exact backbone; `progress` is called for every orbit that is tried.
    fn backbone_with(&self, range: &StructureRange, progress: &dyn Fn()) -> Vec<StructureBranch> {
        let roots = SymmetricMotions::phase_resonant;
        self.branches(range, roots, |motion, with_stability| {
            progress();
            self.accept_resonant(motion, with_stability)
        })
    }

    /// The frequency response of the symmetric 1:1 motions with a reference of the amplitude `reference` within `range`, as curves.
    pub fn frequency_response(&self, reference: f64, range: &StructureRange) -> Vec<StructureBranch> {
        let roots = |motions: &SymmetricMotions| motions.driven(reference);
        self.branches(range, roots, |motion, with_stability| {
            self.accept(motion, with_stability)
        })
    }

    /// The dimensionless numbers of the section `n` alone, without a drive; its response is the displacement of the cavity. `None` unless it
    /// oscillates and the cavity and the drive reach it.
    pub fn numbers(&self, n: usize) -> Option<Dimensionless> {
        let section = self.sections.get(n)?;
        let Particle { mass, half_width, restitution } = self.particle;
        let Oscillator { delta, omega0, .. } = section.oscillator;
        let epsilon = mass * section.velocity_per_impulse(section.cavity);
        let is_driven = harmonic(section.cavity, section.driven(omega0)).norm() > 0.0;
        let reference = match self.excitation {
            Excitation::Force => Reference::Force,
            Excitation::Base => Reference::Base,
        };
        (delta < omega0 && epsilon > 0.0 && is_driven).then(|| Dimensionless {
            omega0,
            b: half_width,
            definition: Definition {
                reference,
                sensor: Sensor::Q1,
                phase: self.target,
                ..Definition::default()
            },
            ..Dimensionless::new(epsilon, 2.0 * delta / (epsilon * omega0), restitution, 0.0)
        })
    }

    /// The modes, in the order of the sections, beside the section `driven`.
    pub fn modes(&self, driven: usize) -> Option<Vec<ModeFacts>> {
        let omega = self.sections.get(driven)?.oscillator.omega0;
        let conditions =
            |keep: &dyn Fn(usize) -> bool| Some(self.with_sections(keep).motions(omega)?.impact_conditions());
        let alone = conditions(&|n| n == driven)?;
        let facts = |(n, section): (usize, &Section)| {
            let Oscillator { delta, omega0, .. } = section.oscillator;
            let ratio = omega0 / omega;
            let distance = |order: &u32| (ratio - f64::from(*order)).abs();
            let nearest = [3, 5, 7]
                .into_iter()
                .min_by(|one, other| distance(one).total_cmp(&distance(other)));
            let order = nearest.unwrap_or(3);
            let influence = if n == driven {
                1.0
            } else {
                let with = conditions(&|other| other == n || other == driven)?;
                (with - alone).norm() / alone.norm()
            };
            Some(ModeFacts {
                omega0,
                zeta: delta / omega0,
                mass_ratio: self.particle.mass * section.velocity_per_impulse(section.cavity),
                ratio,
                harmonic: (order, distance(&order)),
                influence,
            })
        };
        self.sections.iter().enumerate().map(facts).collect()
    }

    /// The range of the backbone of the section `driven`, by first-order theory: all frequencies from slow particles to a speed of 1.5 b omega0,
    /// beyond which symmetric motions are unstable.
    pub fn range(&self, driven: usize, points: usize) -> Option<StructureRange> {
        const FASTEST_PARTICLE: f64 = 1.5;
        let Dimensionless { omega0, b, epsilon, lambda, r, definition, .. } = self.numbers(driven)?;
        let flow = SlowFlow::new(lambda, r);
        let detunings = equally_spaced(0.0, FASTEST_PARTICLE, FEWEST_FREQUENCIES)
            .map(|speed| flow.detuning_at(speed, definition.off_resonance()));
        let (low, high) = numerics::range((0.0, 0.0), detunings);
        // First-order theory leaves out detunings of order epsilon, and other modes.
        let omega = [low - 1.0, high + 1.0].map(|sigma| (1.0 + epsilon * sigma).clamp(SEARCHED[0], SEARCHED[1]));
        Some(StructureRange {
            omega: omega.map(|omega| omega * omega0),
            speed: FASTEST_PARTICLE * b * omega0,
            points,
        })
    }

    /// The modes, and the backbone of the section `driven` alone over its own range, and with all modes also over the frequencies `omega`, rad/s,
    /// with about `points` orbits each. `progress` is called for every orbit that is tried.
    pub fn facts(&self, driven: usize, omega: [f64; 2], points: usize, progress: &dyn Fn()) -> Option<StructureFacts> {
        let range = self.range(driven, points)?;
        Some(StructureFacts {
            modes: self.modes(driven)?,
            alone: self.with_sections(|n| n == driven).backbone(&range),
            all: self.backbone_with(&range.with(omega), progress),
        })
    }

    /// All symmetric motions at the frequency `omega`.
    pub(super) fn motions(&self, omega: f64) -> Option<SymmetricMotions> {
        let force = Some(self.sections.first()?.driven(omega)[0]).filter(|_| self.by_force);
        let reading = Reading {
            sections: self.response.as_deref(),
            reference_sections: self.reference.as_ref(),
            particle: self.of_particle,
            reference: Complex::from_polar(1.0, self.target + FRAC_PI_2) * force.unwrap_or(Complex::ONE),
        };
        SymmetricMotions::new(&self.sections, self.particle, &reading, omega)
    }

    /// Both motions of a quadratic at one frequency.
    fn both(&self, omega: f64, roots: impl Fn(&SymmetricMotions) -> Option<[f64; 2]>) -> Option<[SymmetricMotion; 2]> {
        let motions = self.motions(omega)?;
        Some(roots(&motions)?.map(|speed| motions.at(speed)))
    }

    /// The orbit as [`Self::accept`], if the phase of its response has the sign that is wanted.
    fn accept_resonant(&self, motion: &SymmetricMotion, with_stability: bool) -> Option<StructureOrbit> {
        if motion.cavity.norm() < AMPLITUDE_ROUNDING * self.particle.half_width {
            // Without a drive, its phase is free.
            let turned = wrapped(motion.drive.arg() + motion.phase + FRAC_PI_2);
            let mut orbit = self.accept(motion, with_stability)?;
            orbit.phase = self.target;
            orbit.impact_phase = turned;
            return Some(orbit);
        }
        let resonant = motion.phase.sin() < -1e-12;
        resonant.then(|| self.accept(motion, with_stability)).flatten()
    }

    /// A motion as an orbit, of which neither start nor stability are examined.
    pub(super) fn told(&self, motion: &SymmetricMotion) -> StructureOrbit {
        StructureOrbit {
            omega: motion.omega,
            drive: motion.drive.norm(),
            reference: motion.reference.norm(),
            response: motion.response.norm(),
            phase: wrapped(motion.phase + self.target + FRAC_PI_2),
            speed: motion.speed,
            impact_velocity: motion.impact_velocity,
            impact_phase: motion.drive.arg(),
            start: StructureStart { sections: Vec::new(), q2: f64::NAN, dq2: f64::NAN },
            stability: Stability::default(),
        }
    }

    /// The orbit with its stability, or without it and without its start, if it is physical: the particle moves, and hits the other wall half a
    /// period later, not earlier.
    fn accept(&self, motion: &SymmetricMotion, with_stability: bool) -> Option<StructureOrbit> {
        let orbit = self.told(motion);
        let sizes = [orbit.speed, orbit.response, orbit.drive];
        let is_motion = orbit.speed > 0.0 && orbit.response > AMPLITUDE_ROUNDING * self.particle.half_width;
        if sizes.iter().any(|size| !size.is_finite()) || !is_motion {
            return None;
        }
        let half = HalfPeriod::new(&self.sections, &self.particle, motion)?;
        if !with_stability {
            return Some(orbit);
        }
        let (t, sign) = since_impact(motion);
        let state = |(section, impulsive): (&Section, Vector2<f64>)| {
            let impulsive = section.propagator(t) * impulsive * sign;
            if orbit.drive == 0.0 {
                // Without a drive there is no harmonic part, even at an undamped resonance.
                return impulsive.into();
            }
            let per_force = section.stiffness(motion.omega).inv() * orbit.drive;
            let [x, v] = section.driven(motion.omega).map(|response| (response * per_force).im);
            [x + impulsive[0], v + impulsive[1]]
        };
        let q2 = motion.after[0] - self.particle.half_width;
        Some(StructureOrbit {
            start: StructureStart {
                sections: self.sections.iter().zip(half.impulsive()).map(state).collect(),
                q2: sign * (q2 + motion.speed * t),
                dq2: sign * motion.speed,
            },
            stability: half.stability(),
            ..orbit
        })
    }

    /// The curves of the two roots over frequency that are orbits.
    fn branches(
        &self,
        range: &StructureRange,
        roots: impl Fn(&SymmetricMotions) -> Option<[f64; 2]>,
        accept: impl Fn(&SymmetricMotion, bool) -> Option<StructureOrbit>,
    ) -> Vec<StructureBranch> {
        let both = |omega: f64| self.both(omega, &roots);
        let mut branches = Vec::new();
        for Interval { points, inside: turns } in intervals(self.grid(range.omega), |omega| both(omega).map(|_| ())) {
            let [low, high] = [points[0].0, points[points.len() - 1].0];
            // Angles 0 to pi lead up along the first root, and pi to 2 pi back along the second one.
            let at = |angle: f64, with_stability: bool| {
                let omega = 0.5 * (low + high) - 0.5 * (high - low) * angle.cos();
                let second = usize::from(angle.rem_euclid(TAU) >= PI);
                let motion = &both(omega.clamp(low, high))?[second];
                (motion.speed <= range.speed)
                    .then(|| accept(motion, with_stability))
                    .flatten()
            };
            let arcs = match turns {
                [_, true] => vec![[0.0, TAU]],
                [true, false] => vec![[PI, 3.0 * PI]],
                [false, false] => vec![[0.0, PI], [PI, TAU]],
            };
            for arc in arcs {
                branches.extend(self.pieces(arc, turns == [true; 2], range.points, &at));
            }
        }
        branches
    }

    /// The pieces of an arc that consist of orbits.
    fn pieces(
        &self,
        [from, to]: [f64; 2],
        is_loop: bool,
        points: usize,
        at: &impl Fn(f64, bool) -> Option<StructureOrbit>,
    ) -> Vec<StructureBranch> {
        let count = (points as f64 * (to - from) / PI).ceil().max(2.0);
        let step = (to - from) / count;
        let angle = |n: usize| from + (n as f64 + 0.5) * step;
        let mut samples: Vec<_> = (0..count as usize).map(|n| (angle(n), at(angle(n), true))).collect();
        // A loop begins where it is interrupted, or ends where it begins.
        let closed = is_loop && samples.iter().all(|(_, orbit)| orbit.is_some());
        if is_loop {
            let gap = samples.iter().position(|(_, orbit)| orbit.is_none()).unwrap_or(0);
            for sample in &mut samples[..gap] {
                sample.0 += TAU;
            }
            samples.rotate_left(gap);
            samples.push((samples[0].0 + TAU, samples[0].1.clone()));
        }
        let (mut branches, mut from) = (Vec::new(), 0);
        for run in samples.chunk_by(|one, other| one.1.is_some() == other.1.is_some()) {
            let to = from + run.len();
            let towards = |n: Option<usize>| n.and_then(|n| samples.get(n)).map(|sample| sample.0);
            let inside: Vec<(f64, &StructureOrbit)> = run
                .iter()
                .filter_map(|(angle, orbit)| Some((*angle, orbit.as_ref()?)))
                .collect();
            if !inside.is_empty() {
                let first = towards(from.checked_sub(1)).and_then(|gap| end(at, run[0].0, gap));
                let last = towards(Some(to)).and_then(|gap| end(at, run[run.len() - 1].0, gap));
                let located = inside.windows(2).enumerate().filter_map(|(n, pair)| {
                    let change = self.change(at, pair[0], pair[1])?;
                    Some(StabilityChange { after: n + usize::from(first.is_some()), ..change })
                });
                branches.push(StructureBranch {
                    changes: located.collect(),
                    orbits: first
                        .into_iter()
                        .chain(inside.iter().map(|inside| inside.1.clone()))
                        .chain(last)
                        .collect(),
                    closed,
                });
            }
            from = to;
        }
        branches
    }

    /// Where the number of multipliers outside the unit circle changes between two neighbours.
    fn change(
        &self,
        at: &impl Fn(f64, bool) -> Option<StructureOrbit>,
        (from, first): (f64, &StructureOrbit),
        (to, second): (f64, &StructureOrbit),
    ) -> Option<StabilityChange> {
        let outside = first.stability.outside();
        if outside == second.stability.outside() {
            return None;
        }
        let at = |angle: f64| at(angle, true);
        let like_first = |angle: f64| Some(at(angle)?.stability.outside() == outside);
        let (before, beyond) = try_bisection(from, to, LOCATION_WIDTH, like_first)?;
        // The multipliers rise in modulus: the first one outside has just left, or is about to enter.
        let orbit = at(if outside < second.stability.outside() {
            beyond
        } else {
            before
        })?;
        let multipliers = &orbit.stability.multipliers;
        let [re, im] = *multipliers.get(multipliers.len() - orbit.stability.outside())?;
        let kind = match im == 0.0 {
            false => Bifurcation::NeimarkSacker,
            true if re > 0.0 => Bifurcation::Fold,
            true => Bifurcation::SymmetryBreaking,
        };
        let motion = self.motions(orbit.omega)?.at(orbit.speed);
        let half = HalfPeriod::new(&self.sections, &self.particle, &motion)?;
        let shares = half.shares(Complex::new(re, im), orbit.omega)?;
        Some(StabilityChange { kind, orbit, shares, after: 0 })
    }
}

/// Phase resonance, and an amplitude of the response. The unknowns are frequency and speed over those near which the orbit is searched.
struct AtResponse<'a> {
    orbits: &'a StructureOrbits,
    response: f64,
    near: [f64; 2],
}

impl AtResponse<'_> {
    fn residual(&self, x: Vector2<f64>) -> Option<Vector2<f64>> {
        let [omega, speed] = [0, 1].map(|n| x[n] * self.near[n]);
        let motions = self.orbits.motions(omega)?;
        let response = motions.at(speed).response.norm() / self.response - 1.0;
        let residual = Vector2::new(motions.off_resonance(speed), response);
        residual.iter().all(|value| value.is_finite()).then_some(residual)
    }
}

impl Equations<2> for AtResponse<'_> {
    fn at(&mut self, x: &Vector2<f64>) -> Option<(Vector2<f64>, Matrix2<f64>)> {
        // Steps of central differences, far below the bandwidth of a resonance and the curvature: they do not bound the accuracy.
        let slope = |step: Vector2<f64>| {
            let [after, before] = [self.residual(x + step)?, self.residual(x - step)?];
            Some((after - before) / (2.0 * step.norm()))
        };
        let slopes = [slope(Vector2::new(1e-9, 0.0))?, slope(Vector2::new(0.0, 1e-6))?];
        Some((self.residual(*x)?, Matrix2::from_columns(&slopes)))
    }
}

/// Time since the last impact where the phase of the drive is 0, and -1 where this is the impact on the wall w = -b.
fn since_impact(motion: &SymmetricMotion) -> (f64, f64) {
    let turned = (-motion.drive.arg()).rem_euclid(TAU);
    if turned < PI {
        (turned / motion.omega, 1.0)
    } else {
        ((turned - PI) / motion.omega, -1.0)
    }
}

/// The last orbit from `from`, where there is one, towards `to`, where there is none.
fn end(at: &impl Fn(f64, bool) -> Option<StructureOrbit>, from: f64, to: f64) -> Option<StructureOrbit> {
    let (last, _) = try_bisection(from, to, LOCATION_WIDTH, |angle| Some(at(angle, false).is_some()))?;
    (last != from).then(|| at(last, true)).flatten()
}
