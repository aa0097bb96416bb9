//! The exact backbone as a function of the particle speed B, as in theory: one smooth curve through the fold.

use super::candidate::Family;
use crate::Dimensionless;
use crate::theory::SlowFlow;

/// Rounds of Newton's method; each doubles the number of correct digits, from the first-order theory's two.
const ROUNDS: usize = 8;
/// Largest last change of the frequency, as a share of epsilon.
const CONVERGED: f64 = 1e-9;
/// Difference of the frequencies of the secant, as a share of epsilon: far above rounding, far below the curvature.
const SECANT: f64 = 1e-4;

/// `[Omega, C, G]` of the symmetric 1:1 motion at phase resonance with the particle speed `b` over `b omega0`: the frequency over omega0, the
/// amplitude of the response over b, and the amplitude of the base over `b epsilon`. `None` where there is none.
///
/// Stability and the flights between the impacts are not examined; [`super::exact_backbone`] does.
pub fn backbone_at_speed(scene: &Dimensionless, b: f64) -> Option<[f64; 3]> {
    let Dimensionless { epsilon, lambda, r, .. } = *scene;
    let off = |omega: f64| Some(Family::new(scene, omega)?.off_resonance(b));
    let (mut omega, mut last) = (1.0 + epsilon * SlowFlow::new(lambda, r).free_detuning(b), f64::INFINITY);
    for _ in 0..ROUNDS {
        let here = off(omega)?;
        let slope = (off(omega + SECANT * epsilon)? - here) / (SECANT * epsilon);
        last = here / slope;
        omega -= last;
        if last.abs() < CONVERGED * epsilon {
            break;
        }
    }
    let motion = Family::new(scene, omega)?.at(b);
    let values = [omega, motion.c, motion.g];
    (values.iter().all(|value| value.is_finite()) && last.abs() < CONVERGED * epsilon).then_some(values)
}
