//! Half a period of a symmetric motion: whether the particle flies from wall to wall without another impact, and the multipliers.
//!
//! The particle is one more section of the host, whose output is then the relative displacement w. A disturbance of the state after an impact
//! passes the flow over half a period, and the impact, which it meets a little early or late: with the gradient g of w, the impulse
//! `J = -mu w'-` on the kicks k, and the vector fields f before and after, `R + (f+ - R f-) g/w'-` with `R = 1 - mu k g'` (saltation). The map
//! of the half period is minus this, because the motion is minus itself there.

use std::f64::consts::PI;

use lovines::Section;
use lovines::oscillator::Oscillator;
use nalgebra::{Complex, DMatrix, Matrix2, RowVector2, Vector2};

use super::flight::Flight;
use super::symmetric::{Particle, SymmetricMotion, alternating};

/// Largest difference of the flight from half a period, rad: a slow impact is that ill-defined in time.
const EXACT: f64 = 1e-8;

/// The map of half a period, and its multipliers.
pub(super) struct HalfPeriod {
    /// The sections and, last, the particle, with (x, v) of the periodic response to the impulses after the impact.
    parts: Vec<(Section, Vector2<f64>)>,
    /// Derivative of the state (x, v) of every section and of the particle.
    map: DMatrix<f64>,
}

impl HalfPeriod {
    /// The half period after the impact on the wall w = +b; `None` where the particle does not reach the other wall at its end, and not before.
    pub(super) fn new(sections: &[Section], particle: &Particle, motion: &SymmetricMotion) -> Option<Self> {
        let duration = PI / motion.omega;
        let of_particle = Section {
            oscillator: Oscillator::new(particle.mass, 0.0, 0.0),
            drive: [0.0; 2],
            kick: [0.0, -1.0 / particle.mass],
            cavity: [-1.0, 0.0],
        };
        let all = sections.iter().copied().chain([of_particle]);
        let flows: Vec<_> = all.clone().map(|section| section.propagator(duration)).collect();
        let after = |(section, flow)| Some((section, alternating(&section, flow)? * motion.impulse));
        let parts: Vec<_> = all.zip(&flows).map(after).collect::<Option<_>>()?;
        let ([sections @ .., (_, line)], b) = (&parts[..], particle.half_width) else {
            return None;
        };
        let flight = Flight {
            sections,
            harmonic: motion.cavity,
            omega: motion.omega,
            particle: [line[0], motion.speed],
        };
        let (elapsed, wall) = flight.contact([b, motion.after[1] - motion.speed], b, 1.0)?;
        let is_half_a_period = wall < 0.0 && ((elapsed - duration) * motion.omega).abs() < EXACT;
        is_half_a_period.then(|| Self { map: map(&parts, &flows, motion), parts })
    }

    /// The multipliers of the half period, by rising modulus.
    pub(super) fn multipliers(&self) -> Vec<Complex<f64>> {
        let mut multipliers: Vec<Complex<f64>> = self.map.complex_eigenvalues().iter().copied().collect();
        multipliers.sort_unstable_by(|first, second| first.norm().total_cmp(&second.norm()));
        multipliers
    }

    /// The part of (x, v) of every section after the impact that the impulses make.
    pub(super) fn impulsive(&self) -> impl Iterator<Item = Vector2<f64>> {
        self.parts.iter().map(|part| part.1)
    }

    /// Shares of every section and, last, of the particle in the energy of the disturbance with a multiplier. `omega` is the frequency of a
    /// section without a natural one.
    pub(super) fn shares(&self, multiplier: Complex<f64>, omega: f64) -> Option<Vec<f64>> {
        let scales = self.parts.iter().flat_map(|part| energy_scales(&part.0, omega));
        let scales: Vec<f64> = scales.collect();
        let shifted = DMatrix::from_fn(scales.len(), scales.len(), |row, column| {
            let entry = Complex::from(self.map[(row, column)] * scales[row] / scales[column]);
            if row == column { entry - multiplier } else { entry }
        });
        // The eigenvector is the direction that the map less the multiplier takes to zero.
        let svd = shifted.svd(false, true);
        let vector = svd.v_t?.row(svd.singular_values.imin()).clone_owned();
        let energies = vector
            .as_slice()
            .chunks(2)
            .map(|pair| pair[0].norm_sqr() + pair[1].norm_sqr());
        Some(energies.collect())
    }
}

/// Factors of (x, v) whose squares sum up to twice the energy, up to a factor that all sections have in common: those of a
/// mass-normalised mode are omega0 and 1. Without a natural frequency, the displacement counts as at the frequency `omega`.
fn energy_scales(section: &Section, omega: f64) -> [f64; 2] {
    let omega0 = Some(section.oscillator.omega0)
        .filter(|omega0| *omega0 > 0.0)
        .unwrap_or(omega);
    let ([a, b], [x, dx]) = (section.cavity, section.kick);
    let (seen, kicked) = (a.hypot(omega0 * b), dx.hypot(omega0 * x));
    let scale = if seen > 0.0 && kicked > 0.0 {
        (seen / kicked).sqrt()
    } else {
        1.0
    };
    [scale * omega0, scale]
}

/// The derivative of the state after an impact by the state half a period before, relative to the motion, which has the opposite sign there.
fn map(parts: &[(Section, Vector2<f64>)], flows: &[Matrix2<f64>], motion: &SymmetricMotion) -> DMatrix<f64> {
    let mut acceleration = -motion.omega * motion.omega * motion.cavity.im;
    for (section, after) in parts {
        let before = after - Vector2::from(section.kick) * motion.impulse;
        acceleration += section.at(section.cavity, section.rate(before))[1];
    }
    let mu = -motion.impulse / motion.impact_velocity;
    let mut map = DMatrix::zeros(2 * parts.len(), 2 * parts.len());
    for (column, ((section, _), flow)) in parts.iter().zip(flows).enumerate() {
        let [a, b] = section.cavity;
        let by_w = RowVector2::new(a, b) * flow;
        let Oscillator { delta, omega0_squared, .. } = section.oscillator;
        let by_dw = RowVector2::new(-omega0_squared * b, a - 2.0 * delta * b) * flow;
        for (row, (section, _)) in parts.iter().enumerate() {
            let kick = Vector2::from(section.kick);
            // The vector field jumps by that of the kick.
            let early = section.rate(kick) * motion.impulse + kick * (mu * acceleration);
            let mut block = kick * by_dw * mu - early * by_w / motion.impact_velocity;
            if row == column {
                block -= flow;
            }
            map.fixed_view_mut::<2, 2>(2 * row, 2 * column).copy_from(&block);
        }
    }
    map
}
