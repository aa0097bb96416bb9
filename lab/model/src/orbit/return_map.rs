//! Return maps: the equations that close a periodic motion and select it, Newton's method, multipliers and bifurcations (docs/regimes.md, eq. 27).
//!
//! A motion starts in a section, an event or a phase of the base, and returns to it. The section has four coordinates; frequency and amplitude of
//! the base are unknown as well, and two conditions select the motion.

use nalgebra::{Complex, DMatrix, Matrix4, Matrix4x6, Matrix6, RowVector6, Vector4, Vector6};
use serde::Serialize;

use crate::numerics::{Equations, eigenvalues};

/// Unknowns of a periodic motion: four coordinates at its section, sigma, G.
pub type Unknowns = Vector6<f64>;

/// A map from a section of the motion to itself.
pub(super) trait ReturnMap {
    /// The return of the motion from the unknowns `x`; None where it does not return.
    fn at(&mut self, x: &Unknowns) -> Option<Return>;

    /// Unknowns of the same motion at another section, if it serves better from here on.
    fn restarted(&mut self, _x: &Unknowns) -> Option<Unknowns> {
        None
    }
}

/// The return of a motion to its section.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Return {
    /// Coordinates at the end less those at the start.
    pub apart: Vector4<f64>,
    /// Derivative of the coordinates at the end by the unknowns.
    pub by: Matrix4x6<f64>,
    /// First harmonic S of the response relative to the reference, over b: the response has the part `Im(S exp(i phase))`. Its derivatives.
    pub response: Complex<f64>,
    pub response_by: [Complex<f64>; 6],
}

impl Return {
    /// Derivative of the closing error by the unknowns.
    pub(super) fn closing(&self) -> Matrix4x6<f64> {
        self.by - Matrix4x6::identity()
    }

    /// Derivative of the map by the coordinates: its eigenvalues are the multipliers.
    pub(super) fn monodromy(&self) -> Matrix4<f64> {
        self.by.fixed_columns::<4>(0).into()
    }

    pub(super) fn stability(&self) -> Stability {
        Stability::of(&eigenvalues(DMatrix::from_column_slice(
            4,
            4,
            self.monodromy().as_slice(),
        )))
    }
}

/// How disturbances of a motion develop.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Stability {
    /// Multipliers (real, imaginary) of the map, by rising modulus. The map of a mirrored motion covers half of its period.
    pub multipliers: Vec<[f64; 2]>,
    /// All of them are inside the unit circle.
    pub stable: bool,
    /// The largest are on the unit circle, within 1e-7: disturbances neither grow nor decay.
    pub neutral: bool,
}

/// Distance from the unit circle up to which a multiplier counts as on it: of a double one, rounding leaves half of the digits.
const ON_CIRCLE: f64 = 1e-7;

fn modulus([re, im]: &[f64; 2]) -> f64 {
    re.hypot(*im)
}

impl Stability {
    /// By the multipliers in any order.
    pub(super) fn of(multipliers: &[Complex<f64>]) -> Self {
        let mut sorted = multipliers.to_vec();
        sorted.sort_unstable_by(|first, second| first.norm().total_cmp(&second.norm()));
        let largest = sorted.last().map_or(f64::NAN, |largest| largest.norm());
        Self {
            multipliers: sorted.iter().map(|one| [one.re, one.im]).collect(),
            stable: largest < 1.0 - ON_CIRCLE,
            neutral: (largest - 1.0).abs() <= ON_CIRCLE,
        }
    }

    /// That of the map applied twice.
    pub(super) fn twice(&self) -> Self {
        let squares = self.multipliers.iter().map(|[re, im]| Complex::new(*re, *im).powi(2));
        Self::of(&squares.collect::<Vec<_>>())
    }

    /// Whether a multiplier is outside the unit circle.
    pub fn is_unstable(&self) -> bool {
        !self.stable && !self.neutral
    }

    /// Modulus of the largest multiplier.
    pub fn growth(&self) -> f64 {
        self.multipliers.last().map_or(f64::NAN, modulus)
    }

    /// Number of multipliers outside the unit circle.
    pub(super) fn outside(&self) -> usize {
        let outside = |one: &&[f64; 2]| modulus(one) > 1.0 + ON_CIRCLE;
        self.multipliers.iter().filter(outside).count()
    }

    /// Moduli of the four largest multipliers, ascending; NaN where there are fewer.
    pub(super) fn largest_four(&self) -> [f64; 4] {
        [3, 2, 1, 0].map(|n| self.multipliers.iter().rev().nth(n).map_or(f64::NAN, modulus))
    }

    /// A multiplier whose imaginary part has at least the size `imaginary` is within `distance` of the unit circle.
    pub(super) fn on_circle(&self, imaginary: f64, distance: f64) -> bool {
        let mut pairs = self.multipliers.iter().filter(|[_, im]| im.abs() >= imaginary);
        pairs.any(|one| (modulus(one) - 1.0).abs() < distance)
    }
}

/// An equation that selects a motion, in addition to the four that close it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Condition {
    /// sigma has this value.
    Sigma(f64),
    /// G has this value.
    Excitation(f64),
    /// The first harmonic of the response has this phase, rad, relative to the reference, or the opposite one.
    Phase(f64),
    /// The part C of the first harmonic that has the phase `phase`, rad, and sigma lie on a line: the place of a curve that crosses it, also where
    /// amplitude or frequency have an extremum.
    Across {
        /// The phase.
        phase: f64,
        /// C, over b, and sigma of a point of the line.
        at: [f64; 2],
        /// The normal of the line.
        normal: [f64; 2],
    },
    /// A multiplier, or a pair of them, is on the unit circle.
    Bifurcation(Bifurcation),
    /// The unknowns lie in a plane: the end of a step along a curve.
    Plane {
        /// A point of the plane.
        through: Unknowns,
        /// Its normal, of length 1.
        normal: Unknowns,
    },
}

words! {
    /// How stability changes at a point.
    Bifurcation::name {
        /// A multiplier passes +1: the frequency response turns back.
        Fold = "fold",
        /// The half-period map of a mirrored motion has a multiplier passing -1: it loses its symmetry.
        SymmetryBreaking = "symmetry breaking",
        /// A multiplier of the whole period passes -1.
        PeriodDoubling = "period doubling",
        /// A complex pair leaves the unit circle: modulation begins where the motion was stable.
        NeimarkSacker = "Neimark-Sacker",
    }
}

/// Step of the central differences for conditions on second derivatives of the map. It affects how fast Newton's method converges, not where to.
const MAP_DIFFERENCE: f64 = 1e-6;

impl Bifurcation {
    /// Zero where the multipliers of a map are on the unit circle as the bifurcation says, and smooth also where multipliers meet.
    pub(super) fn test(self, map: &Matrix4<f64>) -> f64 {
        match self {
            Bifurcation::Fold => (map - Matrix4::identity()).determinant(),
            Bifurcation::SymmetryBreaking | Bifurcation::PeriodDoubling => (map + Matrix4::identity()).determinant(),
            // The products of two multipliers are the eigenvalues of the second compound matrix.
            Bifurcation::NeimarkSacker => {
                let pairs = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)];
                let minor = |(a, b): (usize, usize), (c, d): (usize, usize)| {
                    map[(a, c)] * map[(b, d)] - map[(a, d)] * map[(b, c)]
                };
                let compound = Matrix6::from_fn(|row, column| minor(pairs[row], pairs[column]));
                (compound - Matrix6::identity()).determinant()
            }
        }
    }
}

impl Condition {
    /// The part of the first harmonic that has the phase `phase`, rad, has the amplitude `c`, over b.
    pub(super) fn response(phase: f64, c: f64) -> Self {
        Self::Across { phase, at: [c, 0.0], normal: [1.0, 0.0] }
    }

    /// The value of the equation and its derivative by the unknowns.
    pub(super) fn value(&self, map: &mut impl ReturnMap, x: &Unknowns, here: &Return) -> (f64, RowVector6<f64>) {
        let unit = |n: usize| RowVector6::from_fn(|_, column| f64::from(u8::from(column == n)));
        // The harmonic and its derivatives, turned so that the part with a phase is real.
        let turned = |phase: f64| {
            let turned = Complex::from_polar(1.0, -phase);
            (here.response * turned, here.response_by.map(|by| by * turned))
        };
        match *self {
            Condition::Sigma(sigma) => (x[4] - sigma, unit(4)),
            Condition::Excitation(g) => (x[5] - g, unit(5)),
            Condition::Phase(phase) => {
                let (response, by) = turned(phase);
                (response.im, by.map(|by| by.im).into())
            }
            Condition::Across { phase, at: [c, sigma], normal } => {
                let (response, by) = turned(phase);
                let by = RowVector6::from(by.map(|by| by.re)) * normal[0] + unit(4) * normal[1];
                (normal[0] * (response.re - c) + normal[1] * (x[4] - sigma), by)
            }
            Condition::Plane { through, normal } => (normal.dot(&(x - through)), normal.transpose()),
            Condition::Bifurcation(kind) => {
                // Central differences; NaN where the pattern ends.
                let mut at = |n: usize, step: f64| {
                    let mut moved = *x;
                    moved[n] += step;
                    map.at(&moved).map_or(f64::NAN, |map| kind.test(&map.monodromy()))
                };
                let mut slope = |n: usize| (at(n, MAP_DIFFERENCE) - at(n, -MAP_DIFFERENCE)) / (2.0 * MAP_DIFFERENCE);
                let slopes = RowVector6::from_fn(|_, n| slope(n));
                (kind.test(&here.monodromy()), slopes)
            }
        }
    }
}

/// The equations of a motion: four that close it, and two that select it.
pub(super) struct Closing<'a, M> {
    pub map: &'a mut M,
    pub conditions: [Condition; 2],
}

impl<M: ReturnMap> Equations<6> for Closing<'_, M> {
    fn at(&mut self, x: &Unknowns) -> Option<(Unknowns, Matrix6<f64>)> {
        let here = self.map.at(x)?;
        let (mut residual, mut jacobian) = (Unknowns::zeros(), Matrix6::zeros());
        residual.fixed_rows_mut::<4>(0).copy_from(&here.apart);
        jacobian.fixed_rows_mut::<4>(0).copy_from(&here.closing());
        for (row, condition) in [4, 5].into_iter().zip(self.conditions) {
            let (value, by) = condition.value(self.map, x, &here);
            residual[row] = value;
            jacobian.set_row(row, &by);
        }
        let is_finite = residual.iter().chain(&jacobian).all(|value| value.is_finite());
        is_finite.then_some((residual, jacobian))
    }

    fn restarted(&mut self, x: &Unknowns) -> Option<Unknowns> {
        self.map.restarted(x)
    }
}
