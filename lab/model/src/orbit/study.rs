//! The symmetric 1:1 orbits of the study's oscillator, dimensionless: a structure of one section.

use std::f64::consts::FRAC_PI_2;

use nalgebra::Complex;

use super::Orbit;
use super::structure::{OrbitCurve, SEARCHED, StructureOrbit, StructureOrbits, StructureRange};
use crate::Dimensionless;
use crate::numerics::secant;
use crate::theory::{BranchSide, Manifold, SlowFlow};

/// The numbers of `scene` with its own units.
fn bare(scene: &Dimensionless) -> Dimensionless {
    Dimensionless { omega0: 1.0, b: 1.0, ..*scene }
}

/// Dimensionless orbits of the host in the numbers of `scene`.
fn told<'a>(scene: &Dimensionless, found: impl IntoIterator<Item = &'a StructureOrbit>) -> Vec<Orbit> {
    let orbit = |orbit: &StructureOrbit| orbit.in_numbers(&bare(scene), 1.0, 1.0);
    found.into_iter().map(orbit).collect()
}

/// All exact symmetric 1:1 orbits at resonance at the scene's G, by rising C; empty where there are none.
///
/// Frequencies between 0.2 and 3 omega0 are searched, 0.002 and less apart in the detuning where that is of order one, and every root is refined to
/// the last bit.
pub fn phase_resonant(scene: &Dimensionless) -> Vec<Orbit> {
    let orbits = StructureOrbits::of(scene);
    told(scene, &orbits.resonant(scene.epsilon * scene.g, SEARCHED))
}

/// The stable one of [`phase_resonant`] with the smallest C.
pub fn stable_resonant(scene: &Dimensionless) -> Option<Orbit> {
    phase_resonant(scene).into_iter().find(|orbit| orbit.stable)
}

/// The exact backbone: all phase-resonant orbits at the frequency `omega` (over omega0), at any G.
///
/// Without damping and with r = 1 these are the conservative nonlinear mode, with G = 0.
pub fn exact_backbone(scene: &Dimensionless, omega: f64) -> Vec<Orbit> {
    told(scene, &StructureOrbits::of(scene).at_phase_resonance(omega))
}

/// The exact backbone as curves of about `points` orbits each, over the detunings `sigma` or, without them, where first-order theory has it.
pub fn backbone(scene: &Dimensionless, sigma: Option<[f64; 2]>, points: usize) -> Vec<OrbitCurve> {
    let orbits = StructureOrbits::of(scene);
    let range = match sigma {
        None => orbits.range(0, points),
        Some(sigma) => Some(StructureRange::at_any_speed(&bare(scene), sigma, points)),
    };
    let branches = range.map_or(Vec::new(), |range| orbits.backbone(&range));
    branches
        .iter()
        .map(|branch| branch.in_numbers(&bare(scene), 1.0, 1.0))
        .collect()
}

/// All symmetric 1:1 orbits at the detuning `sigma` and the scene's G, at any phase; none or up to two.
pub fn symmetric_orbits(scene: &Dimensionless, sigma: f64) -> Vec<Orbit> {
    let (omega, drive) = (1.0 + scene.epsilon * sigma, scene.epsilon * scene.g);
    told(scene, &StructureOrbits::of(scene).at(omega, drive))
}

/// The smallest G under which there is a symmetric 1:1 orbit at the detuning `sigma`, if its flights meet no wall.
pub(super) fn least_excitation(scene: &Dimensionless, sigma: f64) -> f64 {
    let motions = StructureOrbits::of(scene).motions(1.0 + scene.epsilon * sigma);
    motions.map_or(f64::INFINITY, |motions| motions.least_drive() / scene.epsilon)
}

/// Largest last step of the frequency, as a share of epsilon, and of the speed.
const LAST_STEP: f64 = 1e-9;
/// Difference of the first two frequencies, as a share of epsilon, and of the first two speeds: far above rounding, far below the curvature.
const SECANT: f64 = 1e-4;

/// `[Omega, C, G]` on the curve of all symmetric 1:1 motions at phase resonance: the frequency over omega0, the amplitude of the response over b,
/// and the amplitude of the base over `b epsilon`.
///
/// `speed`, the particle speed of the first-order motion, over `b omega0`, parametrises the curve: the exact motion has its impacts at nearly the same
/// phase of the response. Neither the speed itself nor the frequency would do, because both have extrema along the curve.
/// Stability and the flights between the impacts are not examined; [`exact_backbone`] does.
pub fn backbone_at_speed(scene: &Dimensionless, speed: f64) -> Option<[f64; 3]> {
    let motion = at_speed(scene, speed)?;
    Some([motion.omega, motion.c, motion.g])
}

/// The motion of [`backbone_at_speed`].
pub(super) fn at_speed(scene: &Dimensionless, speed: f64) -> Option<Orbit> {
    let Dimensionless { epsilon, lambda, r, .. } = *scene;
    let flow = SlowFlow::new(lambda, r);
    let guess = 1.0 + epsilon * flow.detuning_at(speed, scene.definition.off_resonance());
    // Of the first-order response; the exact one turns through half a circle without dissipation, too.
    let direction = Complex::new((flow.manifold.dissipation + epsilon) * speed, 1.0 - FRAC_PI_2 * speed);
    let orbits = StructureOrbits::of(scene);
    let motion = |omega: f64| {
        let motions = orbits.motions(omega)?;
        // The response is i + rate B: it has the direction at this B.
        let rate = motions.y(1.0) + motions.kappa - Complex::i();
        let b = direction.re / (rate.re * direction.im - rate.im * direction.re);
        Some((motions, b))
    };
    let off = |omega: f64| {
        let (motions, b) = motion(omega)?;
        let [square, linear, constant] = motions.resonance();
        Some((square * b + linear) * b + constant)
    };
    let omega = secant(off, [guess * (1.0 + SECANT * epsilon), guess], LAST_STEP * epsilon)?;
    let (motions, b) = motion(omega)?;
    let motion = told(scene, &[orbits.told(&motions.at(b))])[0];
    let values = [omega, motion.c, motion.g];
    values.iter().all(|value| value.is_finite()).then_some(motion)
}

/// The motion at phase resonance beyond the fold whose response has the amplitude `c` over b.
pub fn at_amplitude(scene: &Dimensionless, c: f64) -> Option<Orbit> {
    let start = Manifold::new(scene.r).b(c, BranchSide::Right)?;
    let excess = |speed: f64| Some(at_speed(scene, speed)?.c - c);
    at_speed(scene, secant(excess, [start * (1.0 + SECANT), start], LAST_STEP)?)
}
