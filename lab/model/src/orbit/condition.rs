//! Equations that select a motion, in addition to the four that close it.

use nalgebra::{Matrix4, Matrix6, RowSVector};
use serde::Serialize;

use super::pattern::{ImpactPattern, Returned, Unknowns, follow};
use crate::{Dimensionless, Resonance};

/// An equation that selects a motion, in addition to the four that close it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Condition {
    /// sigma has this value.
    Sigma(f64),
    /// G has this value.
    Excitation(f64),
    /// The first harmonic of the response lags (or leads) the reference by a quarter of a period.
    PhaseResonance,
    /// The amplitude of the first harmonic of the response is extreme along the frequency response.
    Peak,
    /// A multiplier, or a pair of them, is on the unit circle.
    Bifurcation(Bifurcation),
}

/// How stability changes at a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum Bifurcation {
    /// A multiplier passes +1: the frequency response turns back.
    #[serde(rename = "fold")]
    Fold,
    /// The half-period map of a mirrored motion has a multiplier passing -1: it loses its symmetry.
    #[serde(rename = "symmetry breaking")]
    SymmetryBreaking,
    /// A multiplier of the whole period passes -1.
    #[serde(rename = "period doubling")]
    PeriodDoubling,
    /// A complex pair leaves the unit circle (Neimark-Sacker): modulation begins.
    #[serde(rename = "torus")]
    Torus,
}

/// The value of an equation and its derivative by the unknowns.
pub(super) type Row = (f64, RowSVector<f64, 6>);

/// Step of the central differences for conditions on second derivatives of the map. It affects how fast Newton's method converges, not where to.
const STEP: f64 = 1e-6;

impl Bifurcation {
    /// As in a table.
    pub fn name(&self) -> &'static str {
        match self {
            Bifurcation::Fold => "fold",
            Bifurcation::SymmetryBreaking => "symmetry breaking",
            Bifurcation::PeriodDoubling => "period doubling",
            Bifurcation::Torus => "Neimark-Sacker",
        }
    }

    /// The one at which a multiplier of a pattern's map is -1.
    pub(super) fn flip(pattern: &ImpactPattern) -> Self {
        if pattern.mirrored {
            Bifurcation::SymmetryBreaking
        } else {
            Bifurcation::PeriodDoubling
        }
    }

    /// Zero where the multipliers of a map are on the unit circle as the bifurcation says, and smooth also where multipliers meet.
    pub(super) fn test(self, map: &Matrix4<f64>) -> f64 {
        match self {
            Bifurcation::Fold => (map - Matrix4::identity()).determinant(),
            Bifurcation::SymmetryBreaking | Bifurcation::PeriodDoubling => (map + Matrix4::identity()).determinant(),
            // The products of two multipliers are the eigenvalues of the second compound matrix.
            Bifurcation::Torus => {
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
    /// What selects the backbone by the scene's definition.
    pub fn backbone(scene: &Dimensionless) -> Self {
        match scene.definition.resonance {
            Resonance::Phase => Condition::PhaseResonance,
            Resonance::Peak => Condition::Peak,
        }
    }

    pub(super) fn value(
        &self,
        scene: &Dimensionless,
        pattern: &ImpactPattern,
        x: &Unknowns,
        returned: &Returned,
    ) -> Row {
        let mut row = RowSVector::<f64, 6>::zeros();
        match *self {
            Condition::Sigma(sigma) => {
                row[4] = 1.0;
                (x[4] - sigma, row)
            }
            Condition::Excitation(g) => {
                row[5] = 1.0;
                (x[5] - g, row)
            }
            Condition::PhaseResonance => (returned.s.re, returned.s_by[0]),
            Condition::Peak => by_differences(scene, pattern, x, returned, slope_of_amplitude),
            Condition::Bifurcation(kind) => by_differences(scene, pattern, x, returned, |at| kind.test(&at.monodromy)),
        }
    }
}

/// The value of `f` and its derivative by central differences; NaN where the pattern ends.
fn by_differences(
    scene: &Dimensionless,
    pattern: &ImpactPattern,
    x: &Unknowns,
    returned: &Returned,
    f: impl Fn(&Returned) -> f64,
) -> Row {
    let at = |n: usize, step: f64| {
        let mut moved = *x;
        moved[n] += step;
        follow(scene, pattern, &moved).map_or(f64::NAN, |returned| f(&returned))
    };
    let slope = |n: usize| (at(n, STEP) - at(n, -STEP)) / (2.0 * STEP);
    (f(returned), RowSVector::from_fn(|_, n| slope(n)))
}

/// The change of half the square of the amplitude along a direction that closes the motion at constant G, by phase, q1, q1', q2' and
/// sigma. The direction's components are the minors of the closing equations, so that it has no sign to choose.
fn slope_of_amplitude(returned: &Returned) -> f64 {
    let by_sigma = returned.by.fixed_columns::<5>(0);
    (0..5)
        .map(|n| {
            let minor: Matrix4<f64> = by_sigma.remove_fixed_columns::<1>(n);
            let sign = if n % 2 == 0 { 1.0 } else { -1.0 };
            let change = returned.s.re * returned.s_by[0][n] + returned.s.im * returned.s_by[1][n];
            sign * minor.determinant() * change
        })
        .sum()
}
