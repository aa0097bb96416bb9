//! Parameters of an ideal cavity from a record: regimes, curve and fit in turn, until the linear response stays.

use std::collections::BTreeSet;

use nalgebra::SVector;
use num_complex::Complex64;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use vines_estimate::{Curve, Estimate, Linear, Record, Signals, Window};
use vines_model::Sensor;
use vines_model::numerics::{LeastSquares, Misfit};

use crate::ideal_rig::IdealRig;
use crate::particle::Particle;
use crate::quantity::STEP;
use crate::regime::{Expected, TOLERANCES, one_to_one, rough_scene};

/// A record, and what its sensors are.
#[derive(Debug, Clone)]
pub struct Samples {
    /// Response and base.
    pub signals: Signals,
    /// What the response is.
    pub sensor: Sensor,
}

/// What a record says of an ideal cavity.
#[derive(Debug, Clone)]
pub struct Identified {
    /// The parameters.
    pub scene: IdealRig,
    /// Their standard uncertainties.
    pub uncertainty: [f64; 5],
    /// Drive and frequency of phase resonance, without the model of a cavity.
    pub curve: Curve,
    /// Chi-square of the ideal cavity for the information of the curve.
    pub chi_square: f64,
    /// Its degrees of freedom.
    pub degrees: usize,
    /// The periods that were used.
    pub used: Vec<bool>,
    /// Times of the middles of all periods, s.
    pub time: Vec<f64>,
    /// Amplitudes of the response in all periods, m.
    pub amplitude: Vec<f64>,
    /// The windows and their most probable motions.
    pub motions: Vec<(Window, usize)>,
    /// The particle that lags by a factor 1.
    pub read: Particle,
    /// Factor of the particle's lag: 1 if its closed form holds.
    pub lag: Complex64,
    /// Number of passes.
    pub passes: usize,
    /// Whether the linear response stayed.
    pub converged: bool,
}

impl Identified {
    /// Probability that noise contradicts an ideal cavity as much.
    pub fn p(&self) -> f64 {
        ChiSquared::new(self.degrees as f64).map_or(f64::NAN, |one| one.sf(self.chi_square))
    }
}

/// Most passes, and most readings by a hypothesis.
pub(crate) const PASSES: usize = 6;
/// Change of an unknown, in standard uncertainties, below which another pass or reading changes nothing.
pub(crate) const STILL: f64 = 0.1;
/// Fewest periods: with fewer the curve is the prior's.
const FEWEST_PERIODS: usize = 30;
/// Gain of a further step, relative to one and chi-square, at which the minimum counts as found.
const LEAST_GAIN: f64 = 1e-6;

/// A least-squares model without traces.
struct Model<F>(F);

impl<const N: usize, F: Fn(&SVector<f64, N>) -> Option<Vec<f64>>> Misfit<N> for Model<F> {
    type Trace = ();

    fn residuals(&self, x: &SVector<f64, N>, (): &()) -> Option<(Vec<f64>, ())> {
        Some(((self.0)(x)?, ()))
    }

    fn derivatives(&self, x: &SVector<f64, N>, (): &()) -> Option<Vec<SVector<f64, N>>> {
        let mut columns = Vec::new();
        for i in 0..N {
            let [above, below] = [STEP, -STEP].map(|step| {
                let mut moved = *x;
                moved[i] += step;
                (self.0)(&moved)
            });
            let (above, below) = (above?, below?);
            columns.push(
                above
                    .iter()
                    .zip(&below)
                    .map(|(a, b)| (a - b) / (2.0 * STEP))
                    .collect::<Vec<f64>>(),
            );
        }
        let rows = columns.first().map_or(0, Vec::len);
        Some((0..rows).map(|row| SVector::from_fn(|i, _| columns[i][row])).collect())
    }
}

/// Parameters, uncertainties and chi-square of the cavity that fits the information of a curve, with the scene as a prior: without it a short noisy
/// decay runs away.
fn fit(curve: &Curve, sensor: Sensor, start: &IdealRig, prior: &IdealRig) -> Option<(IdealRig, [f64; 5], f64)> {
    let expected = prior.unknowns();
    let mut u = IdealRig::UNCERTAINTY;
    u[2] /= prior.r * (1.0 - prior.r);
    let residuals = |x: &SVector<f64, 5>| {
        let mut residuals = curve
            .residuals(&IdealRig::of(x).backbone(sensor)?, Complex64::ONE, 0.0)?
            .as_slice()
            .to_vec();
        residuals.extend((0..5).map(|i| (x[i] - expected[i]) / u[i]));
        residuals.iter().all(|one| one.is_finite()).then_some(residuals)
    };
    let best = LeastSquares::minimum(&Model(residuals), start.unknowns(), &(), LEAST_GAIN)?;
    let scene = IdealRig::of(&best.x);
    let (covariance, slopes) = (best.covariance(), scene.slopes());
    let uncertainty = std::array::from_fn(|i| covariance[(i, i)].sqrt() * slopes[i]);
    Some((scene, uncertainty, best.chi_square))
}

/// Points of a backbone to which the three effective constants are fitted.
const EFFECTIVE_POINTS: usize = 48;

/// The particle whose closed form has the exact force of a backbone: harmonics of the host change only its constants.
fn effective(near: Particle, backbone: &[[f64; 3]], linear: Linear) -> Option<Particle> {
    let stride = (backbone.len() / EFFECTIVE_POINTS).max(1);
    let particle = |x: &SVector<f64, 3>| {
        let [epsilon, b, r] = x.map(f64::exp).into();
        Particle { epsilon, b, r: r / (1.0 + r), ..near }
    };
    let residuals = |x: &SVector<f64, 3>| {
        let particle = particle(x);
        let error = |point: &[f64; 3]| {
            let error = particle.steady_motion(point[0]).force - linear.force_at_resonance(*point, power(near.sensor));
            let error = error / (near.epsilon * near.b);
            [error.re, error.im]
        };
        Some(backbone.iter().step_by(stride).flat_map(error).collect())
    };
    let start = SVector::from([near.epsilon, near.b, near.r / (1.0 - near.r)].map(f64::ln));
    LeastSquares::minimum(&Model(residuals), start, &(), LEAST_GAIN).map(|best| particle(&best.x))
}

/// Power of the frequency by which the particle's force on a response grows.
fn power(sensor: Sensor) -> i32 {
    match sensor {
        Sensor::V => 0,
        Sensor::Q1 => 2,
    }
}

impl Samples {
    fn record(&self, linear: Linear) -> Option<Record> {
        Record::new(&self.signals, linear, power(self.sensor))
    }

    /// The curve of the periods `used` as a rig reads it that has this particle, a backbone, and a linear response.
    pub(crate) fn read(&self, used: &[bool], near: Particle, backbone: &[[f64; 3]], linear: Linear) -> Option<Curve> {
        let record = self.record(linear)?;
        let particle = effective(near, backbone, linear)?;
        let mut used = used.to_vec();
        used.resize(record.periods.time.len(), false);
        let scale = near.epsilon * near.b;
        let (estimate, solution) = Estimate::of_periods(&record, &particle, scale, &used)?.fit()?;
        estimate.curve(&solution)
    }
}

/// Why a record has no curve: the motions of its windows, if these are not symmetric 1:1 for at least thirty periods; otherwise too little of it
/// is smooth.
#[derive(Debug, Clone, Default)]
pub struct Unidentified {
    /// Numbers of [`crate::MOTIONS`], each once.
    pub motions: BTreeSet<usize>,
}

/// Regimes, curve and parameters, from samples and a rough scene.
///
/// # Errors
/// Fewer than thirty periods of symmetric 1:1 motion.
pub fn identify(samples: &Samples, rough: &IdealRig) -> Result<Identified, Unidentified> {
    let mut motions = BTreeSet::new();
    passes(samples, rough, &mut motions).ok_or(Unidentified { motions })
}

fn passes(samples: &Samples, rough: &IdealRig, found: &mut BTreeSet<usize>) -> Option<Identified> {
    let mut scene = rough_scene(&samples.record(rough.linear())?, rough, samples.sensor);
    for pass in 1..=PASSES {
        let record = samples.record(scene.linear())?;
        let near = scene.particle(samples.sensor);
        let particle = effective(near, &scene.backbone(samples.sensor)?, scene.linear())?;
        let scale = scene.epsilon * scene.b;
        let tolerance = TOLERANCES[usize::from(pass > 1)];
        let u_loss = IdealRig::UNCERTAINTY[3];
        let expected = Expected { particle, host: Complex64::ZERO, tolerance, scale, u_loss };
        let (used, motions) = one_to_one(&record, &expected);
        *found = motions.iter().map(|(_, motion)| *motion).collect();
        if used.iter().filter(|one| **one).count() < FEWEST_PERIODS {
            return None;
        }
        let (estimate, solution) = Estimate::new(&record, &particle, scale, &used)?.fit()?;
        let curve = estimate.curve(&solution)?;
        let (fitted, uncertainty, chi_square) = fit(&curve, samples.sensor, &scene, rough)?;
        let changes = [
            (fitted.f0 - scene.f0) / uncertainty[0],
            (fitted.zeta - scene.zeta) / uncertainty[1],
        ];
        let converged = changes.iter().all(|change| change.abs() < STILL);
        scene = fitted;
        if converged || pass == PASSES {
            return Some(Identified {
                scene,
                uncertainty,
                chi_square,
                degrees: curve.expected.len(),
                curve,
                used: estimate.used.clone(),
                time: record.periods.time.clone(),
                amplitude: record.periods.response.iter().map(|z| z.norm()).collect(),
                motions,
                read: near,
                lag: estimate.lag,
                passes: pass,
                converged,
            });
        }
    }
    None
}
