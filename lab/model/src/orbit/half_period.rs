//! Half a period of a symmetric motion: whether the particle flies from wall to wall without another impact, and the multipliers.
//!
//! The particle is one more section of the host, whose output is then the relative displacement w. A disturbance of the state after an impact
//! passes the flow over half a period, and the impact, which it meets a little early or late: with the gradient g of w, the impulse
//! `J = -mu w'-` on the kicks k, and the vector fields f before and after, `R + (f+ - R f-) g/w'-` with `R = 1 - mu k g'` (saltation). The map
//! of the half period is minus this, because the motion is minus itself there.

use std::f64::consts::PI;

use lovines::Section;
use lovines::oscillator::Oscillator;
use nalgebra::{Complex, DMatrix, DVector, Matrix2, RowVector2, Vector2};

use super::flight::Flight;
use super::multipliers::{self, Impact, field};
use super::periodic::ORBIT_ERROR;
use super::return_map::Stability;
use super::symmetric::{Particle, SymmetricMotion, alternating};
use crate::numerics::eigenvalues;

/// The map of half a period, and its multipliers.
pub(super) struct HalfPeriod {
    /// The sections and, last, the particle, with (x, v) of the periodic response to the impulses after the impact.
    parts: Vec<(Section, Vector2<f64>)>,
    /// Their flows over half a period.
    flows: Vec<(Section, Matrix2<f64>)>,
    impact: Impact,
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
        let (harmonic, omega, particle) = (motion.cavity, motion.omega, [line[0], motion.speed]);
        let flight = Flight { sections, harmonic, omega, particle };
        let (elapsed, wall) = flight.contact([b, motion.after[1] - motion.speed], b)?;
        let is_half_a_period = wall < 0.0 && ((elapsed - duration) * motion.omega).abs() < ORBIT_ERROR;
        is_half_a_period.then(|| Self {
            impact: impact(&parts, motion),
            flows: parts.iter().map(|part| part.0).zip(flows).collect(),
            parts,
        })
    }

    pub(super) fn stability(&self) -> Stability {
        // The matrix of one oscillator is as fast, and keeps half of the digits of a double multiplier.
        let found = (self.flows.len() > 2)
            .then(|| multipliers::multipliers(&self.flows, self.impact))
            .flatten();
        let all = || eigenvalues(map(&self.flows, self.impact));
        Stability::of(&found.unwrap_or_else(all))
    }

    /// The part of (x, v) of every section after the impact that the impulses make.
    pub(super) fn impulsive(&self) -> impl Iterator<Item = Vector2<f64>> {
        self.parts.iter().map(|part| part.1)
    }

    /// Shares of every section and, last, of the particle in the energy of the disturbance with a multiplier. `omega` is the frequency of a
    /// section without a natural one.
    pub(super) fn shares(&self, multiplier: Complex<f64>, omega: f64) -> Option<Vec<f64>> {
        /// Relative distance of the shift from the multiplier: the matrix is not singular, and other multipliers are farther.
        const SHIFT_OFFSET: f64 = 1e-9;
        let scales: Vec<f64> = self
            .parts
            .iter()
            .flat_map(|part| energy_scales(&part.0, omega))
            .collect();
        let (map, shift) = (map(&self.flows, self.impact), multiplier * (1.0 + SHIFT_OFFSET));
        let shifted = DMatrix::from_fn(scales.len(), scales.len(), |row, column| {
            let entry = Complex::from(map[(row, column)] * scales[row] / scales[column]);
            if row == column { entry - shift } else { entry }
        });
        // Inverse iteration: the disturbance is the eigenvector.
        let factors = shifted.lu();
        let mut vector = DVector::from_element(scales.len(), Complex::ONE);
        for _ in 0..3 {
            vector = factors.solve(&vector)?;
            let norm = vector.norm();
            if !(norm.is_finite() && norm > 0.0) {
                return None;
            }
            vector /= Complex::from(norm);
        }
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

/// What the impact adds to the flows, from (x, v) of every section after it.
fn impact(parts: &[(Section, Vector2<f64>)], motion: &SymmetricMotion) -> Impact {
    let mut acceleration = -motion.omega * motion.omega * motion.cavity.im;
    for (section, after) in parts {
        let before = after - Vector2::from(section.kick) * motion.impulse;
        acceleration += section.at(section.cavity, section.rate(before))[1];
    }
    let mu = -motion.impulse / motion.impact_velocity;
    Impact { mu, kappa: mu * acceleration / motion.impact_velocity }
}

/// The derivative of the state after an impact by the state half a period before, relative to the motion, which has the opposite sign there.
fn map(flows: &[(Section, Matrix2<f64>)], Impact { mu, kappa }: Impact) -> DMatrix<f64> {
    let mut map = DMatrix::zeros(2 * flows.len(), 2 * flows.len());
    for (column, (section, flow)) in flows.iter().enumerate() {
        let cavity = RowVector2::from(section.cavity);
        let (by_w, by_dw) = (cavity * flow, cavity * field(section) * flow);
        for (row, (section, _)) in flows.iter().enumerate() {
            let kick = Vector2::from(section.kick);
            // An early impact also acts on the vector field of the kick.
            let mut block = kick * (by_dw * mu - by_w * kappa) + section.rate(kick) * by_w * mu;
            if row == column {
                block -= flow;
            }
            map.fixed_view_mut::<2, 2>(2 * row, 2 * column).copy_from(&block);
        }
    }
    map
}

#[cfg(test)]
mod tests {
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::{Rng, SeedableRng};

    use super::*;

    /// Sections of modes (frequency over that of the drive, damping ratio, shape) and of the particle, and their flows over half a period.
    fn flows(modes: &[[f64; 3]], particle: f64) -> Vec<(Section, Matrix2<f64>)> {
        let mode = |[omega, zeta, shape]: &[f64; 3]| Section {
            oscillator: Oscillator::new(1.0, omega * omega, 2.0 * zeta * omega),
            drive: [0.0; 2],
            kick: [0.0, *shape],
            cavity: [*shape, 0.0],
        };
        let of_particle = Section {
            oscillator: Oscillator::new(particle, 0.0, 0.0),
            drive: [0.0; 2],
            kick: [0.0, -1.0 / particle],
            cavity: [-1.0, 0.0],
        };
        let sections = modes.iter().map(mode).chain([of_particle]);
        sections.map(|section| (section, section.propagator(PI))).collect()
    }

    /// Largest distance of a multiplier from the nearest of the eigenvalues, which are used up.
    fn apart(found: &[Complex<f64>], eigenvalues: &[Complex<f64>]) -> f64 {
        let mut left = eigenvalues.to_vec();
        let nearest = found.iter().map(|one| {
            let distance = |n: &usize| (left[*n] - one).norm();
            let n = (0..left.len())
                .min_by(|a, b| distance(a).total_cmp(&distance(b)))
                .unwrap();
            (left.swap_remove(n) - one).norm()
        });
        nearest.fold(0.0, f64::max)
    }

    #[test]
    fn the_multipliers_of_random_structures_are_the_eigenvalues_of_their_maps() {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let mut uniform =
            |low: f64, high: f64| low + (high - low) * (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
        let mut worst = 0.0_f64;
        for _ in 0..400 {
            let count = uniform(1.0, 30.0) as usize;
            // Half of the structures without damping.
            let damping = uniform(-0.2, 0.2).max(0.0);
            let mode = |_| [uniform(0.1, 60.0), uniform(0.0, 1.0) * damping, uniform(-1.0, 1.0)];
            let mut modes: Vec<[f64; 3]> = (0..count).map(mode).collect();
            // A mode at a node, and two with one frequency.
            if count > 5 {
                modes[0][2] = 0.0;
                modes[2] = [modes[1][0], modes[1][1], modes[2][2]];
            }
            let particle = 10_f64.powf(uniform(-6.0, -0.5));
            let flows = flows(&modes, particle);
            let mobility = modes.iter().map(|mode| mode[2] * mode[2]).sum::<f64>() + particle.recip();
            let mu = (1.0 + uniform(0.1, 1.0)) / mobility;
            let impact = Impact { mu, kappa: mu * uniform(-3.0, 3.0) };
            let found = multipliers::multipliers(&flows, impact).unwrap();
            worst = worst.max(apart(&found, &eigenvalues(map(&flows, impact))));
        }
        assert!(worst < 1e-10, "{worst:e}");
    }
}
