//! The five parameters of an ideal cavity on a mass, and its exact backbone.

use std::f64::consts::TAU;

use lovines::Parameters;
use nalgebra::SVector;
use vines_estimate::{Backbone, Linear};
use vines_model::{Definition, Dimensionless, Sensor};

use crate::branch::Branch;
use crate::particle::Particle;
use crate::quantity::Quantity;

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

impl IdealRig {
    /// Standard uncertainties of a drawing: f0 and zeta (relative), r, b and epsilon (relative).
    pub const UNCERTAINTY: [f64; 5] = [0.01, 0.25, 0.15, 0.1, 0.15];

    /// The ideal rig of a plant.
    pub fn of_plant(plant: &Parameters) -> Self {
        let of = |quantity: Quantity| quantity.of_plant(plant);
        Self {
            f0: of(Quantity::F0),
            zeta: of(Quantity::Zeta),
            r: of(Quantity::R),
            b: of(Quantity::B),
            epsilon: of(Quantity::Epsilon),
        }
    }

    /// Standard uncertainties of the values, if they are those of a drawing.
    pub(crate) fn uncertainties(&self) -> [f64; 5] {
        let [f0, zeta, r, b, epsilon] = Self::UNCERTAINTY;
        [f0 * self.f0, zeta * self.zeta, r, b * self.b, epsilon * self.epsilon]
    }

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

    /// Its particle.
    pub fn particle(&self, sensor: Sensor) -> Particle {
        Particle::ideal([self.epsilon, self.b, self.r], sensor)
    }

    /// The exact backbone above the fold, by rising amplitude; `None` where a fit has left what is possible.
    pub fn backbone(&self, sensor: Sensor) -> Option<Backbone> {
        Some(Branch::ideal(&self.dimensionless(sensor), |place| place)?.rising())
    }
}
