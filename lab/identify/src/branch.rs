//! Curves of phase resonance, amplitude, frequency and drive along a parameter, as the hypotheses have them.

use std::f64::consts::FRAC_PI_2;

use nalgebra::{SVector, Vector3};
use num_complex::Complex64;
use vines_estimate::{Backbone, CubicSpline};
use vines_model::numerics::{LeastSquares, Misfit, equally_spaced};
use vines_model::orbit::backbone_at_speed;
use vines_model::theory::Manifold;
use vines_model::{Definition, Dimensionless};

/// A curve through places.
pub(crate) struct Branch {
    /// The variable at the places.
    knots: Vec<f64>,
    /// Amplitude, m, and frequency, rad/s, over the variable.
    motion: CubicSpline,
    /// Drive, m.
    drive: CubicSpline,
}

/// Places of a curve that has a closed form.
const PLACES: usize = 64;
/// Speed of the particle, over that at the fold, at which the curve of an ideal cavity begins: beyond the fold the amplitude rises again.
const BEYOND_THE_FOLD: f64 = 0.97;
/// Largest speed of the particle over `b omega`: the symmetric motion loses its stability at 1.07.
pub(crate) const FASTEST: f64 = 1.3;
/// Fewest places of a curve.
const FEWEST_PLACES: usize = 4;
/// Relative gain of the squared distance from the curve at which the nearest place on it counts as found.
const NEAREST_GAIN: f64 = 1e-12;

impl Branch {
    /// Through places (amplitude m, frequency rad/s, drive m) at rising values of a variable. `None` for fewer than four.
    pub fn new(knots: Vec<f64>, places: &[Vector3<f64>]) -> Option<Self> {
        let motion = places.iter().map(|place| Complex64::new(place[0], place[1])).collect();
        let drive = places.iter().map(|place| Complex64::from(place[2])).collect();
        (places.len() >= FEWEST_PLACES).then(|| Self {
            motion: CubicSpline::new(knots.clone(), motion),
            drive: CubicSpline::new(knots.clone(), drive),
            knots,
        })
    }

    /// Through places at equal distances of a variable.
    fn even(places: &[Vector3<f64>]) -> Option<Self> {
        Self::new((0..places.len()).map(|n| n as f64).collect(), places)
    }

    fn ends(&self) -> [f64; 2] {
        [self.knots[0], self.knots[self.knots.len() - 1]]
    }

    /// Of an ideal cavity with these numbers, from just beyond the fold. The variable is the root of the speed of the particle, over `b omega`, beyond
    /// the slowest: the curve bends most at the fold. `changed`: what is changed in amplitude, m, frequency, rad/s, and drive, m.
    pub fn ideal(numbers: &Dimensionless, changed: impl Fn([f64; 3]) -> [f64; 3]) -> Option<Self> {
        let slowest = BEYOND_THE_FOLD * Manifold::new(numbers.r).b_min();
        let place = |root: f64| {
            let [omega, c, g] = backbone_at_speed(numbers, slowest + root * root)?;
            let place = [c * numbers.b, omega * numbers.omega0, g * numbers.b * numbers.epsilon];
            Some(changed(place).into())
        };
        let roots: Vec<f64> = equally_spaced(0.0, (FASTEST - slowest).sqrt(), PLACES).collect();
        let places: Option<Vec<Vector3<f64>>> = roots.iter().map(|root| place(*root)).collect();
        Self::new(roots, &places?)
    }

    /// Amplitude, frequency and drive at a place, and their derivatives.
    pub fn at(&self, s: f64) -> [Vector3<f64>; 2] {
        let (motion, drive) = (self.motion.at(s), self.drive.at(s));
        [0, 1].map(|n| Vector3::new(motion[n].re, motion[n].im, drive[n].re))
    }

    /// The place nearest to a point, with these standard uncertainties.
    pub fn nearest(&self, point: &Vector3<f64>, u: &Vector3<f64>) -> Option<f64> {
        let distance = |s: f64| (self.at(s)[0] - point).component_div(u).norm_squared();
        let knots = self.knots.iter().copied();
        let start = knots.min_by(|one, other| distance(*one).total_cmp(&distance(*other)))?;
        let problem = Distance { branch: self, point, u };
        Some(LeastSquares::minimum(&problem, SVector::from([start]), &(), NEAREST_GAIN)?.x[0])
    }

    /// The part of the curve with rising amplitude, above the fold.
    pub fn rising(&self) -> Backbone {
        let [from, to] = self.ends();
        let mut places: Vec<Vector3<f64>> = equally_spaced(from, to, 3 * PLACES).map(|s| self.at(s)[0]).collect();
        if places[0][0] > places[places.len() - 1][0] {
            places.reverse();
        }
        let fold = (0..places.len())
            .min_by(|i, j| places[*i][0].total_cmp(&places[*j][0]))
            .unwrap_or(0);
        let mut rising: Backbone = Vec::new();
        for place in &places[fold..] {
            if rising.last().is_none_or(|last| place[0] > last[0] * (1.0 + 1e-9)) {
                rising.push([place[0], place[2], place[1]]);
            }
        }
        rising
    }
}

/// A search for the nearest place.
struct Distance<'a> {
    branch: &'a Branch,
    point: &'a Vector3<f64>,
    u: &'a Vector3<f64>,
}

impl Misfit<1> for Distance<'_> {
    type Trace = ();

    fn residuals(&self, s: &SVector<f64, 1>, (): &()) -> Option<(Vec<f64>, ())> {
        let residual = (self.branch.at(s[0])[0] - self.point).component_div(self.u);
        Some((residual.as_slice().to_vec(), ()))
    }

    fn derivatives(&self, s: &SVector<f64, 1>, (): &()) -> Option<Vec<SVector<f64, 1>>> {
        let along = self.branch.at(s[0])[1].component_div(self.u);
        Some(along.iter().map(|one| SVector::from([*one])).collect())
    }

    fn limits(&self) -> [[f64; 2]; 1] {
        [self.branch.ends()]
    }
}

/// The curve of a linear structure with a cubic stiffness and without a particle, by first-order theory: `E = 2 zeta A/cos p` and
/// `omega = omega0 (1 + 3/8 h (A/b)² - zeta tan p)` for a phase of p beyond phase resonance.
pub(crate) fn spring([omega0, zeta, h, b]: [f64; 4], definition: Definition, [low, high]: [f64; 2]) -> Option<Branch> {
    let off = definition.off_resonance();
    debug_assert!(off.abs() < FRAC_PI_2);
    let place = |a: f64| {
        let omega = omega0 * (1.0 + 0.375 * h * (a / b).powi(2) - zeta * off.tan());
        Vector3::new(a, omega, 2.0 * zeta * a / off.cos())
    };
    Branch::even(&equally_spaced(low, high, PLACES).map(place).collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use vines_model::Sensor;
    use vines_model::orbit::resonant_motion;
    use vines_model::theory::B_SYMMETRY_BREAKING;

    use super::*;
    use crate::hypothesis::{Hypothesis, numbers, plant};
    use crate::quantity::Unknowns;

    #[test]
    fn the_curve_of_an_ideal_cavity_goes_through_the_motions_of_the_plant_at_light_and_heavy_damping() {
        for (zeta, r, epsilon) in [(0.019, 0.62, 0.0218), (0.007, 0.7, 0.0264), (0.002, 0.5, 0.004_f64)] {
            for sensor in [Sensor::Q1, Sensor::V] {
                let definition = Definition { sensor, ..Definition::default() };
                let [omega0, b]: [f64; 2] = [20.0, 0.005];
                let x = Unknowns::from([omega0.ln(), zeta, r, b.ln(), epsilon.ln(), 0.0, 0.0, 0.0]);
                let ideal = plant(&x, Hypothesis::Ideal.cavity([0.0; 2], r, 1.0));
                let branch = Branch::ideal(&numbers(&x, definition), |place| place).unwrap();
                // Of a heavy particle the motion of the mass loses its symmetry before first-order theory says so.
                let manifold = Manifold::new(r);
                for n in 0..10 {
                    let [low, high] = [
                        1.1 * manifold.c(manifold.b_min()),
                        0.85 * manifold.c(B_SYMMETRY_BREAKING),
                    ];
                    let c = low + (high - low) * f64::from(n) / 9.0;
                    let motion = resonant_motion(&ideal, definition, c * b, None).unwrap();
                    let exact = Vector3::new(motion.response.norm(), motion.omega, motion.amplitude);
                    let u = exact.component_mul(&Vector3::new(1e-5, 1e-7, 1e-5));
                    let near = branch.at(branch.nearest(&exact, &u).unwrap())[0];
                    let off = (near - exact).component_div(&u).norm();
                    assert!(off < 0.3, "{sensor:?}, epsilon = {epsilon}, C = {c}: {off}");
                }
            }
        }
    }
}
