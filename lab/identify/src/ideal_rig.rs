//! The five parameters of an ideal cavity on a mass, and its exact backbone.

use std::f64::consts::{FRAC_PI_2, TAU};

use nalgebra::SVector;
use vines_estimate::{Backbone, Linear};
use vines_model::orbit::backbone_at_speed;
use vines_model::{Definition, Dimensionless, Sensor};

/// The parameters of an ideal cavity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IdealRig {
    /// Natural frequency, Hz.
    pub f0: f64,
    /// Damping ratio.
    pub zeta: f64,
    /// Restitution.
    pub r: f64,
    /// Half-width, m.
    pub b: f64,
    /// Mass ratio.
    pub epsilon: f64,
}

/// Points of a backbone.
const POINTS: usize = 200;
/// Largest speed of the particle over `b omega`: the symmetric motion becomes unstable above 1.07.
const FASTEST: f64 = 1.3;

impl IdealRig {
    /// Standard uncertainties of a drawing: f0 and zeta (relative), r, b and epsilon (relative).
    pub const UNCERTAINTY: [f64; 5] = [0.01, 0.25, 0.15, 0.1, 0.15];

    /// f0, zeta, r, b and epsilon.
    pub fn values(&self) -> [f64; 5] {
        [self.f0, self.zeta, self.r, self.b, self.epsilon]
    }

    /// Unknowns of a fit: logarithms, of r that of `r/(1 - r)`, so that all values are possible ones.
    pub fn unknowns(&self) -> SVector<f64, 5> {
        let r = self.r / (1.0 - self.r);
        SVector::from([self.f0, self.zeta, r, self.b, self.epsilon].map(f64::ln))
    }

    /// From the unknowns of a fit.
    pub fn of(unknowns: &SVector<f64, 5>) -> Self {
        let [f0, zeta, r, b, epsilon] = unknowns.map(f64::exp).into();
        Self { f0, zeta, r: r / (1.0 + r), b, epsilon }
    }

    /// Derivatives of the values by the unknowns.
    pub fn slopes(&self) -> [f64; 5] {
        [self.f0, self.zeta, self.r * (1.0 - self.r), self.b, self.epsilon]
    }

    /// The linear response.
    pub fn linear(&self) -> Linear {
        Linear { omega0: TAU * self.f0, zeta: self.zeta }
    }

    /// The dimensionless numbers, for a sensor of the response.
    pub fn dimensionless(&self, sensor: Sensor) -> Dimensionless {
        Dimensionless {
            epsilon: self.epsilon,
            lambda: 2.0 * self.zeta / self.epsilon,
            r: self.r,
            g: 0.0,
            omega0: TAU * self.f0,
            b: self.b,
            definition: Definition { sensor, ..Definition::default() },
        }
    }

    /// The exact backbone above the fold, by rising amplitude. The speed of the particle parametrises it, because neither amplitude nor frequency is
    /// single-valued.
    pub fn backbone(&self, sensor: Sensor) -> Backbone {
        let numbers = self.dimensionless(sensor);
        let ratio = (1.0 - self.r) / (1.0 + self.r);
        let slowest = FRAC_PI_2 / (ratio * ratio + FRAC_PI_2 * FRAC_PI_2) - 0.1 * ratio;
        let point = |n: usize| {
            let share = n as f64 / (POINTS - 1) as f64;
            // Dense at the fold.
            let [omega, c, g] = backbone_at_speed(&numbers, slowest + (FASTEST - slowest) * share.powf(1.5))?;
            Some([c * self.b, g * self.b * self.epsilon, omega * numbers.omega0])
        };
        let points: Vec<[f64; 3]> = (0..POINTS).filter_map(point).collect();
        let least = |points: &[[f64; 3]]| {
            let half = &points[..points.len() / 2];
            (0..half.len())
                .min_by(|i, j| half[*i][0].total_cmp(&half[*j][0]))
                .unwrap_or(0)
        };
        let mut rising: Backbone = Vec::new();
        for point in &points[least(&points)..] {
            if rising.last().is_none_or(|last| point[0] > last[0] * (1.0 + 1e-12)) {
                rising.push(*point);
            }
        }
        rising
    }
}
